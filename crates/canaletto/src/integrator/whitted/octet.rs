//! Stops and the light that comes to them, eight side by side: lengths, directions, cosines and colours are computed for all of them at once.

use crate::light::Illumination;
use crate::material::{MaterialPoint, reflect};
use crate::math::{Rgb, offset_origin, saturate};
use crate::shape::{Encounters, Rows, SURFACES, Surfaces, Thin, set_thin, set_wide, thin, wide};
use canaletto_bvh::{InstructionSet, Kernel};
use glam::{DVec3, Vec3};

/// How many stops are side by side.
pub(super) const STOPS: usize = SURFACES;

/// Eight stops.
#[derive(Clone, Copy)]
pub(super) struct Octet {
    pub(super) surfaces: Surfaces,
    /// 1 for a ray that came from the outer side, or −1.
    side: [f64; STOPS],
    /// v̂, towards where the rays came from.
    wo: Rows,
    /// The unit geometric normals on the viewer's side.
    facing: Rows,
    /// The unit shading normals on the viewer's side.
    normal: Rows,
    /// r, the mirrored directions (5.37).
    mirrored: Rows,
    /// Where shadow rays start.
    pub(super) start: Thin,
    kd: Thin,
    ks: Thin,
    /// n, the exponents of highlights.
    pub(super) n: [f32; STOPS],
    /// The light so far.
    color: Thin,
    /// A bit for each stop of which anything but a print is seen.
    pub(super) seen: u32,
    /// A bit for each stop that has highlights.
    pub(super) shiny: u32,
    /// A bit for each stop whose shading normal a texture bent.
    pub(super) bent: u32,
}

/// The ways from eight stops to a point of light, and what comes along them.
#[derive(Clone, Copy)]
pub(super) struct Towards {
    /// L̂, the unit directions; NaN for a light exactly at the stop.
    direction: Rows,
    /// How far it is.
    pub(super) distance: [f32; STOPS],
    /// n · L.
    pub(super) n_dot_l: [f32; STOPS],
    /// r · L.
    pub(super) r_dot_l: [f32; STOPS],
    /// Before shadows.
    intensity: Thin,
    /// The directions of shadow rays, and up to where these count: towards a point they end there, at t = 1; towards infinity they have no end.
    pub(super) to: Thin,
    pub(super) reach: [f32; STOPS],
    /// A bit for each stop to which any light comes, before shadows.
    pub(super) comes: u32,
    /// f_s, the share that passes; 0 where none comes.
    pub(super) f_s: [f32; STOPS],
    /// cosⁿα, where there is a highlight.
    pub(super) highlight: [f32; STOPS],
}

/// Up to where a ray to a point of light counts.
const BEFORE_LIGHT: f32 = 1.0 - f32::EPSILON;

const ZERO: Rows = [[0.0; STOPS]; 3];
const BLACK: Thin = [[0.0; STOPS]; 3];

/// The numbers of the bits that are set.
pub(super) fn lanes(mut bits: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let lane = (bits != 0).then_some(bits.trailing_zeros() as usize);
        bits &= bits.wrapping_sub(1);
        lane
    })
}

impl Octet {
    /// Eight times nothing.
    pub(super) const NOTHING: Octet = Octet {
        surfaces: Surfaces::NOTHING,
        side: [1.0; STOPS],
        wo: ZERO,
        facing: ZERO,
        normal: ZERO,
        mirrored: ZERO,
        start: BLACK,
        kd: BLACK,
        ks: BLACK,
        n: [0.0; STOPS],
        color: BLACK,
        seen: 0,
        shiny: 0,
        bent: 0,
    };

    /// Leaves no stop; numbers that nothing reads stay.
    pub(super) fn clear(&mut self) {
        (self.seen, self.shiny, self.bent) = (0, 0, 0);
    }

    /// Takes a stop's material.
    #[inline]
    pub(super) fn set_material(&mut self, lane: usize, material: &MaterialPoint) {
        let phong = &material.phong;
        set_thin(&mut self.kd, lane, phong.kd.to_array().into());
        set_thin(&mut self.ks, lane, phong.ks.to_array().into());
        self.n[lane] = phong.n;
        self.seen |= u32::from(material.is_seen()) << lane;
        self.shiny |= u32::from(!phong.ks.is_black()) << lane;
        self.bent |= u32::from(material.bent) << lane;
    }

    /// Finds the surfaces of `encounters`, and how all look from where the rays came.
    pub(super) fn settle(&mut self, encounters: &mut Encounters) {
        InstructionSet::run(Settle { octet: self, encounters });
        encounters.clear();
    }

    /// The light so far at a stop.
    #[inline]
    pub(super) fn set_color(&mut self, lane: usize, color: Rgb) {
        set_thin(&mut self.color, lane, color.to_array().into());
    }

    /// Whether the ray came from the outer side.
    #[inline]
    pub(super) fn outside(&self, lane: usize) -> bool {
        self.side[lane] > 0.0
    }

