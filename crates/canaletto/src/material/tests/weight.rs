//! The weights of scattering events, f cos θ / pdf, of all models over grids of numbers and viewing angles.

use super::super::testing::{bsdf_of, check_sampling, direction};
use super::super::{Bsdf, Dielectric, PRESETS, ScatteringFrame, StandardSurface};
use crate::math::Rgb;
use crate::shape::testing::Random;
use glam::DVec3;

/// A boundary as it is seen from its outer or its inner side, with its ηᵢ/ηₜ.
fn standard(surface: &StandardSurface, outside: bool) -> (Bsdf, f64) {
    let (ior, is_clear) = (f64::from(surface.ior()), surface.transmission.weight > 0.0 && !surface.thin_walled);
    let eta_ratio = match (is_clear, outside) {
        (false, _) => 1.0,
        (true, true) => 1.0 / ior,
        (true, false) => ior,
    };
    let tangent = DVec3::new(0.3, 1.0, 0.0);
    let frame = ScatteringFrame { tangent, outside, ..ScatteringFrame::flat(DVec3::Z, eta_ratio) };
    (bsdf_of(*surface, frame), eta_ratio)
}

fn dielectric(eta: f32, roughness: f32, outside: bool) -> (Bsdf, f64) {
    let eta_ratio = if outside { 1.0 / f64::from(eta) } else { eta.into() };
    let smooth = Dielectric::new(eta);
    let rough = Dielectric { roughness, ..smooth };
    (bsdf_of(rough, ScatteringFrame { outside, ..ScatteringFrame::flat(DVec3::Z, eta_ratio) }), eta_ratio)
}

/// The largest weight of an event, without the squeezing of radiance, and the largest variance of the weight by the
/// square of its mean.
fn weights((bsdf, eta_ratio): &(Bsdf, f64), events: u32) -> (f64, f64) {
    let (mut largest, mut variance) = (0.0f64, 0.0f64);
    for degrees in [0.0, 25.0, 45.0, 60.0, 75.0, 87.0] {
        let seen = bsdf.seen_from(direction(degrees));
        let (mut random, mut sum, mut squares) = (Random(5), 0.0, 0.0);
        for _ in 0..events {
            let [u_lobe, u, v] = [(); 3].map(|()| f64::from(random.unit()));
            let Some(s) = seen.sample(u_lobe, [u, v]) else { continue };
            let squeezed = if s.wi.z > 0.0 { 1.0 } else { eta_ratio * eta_ratio };
            let weight = f64::from(s.f.max_component()) / (s.pdf * squeezed);
            (sum, squares, largest) = (sum + weight, squares + weight * weight, largest.max(weight));
        }
        let mean = sum / f64::from(events);
        if mean > 1e-3 {
            variance = variance.max(squares / f64::from(events) / (mean * mean) - 1.0);
        }
    }
    (largest, variance)
}

fn assert_light(name: &str, bsdf: &(Bsdf, f64), events: u32) {
    let (largest, variance) = weights(bsdf, events);
    assert!(largest < 5.0 && variance < 4.0, "{name}: a weight of {largest}, a variance of {variance}");
}

/// A facet is chosen before what it does, so that no event is both rare and heavy.
#[test]
fn no_event_of_a_preset_weighs_much() {
    for preset in &PRESETS {
        let surface = preset.surface();
        assert_light(preset.name, &standard(&surface, true), 512);
        if surface.transmission.weight > 0.0 && !surface.thin_walled {
            assert_light(&format!("{} from inside", preset.name), &standard(&surface, false), 512);
        }
    }
}

#[test]
fn no_event_of_a_dielectric_weighs_much() {
    for eta in [1.1, 1.5, 2.4] {
        for roughness in [0.1, 0.2, 0.5, 1.0] {
            for outside in [true, false] {
                let glass = dielectric(eta, roughness, outside);
                assert_light(&format!("η {eta}, roughness {roughness}, outside {outside}"), &glass, 4096);
            }
        }
    }
}

/// Surfaces with every pair of layers, and clear ones of several weights, from both sides.
#[test]
fn no_event_of_mixed_layers_weighs_much() {
    let mut random = Random(1);
    for i in 0..400 {
        let mut choose = |values: &[f32]| values[(random.unit() * values.len() as f32) as usize];
        let mut surface = StandardSurface::default();
        surface.base.color = Rgb::gray(choose(&[0.0, 0.5, 1.0]));
        surface.base.metalness = choose(&[0.0, 0.0, 0.5, 1.0]);
        surface.specular.roughness = choose(&[0.0, 0.1, 0.3, 0.6, 1.0]);
        surface.specular.ior = choose(&[1.1, 1.5, 2.4]);
        surface.specular.anisotropy = choose(&[0.0, 0.0, 0.7]);
        surface.transmission.weight = choose(&[0.0, 0.02, 0.5, 1.0]);
        surface.subsurface.weight = choose(&[0.0, 0.5]);
        surface.coat.weight = choose(&[0.0, 0.5, 1.0]);
        surface.coat.roughness = choose(&[0.0, 0.3]);
        surface.fuzz.weight = choose(&[0.0, 0.0, 1.0]);
        surface.thin_film.weight = choose(&[0.0, 0.0, 1.0]);
        surface.thin_walled = choose(&[0.0, 0.0, 1.0]) == 1.0;
        for outside in [true, false] {
            let (largest, variance) = weights(&standard(&surface, outside), 128);
            // Dark facets of a rough metal mirror only at their rims.
            assert!(largest < 8.0 && variance < 6.0, "{i}: {largest}, {variance}, outside {outside}: {surface:?}");
        }
    }
}

/// Facets that mirror and refract have the density of their directions, from inside, too, where they reflect totally.
#[test]
fn clear_layers_have_their_density() {
    let glass = |weight: f32, roughness: f32| {
        let mut surface = StandardSurface::default();
        (surface.transmission.weight, surface.specular.roughness) = (weight, roughness);
        surface
    };
    let mut filmed = glass(0.7, 0.5);
    (filmed.thin_film.weight, filmed.coat.weight, filmed.coat.roughness) = (1.0, 0.5, 0.4);
    let mut straight = glass(0.5, 0.5);
    (straight.specular.ior, straight.thin_film.weight) = (1.0, 1.0);
    for (surface, degrees) in [(glass(1.0, 0.6), 50.0), (glass(0.3, 0.8), 20.0), (filmed, 60.0)] {
        for outside in [true, false] {
            check_sampling(&standard(&surface, outside).0, direction(degrees), 0.0);
        }
    }
    let (bsdf, _) = standard(&straight, true);
    let mut random = Random(3);
    let mut deltas = 0.0;
    for _ in 0..1 << 16 {
        let [u_lobe, u, v] = [(); 3].map(|()| f64::from(random.unit()));
        let sample = bsdf.sample(direction(30.0), u_lobe, [u, v]);
        deltas += f64::from(u8::from(sample.is_some_and(|s| s.is_delta && s.wi == -direction(30.0))));
    }
    assert!(deltas > 1000.0);
    check_sampling(&bsdf, direction(30.0), deltas / f64::from(1 << 16));
    for (eta, roughness) in [(2.4, 0.5), (1.1, 0.8)] {
        for outside in [true, false] {
            check_sampling(&dielectric(eta, roughness, outside).0, direction(65.0), 0.0);
        }
    }
}
