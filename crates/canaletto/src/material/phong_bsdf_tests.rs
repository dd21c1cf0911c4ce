use super::super::Bsdf;
use super::super::bsdf_tests::bsdf_of;
use super::*;
use crate::shape::testing::Random;
use std::f64::consts::PI;

fn color(random: &mut Random) -> Rgb {
    Rgb::from([(); 3].map(|()| random.unit()))
}

fn unit(random: &mut Random) -> f64 {
    random.unit().into()
}

/// A unit vector.
fn direction(random: &mut Random) -> DVec3 {
    let (z, angle) = (2.0 * unit(random) - 1.0, TAU * unit(random));
    let across = (1.0 - z * z).sqrt();
    DVec3::new(across * angle.cos(), across * angle.sin(), z)
}

fn bsdf(phong: Phong, frame: ScatteringFrame) -> Bsdf {
    bsdf_of(phong, frame)
}

fn flat(eta_ratio: f64) -> ScatteringFrame {
    ScatteringFrame::flat(DVec3::Z, eta_ratio)
}

/// A direction above the surface, at least a little.
fn above(random: &mut Random) -> DVec3 {
    let d = direction(random);
    DVec3::new(d.x, d.y, d.z.abs().max(0.15)).normalize()
}

/// Rough and not too sharp materials with all lobes or some, viewers, and frames whose shading normal leans.
fn cases(random: &mut Random) -> Vec<(Phong, ScatteringFrame, DVec3)> {
    let mut all = Vec::new();
    for i in 0..24 {
        let phong = Phong {
            kd: if i % 3 == 0 { Rgb::BLACK } else { color(random) },
            ks: if i % 4 == 1 { Rgb::BLACK } else { color(random) },
            n: if i % 5 == 0 { 0.0 } else { (20.0 * unit(random)) as f32 },
            k: if i % 2 == 0 { Rgb::BLACK } else { color(random) },
            eta: 1.5,
            opacity: if i % 6 < 3 { 1.0 } else { unit(random) as f32 },
            roughness: (0.45 + 0.55 * unit(random)) as f32,
            emission: Rgb::WHITE,
        };
        let normal = if i % 2 == 0 { DVec3::Z } else { (DVec3::Z + direction(random) * 0.3).normalize() };
        let eta_ratio = [1.0 / 1.5, 1.5, 1.0][i % 3];
        all.push((phong, ScatteringFrame { normal, ..flat(eta_ratio) }, above(random)));
    }
    all
}

/// The integral of a function over the sphere of directions, with cells of equal solid angle.
fn integral<const N: usize>(f: impl Fn(DVec3) -> [f64; N]) -> [f64; N] {
    let (rows, columns) = (1000, 500);
    let mut sum = [0.0; N];
    for j in 0..rows {
        for i in 0..columns {
            let (z, angle) =
                ((f64::from(j) + 0.5) / f64::from(rows) * 2.0 - 1.0, TAU * f64::from(i) / f64::from(columns));
            let across = (1.0 - z * z).sqrt();
            let values = f(DVec3::new(across * angle.cos(), across * angle.sin(), z));
            sum.iter_mut().zip(values).for_each(|(sum, v)| *sum += v * 4.0 * PI / f64::from(rows * columns));
        }
    }
    sum
}

fn rgb(c: Rgb) -> [f64; 3] {
    c.to_array().map(f64::from)
}

/// The probability of all delta lobes.
fn delta(bsdf: &Bsdf) -> f64 {
    let Bsdf::Phong(phong) = bsdf else { panic!("{bsdf:?}") };
    LOBES.iter().enumerate().filter(|(_, l)| phong.is_delta_lobe(**l)).map(|(i, _)| phong.probability(i)).sum()
}

#[test]
fn densities_integrate_to_one() {
    for (phong, frame, wo) in cases(&mut Random(1)) {
        let bsdf = bsdf(phong, frame);
        let [total] = integral(|wi| [bsdf.pdf(wo, wi)]);
        let expected = 1.0 - delta(&bsdf);
        assert!((total - expected).abs() < 0.01, "{phong:?} {frame:?} {wo}: {total} instead of {expected}");
    }
}

