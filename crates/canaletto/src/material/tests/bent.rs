//! Bent shading normals: no model loses light by them, none sends light through an opaque surface, and directions keep
//! their density.

use super::super::testing::{bsdf_of, check_sampling, direction};
use super::super::{Bsdf, Conductor, Dielectric, ScatteringFrame, StandardSurface};
use crate::math::Rgb;
use crate::shape::testing::Random;
use glam::DVec3;

/// The names and makers of models that absorb nothing, by roughness and frame.
type Make = (&'static str, fn(f32, ScatteringFrame) -> Bsdf);

fn white(roughness: f32) -> StandardSurface {
    let mut surface = StandardSurface::default();
    (surface.base.color, surface.specular.roughness) = (Rgb::WHITE, roughness);
    surface
}

const LOSSLESS: [Make; 7] = [
    ("metal", |roughness, frame| {
        let metal = Conductor::new(Rgb::gray(1e-6), Rgb::gray(1e6));
        bsdf_of(Conductor { roughness, ..metal }, frame)
    }),
    ("dielectric", |roughness, frame| {
        let glass = Dielectric::new(1.5);
        bsdf_of(Dielectric { roughness, ..glass }, ScatteringFrame { eta_ratio: 1.0 / 1.5, ..frame })
    }),
    ("dielectric from inside", |roughness, frame| {
        let glass = Dielectric::new(1.5);
        bsdf_of(Dielectric { roughness, ..glass }, ScatteringFrame { eta_ratio: 1.5, outside: false, ..frame })
    }),
    ("standard metal", |roughness, frame| {
        let mut surface = white(roughness);
        surface.base.metalness = 1.0;
        bsdf_of(surface, frame)
    }),
    ("standard glass", |roughness, frame| {
        let mut surface = white(roughness);
        surface.transmission.weight = 1.0;
        bsdf_of(surface, ScatteringFrame { eta_ratio: 1.0 / 1.5, ..frame })
    }),
    ("plastic", |roughness, frame| bsdf_of(white(roughness), frame)),
    ("coat", |roughness, frame| {
        let mut surface = white(0.3);
        (surface.coat.weight, surface.coat.roughness) = (1.0, roughness);
        bsdf_of(surface, frame)
    }),
];

/// Viewers at these angles to the geometric normal, on the side to which the shading normal leans and on the other one.
const VIEWERS: [f64; 5] = [0.0, 50.0, -50.0, 80.0, -80.0];

fn tilted(degrees: f64) -> ScatteringFrame {
    ScatteringFrame { normal: direction(degrees), ..ScatteringFrame::flat(DVec3::Z, 1.0) }
}

/// The light of an even sky that leaves, without the squeezing of radiance, and its standard error.
fn furnace(bsdf: &Bsdf, wo: DVec3, events: u32) -> (f64, f64) {
    let seen = bsdf.seen_from(wo);
    let eta_ratio = match bsdf {
        Bsdf::Dielectric(dielectric) => dielectric.eta_ratio(),
        Bsdf::Standard(standard) if standard.is_clear() => standard.eta_ratio(),
        _ => 1.0,
    };
    let (mut random, mut sum, mut squares) = (Random(4), 0.0, 0.0);
    for _ in 0..events {
        let [u_lobe, u, v] = [(); 3].map(|()| f64::from(random.unit()));
        let Some(s) = seen.sample(u_lobe, [u, v]) else { continue };
        let squeezed = if s.wi.z > 0.0 { 1.0 } else { eta_ratio * eta_ratio };
        let weight = f64::from(s.f.g) / (s.pdf * squeezed);
        (sum, squares) = (sum + weight, squares + weight * weight);
    }
    let (n, mean) = (f64::from(events), sum / f64::from(events));
    (mean, ((squares / n - mean * mean).max(0.0) / n).sqrt())
}

/// White surfaces stay white under tilts up to 60°, from all sides, and a rough one is as bright as a polished one.
#[test]
fn bent_normals_lose_no_light() {
    for (name, make) in LOSSLESS {
        for tilt in [0.0, 15.0, 40.0, 60.0] {
            for roughness in [0.0, 0.1, 0.5] {
                let bsdf = make(roughness, tilted(tilt));
                for degrees in VIEWERS {
                    let (mean, error) = furnace(&bsdf, direction(degrees), 2000);
                    assert!(
                        (mean - 1.0).abs() < 6e-3 + 3.5 * error,
                        "{name}, roughness {roughness}, tilt {tilt}°, seen at {degrees}°: {mean} ± {error}"
                    );
                }
            }
        }
    }
}

#[test]
fn directions_at_bent_normals_have_their_density() {
    for (i, (_, make)) in LOSSLESS.into_iter().enumerate() {
        for (tilt, degrees) in [(50.0, -60.0), (25.0, 75.0)] {
            check_sampling(&make([0.5, 0.7][i % 2], tilted(tilt)), direction(degrees), 0.0);
        }
    }
}

/// Neither evaluation nor density lets light through the geometric surface of an opaque body.
#[test]
fn no_light_comes_through_the_back() {
    let mut random = Random(2);
    for (_, make) in LOSSLESS.into_iter().filter(|(name, _)| !name.contains("glass") && !name.contains("dielectric")) {
        let bsdf = make(0.4, tilted(45.0));
        for degrees in VIEWERS {
            let seen = bsdf.seen_from(direction(degrees));
            for _ in 0..200 {
                let wi = -random.cube().as_dvec3().with_z(f64::from(random.unit())).normalize();
                assert!(seen.eval(wi).is_black() && seen.pdf(wi) == 0.0, "{bsdf:?}, {degrees}°, {wi}");
                let [u_lobe, u, v] = [(); 3].map(|()| f64::from(random.unit()));
                assert!(seen.sample(u_lobe, [u, v]).is_none_or(|s| s.wi.z > 0.0));
            }
        }
    }
}

/// Where the shading normal turns away from the viewer, nothing jumps.
#[test]
fn scattering_is_continuous_where_the_normal_turns_away() {
    for (name, make) in LOSSLESS {
        let (edge, wi) = (-40.0, DVec3::new(0.5, 0.3, 0.6).normalize());
        let [before, after] = [1e-3, -1e-3].map(|off| {
            let bsdf = make(0.6, tilted(50.0));
            f64::from(bsdf.eval(direction(edge + off), wi).g)
        });
        assert!((before - after).abs() <= 2e-3 * before.max(after), "{name}: {before} and {after}");
    }
}
