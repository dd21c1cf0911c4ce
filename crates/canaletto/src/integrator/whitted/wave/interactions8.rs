//! Interactions and the light that arrives at them, eight side by side. Lengths, directions, cosines and colours are
//! computed for all eight at once.

use crate::integrator::shading::BEFORE_LIGHT;
use crate::integrator::visible_hit::Frame;
use crate::light::Illumination;
use crate::material::MaterialPoint;
use crate::math::{Rgb, saturate};
use crate::shape::{DVec3x8, SURFACES, SurfaceInputs8, Surfaces, Vec3x8, dvec3, set_dvec3, set_vec3, vec3};
use canaletto_bvh::{InstructionSet, Kernel};
use glam::{DVec3, Vec3};

/// The number of interactions side by side.
pub(super) const LANES: usize = SURFACES;

/// The diffuse and the specular light of one component: (5.32b) and (5.38).
#[inline(always)]
pub(super) fn lit(intensity: f32, [kd, n_dot_l]: [f32; 2], [ks, highlight]: [f32; 2]) -> [f32; 2] {
    [saturate(intensity * kd) * n_dot_l, saturate(intensity * ks) * highlight]
}

/// The sum of both terms after shadows (5.39a).
#[inline(always)]
pub(super) fn contribution([diffuse, specular]: [f32; 2], f_s: f32) -> f32 {
    if f_s > 0.0 { saturate(diffuse + specular) * f_s } else { 0.0 }
}

/// Eight interactions.
#[derive(Clone, Copy)]
pub(super) struct Interactions8 {
    pub(super) surfaces: Surfaces,
    /// 1 for a ray that hit the outer side, −1 for the inner side.
    side: [f64; LANES],
    /// v̂, the unit directions back along the rays.
    wo: DVec3x8,
    /// The unit geometric normals on the viewer's side.
    facing: DVec3x8,
    /// The unit shading normals on the viewer's side.
    normal: DVec3x8,
    /// r, the mirrored directions (5.37).
    mirrored: DVec3x8,
    /// The origins of shadow rays.
    pub(super) start: Vec3x8,
    kd: Vec3x8,
    ks: Vec3x8,
    /// n, the exponents of highlights.
    pub(super) n: [f32; LANES],
    /// The sum of the light so far.
    color: Vec3x8,
    /// A bit for each interaction whose shading is visible through its overlay.
    pub(super) seen: u32,
    /// A bit for each interaction whose material has a highlight.
    pub(super) shiny: u32,
    /// A bit for each interaction whose shading normal a texture bent.
    pub(super) normal_bent: u32,
}

/// The directions from eight interactions to a light point, and the light along them.
#[derive(Clone, Copy)]
pub(super) struct LightSamples8 {
    /// L̂, the unit directions; NaN for a light exactly at the interaction.
    direction: DVec3x8,
    /// The distance to the light.
    pub(super) distance: [f32; LANES],
    /// n · L.
    pub(super) n_dot_l: [f32; LANES],
    /// r · L.
    pub(super) r_dot_l: [f32; LANES],
    /// The intensity before shadows.
    intensity: Vec3x8,
    /// The directions of shadow rays, and their `t_max` in `reach`. Towards a point, `t_max` lies just below 1. Towards
    /// infinity it is infinite.
    pub(super) to: Vec3x8,
    pub(super) reach: [f32; LANES],
    /// A bit for each interaction that any light reaches, before shadows.
    pub(super) lit: u32,
    /// f_s, the share of light that passes; 0 where no light arrives.
    pub(super) f_s: [f32; LANES],
    /// cosⁿα, where there is a highlight.
    pub(super) highlight: [f32; LANES],
}

const ZERO: DVec3x8 = [[0.0; LANES]; 3];
const BLACK: Vec3x8 = [[0.0; LANES]; 3];

impl Interactions8 {
    /// Eight empty lanes.
    pub(super) const NOTHING: Interactions8 = Interactions8 {
        surfaces: Surfaces::NOTHING,
        side: [1.0; LANES],
        wo: ZERO,
        facing: ZERO,
        normal: ZERO,
        mirrored: ZERO,
        start: BLACK,
        kd: BLACK,
        ks: BLACK,
        n: [0.0; LANES],
        color: BLACK,
        seen: 0,
        shiny: 0,
        normal_bent: 0,
    };

    /// Removes all interactions. Values that aren't read again remain.
    pub(super) fn clear(&mut self) {
        (self.seen, self.shiny, self.normal_bent) = (0, 0, 0);
    }

    /// Stores an interaction's material.
    #[inline]
    pub(super) fn set_material(&mut self, lane: usize, material: &MaterialPoint) {
        let phong = &material.classic;
        set_vec3(&mut self.kd, lane, phong.kd.to_array().into());
        set_vec3(&mut self.ks, lane, phong.ks.to_array().into());
        self.n[lane] = phong.n;
        self.seen |= u32::from(material.is_seen()) << lane;
        self.shiny |= u32::from(!phong.ks.is_black()) << lane;
        self.normal_bent |= u32::from(material.normal_bent) << lane;
    }