    /// v̂, towards where the ray came from.
    #[inline]
    pub(super) fn wo(&self, lane: usize) -> DVec3 {
        wide(&self.wo, lane)
    }

    /// The unit geometric normal on the outer side.
    #[inline]
    pub(super) fn outer(&self, lane: usize) -> DVec3 {
        wide(&self.surfaces.normal, lane)
    }

    /// The unit geometric normal on the viewer's side.
    #[inline]
    pub(super) fn facing(&self, lane: usize) -> DVec3 {
        wide(&self.facing, lane)
    }

    /// The unit shading normal on the viewer's side.
    #[inline(always)]
    pub(super) fn normal(&self, lane: usize) -> DVec3 {
        wide(&self.normal, lane)
    }

    /// r, the mirrored direction (5.37).
    #[inline(always)]
    pub(super) fn mirrored(&self, lane: usize) -> DVec3 {
        wide(&self.mirrored, lane)
    }

    /// The point before it was rounded.
    #[inline]
    pub(super) fn exact(&self, lane: usize) -> DVec3 {
        wide(&self.surfaces.exact, lane)
    }

    /// The point, and the bound of its error.
    #[inline]
    pub(super) fn point(&self, lane: usize) -> [Vec3; 2] {
        [thin(&self.surfaces.point, lane), thin(&self.surfaces.error, lane)]
    }

    /// Where a stop's shadow rays start.
    #[inline]
    pub(super) fn start(&self, lane: usize) -> Vec3 {
        thin(&self.start, lane)
    }

    /// The light so far at a stop.
    #[inline]
    pub(super) fn color(&self, lane: usize) -> Rgb {
        Rgb::from(thin(&self.color, lane).to_array())
    }
}

/// The diffuse and the specular light of one component: (5.32b) and (5.38).
#[inline(always)]
fn lit(intensity: f32, [kd, n_dot_l]: [f32; 2], [ks, highlight]: [f32; 2]) -> [f32; 2] {
    [saturate(intensity * kd) * n_dot_l, saturate(intensity * ks) * highlight]
}

/// What arrives of it, added to the light so far (5.39a).
#[inline(always)]
fn contribution([diffuse, specular]: [f32; 2], f_s: f32) -> f32 {
    if f_s > 0.0 { saturate(diffuse + specular) * f_s } else { 0.0 }
}

impl Towards {
    const NOTHING: Towards = Towards {
        direction: ZERO,
        distance: [0.0; STOPS],
        n_dot_l: [0.0; STOPS],
        r_dot_l: [0.0; STOPS],
        intensity: BLACK,
        to: BLACK,
        reach: [0.0; STOPS],
        comes: 0,
        f_s: [0.0; STOPS],
        highlight: [0.0; STOPS],
    };

    /// The ways to one point.
    pub(super) fn point(ways: &mut Vec<Towards>, octets: &[Octet], position: Vec3) {
        ways.resize(octets.len(), Towards::NOTHING);
        InstructionSet::run(ToPoint { ways, octets, position });
    }

    /// Ways on which is known what arrives at each stop.
    pub(super) fn known(ways: &mut Vec<Towards>, octets: &[Octet], arriving: &[Illumination]) {
        ways.resize(octets.len(), Towards::NOTHING);
        for ((way, octet), arriving) in ways.iter_mut().zip(octets).zip(arriving.chunks(STOPS)) {
            for (lane, arriving) in arriving.iter().enumerate() {
                set_wide(&mut way.direction, lane, arriving.direction);
                way.distance[lane] = arriving.distance;
                let (to, reach) = match arriving.position {
                    Some(position) => (position - octet.start(lane), BEFORE_LIGHT),
                    None => (arriving.direction.as_vec3(), f32::INFINITY),
                };
                set_thin(&mut way.to, lane, to);
                way.reach[lane] = reach;
                way.set_intensity(lane, arriving.intensity);
            }
        }
        InstructionSet::run(Cosines { ways, octets });
    }

    /// The direction from a stop.
    #[inline(always)]
    pub(super) fn direction(&self, lane: usize) -> DVec3 {
        wide(&self.direction, lane)
    }

    /// The intensity at a stop, before shadows.
    pub(super) fn intensity(&self, lane: usize) -> Rgb {
        Rgb::from(thin(&self.intensity, lane).to_array())
    }

    /// Sets the intensity at a stop.
    #[inline]
    pub(super) fn set_intensity(&mut self, lane: usize, intensity: Rgb) {
        set_thin(&mut self.intensity, lane, intensity.to_array().into());
    }

    /// Sets the intensity at all stops.
    pub(super) fn set_intensities(&mut self, intensity: Rgb) {
        self.intensity = intensity.to_array().map(|v| [v; STOPS]);
    }

