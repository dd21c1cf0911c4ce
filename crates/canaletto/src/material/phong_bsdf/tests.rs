use super::super::Bsdf;
use super::super::testing::{check_sampling, sphere_integral};
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

/// Phong's model without a bound of its light.
fn bsdf(phong: Phong, frame: ScatteringFrame) -> Bsdf {
    Bsdf::Phong(PhongBsdf::new(phong, frame))
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

/// The probability of all delta lobes.
fn delta(bsdf: &Bsdf) -> f64 {
    let Bsdf::Phong(phong) = bsdf else { panic!("{bsdf:?}") };
    LOBES.iter().enumerate().filter(|(_, l)| phong.is_delta_lobe(**l)).map(|(i, _)| phong.probability(i)).sum()
}

#[test]
fn directions_have_their_density() {
    for (phong, frame, wo) in cases(&mut Random(1)) {
        let bsdf = bsdf(phong, frame);
        check_sampling(&bsdf, wo, delta(&bsdf));
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
        let ours = l * bsdf(phong, flat(1.0)).seen_from(wo).eval_point_light(light) * PI as f32;
        let off = (chapter - ours).to_array().into_iter().fold(0.0f32, |most, v| most.max(v.abs()));
        assert!(off < 1e-6, "{phong:?}: {ours:?} instead of {chapter:?}");
        let behind = bsdf(phong, flat(1.0)).seen_from(wo);
        assert_eq!([behind.eval_point_light(-light), behind.eval(-light)], [Rgb::BLACK; 2], "light from behind");
    }
}

/// The highlight returns ks of the light from all sides, at any angle and with any exponent. Where kd leaves less, it
/// returns as much as is left.
#[test]
fn highlights_return_ks() {
    let mut random = Random(9);
    for n in [0.0, 1.0, 7.5, 60.0] {
        for (kd, ks, expected) in [(0.0, 0.6, 0.6), (0.3, 0.5, 0.8), (0.8, 0.5, 1.0), (1.0, 0.5, 1.0)] {
            let phong = Phong { kd: Rgb::gray(kd), ks: Rgb::gray(ks), n, ..Phong::default() };
            let lean = (DVec3::Z + direction(&mut random) * 0.2).normalize();
            // Diffuse light below the geometric surface is lost, but none of the highlight.
            let normal = if kd == 0.0 { lean } else { DVec3::Z };
            let wo = above(&mut random);
            let bsdf = bsdf(phong, ScatteringFrame { normal, ..flat(1.0) });
            let albedo = sphere_integral(&|wi| bsdf.eval(wo, wi).r.into());
            assert!((albedo - expected).abs() < 2e-3, "kd {kd}, ks {ks}, n {n}: {albedo}, not {expected}");
        }
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
        let r = sphere_integral(&|wi| bsdf.eval(wo, wi).r.into());
        assert!((r - 0.5).abs() < 2e-3, "{phong:?} {wo}: {r}");
        assert!(!bsdf.is_delta());
    }
}

#[test]
fn a_black_surface_scatters_nothing() {
    let black = bsdf(Phong { kd: Rgb::BLACK, ..Phong::default() }, flat(1.0));
    assert_eq!(black.sample(DVec3::Z, 0.5, [0.5; 2]), None);
    assert_eq!((black.pdf(DVec3::Z, DVec3::Z), black.eval(DVec3::Z, DVec3::Z)), (0.0, Rgb::BLACK));
}
