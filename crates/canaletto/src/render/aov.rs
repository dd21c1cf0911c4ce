//! Extra layers (arbitrary output variables). A probe writes them, so that they come from the rays that make the
//! picture.

use crate::camera::Camera;
use crate::film::Layer;
use crate::integrator::{LightTerm, Probe, RayKind};
use crate::material::MaterialPoint;
use crate::math::Rgb;
use crate::shape::Surface;
use crate::world::{GeometryProbe, Hit, World};
use crate::{Named, named};
use canaletto_bvh::Ray;
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// An extra layer of the picture.
///
/// Geometry layers (depth to material id) come from the first hit of the first sample, since a mean of two objects has
/// no meaning. Pixels of the background have infinite depth and zeros elsewhere. Light layers (diffuse to refraction)
/// are filtered like the picture. They sum to it, except for `shadow`, which holds the light that shadows remove.
/// `tree-depth` and `cost` count rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Aov {
    /// Distance of the point from the eye, even if the ray leaves another point of a lens.
    Depth,
    /// Shading normal on the viewer's side, in world space.
    Normal,
    /// The point in world space. It is `f32`, and so rounded far from zero.
    Position,
    /// Texture coordinates.
    Uv,
    /// [`World::object_id`]; 0 is the background.
    ObjectId,
    /// 1 + the material's index; 0 is the background.
    MaterialId,
    /// Σ f_s l ⊗ kd (n·L) at the first hit, and the colours of overlays.
    Diffuse,
    /// Σ f_s l ⊗ ks (r·L)ⁿ at the first hit.
    Specular,
    /// The light that shadows remove at the first hit.
    Shadow,
    /// Iₐ ⊗ kd at the first hit; the background for rays without a hit.
    Ambient,
    /// k times the colour of the mirrored ray.
    Reflection,
    /// 1 − o times the colour of the refracted ray, and the light through cut-outs.
    Refraction,
    /// The largest depth in the pixel's ray trees.
    TreeDepth,
    /// The number of rays traced for the pixel, of all kinds.
    Cost,
}

named!(Aov {
    Depth => "depth",
    Normal => "normal",
    Position => "position",
    Uv => "uv",
    ObjectId => "object-id",
    MaterialId => "material-id",
    Diffuse => "diffuse",
    Specular => "specular",
    Shadow => "shadow",
    Ambient => "ambient",
    Reflection => "reflection",
    Refraction => "refraction",
    TreeDepth => "tree-depth",
    Cost => "cost",
});

impl Aov {
    /// Whether the layer holds light, in red, green and blue.
    pub fn is_light(self) -> bool {
        self.channels() == ["R", "G", "B"]
    }

    /// The names of the layer's channels.
    pub fn channels(self) -> &'static [&'static str] {
        match self {
            Aov::Depth => &["Z"],
            Aov::Normal | Aov::Position => &["X", "Y", "Z"],
            Aov::Uv => &["U", "V"],
            Aov::ObjectId | Aov::MaterialId | Aov::TreeDepth | Aov::Cost => &["X"],
            Aov::Diffuse | Aov::Specular | Aov::Shadow | Aov::Ambient | Aov::Reflection | Aov::Refraction => {
                &["R", "G", "B"]
            }
        }
    }

    /// Whether the layer holds numbers of objects or materials.
    pub fn is_id(self) -> bool {
        matches!(self, Aov::ObjectId | Aov::MaterialId)
    }

    pub(super) fn layer(self, world: &World, width: u32, height: u32) -> Layer {
        /// `f32` represents all integers up to this one.
        const EXACT: u64 = 1 << f32::MANTISSA_DIGITS;
        let (name, channels) = (self.name(), self.channels());
        let pixels = width as usize * height as usize;
        let ids = if self.is_id() && world.largest_id() > EXACT { vec![0; pixels] } else { Vec::new() };
        Layer { name, channels, data: vec![0.0; pixels * channels.len()], ids }
    }
}

/// Sums of the light terms of one sample, or weighted sums of all samples.
#[derive(Clone, Copy, Default)]
struct Light {
    diffuse: Rgb,
    specular: Rgb,
    shadow: Rgb,
    ambient: Rgb,
    reflection: Rgb,
    refraction: Rgb,
}

impl Light {
    fn scale(&mut self, factor: f32) {
        for term in [
            &mut self.diffuse,
            &mut self.specular,
            &mut self.shadow,
            &mut self.ambient,
            &mut self.reflection,
            &mut self.refraction,
        ] {
            *term *= factor;
        }
    }

    fn terms(&self) -> [Rgb; 6] {
        [self.diffuse, self.specular, self.shadow, self.ambient, self.reflection, self.refraction]
    }
}

/// The probe that collects the layers of one pixel.
pub(super) struct AovProbe<'w> {
    world: &'w World,
    camera: &'w Camera,
    /// The eye's position at the time of the sample.
    eye: DVec3,
    /// Depth, normal, position and uv of the first sample.
    geometry: Option<[f32; 9]>,
    /// The numbers of the first sample's object and material; 0 for a miss.
    ids: [u32; 2],
    samples: u32,
    weight: f64,
    sums: [[f64; 3]; 6],
    sample_weight: f64,
    sample: Light,
    /// The kinds and factors of the rays from the camera ray to the current ray.
    stack: Vec<(RayKind, Rgb)>,
    tree_depth: u32,
    rays: u64,
}