/// Compares the numbers of samples in cells of equal solid angle with the integral of the density there, by χ².
#[test]
fn samples_follow_their_density() {
    let (rows, columns, fine, n) = (12, 16, 24, 40_000);
    let mut random = Random(2);
    for (phong, frame, wo) in cases(&mut Random(3)) {
        let bsdf = bsdf(phong, frame);
        let mut counts = vec![0.0; rows * columns];
        let mut deltas = 0.0;
        for _ in 0..n {
            let sample = bsdf.sample(wo, unit(&mut random), [unit(&mut random), unit(&mut random)]).unwrap();
            assert!((sample.wi.length() - 1.0).abs() < 1e-9, "{sample:?}");
            if sample.is_delta {
                deltas += 1.0;
                continue;
            }
            assert!((sample.pdf / bsdf.pdf(wo, sample.wi) - 1.0).abs() < 1e-9 && sample.pdf > 0.0, "{sample:?}");
            let row = (((sample.wi.z + 1.0) * 0.5 * rows as f64) as usize).min(rows - 1);
            let angle = sample.wi.y.atan2(sample.wi.x).rem_euclid(TAU);
            counts[row * columns + ((angle / TAU * columns as f64) as usize).min(columns - 1)] += 1.0;
        }
        let mut chi2 = (0.0f64, 0.0f64);
        let mut add = |count: f64, expected: f64| {
            if expected > 5.0 {
                chi2 = (chi2.0 + (count - expected) * (count - expected) / expected, chi2.1 + 1.0);
            } else {
                assert!(count < expected + 25.0, "{count} samples instead of {expected}");
            }
        };
        add(deltas, delta(&bsdf) * f64::from(n));
        for (cell, count) in counts.iter().enumerate() {
            let mut sum = 0.0;
            for k in 0..fine * fine {
                let at = |cell: usize, k: usize| cell as f64 + (k as f64 + 0.5) / fine as f64;
                let z = at(cell / columns, k / fine) / rows as f64 * 2.0 - 1.0;
                let angle = at(cell % columns, k % fine) / columns as f64 * TAU;
                let across = (1.0 - z * z).sqrt();
                sum += bsdf.pdf(wo, DVec3::new(across * angle.cos(), across * angle.sin(), z));
            }
            add(*count, sum * 4.0 * PI / (rows * columns * fine * fine) as f64 * f64::from(n));
        }
        let (chi2, cells) = chi2;
        assert!(chi2 < cells + 6.0 * (2.0 * cells).sqrt(), "{phong:?} {frame:?} {wo}: χ² {chi2} of {cells} cells");
    }
}

/// The mean of f / pdf over samples is the integral of f |cos θ| plus the factors of delta lobes.
#[test]
fn samples_estimate_the_integral() {
    let (n, mut random) = (60_000, Random(4));
    for (phong, frame, wo) in cases(&mut Random(5)) {
        let bsdf = bsdf(phong, frame);
        // A light that isn't even, so that directions matter.
        let light = |wi: DVec3| 1.0 + wi.x + 0.5 * wi.z * wi.y;
        let expected = integral(|wi| rgb(bsdf.eval(wo, wi)).map(|f| f * light(wi)));
        let (mut sum, mut squares) = ([0.0; 3], [0.0; 3]);
        for _ in 0..n {
            let sample = bsdf.sample(wo, unit(&mut random), [unit(&mut random), unit(&mut random)]).unwrap();
            if sample.is_delta {
                continue;
            }
            for (c, f) in rgb(sample.f).into_iter().enumerate() {
                let v = f / sample.pdf * light(sample.wi);
                sum[c] += v / f64::from(n);
                squares[c] += v * v / f64::from(n);
            }
        }
        for c in 0..3 {
            let deviation = ((squares[c] - sum[c] * sum[c]).max(0.0) / f64::from(n)).sqrt();
            let off = (sum[c] - expected[c]).abs();
            assert!(off < 5.0 * deviation + 0.004, "{phong:?} {frame:?} {wo}: {sum:?} instead of {expected:?}");
        }
    }
}

