//! What can be seen while patches shoot their light.

use super::super::*;
use crate::light::{Light as SceneLight, LightKind, Omni};
use crate::material::{Material, Phong};
use crate::math::Rgb;
use crate::scene::{Node, Scene};
use crate::shape::{Cuboid, Shape};
use glam::{DVec3, Vec3};

/// Looks at the solution after each step.
#[derive(Default)]
struct Watched {
    steps: usize,
    unsent: Vec<f64>,
    last: Option<RadiositySolution>,
}

impl ShootingWatcher for Watched {
    fn watches(&self) -> bool {
        true
    }

    fn step(&mut self, step: &ShootingStep) {
        self.steps += 1;
        assert_eq!(step.step, self.steps);
        self.unsent.push(step.unsent);
        let solution = step.solution();
        assert_eq!(solution.patches().len(), step.radiance.len());
        // Cohen et al. (1988): each patch shows B + ρ times the ambient light, which stands for the light to come.
        for (patch, radiance) in solution.patches().iter().zip(step.radiance) {
            assert!((patch.radiance() - *radiance).abs().max_element() <= 1e-12 * radiance.max_element());
            let light = patch.arriving();
            assert!(light.indirect.min_element() >= step.ambient.min_element() * (1.0 - 1e-9), "{light:?}");
        }
        self.last = Some(solution);
    }
}

#[test]
fn each_step_has_a_solution_with_the_ambient_light_of_what_is_unsent() {
    let phong = |kd: f32, emission: f32| Phong { kd: Rgb::gray(kd), emission: Rgb::gray(emission), ..Phong::default() };
    let block = |min: f32, max: f32, material: u32| {
        Node::from(Shape::Box(Cuboid { min: Vec3::splat(min), max: Vec3::splat(max) })).with_material(material)
    };
    let lamp = SceneLight::new(LightKind::Omni(Omni::at(Vec3::splat(0.4))), Rgb::gray(0.2));
    let scene = Scene {
        materials: vec![Material::new("wall", phong(0.6, 0.0)), Material::new("lamp", phong(0.1, 3.0))],
        nodes: vec![block(-1.0, 1.0, 0), block(-0.2, 0.1, 1), Node::from(lamp)],
        ..Scene::default()
    };
    let world = World::build(scene).unwrap();
    let settings = RadiositySettings { method: RadiosityMethod::Shooting, error: 0.3, ..RadiositySettings::DEFAULT };
    let mut watched = Watched::default();
    let solution = RadiositySolution::solve_watched(&world, &settings, &(), &mut watched).unwrap();
    let plain = RadiositySolution::solve(&world, &settings, &()).unwrap();
    assert_eq!(format!("{solution:?}"), format!("{plain:?}"), "nothing depends on who looks");
    assert!(watched.steps > 20, "{}", watched.steps);
    assert!(watched.unsent[watched.steps - 1] < 0.1 * watched.unsent[0], "{:?}", watched.unsent);
    // What is still unsent at the end is a few percent of the wanted error.
    let of = |solution: &RadiositySolution| {
        solution.patches().iter().map(|patch| patch.radiance() * patch.area).sum::<DVec3>().x
    };
    let (last, end) = (of(&watched.last.unwrap()), of(&solution));
    assert!(last >= end && last < end * 1.05, "{last} {end}");
}
