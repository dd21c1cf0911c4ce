//! Measurements of light by paths that begin at points of space, as a light meter takes them.

use super::vertex::{MeterVertex, Vertex};
use super::{PathTracer, PreparedPath};
use crate::integrator::{Measurement, PreparedRayIntegrator, RayIntegrator};
use crate::math::Rgb;
use crate::sampler::{FrameSampler, Sample};
use crate::scene::{PathSettings, SamplerKind};
use crate::world::World;
use glam::DVec3;

/// The number of independent sets of paths, whose spread tells the error.
const SETS: u32 = 16;

/// A light meter that traces paths.
pub struct PathMeter<'w> {
    world: &'w World,
    prepared: PreparedPath,
}

impl<'w> PathMeter<'w> {
    /// A meter in a world.
    pub fn new(world: &'w World, settings: PathSettings) -> PathMeter<'w> {
        PathMeter { world, prepared: PreparedPath::new(world, settings) }
    }

    /// Measures the irradiance at a point of the world, facing along a unit normal, by about `paths` paths. Each
    /// measurement of a seed should have a number of its own.
    pub fn measure(&self, place: (DVec3, DVec3), paths: u32, (seed, number): (u64, u32)) -> Measurement {
        let mut tracer = self.prepared.worker(self.world, &|_| false);
        let each = paths.div_ceil(SETS).max(1);
        let sampler = FrameSampler::new(seed, 0, SamplerKind::Sobol);
        Measurement::of_sets((0..SETS).map(|set| {
            let numbers = sampler.pixel([number, set]);
            let light = |index: u32| tracer.on_white_surface(place, numbers.sample(index, each));
            (0..each).map(light).map(|light| DVec3::from(light.to_array().map(f64::from))).sum::<DVec3>()
                / f64::from(each)
        }))
    }
}

impl PathTracer<'_> {
    /// The radiance of a white matte surface at a point, by one path. It is the irradiance divided by π.
    fn on_white_surface(&mut self, (position, normal): (DVec3, DVec3), sample: Sample) -> Rgb {
        self.begin(sample, 0.0);
        self.media.clear();
        let mut path = self.start_at(position, sample);
        let vertex = MeterVertex { position, normal, inside: path.inside() };
        let step = self.scatter(&mut path, &Vertex::Meter(vertex), &mut ());
        self.follow(path, step, &mut ())
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{matte, node};
    use super::*;
    use crate::light::{Light, LightKind, Omni};
    use crate::material::{Dielectric, Material, Medium, Phong};
    use crate::scene::{Node, Scene};
    use crate::shape::{Disk, Shape, Sphere};
    use glam::Vec3;
    use std::f64::consts::PI;

    /// Below a disk of radius r at height h the irradiance is π L r² / (r² + h²). A point light of intensity l adds
    /// π l cos θ, as much as a white surface needs to have the radiance l cos θ (5.32).
    #[test]
    fn meters_read_what_closed_forms_say() {
        let lamp = Phong { emission: Rgb::gray(4.0), ..matte(0.0) };
        let disk = Shape::Disk(Disk { center: Vec3::Y * 2.0, normal: Vec3::NEG_Y, radius: 1.0 });
        let light = Light::new(LightKind::Omni(Omni::at(Vec3::new(3.0, 3.0, 0.0))), Rgb::gray(0.8));
        let absorption = Rgb::gray(0.25);
        let fog = Material::new("fog", Dielectric::new(1.0)).with_medium(Medium { absorption, ..Medium::VACUUM });
        let ball = Shape::Sphere(Sphere { center: Vec3::ZERO, radius: 0.5 });
        let measured = |nodes: Vec<Node>, background: Rgb| {
            let materials = vec![Material::new("lamp", lamp), fog.clone()];
            let world = World::build(Scene { background, materials, nodes, ..Scene::default() }).unwrap();
            PathMeter::new(&world, PathSettings::DEFAULT).measure((DVec3::ZERO, DVec3::Y), 4096, (0, 0))
        };
        let slant = 0.5f64.sqrt();
        for (name, nodes, background, expected) in [
            ("disk", vec![node(disk, 0)], 0.0, PI * 4.0 / 5.0),
            ("light", vec![Node::from(light.clone())], 0.0, PI * 0.8 * slant),
            ("sky", vec![], 0.5, PI * 0.5),
            ("sky through fog", vec![node(ball, 1)], 0.5, PI * 0.5 * (-0.125f64).exp()),
            ("both", vec![node(disk, 0), Node::from(light)], 0.0, PI * (4.0 / 5.0 + 0.8 * slant)),
        ] {
            let Measurement { irradiance, standard_error, .. } = measured(nodes, Rgb::gray(background));
            let (found, error) = (irradiance.y, standard_error.y);
            assert!(
                (found - expected).abs() <= 4.0 * error + 1e-5 * expected,
                "{name}: {found} ± {error}, not {expected}"
            );
            assert!(error < 5e-3 * expected, "{name}: {error}");
        }
    }
}