/// π l f cos θ is the chapter's l ⊗ (kd n·L + ks cosⁿ α), (5.38).
#[test]
fn evaluation_gives_the_chapters_terms() {
    let mut random = Random(6);
    for _ in 0..1000 {
        let phong = Phong {
            kd: color(&mut random),
            ks: color(&mut random),
            n: (60.0 * unit(&mut random)) as f32,
            ..Phong::default()
        };
        let (wo, light, l) = (above(&mut random), above(&mut random), color(&mut random));
        let (n_dot_l, r) = (light.z, DVec3::new(-wo.x, -wo.y, wo.z));
        let highlight = r.dot(light).max(0.0).powf(phong.n.into());
        let chapter = l * (phong.kd * n_dot_l as f32 + phong.ks * highlight as f32);
        let ours = l * bsdf(phong, flat(1.0)).eval(wo, light) * PI as f32;
        let off = (chapter - ours).to_array().into_iter().fold(0.0f32, |most, v| most.max(v.abs()));
        assert!(off < 1e-6, "{phong:?}: {ours:?} instead of {chapter:?}");
        assert_eq!(bsdf(phong, flat(1.0)).eval(wo, -light), Rgb::BLACK, "light from behind");
    }
}

#[test]
fn polished_lobes_carry_k_and_one_less_the_opacity() {
    let mut random = Random(7);
    let k = Rgb::new(0.5, 0.25, 0.125);
    let phong = Phong { kd: Rgb::BLACK, k, eta: 1.5, opacity: 0.25, ..Phong::default() };
    for ratio in [1.0 / 1.5, 1.5] {
        let (mut mirrored, mut refracted, mut total) = (0, 0, 0);
        let n = 4000;
        for _ in 0..n {
            let wo = above(&mut random);
            let bsdf = bsdf(phong, flat(ratio));
            assert!(bsdf.is_delta() && bsdf.eval(wo, -wo).is_black() && bsdf.pdf(wo, wo) == 0.0);
            let sample = bsdf.sample(wo, unit(&mut random), [unit(&mut random), unit(&mut random)]).unwrap();
            assert!(sample.is_delta);
            match (sample.lobe, refract(wo, DVec3::Z, ratio)) {
                (Lobe::Mirror, _) => {
                    mirrored += 1;
                    assert_eq!((sample.wi, sample.f), (reflect(wo, DVec3::Z), k));
                    assert!((sample.pdf - 0.5 / 1.25).abs() < 1e-6);
                }
                (_, refraction) => {
                    let along = refraction.unwrap_or_else(|| reflect(wo, DVec3::Z));
                    (refracted, total) = (refracted + 1, total + u32::from(refraction.is_none()));
                    assert_eq!((sample.wi, sample.f), (along, Rgb::gray(0.75)));
                    assert!((sample.pdf - 0.75 / 1.25).abs() < 1e-6);
                }
            }
        }
        assert!((f64::from(mirrored) / f64::from(n) - 0.4).abs() < 0.03 && refracted > 0, "{mirrored} of {n}");
        assert_eq!(total > 0, ratio > 1.0);
    }
}

/// A rough mirror or boundary loses nothing: its lobe's integral is the factor, from any side.
#[test]
fn rough_lobes_lose_nothing() {
    let mut random = Random(8);
    for i in 0..12 {
        let mut phong = Phong { kd: Rgb::BLACK, roughness: 0.8, eta: 1.5, ..Phong::default() };
        if i % 2 == 0 {
            phong.k = Rgb::gray(0.5)
        } else {
            phong.opacity = 0.5
        }
        let bsdf = bsdf(phong, flat([1.0 / 1.5, 1.5][i / 2 % 2]));
        let wo = above(&mut random);
        let [r, ..] = integral(|wi| rgb(bsdf.eval(wo, wi)));
        assert!((r - 0.5).abs() < 0.005, "{phong:?} {wo}: {r}");
        assert!(!bsdf.is_delta());
    }
}

#[test]
fn a_black_surface_scatters_nothing() {
    let black = bsdf(Phong { kd: Rgb::BLACK, ..Phong::default() }, flat(1.0));
    assert_eq!(black.sample(DVec3::Z, 0.5, [0.5; 2]), None);
    assert_eq!((black.pdf(DVec3::Z, DVec3::Z), black.eval(DVec3::Z, DVec3::Z)), (0.0, Rgb::BLACK));
}
