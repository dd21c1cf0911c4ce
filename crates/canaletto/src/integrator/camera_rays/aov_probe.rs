//! The probe that collects the extra layers of one pixel from the rays that make the picture.

use crate::camera::Camera;
use crate::film::TileBuffer;
use crate::integrator::{EmittersTerm, FirstHit, LightTerm, Probe, RayKind};
use crate::job::Aov;
use crate::material::MaterialPoint;
use crate::math::Rgb;
use crate::shape::Surface;
use crate::world::{GeometryProbe, Hit, World};
use canaletto_bvh::Ray;

/// Sums of the light terms of one sample, or weighted sums of all samples.
#[derive(Clone, Copy, Default)]
struct Light {
    diffuse: Rgb,
    specular: Rgb,
    shadow: Rgb,
    ambient: Rgb,
    emission: Rgb,
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
            &mut self.emission,
            &mut self.reflection,
            &mut self.refraction,
        ] {
            *term *= factor;
        }
    }

    fn terms(&self) -> [Rgb; 7] {
        [self.diffuse, self.specular, self.shadow, self.ambient, self.emission, self.reflection, self.refraction]
    }
}

/// The probe that collects the layers of one pixel.
pub(super) struct AovProbe<'w> {
    world: &'w World,
    camera: &'w Camera,
    /// The camera at the time of the sample, if it moves.
    still: Option<Camera>,
    /// The hit of the first sample.
    first_hit: FirstHit,
    samples: u32,
    sums: [[f64; 3]; 7],
    alpha: f64,
    sample_weight: f64,
    sample: Light,
    /// The share of the background that the sample hides.
    sample_alpha: f32,
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
            still: None,
            first_hit: FirstHit::MISS,
            samples: 0,
            sums: [[0.0; 3]; 7],
            alpha: 0.0,
            sample_weight: 0.0,
            sample: Light::default(),
            sample_alpha: 0.0,
            stack: Vec::new(),
            tree_depth: 0,
            rays: 0,
        }
    }

    /// Ends the pixel, for which this many rays were traced, and adds it to the layers of a tile.
    pub(super) fn finish(mut self, rays: u64, aovs: &[Aov], pixel: usize, buffer: &mut TileBuffer) {
        self.close_sample();
        self.rays = rays;
        for (layer, aov) in aovs.iter().enumerate() {
            let mut values = [0.0; 3];
            let values = &mut values[..aov.channels().len()];
            self.write(*aov, values);
            buffer.add_to_layer(layer, pixel, values);
        }
    }

    fn close_sample(&mut self) {
        for (sum, term) in self.sums.iter_mut().zip(self.sample.terms()) {
            for (s, t) in sum.iter_mut().zip(term.saturated().to_array()) {
                *s += self.sample_weight * f64::from(t);
            }
        }
        self.alpha += self.sample_weight * f64::from(self.sample_alpha);
        (self.sample, self.sample_alpha) = (Light::default(), 0.0);
        self.sample_weight = 0.0;
    }

    /// The values of the pixel's samples. Light is a weighted sum over them.
    fn write(&self, aov: Aov, out: &mut [f64]) {
        match aov {
            Aov::Depth | Aov::Normal | Aov::Position | Aov::Uv | Aov::ObjectId | Aov::MaterialId | Aov::ElementId => {
                self.first_hit.write(aov, out);
            }
            Aov::Diffuse => out.copy_from_slice(&self.sums[0]),
            Aov::Specular => out.copy_from_slice(&self.sums[1]),
            Aov::Shadow => out.copy_from_slice(&self.sums[2]),
            Aov::Ambient => out.copy_from_slice(&self.sums[3]),
            Aov::Emission => out.copy_from_slice(&self.sums[4]),
            Aov::Reflection => out.copy_from_slice(&self.sums[5]),
            Aov::Refraction => out.copy_from_slice(&self.sums[6]),
            Aov::TreeDepth => out[0] = self.tree_depth.into(),
            Aov::Cost => out[0] = self.rays as f64,
            Aov::Alpha => out[0] = self.alpha,
            // Written from the samples of the film.
            Aov::HalfA | Aov::HalfB | Aov::Samples => {}
            // Made after the picture.
            Aov::Noisy | Aov::DenoisingAlbedo | Aov::DenoisingNormal | Aov::DenoisingDepth => {}
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

    fn alpha(&mut self, share: f32) {
        self.sample_alpha = share;
    }

    fn drawn(&mut self, time: Option<f64>, _lens: Option<[f64; 2]>) {
        if let Some(time) = time
            && self.camera.moves()
        {
            self.still = Some(self.camera.at(time));
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
            let camera = self.still.as_ref().unwrap_or(self.camera);
            self.first_hit = FirstHit::new(self.world, camera, hit, surface, outside);
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

    fn emitters(&mut self, term: &EmittersTerm) {
        if self.stack.len() == 1 {
            self.sample.diffuse += term.contribution;
        }
    }

    fn emission(&mut self, radiance: Rgb) {
        if self.stack.len() == 1 {
            self.sample.emission += radiance;
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
                RayKind::Eye | RayKind::Scattered => {}
            }
        }
    }
}