    /// Finds out to which stops light comes; without highlights, and nothing in between.
    #[inline]
    pub(super) fn come(&mut self, octet: &Octet) {
        let [r, g, b] = &self.intensity;
        self.comes = 0;
        for i in 0..STOPS {
            // NaN, which isn't: a light exactly at the point, which adds nothing.
            let lit = self.n_dot_l[i] > 0.0 && !(r[i] == 0.0 && g[i] == 0.0 && b[i] == 0.0);
            self.comes |= u32::from(lit) << i;
        }
        self.comes &= octet.seen;
        for i in 0..STOPS {
            self.f_s[i] = if self.comes >> i & 1 == 1 { 1.0 } else { 0.0 };
        }
        self.highlight = [0.0; STOPS];
    }

    /// Lets none come to a stop.
    pub(super) fn keep_off(&mut self, lane: usize) {
        self.comes &= !(1 << lane);
        self.f_s[lane] = 0.0;
    }

    /// Adds what arrives at all stops.
    pub(super) fn add(ways: &[Towards], octets: &mut [Octet]) {
        InstructionSet::run(Add { ways, octets });
    }

    /// The diffuse, the specular and the whole light that arrives at a stop.
    pub(super) fn terms(&self, octet: &Octet, lane: usize) -> [Rgb; 3] {
        if self.comes >> lane & 1 == 0 {
            return [Rgb::BLACK; 3];
        }
        let both: [[f32; 2]; 3] = std::array::from_fn(|c| {
            let diffuse = [octet.kd[c][lane], self.n_dot_l[lane]];
            lit(self.intensity[c][lane], diffuse, [octet.ks[c][lane], self.highlight[lane]])
        });
        let whole = both.map(|both| contribution(both, self.f_s[lane]));
        [both.map(|[diffuse, _]| diffuse), both.map(|[_, specular]| specular), whole].map(Rgb::from)
    }

    #[inline(always)]
    fn cosines(&mut self, octet: &Octet) {
        for i in 0..STOPS {
            let direction = self.direction(i);
            self.n_dot_l[i] = octet.normal(i).dot(direction) as f32;
            self.r_dot_l[i] = octet.mirrored(i).dot(direction) as f32;
        }
    }
}

struct Settle<'a> {
    octet: &'a mut Octet,
    encounters: &'a Encounters,
}

impl Kernel for Settle<'_> {
    type Answer = ();

    #[inline(always)]
    fn run(self) {
        let Settle { octet, encounters } = self;
        encounters.surfaces(&mut octet.surfaces);
        for i in 0..STOPS {
            let surfaces = &octet.surfaces;
            let (direction, outer) = (wide(&encounters.direction, i), wide(&surfaces.normal, i));
            let outside = direction.dot(outer) < 0.0;
            let side = if outside { 1.0 } else { -1.0 };
            let (wo, facing, normal) = (-direction.normalize(), outer * side, wide(&surfaces.shading_normal, i) * side);
            let [lifted, point] = [&surfaces.lifted, &surfaces.point].map(|rows| thin(rows, i));
            let start = offset_origin(if outside { lifted } else { point }, thin(&surfaces.error, i), facing, facing);
            octet.side[i] = side;
            set_wide(&mut octet.wo, i, wo);
            set_wide(&mut octet.facing, i, facing);
            set_wide(&mut octet.normal, i, normal);
            set_wide(&mut octet.mirrored, i, reflect(wo, normal));
            set_thin(&mut octet.start, i, start);
        }
    }
}

struct ToPoint<'a> {
    ways: &'a mut [Towards],
    octets: &'a [Octet],
    position: Vec3,
}

impl Kernel for ToPoint<'_> {
    type Answer = ();

    #[inline(always)]
    fn run(self) {
        let position = self.position.as_dvec3();
        for (way, octet) in self.ways.iter_mut().zip(self.octets) {
            for i in 0..STOPS {
                let to_light = position - wide(&octet.surfaces.exact, i);
                let length = to_light.length();
                set_wide(&mut way.direction, i, to_light / length);
                way.distance[i] = length as f32;
                set_thin(&mut way.to, i, self.position - thin(&octet.start, i));
            }
            way.reach = [BEFORE_LIGHT; STOPS];
            way.cosines(octet);
        }
    }
}

struct Cosines<'a> {
    ways: &'a mut [Towards],
    octets: &'a [Octet],
}

impl Kernel for Cosines<'_> {
    type Answer = ();

    #[inline(always)]
    fn run(self) {
        for (way, octet) in self.ways.iter_mut().zip(self.octets) {
            way.cosines(octet);
        }
    }
}

struct Add<'a> {
    ways: &'a [Towards],
    octets: &'a mut [Octet],
}

impl Kernel for Add<'_> {
    type Answer = ();

    #[inline(always)]
    fn run(self) {
        for (way, octet) in self.ways.iter().zip(self.octets) {
            for c in 0..3 {
                for i in 0..STOPS {
                    let (diffuse, specular) = ([octet.kd[c][i], way.n_dot_l[i]], [octet.ks[c][i], way.highlight[i]]);
                    let arrives = contribution(lit(way.intensity[c][i], diffuse, specular), way.f_s[i]);
                    octet.color[c][i] = saturate(octet.color[c][i] + arrives);
                }
            }
        }
    }
}