impl<'w> AovProbe<'w> {
    pub(super) fn new(world: &'w World, camera: &'w Camera) -> AovProbe<'w> {
        AovProbe {
            world,
            camera,
            eye: camera.eye(),
            geometry: None,
            ids: [0; 2],
            samples: 0,
            weight: 0.0,
            sums: [[0.0; 3]; 6],
            sample_weight: 0.0,
            sample: Light::default(),
            stack: Vec::new(),
            tree_depth: 0,
            rays: 0,
        }
    }

    /// Ends the pixel, for which this many rays were traced.
    pub(super) fn finish(&mut self, rays: u64) {
        self.close_sample();
        self.rays = rays;
    }

    fn close_sample(&mut self) {
        for (sum, term) in self.sums.iter_mut().zip(self.sample.terms()) {
            for (s, t) in sum.iter_mut().zip(term.saturated().to_array()) {
                *s += self.sample_weight * f64::from(t);
            }
        }
        self.weight += self.sample_weight;
        self.sample = Light::default();
        self.sample_weight = 0.0;
    }

    /// The number of the object or the material, if the layer holds one.
    pub(super) fn id(&self, aov: Aov) -> Option<u32> {
        match aov {
            Aov::ObjectId => Some(self.ids[0]),
            Aov::MaterialId => Some(self.ids[1]),
            _ => None,
        }
    }

    pub(super) fn write(&self, aov: Aov, out: &mut [f32]) {
        const MISS: [f32; 9] = [f32::INFINITY, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        let geometry = self.geometry.as_ref().unwrap_or(&MISS);
        let light = |term: usize| Rgb::from(self.sums[term].map(|s| (s / self.weight) as f32)).saturated().to_array();
        match aov {
            Aov::Depth => out.copy_from_slice(&geometry[0..1]),
            Aov::Normal => out.copy_from_slice(&geometry[1..4]),
            Aov::Position => out.copy_from_slice(&geometry[4..7]),
            Aov::Uv => out.copy_from_slice(&geometry[7..9]),
            Aov::ObjectId => out[0] = self.ids[0] as f32,
            Aov::MaterialId => out[0] = self.ids[1] as f32,
            Aov::Diffuse => out.copy_from_slice(&light(0)),
            Aov::Specular => out.copy_from_slice(&light(1)),
            Aov::Shadow => out.copy_from_slice(&light(2)),
            Aov::Ambient => out.copy_from_slice(&light(3)),
            Aov::Reflection => out.copy_from_slice(&light(4)),
            Aov::Refraction => out.copy_from_slice(&light(5)),
            Aov::TreeDepth => out[0] = self.tree_depth as f32,
            Aov::Cost => out[0] = self.rays as f32,
        }
    }
}

impl GeometryProbe for AovProbe<'_> {}

impl Probe for AovProbe<'_> {
    fn sample(&mut self, _position: [f64; 2], weight: f64) {
        self.close_sample();
        self.samples += 1;
        self.sample_weight = weight;
    }

    fn drawn(&mut self, time: Option<f64>, _lens: Option<[f64; 2]>) {
        if let Some(time) = time
            && self.camera.moves()
        {
            self.eye = self.camera.at(time).eye();
        }
    }

    fn ray(&mut self, kind: RayKind, _ray: &Ray, depth: u32, factor: Rgb) {
        self.tree_depth = self.tree_depth.max(depth);
        self.stack.push((kind, factor));
    }

    fn miss(&mut self, background: Rgb) {
        if self.stack.len() == 1 {
            self.sample.ambient += background;
        }
    }

    fn hit(&mut self, hit: &Hit, surface: &Surface, _material: &MaterialPoint, outside: bool) {
        if self.samples == 1 && self.stack.len() == 1 {
            let normal = if outside { surface.shading_normal } else { -surface.shading_normal }.as_vec3();
            let (p, uv) = (self.world.to_scene(surface.point), surface.uv);
            let depth = (surface.exact - self.eye).length() as f32;
            self.ids = [self.world.object_id(hit), self.world.material_index(hit) + 1];
            self.geometry = Some([depth, normal.x, normal.y, normal.z, p.x, p.y, p.z, uv.x, uv.y]);
        }
    }

    fn unlit(&mut self, kd: Rgb) {
        if self.stack.len() == 1 {
            self.sample.diffuse += kd;
        }
    }

    fn ambient(&mut self, term: Rgb) {
        if self.stack.len() == 1 {
            self.sample.ambient += term;
        }
    }

    fn light(&mut self, term: &LightTerm) {
        if self.stack.len() == 1 {
            self.sample.diffuse += term.diffuse * term.f_s;
            self.sample.specular += term.specular * term.f_s;
            self.sample.shadow += (term.diffuse + term.specular).saturated() * (1.0 - term.f_s);
        }
    }

    fn overlay(&mut self, color: Rgb, share: f32) {
        if self.stack.len() == 1 {
            self.sample.scale(1.0 - share);
            self.sample.diffuse += color * share;
        }
    }

    fn coverage(&mut self, share: f32) {
        if self.stack.len() == 1 {
            self.sample.scale(share);
        }
    }

    fn end(&mut self, color: Rgb) {
        let Some((kind, factor)) = self.stack.pop() else { return };
        if self.stack.len() == 1 {
            match kind {
                RayKind::Reflected => self.sample.reflection += color * factor,
                RayKind::Refracted | RayKind::TotallyReflected | RayKind::Passed => {
                    self.sample.refraction += color * factor;
                }
                RayKind::Eye => {}
            }
        }
    }
}
