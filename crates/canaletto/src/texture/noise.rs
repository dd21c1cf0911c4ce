//! Perlin's noise, as improved (*Improving Noise*, SIGGRAPH 2002), and sums of it over octaves.
//!
//! Octaves finer than the footprint are faded to their mean, so that sums don't alias (Norton, Rockwood and Skolmoski,
//! *Clamping*, SIGGRAPH 1982). With seed 0 the lattice is Perlin's own, and values are the published ones.

use glam::DVec3;

/// The lattice's numbers 0 to 255 in Perlin's order.
const PERLIN: [u8; 256] = [
    151, 160, 137, 91, 90, 15, 131, 13, 201, 95, 96, 53, 194, 233, 7, 225, 140, 36, 103, 30, 69, 142, 8, 99, 37, 240,
    21, 10, 23, 190, 6, 148, 247, 120, 234, 75, 0, 26, 197, 62, 94, 252, 219, 203, 117, 35, 11, 32, 57, 177, 33, 88,
    237, 149, 56, 87, 174, 20, 125, 136, 171, 168, 68, 175, 74, 165, 71, 134, 139, 48, 27, 166, 77, 146, 158, 231, 83,
    111, 229, 122, 60, 211, 133, 230, 220, 105, 92, 41, 55, 46, 245, 40, 244, 102, 143, 54, 65, 25, 63, 161, 1, 216,
    80, 73, 209, 76, 132, 187, 208, 89, 18, 169, 200, 196, 135, 130, 116, 188, 159, 86, 164, 100, 109, 198, 173, 186,
    3, 64, 52, 217, 226, 250, 124, 123, 5, 202, 38, 147, 118, 126, 255, 82, 85, 212, 207, 206, 59, 227, 47, 16, 58, 17,
    182, 189, 28, 42, 223, 183, 170, 213, 119, 248, 152, 2, 44, 154, 163, 70, 221, 153, 101, 155, 167, 43, 172, 9, 129,
    22, 39, 253, 19, 98, 108, 110, 79, 113, 224, 232, 178, 185, 112, 104, 218, 246, 97, 228, 251, 34, 242, 193, 238,
    210, 144, 12, 191, 179, 162, 241, 81, 51, 145, 235, 249, 14, 239, 107, 49, 192, 214, 31, 181, 199, 106, 157, 184,
    84, 204, 176, 115, 121, 50, 45, 127, 4, 150, 254, 138, 236, 205, 93, 222, 114, 67, 29, 24, 72, 243, 141, 128, 195,
    78, 66, 215, 61, 156, 180,
];

/// The mean of the noise's absolute value.
const MEAN_ABSOLUTE: f64 = 0.221;
/// The mean of the noise's square.
const MEAN_SQUARE: f64 = 0.074;

/// A filtered number, and the variance that the filter removed. A ramp of the number still depends on the removed fine
/// features.
#[derive(Clone, Copy, Debug)]
pub(super) struct Filtered {
    pub(super) value: f64,
    pub(super) lost: f64,
}

/// A lattice of gradients.
#[derive(Debug)]
pub(super) struct Noise {
    table: [u8; 256],
}

/// The parameters of a sum of octaves.
#[derive(Clone, Copy, Debug)]
pub(super) struct Octaves {
    pub(super) count: u32,
    /// The ratio of frequencies of consecutive octaves.
    pub(super) lacunarity: f64,
    /// The ratio of their amplitudes.
    pub(super) gain: f64,
}

impl Noise {
    pub(super) fn new(seed: u32) -> Noise {
        let mut table = PERLIN;
        if seed != 0 {
            // Fisher and Yates' shuffle.
            let mut state = u64::from(seed);
            for i in (1..256usize).rev() {
                state = scatter(state);
                table.swap(i, (state >> 32) as usize % (i + 1));
            }
        }
        Noise { table }
    }

    /// The noise at a point, −1 to 1 (seldom beyond ±0.9). It is 0 at points of whole numbers, and has a period of 256
    /// along each axis.
    pub(super) fn at(&self, p: DVec3) -> f64 {
        let p = if p.is_finite() { p } else { DVec3::ZERO };
        let cell = p.floor();
        let f = p - cell;
        let [x, y, z] = cell.to_array().map(|v| v.rem_euclid(256.0) as u8);
        // 6 t⁵ − 15 t⁴ + 10 t³
        let [u, v, w] = f.to_array().map(|t| t * t * t * (t * (t * 6.0 - 15.0) + 10.0));
        let t = |i: u8| self.table[usize::from(i)];
        let corner = |dx: u8, dy: u8, dz: u8| {
            let hash = t(t(t(x.wrapping_add(dx)).wrapping_add(y).wrapping_add(dy)).wrapping_add(z).wrapping_add(dz));
            slope(hash, f.x - f64::from(dx), f.y - f64::from(dy), f.z - f64::from(dz))
        };
        let mix = |t: f64, a: f64, b: f64| a + t * (b - a);
        let edge = |dy, dz| mix(u, corner(0, dy, dz), corner(1, dy, dz));
        let face = |dz| mix(v, edge(0, dz), edge(1, dz));
        mix(w, face(0), face(1))
    }

    /// The sum of octaves, −1 to 1; `width` is the footprint's.
    pub(super) fn fbm(&self, p: DVec3, octaves: Octaves, width: f64) -> Filtered {
        self.sum(p, octaves, width, |n| n, 0.0)
    }