    /// Evaluates the surfaces of `surface_inputs`, and the directions and normals on the viewer's side.
    pub(super) fn evaluate(&mut self, surface_inputs: &mut SurfaceInputs8) {
        InstructionSet::run(Evaluate { interactions8: self, surface_inputs });
        surface_inputs.clear();
    }

    /// Sets the sum of the light so far at an interaction.
    #[inline]
    pub(super) fn set_color(&mut self, lane: usize, color: Rgb) {
        set_vec3(&mut self.color, lane, color.to_array().into());
    }

    /// Whether a ray hit the outer side.
    #[inline]
    pub(super) fn is_outside(&self, lane: usize) -> bool {
        self.side[lane] > 0.0
    }

    /// The frame of an interaction.
    #[inline]
    pub(super) fn frame(&self, lane: usize) -> Frame {
        Frame {
            outside: self.is_outside(lane),
            wo: dvec3(&self.wo, lane),
            outer: dvec3(&self.surfaces.normal, lane),
            facing: self.facing(lane),
            normal: self.normal(lane),
            mirrored: self.mirrored(lane),
            exact: self.exact(lane),
            point: vec3(&self.surfaces.point, lane),
            error: vec3(&self.surfaces.error, lane),
            start: self.start(lane),
        }
    }

    /// The unit geometric normal on the viewer's side.
    #[inline]
    pub(super) fn facing(&self, lane: usize) -> DVec3 {
        dvec3(&self.facing, lane)
    }

    /// Whether light comes from behind the surface, though perhaps not from behind its bent normal. It doesn't arrive.
    #[inline]
    pub(super) fn is_below(&self, lane: usize, direction: DVec3) -> bool {
        self.normal_bent >> lane & 1 == 1 && self.facing(lane).dot(direction) <= 0.0
    }

    /// The unit shading normal on the viewer's side.
    #[inline(always)]
    pub(super) fn normal(&self, lane: usize) -> DVec3 {
        dvec3(&self.normal, lane)
    }

    /// r, the mirrored direction (5.37).
    #[inline(always)]
    pub(super) fn mirrored(&self, lane: usize) -> DVec3 {
        dvec3(&self.mirrored, lane)
    }

    /// The point before rounding.
    #[inline]
    pub(super) fn exact(&self, lane: usize) -> DVec3 {
        dvec3(&self.surfaces.exact, lane)
    }

    /// The origin of an interaction's shadow rays.
    #[inline]
    pub(super) fn start(&self, lane: usize) -> Vec3 {
        vec3(&self.start, lane)
    }

    /// The sum of the light so far at an interaction.
    #[inline]
    pub(super) fn color(&self, lane: usize) -> Rgb {
        Rgb::from(vec3(&self.color, lane).to_array())
    }
}

impl LightSamples8 {
    const NOTHING: LightSamples8 = LightSamples8 {
        direction: ZERO,
        distance: [0.0; LANES],
        n_dot_l: [0.0; LANES],
        r_dot_l: [0.0; LANES],
        intensity: BLACK,
        to: BLACK,
        reach: [0.0; LANES],
        lit: 0,
        f_s: [0.0; LANES],
        highlight: [0.0; LANES],
    };

    /// The directions to one point.
    pub(super) fn point(light_samples: &mut Vec<LightSamples8>, interactions8: &[Interactions8], position: Vec3) {
        light_samples.resize(interactions8.len(), LightSamples8::NOTHING);
        InstructionSet::run(ToPoint { light_samples, interactions8, position });
    }

    /// The directions of light samples whose arriving light is given.
    pub(super) fn from_illumination(
        light_samples: &mut Vec<LightSamples8>,
        interactions8: &[Interactions8],
        arriving: &[Illumination],
    ) {
        light_samples.resize(interactions8.len(), LightSamples8::NOTHING);
        for ((samples8, interactions8), arriving) in
            light_samples.iter_mut().zip(interactions8).zip(arriving.chunks(LANES))
        {
            for (lane, arriving) in arriving.iter().enumerate() {
                set_dvec3(&mut samples8.direction, lane, arriving.direction);
                samples8.distance[lane] = arriving.distance;
                let (to, reach) = match arriving.position {
                    Some(position) => (position - interactions8.start(lane), BEFORE_LIGHT),
                    None => (arriving.direction.as_vec3(), f32::INFINITY),
                };
                set_vec3(&mut samples8.to, lane, to);
                samples8.reach[lane] = reach;
                samples8.set_intensity(lane, arriving.intensity);
            }
        }
        InstructionSet::run(Cosines { light_samples, interactions8 });
    }

    /// The unit direction from an interaction to the light.
    #[inline(always)]
    pub(super) fn direction(&self, lane: usize) -> DVec3 {
        dvec3(&self.direction, lane)
    }

    /// The intensity before shadows.
    pub(super) fn intensity(&self, lane: usize) -> Rgb {
        Rgb::from(vec3(&self.intensity, lane).to_array())
    }

