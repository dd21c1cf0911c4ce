//! A mesh of architecture. It is a hall of two storeys with fluted columns, arches, balusters, a tiled floor, a vault,
//! beams and rods. Many triangles are long, thin and not parallel to the axes.

use glam::Vec3;

use super::mesh::Mesh;
use super::noise::{sin_cos, uniform};

const LENGTH: f32 = 36.0;
const WIDTH: f32 = 8.0;
const STOREY: f32 = 6.0;

/// The hall, of about 305,000 triangles.
pub(super) fn atrium() -> Mesh {
    let mut mesh = Mesh::new("atrium");
    tiles(&mut mesh);
    for storey in 0..2 {
        let z = storey as f32 * STOREY;
        for side in [-1.0, 1.0] {
            for i in 0..12 {
                let x = (i as f32 + 0.5) * LENGTH / 12.0;
                column(&mut mesh, Vec3::new(x, side * WIDTH / 2.0, z));
                if i < 11 {
                    arch(&mut mesh, x, x + LENGTH / 12.0, side * WIDTH / 2.0, z + 0.72 * STOREY);
                }
            }
            for i in 0..80 {
                baluster(&mut mesh, Vec3::new((i as f32 + 0.5) * LENGTH / 80.0, side * (WIDTH / 2.0 - 0.35), z));
            }
            rail(&mut mesh, side * (WIDTH / 2.0 - 0.35), z + 0.9);
            // The gallery behind the rail, and its wall.
            let (near, far) = (side * WIDTH / 2.0, side * (WIDTH / 2.0 + 3.0));
            let corners = [(0.0, near), (LENGTH, near), (LENGTH, far), (0.0, far)];
            mesh.quad(corners.map(|(x, y)| Vec3::new(x, y, z + STOREY)));
            let corners = [(0.0, z), (LENGTH, z), (LENGTH, z + STOREY), (0.0, z + STOREY)];
            mesh.quad(corners.map(|(x, z)| Vec3::new(x, far, z)));
        }
    }
    vault(&mut mesh);
    let (low, high) = (-WIDTH / 2.0 - 3.0, WIDTH / 2.0 + 3.0);
    for x in [0.0, LENGTH] {
        let corners = [(low, 0.0), (high, 0.0), (high, 3.0 * STOREY), (low, 3.0 * STOREY)];
        mesh.quad(corners.map(|(y, z)| Vec3::new(x, y, z)));
    }
    rods(&mut mesh);
    mesh.eye = Vec3::new(2.0, -1.6, 2.2);
    mesh.target = Vec3::new(22.0, 1.5, 5.0);
    mesh.fovy = 62.0;
    mesh.light = Vec3::new(17.0, 0.4, 10.5);
    mesh
}

/// A box from `min` to `max`.
fn block(mesh: &mut Mesh, min: Vec3, max: Vec3) {
    for axis in 0..3 {
        for end in [min, max] {
            let (y, z) = ((axis + 1) % 3, (axis + 2) % 3);
            mesh.quad([(min, min), (max, min), (max, max), (min, max)].map(|(a, b)| {
                let mut p = end;
                (p[y], p[z]) = (a[y], b[z]);
                p
            }));
        }
    }
}

fn tiles(mesh: &mut Mesh) {
    for i in 0..54 {
        for j in 0..21 {
            let min = Vec3::new(i as f32 * LENGTH / 54.0, (j as f32 / 21.0 - 0.5) * (WIDTH + 6.0), -0.1);
            let height = 0.1 + 0.01 * uniform(1, i * 100 + j);
            block(mesh, min, min + Vec3::new(0.65, 0.65, height));
        }
    }
    mesh.quad([(0.0, -8.0), (LENGTH, -8.0), (LENGTH, 8.0), (0.0, 8.0)].map(|(x, y)| Vec3::new(x, y, -0.06)));
}

/// Rotates a profile (radius, height) around the z axis through `foot`; `flutes` modulates the radius.
fn turned(mesh: &mut Mesh, foot: Vec3, sides: u32, profile: &[(f32, f32)], flutes: f32) {
    mesh.grid(sides, profile.len() as u32 - 1, |i, j| {
        let (s, c) = sin_cos(std::f32::consts::TAU * (i % sides) as f32 / sides as f32);
        let (radius, height) = profile[j as usize];
        let radius = radius * (1.0 - flutes * (i % 4 / 2) as f32);
        foot + Vec3::new(radius * c, radius * s, height)
    });
}

