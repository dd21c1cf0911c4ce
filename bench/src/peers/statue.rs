//! Smooth meshes like scans, with even triangles that are much finer than their features.

use glam::Vec3;

use super::mesh::Mesh;
use super::noise::{fractal, noise, sin_cos};

/// A lump with folds on a floor, of 12 × 76² + 2 triangles.
pub(super) fn statue() -> Mesh {
    const N: u32 = 76;
    let mut mesh = Mesh::new("statue");
    for axis in 0..3 {
        for side in [-1.0, 1.0] {
            mesh.grid(N, N, |i, j| {
                let mut p = Vec3::splat(side);
                p[(axis + 1) % 3] = 2.0 * i as f32 / N as f32 - 1.0;
                p[(axis + 2) % 3] = 2.0 * j as f32 / N as f32 - 1.0;
                let d = p.normalize();
                let folds = 0.5 - noise(d * 2.1 + Vec3::splat(5.0)).abs();
                d * Vec3::new(1.0, 1.0, 1.3) * (1.0 + 0.9 * folds + 0.04 * fractal(d * 14.0, 3))
            });
        }
    }
    floor(&mut mesh, -1.5);
    mesh.eye = Vec3::new(3.2, -3.6, 1.6);
    mesh.target = Vec3::new(0.0, 0.0, 0.1);
    mesh.light = Vec3::new(4.0, 2.0, 8.0);
    mesh
}

/// A tube with scales along a knot (2, 3) on a floor, of 400,000 × `fineness`² + 2 triangles.
pub(super) fn serpent(fineness: u32) -> Mesh {
    let (length, around) = (1000 * fineness, 200 * fineness);
    let mut mesh = Mesh::new(if fineness == 1 { "serpent" } else { "serpent4" });
    let knot = |angle: f32| {
        let (s3, c3) = sin_cos(3.0 * angle);
        let (s2, c2) = sin_cos(2.0 * angle);
        Vec3::new((2.0 + c3) * c2, (2.0 + c3) * s2, s3)
    };
    mesh.grid(length, around, |i, j| {
        let angle = std::f32::consts::TAU * (i % length) as f32 / length as f32;
        let turn = std::f32::consts::TAU * (j % around) as f32 / around as f32;
        let center = knot(angle);
        let tangent = (knot(angle + 1e-3) - knot(angle - 1e-3)).normalize();
        let (s2, c2) = sin_cos(2.0 * angle);
        let outward = center - 2.0 * Vec3::new(c2, s2, 0.0);
        let x = (outward - tangent * outward.dot(tangent)).normalize();
        let (s, c) = sin_cos(turn);
        let out = x * c + tangent.cross(x) * s;
        let scales = sin_cos(angle * 120.0).0 * sin_cos(turn * 14.0 + angle * 60.0).0;
        let wrinkles = fractal(center * 3.0 + out, 5);
        center + out * (0.5 + 0.12 * wrinkles + 0.03 * scales)
    });
    floor(&mut mesh, -1.8);
    mesh.eye = Vec3::new(4.5, -5.0, 5.0);
    mesh.target = Vec3::new(0.0, 0.0, -0.4);
    mesh.light = Vec3::new(-4.0, 3.0, 9.0);
    mesh
}

fn floor(mesh: &mut Mesh, z: f32) {
    mesh.quad([(-12.0, -12.0), (12.0, -12.0), (12.0, 12.0), (-12.0, 12.0)].map(|(x, y)| Vec3::new(x, y, z)));
}