    /// The sum of the octaves' absolute values, 0 to 1.
    pub(super) fn turbulence(&self, p: DVec3, octaves: Octaves, width: f64) -> Filtered {
        self.sum(p, octaves, width, f64::abs, MEAN_ABSOLUTE)
    }

    fn sum(&self, p: DVec3, octaves: Octaves, width: f64, f: impl Fn(f64) -> f64, mean: f64) -> Filtered {
        let (mut sum, mut total, mut lost) = (0.0, 0.0, 0.0);
        let (mut frequency, mut amplitude) = (1.0, 1.0);
        for _ in 0..octaves.count {
            let share = seen(width * frequency);
            let value = if share > 0.0 { f(self.at(p * frequency)) } else { 0.0 };
            sum += amplitude * (mean + (value - mean) * share);
            lost += amplitude * amplitude * (1.0 - share * share) * (MEAN_SQUARE - mean * mean);
            total += amplitude;
            frequency *= octaves.lacunarity;
            amplitude *= octaves.gain;
        }
        Filtered { value: sum / total, lost: lost / (total * total) }
    }
}

/// The share of a noise with features of size 1 that remains in a mean over this width.
pub(super) fn seen(width: f64) -> f64 {
    // 1 up to a quarter of the lattice's spacing, 0 from one and a quarter on.
    let t = (1.25 - width).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// The scalar product with one of the twelve directions to a cube's edges, four of them twice. The hash's lowest bits
/// select it.
fn slope(hash: u8, x: f64, y: f64, z: f64) -> f64 {
    let h = hash & 15;
    let u = if h < 8 { x } else { y };
    let v = match h {
        0..4 => y,
        12 | 14 => x,
        _ => z,
    };
    (if h & 1 == 0 { u } else { -u }) + (if h & 2 == 0 { v } else { -v })
}

/// A hash over 64 bits (SplitMix64).
pub(super) fn scatter(value: u64) -> u64 {
    let mut x = value.wrapping_add(0x9e37_79b9_7f4a_7c15);
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(count: u64) -> impl Iterator<Item = DVec3> {
        (0..count).map(|i| {
            let r = |k: u64| (scatter(3 * i + k) >> 11) as f64 / (1u64 << 53) as f64 * 50.0 - 25.0;
            DVec3::new(r(0), r(1), r(2))
        })
    }

    #[test]
    #[allow(clippy::approx_constant)] // the place is the task's, and no π
    fn values_are_the_published_ones() {
        // The task "Perlin noise" of rosettacode.org, after Perlin's reference implementation.
        assert!((Noise::new(0).at(DVec3::new(3.14, 42.0, 7.0)) - 0.13691995878400012).abs() < 1e-15);
        assert_eq!(Noise::new(0).at(DVec3::new(-3.0, 42.0, 1e6)), 0.0);
        let mut all = PERLIN;
        all.sort_unstable();
        assert!(all.iter().enumerate().all(|(i, v)| i == usize::from(*v)));
    }

    #[test]
    fn it_is_continuous_balanced_and_bounded() {
        for seed in [0, 1, 7] {
            let noise = Noise::new(seed);
            let (mut sum, mut absolute, mut square, count) = (0.0, 0.0, 0.0, 60_000);
            for p in points(count) {
                let v = noise.at(p);
                assert!(v.abs() <= 1.0);
                assert!((noise.at(p + DVec3::splat(1e-4)) - v).abs() < 1e-3);
                sum += v;
                absolute += v.abs();
                square += v * v;
            }
            let [mean, absolute, square] = [sum, absolute, square].map(|v| v / count as f64);
            println!("{seed}: {mean:.4} {absolute:.4} {square:.4}");
            assert!((square - MEAN_SQUARE).abs() < 0.004);
            assert!(mean.abs() < 0.01 && (absolute - MEAN_ABSOLUTE).abs() < 0.01, "{seed}: {mean} {absolute}");
        }
        for x in [f64::NAN, f64::INFINITY, 1e300, -1e300] {
            assert!(Noise::new(0).at(DVec3::new(x, 0.3, 0.2)).is_finite());
        }
    }

    #[test]
    fn clamped_octaves_are_nearer_to_the_mean_over_the_footprint() {
        let noise = Noise::new(0);
        let octaves = Octaves { count: 8, lacunarity: 2.0, gain: 0.6 };
        for width in [0.05, 0.2, 0.6, 2.0] {
            let (mut clamped, mut plain) = (0.0, 0.0);
            for p in points(60) {
                let mut mean = [0.0; 2];
                for i in 0..1024u64 {
                    let r = |k: u64| (scatter(99 + 2 * i + k) >> 11) as f64 / (1u64 << 53) as f64 - 0.5;
                    let q = p + DVec3::new(r(0) * width, 0.0, r(1) * width);
                    mean[0] += noise.fbm(q, octaves, 0.0).value / 1024.0;
                    mean[1] += noise.turbulence(q, octaves, 0.0).value / 1024.0;
                }
                clamped += (noise.fbm(p, octaves, width).value - mean[0]).powi(2);
                clamped += (noise.turbulence(p, octaves, width).value - mean[1]).powi(2);
                plain += (noise.fbm(p, octaves, 0.0).value - mean[0]).powi(2);
                plain += (noise.turbulence(p, octaves, 0.0).value - mean[1]).powi(2);
            }
            println!("{width}: {clamped} {plain}");
            assert!(clamped < 0.5 * plain, "{width}: {clamped} for {plain}");
        }
    }
}