fn column(mesh: &mut Mesh, foot: Vec3) {
    let molding = |at: f32, height: f32| -> Vec<(f32, f32)> {
        (0..=8).map(|i| (0.34 + 0.06 * sin_cos(i as f32).0, at + height * i as f32 / 8.0)).collect()
    };
    turned(mesh, foot, 96, &molding(0.0, 0.4), 0.0);
    turned(mesh, foot, 96, &[(0.3, 0.4), (0.26, 0.62 * STOREY)], 0.1);
    turned(mesh, foot, 96, &molding(0.62 * STOREY, 0.3), 0.0);
    let plate = Vec3::new(0.42, 0.42, 0.0);
    let top = foot + Vec3::Z * (0.62 * STOREY + 0.3);
    block(mesh, top - plate, top + plate + Vec3::Z * 0.3);
}

fn arch(mesh: &mut Mesh, from: f32, to: f32, y: f32, z: f32) {
    const RIB: [(f32, f32); 9] = [
        (-0.30, 0.10),
        (-0.30, 0.00),
        (-0.20, -0.04),
        (-0.12, 0.00),
        (0.0, -0.06),
        (0.12, 0.00),
        (0.20, -0.04),
        (0.30, 0.00),
        (0.30, 0.10),
    ];
    let (center, radius) = ((from + to) / 2.0, (to - from) / 2.0);
    mesh.grid(40, 8, |i, j| {
        let (s, c) = sin_cos(std::f32::consts::PI * i as f32 / 40.0);
        let (across, out) = RIB[j as usize];
        let r = radius - 0.3 + out;
        Vec3::new(center - r * c, y + across, z + r * s * 0.9)
    });
}

fn baluster(mesh: &mut Mesh, foot: Vec3) {
    let profile: Vec<_> = (0..=10).map(|i| (0.05 + 0.025 * sin_cos(i as f32 * 0.9).0, 0.9 * i as f32 / 10.0)).collect();
    turned(mesh, foot, 12, &profile, 0.0);
}

fn rail(mesh: &mut Mesh, y: f32, z: f32) {
    block(mesh, Vec3::new(0.0, y - 0.08, z), Vec3::new(LENGTH, y + 0.08, z + 0.1));
}

/// The ceiling: a barrel with ribs. Its strips run along the whole hall, and light enters through slits between them.
fn vault(mesh: &mut Mesh) {
    let height = 2.0 * STOREY;
    let at = |angle: f32, x: f32, r: f32| {
        let (s, c) = sin_cos(angle);
        Vec3::new(x, -c * r, height + s * r * 0.8)
    };
    for strip in 0..160 {
        if strip % 20 == 10 {
            continue;
        }
        let angle = |i: u32| std::f32::consts::PI * i as f32 / 160.0;
        let [a, b] = [angle(strip), angle(strip + 1)];
        let radius = WIDTH / 2.0 + 3.0;
        mesh.quad([at(a, 0.0, radius), at(a, LENGTH, radius), at(b, LENGTH, radius), at(b, 0.0, radius)]);
    }
    for rib in 0..24 {
        let x = (rib as f32 + 0.5) * LENGTH / 24.0;
        mesh.grid(140, 4, |i, j| {
            let across = [-0.15, -0.15, 0.0, 0.15, 0.15][j as usize];
            let depth = [0.0, 0.3, 0.36, 0.3, 0.0][j as usize];
            at(std::f32::consts::PI * i as f32 / 140.0, x + across, WIDTH / 2.0 + 3.0 - depth)
        });
    }
}

/// Thin oblique rods through the hall.
fn rods(mesh: &mut Mesh) {
    for rod in 0..60_u64 {
        let random = |i| uniform(2, rod * 8 + i);
        let from = Vec3::new(LENGTH * random(0), -WIDTH / 2.0, STOREY * (1.0 + random(1)));
        let to = Vec3::new(from.x + 6.0 * (random(2) - 0.5), WIDTH / 2.0, STOREY * (1.0 + random(3)));
        let axis = (to - from).normalize();
        let (x, y) = axis.any_orthonormal_pair();
        mesh.grid(8, 1, |i, j| {
            let (s, c) = sin_cos(std::f32::consts::TAU * (i % 8) as f32 / 8.0);
            (if j == 0 { from } else { to }) + 0.015 * (x * c + y * s)
        });
    }
}