    /// Sets the intensity at an interaction.
    #[inline]
    pub(super) fn set_intensity(&mut self, lane: usize, intensity: Rgb) {
        set_vec3(&mut self.intensity, lane, intensity.to_array().into());
    }

    /// Sets the intensity at all interactions.
    pub(super) fn set_intensities(&mut self, intensity: Rgb) {
        self.intensity = intensity.to_array().map(|v| [v; LANES]);
    }

    /// Finds the interactions that light reaches, without highlights and without occlusion.
    #[inline]
    pub(super) fn evaluate(&mut self, interactions8: &Interactions8) {
        let [r, g, b] = &self.intensity;
        self.lit = 0;
        for i in 0..LANES {
            // A light exactly at the point gives NaN. The comparison is then false, and the light adds nothing.
            let lit = self.n_dot_l[i] > 0.0 && !(r[i] == 0.0 && g[i] == 0.0 && b[i] == 0.0);
            self.lit |= u32::from(lit) << i;
        }
        self.lit &= interactions8.seen;
        for i in 0..LANES {
            self.f_s[i] = if self.lit >> i & 1 == 1 { 1.0 } else { 0.0 };
        }
        self.highlight = [0.0; LANES];
    }

    /// Removes the light at an interaction.
    pub(super) fn mask_out(&mut self, lane: usize) {
        self.lit &= !(1 << lane);
        self.f_s[lane] = 0.0;
    }

    /// Adds the arriving light at all interactions.
    pub(super) fn add(light_samples: &[LightSamples8], interactions8: &mut [Interactions8]) {
        InstructionSet::run(Add { light_samples, interactions8 });
    }

    #[inline(always)]
    fn cosines(&mut self, interactions8: &Interactions8) {
        for i in 0..LANES {
            let direction = self.direction(i);
            self.n_dot_l[i] = interactions8.normal(i).dot(direction) as f32;
            self.r_dot_l[i] = interactions8.mirrored(i).dot(direction) as f32;
        }
    }
}

struct Evaluate<'a> {
    interactions8: &'a mut Interactions8,
    surface_inputs: &'a SurfaceInputs8,
}

impl Kernel for Evaluate<'_> {
    type Answer = ();

    #[inline(always)]
    fn run(self) {
        let Evaluate { interactions8, surface_inputs } = self;
        surface_inputs.surfaces(&mut interactions8.surfaces);
        for i in 0..LANES {
            let frame = Frame::new(dvec3(&surface_inputs.direction, i), &interactions8.surfaces.get(i));
            interactions8.side[i] = if frame.outside { 1.0 } else { -1.0 };
            set_dvec3(&mut interactions8.wo, i, frame.wo);
            set_dvec3(&mut interactions8.facing, i, frame.facing);
            set_dvec3(&mut interactions8.normal, i, frame.normal);
            set_dvec3(&mut interactions8.mirrored, i, frame.mirrored);
            set_vec3(&mut interactions8.start, i, frame.start);
        }
    }
}

struct ToPoint<'a> {
    light_samples: &'a mut [LightSamples8],
    interactions8: &'a [Interactions8],
    position: Vec3,
}

impl Kernel for ToPoint<'_> {
    type Answer = ();

    #[inline(always)]
    fn run(self) {
        let position = self.position.as_dvec3();
        for (samples8, interactions8) in self.light_samples.iter_mut().zip(self.interactions8) {
            for i in 0..LANES {
                let to_light = position - dvec3(&interactions8.surfaces.exact, i);
                let length = to_light.length();
                set_dvec3(&mut samples8.direction, i, to_light / length);
                samples8.distance[i] = length as f32;
                set_vec3(&mut samples8.to, i, self.position - vec3(&interactions8.start, i));
            }
            samples8.reach = [BEFORE_LIGHT; LANES];
            samples8.cosines(interactions8);
        }
    }
}

struct Cosines<'a> {
    light_samples: &'a mut [LightSamples8],
    interactions8: &'a [Interactions8],
}

impl Kernel for Cosines<'_> {
    type Answer = ();

    #[inline(always)]
    fn run(self) {
        for (samples8, interactions8) in self.light_samples.iter_mut().zip(self.interactions8) {
            samples8.cosines(interactions8);
        }
    }
}

struct Add<'a> {
    light_samples: &'a [LightSamples8],
    interactions8: &'a mut [Interactions8],
}

impl Kernel for Add<'_> {
    type Answer = ();

    #[inline(always)]
    fn run(self) {
        for (samples8, interactions8) in self.light_samples.iter().zip(self.interactions8) {
            for c in 0..3 {
                for i in 0..LANES {
                    let (diffuse, specular) = (
                        [interactions8.kd[c][i], samples8.n_dot_l[i]],
                        [interactions8.ks[c][i], samples8.highlight[i]],
                    );
                    let arrives = contribution(lit(samples8.intensity[c][i], diffuse, specular), samples8.f_s[i]);
                    interactions8.color[c][i] = saturate(interactions8.color[c][i] + arrives);
                }
            }
        }
    }
}
