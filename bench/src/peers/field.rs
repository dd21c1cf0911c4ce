//! A mesh of grass on hills, with far more triangles than pixels, in no spatial order.

use glam::Vec3;
use rayon::prelude::*;

use super::mesh::Mesh;
use super::noise::{fractal, sin_cos, uniform};

const SIZE: f32 = 60.0;
const PLANTS: u32 = 37_000;
const BLADES: u32 = 20;
const JOINTS: u32 = 5;

fn height(x: f32, y: f32) -> f32 {
    2.5 * fractal(Vec3::new(x * 0.06, y * 0.06, 3.5), 4)
}

/// The field, of 7.9 million triangles: 37,000 plants of 20 blades of 10 triangles, and half a million for the ground.
pub(super) fn field() -> Mesh {
    let mut mesh = Mesh::new("field");
    mesh.grid(500, 500, |i, j| {
        let [x, y] = [i, j].map(|i| SIZE * (i as f32 / 500.0 - 0.5));
        Vec3::new(x, y, height(x, y))
    });
    let per_blade = 2 * (JOINTS + 1);
    let first = mesh.positions.len() as u32;
    let blades: Vec<_> = (0..PLANTS * BLADES).into_par_iter().map(blade).collect();
    mesh.positions.extend(blades.iter().flatten());
    mesh.triangles.extend((0..PLANTS * BLADES).flat_map(|blade| {
        (0..JOINTS).flat_map(move |joint| {
            let a = first + blade * per_blade + 2 * joint;
            [[a, a + 1, a + 3], [a, a + 3, a + 2]]
        })
    }));
    mesh.eye = Vec3::new(-0.36 * SIZE, -0.38 * SIZE, height(-0.36 * SIZE, -0.38 * SIZE) + 2.6);
    mesh.target = Vec3::new(0.0, 0.0, 0.0);
    mesh.fovy = 45.0;
    mesh.light = Vec3::new(-20.0, 25.0, 40.0);
    mesh
}

/// A bent ribbon that narrows.
fn blade(index: u32) -> [Vec3; 2 * (JOINTS as usize + 1)] {
    let plant = |i| uniform(11, u64::from(index / BLADES) * 4 + i);
    let random = |i| uniform(12, u64::from(index) * 8 + i);
    let [x, y] = [plant(0), plant(1)].map(|u| SIZE * (u - 0.5));
    let (s, c) = sin_cos(std::f32::consts::TAU * random(0));
    let away = Vec3::new(c, s, 0.0);
    let side = Vec3::new(-s, c, 0.0) * (0.012 + 0.01 * random(1));
    let spread = 0.12 * random(2);
    let (length, bend) = ((0.4 + 0.7 * plant(2)) * (0.6 + 0.4 * random(3)), 0.2 + 0.9 * random(4));
    let foot = Vec3::new(x, y, height(x, y) - 0.02) + away * spread;
    let mut points = [Vec3::ZERO; 2 * (JOINTS as usize + 1)];
    for joint in 0..=JOINTS {
        let t = joint as f32 / JOINTS as f32;
        let (s, c) = sin_cos(bend * t);
        let at = foot + length * t * (away * s * t + Vec3::Z * c);
        let half = side * (1.0 - 0.9 * t);
        let i = 2 * joint as usize;
        (points[i], points[i + 1]) = (at - half, at + half);
    }
    points
}
