//! Pseudorandom numbers from seeds: a hash, and Perlin's gradient noise ("Improving noise", 2002) over it.
//!
//! Only exact operations and `libm` are used, so the meshes are equal on every machine.

use glam::{DVec3, Vec3};

/// A hash of 64 bits (the finalizer of SplitMix64).
pub(super) fn hash(x: u64) -> u64 {
    let x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let x = (x ^ x >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ x >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ x >> 31
}

/// A number in [0, 1) for a seed and a counter.
pub(super) fn uniform(seed: u64, counter: u64) -> f32 {
    (hash(hash(seed) ^ counter) >> 40) as f32 / (1 << 24) as f32
}

/// The sine and cosine of an angle in radians.
pub(super) fn sin_cos(angle: f32) -> (f32, f32) {
    (libm::sinf(angle), libm::cosf(angle))
}

fn gradient(cell: [i64; 3], offset: Vec3) -> f32 {
    let h = hash((cell[0] as u64) ^ hash((cell[1] as u64) ^ hash(cell[2] as u64)));
    let sign = |bit: u32| if h >> bit & 1 == 0 { 1.0 } else { -1.0 };
    let (a, b) = match h % 3 {
        0 => (offset.x, offset.y),
        1 => (offset.y, offset.z),
        _ => (offset.z, offset.x),
    };
    sign(8) * a + sign(9) * b
}

/// Smooth noise, about −1 to 1; it is 0 on whole numbers.
pub(super) fn noise(p: Vec3) -> f32 {
    let floor = p.floor();
    let f = p - floor;
    let cell = floor.as_i64vec3().to_array();
    let s = f * f * f * (f * (f * 6.0 - Vec3::splat(15.0)) + Vec3::splat(10.0));
    let corner = |i: i64, j: i64, k: i64| {
        gradient([cell[0] + i, cell[1] + j, cell[2] + k], f - Vec3::new(i as f32, j as f32, k as f32))
    };
    let mix = |a: f32, b: f32, t: f32| a + (b - a) * t;
    let edge = |j, k| mix(corner(0, j, k), corner(1, j, k), s.x);
    let face = |k| mix(edge(0, k), edge(1, k), s.y);
    mix(face(0), face(1), s.z)
}

/// Noise of several octaves. Each has half the amplitude and twice the frequency of the previous one.
pub(super) fn fractal(p: Vec3, octaves: u32) -> f32 {
    (0..octaves).map(|i| noise(p * (1 << i) as f32 + Vec3::splat(17.3 * i as f32)) / (1 << i) as f32).sum()
}

/// A direction around `normal` with cosine density, from two numbers in [0, 1).
pub(super) fn around(normal: Vec3, u: f32, v: f32) -> Vec3 {
    let n = normal.as_dvec3();
    let tangent = n.any_orthonormal_vector();
    let bitangent = n.cross(tangent);
    let r = libm::sqrt(f64::from(u));
    let phi = std::f64::consts::TAU * f64::from(v);
    let height = libm::sqrt(1.0 - f64::from(u));
    let direction: DVec3 = tangent * (r * libm::cos(phi)) + bitangent * (r * libm::sin(phi)) + n * height;
    direction.as_vec3()
}
