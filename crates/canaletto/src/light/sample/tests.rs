use super::super::{DiskLight, Falloff, Light, MeshLight, Omni, RectangleLight, SphereLight, Spot};
use super::*;
use crate::light::Directional;
use crate::math::Transform;
use crate::shape::testing::Random;
use crate::shape::{Disk, Parallelogram, Shape, Sphere};
use glam::Vec3;
use std::f64::consts::TAU;

const DISK: Disk = Disk { center: Vec3::new(0.5, 3.0, 0.2), normal: Vec3::new(0.3, -1.0, 0.1), radius: 0.7 };
const BALL: Sphere = Sphere { center: Vec3::new(-1.0, 2.5, 0.5), radius: 0.6 };
const SHEET: Parallelogram =
    Parallelogram { corner: Vec3::new(-0.5, 2.0, -0.5), u: Vec3::X, v: Vec3::new(0.2, 0.3, 1.5) };
const INTENSITY: Rgb = Rgb::new(2.0, 1.0, 0.5);

fn surfaces() -> Vec<LightKind> {
    vec![
        LightKind::Disk(DiskLight { disk: DISK, points: 64 }),
        LightKind::Rectangle(Box::new(RectangleLight { parallelogram: SHEET, points: 64 })),
        LightKind::Sphere(SphereLight { sphere: BALL, points: 64 }),
        LightKind::Mesh(Box::new(MeshLight { meshes: vec![0], transform: Transform::IDENTITY, points: 64 })),
    ]
}

fn points() -> Vec<LightKind> {
    let spot = |falloff| Spot { position: Vec3::new(0.0, 3.0, 1.0), target: Vec3::ZERO, falloff, range: 0.0 }.into();
    vec![
        LightKind::Omni(Omni::at(Vec3::Y * 3.0)),
        spot(Falloff::Smooth { inner: 20.0, outer: 50.0 }),
        spot(Falloff::Exponent { exponent: 3.0, outer: 60.0 }),
    ]
}

/// A light; that of meshes is the surface of a tilted square.
fn prepared(kind: LightKind, emission: Emission, samples: u32) -> PreparedLight {
    let p = |x: f64, z: f64| DVec3::new(x, 2.5 + 0.2 * x, z);
    let triangles = [[p(0.0, 0.0), p(1.0, 0.0), p(1.0, 1.0)], [p(0.0, 0.0), p(1.0, 1.0), p(0.0, 1.0)]];
    PreparedLight::of_triangles(Light { emission, samples, ..Light::new(kind, INTENSITY) }, &triangles)
}

fn uniform(random: &mut Random) -> [f64; 2] {
    [random.unit().into(), random.unit().into()]
}

/// The mean of f |cos θ| li / pdf is the light that (5.39a) adds: the sum over the light's points.
#[test]
fn samples_estimate_what_the_points_give() {
    let mut random = Random(1);
    let infinite = [
        LightKind::Omni(Omni { position: [1.0, 2.0, 3.0, 0.0], range: 0.0 }),
        LightKind::Directional(Directional { towards: Vec3::new(0.3, -1.0, 0.2), beam: Some((Vec3::Y, 0.9)) }),
    ];
    for kind in surfaces().into_iter().chain(points()).chain(infinite) {
        for (emission, samples) in
            [(Emission::Even, 0), (Emission::Even, 4), (Emission::Matte, 0), (Emission::Matte, 4)]
        {
            let many = LightKind::clone(&kind);
            let light = prepared(many, emission, samples);
            if !light.light.has_area() && (emission == Emission::Matte || samples > 0) {
                continue;
            }
            let p = DVec3::new(0.2, 0.1, -0.3);
            let normal = DVec3::new(0.1, 1.0, 0.2).normalize();
            let white = |wi: DVec3| wi.dot(normal).max(0.0) / PI;
            let (n, mut mean, mut points) = (20_000, 0.0, 0.0);
            for _ in 0..n {
                let Some(sample) = light.sample(p, uniform(&mut random)) else { continue };
                assert_eq!(sample.is_delta, emission == Emission::Even || !light.light.has_area());
                mean += white(sample.wi) * f64::from(sample.li.r) / sample.pdf / f64::from(n);
            }
            let fixed = PreparedLight::of_triangles(Light { samples: 0, ..light.light.clone() }, &[]);
            let reference =
                if matches!(kind, LightKind::Mesh(_)) { prepared(kind.clone(), emission, 0) } else { fixed };
            for i in 0..reference.points() {
                let arriving = reference.illuminate(i, p);
                points += f64::from(arriving.intensity.r) * arriving.direction.dot(normal).max(0.0);
            }
            assert!((mean / points - 1.0).abs() < 0.03, "{kind:?} {emission:?} {samples}: {mean} instead of {points}");
        }
    }
}

/// The integral of the density over the directions in which the light is seen is 1, and that of the radiance is the
/// irradiance that samples estimate.
#[test]
fn radiance_and_density_agree_with_samples() {
    let mut random = Random(2);
    let (disk, ball) = (Shape::Disk(DISK), Shape::Sphere(BALL));
    for (kind, shape) in [
        (LightKind::Disk(DiskLight { disk: DISK, points: 1 }), disk),
        (LightKind::Sphere(SphereLight { sphere: BALL, points: 1 }), ball),
    ] {
        let light = prepared(kind, Emission::Matte, 4);
        let (p, normal) = (Vec3::new(0.2, 0.1, -0.3), DVec3::Y);
        let (mut density, mut irradiance) = (0.0, 0.0);
        let (rows, columns) = (900, 900);
        let part = TAU / f64::from(rows * columns);
        for (row, column) in (0..rows).flat_map(|r| (0..columns).map(move |c| (r, c))) {
            let y = (f64::from(row) + 0.5) / f64::from(rows);
            let (s, c) = (TAU * f64::from(column) / f64::from(columns)).sin_cos();
            let wi = DVec3::new(c * (1.0 - y * y).sqrt(), y, s * (1.0 - y * y).sqrt());
            let ray = canaletto_bvh::Ray::new(p, wi.as_vec3());
            if let Some(hit) = shape.intersect(&ray, f32::INFINITY) {
                let surface = shape.surface(&ray, &hit);
                density += part * light.pdf(p.as_dvec3(), surface.exact, surface.normal);
                irradiance += part * wi.dot(normal) * f64::from(light.le(surface.normal, -wi).r);
            }
        }
        assert!((density - 1.0).abs() < 0.02, "{shape:?}: {density}");
        let (n, mut mean) = (20_000, 0.0);
        for _ in 0..n {
            let Some(sample) = light.sample(p.as_dvec3(), uniform(&mut random)) else { continue };
            mean += sample.wi.dot(normal) * f64::from(sample.li.r) / sample.pdf / f64::from(n);
        }
        assert!((mean / irradiance - 1.0).abs() < 0.02, "{shape:?}: {mean} instead of {irradiance}");
        // No light leaves on the other side.
        assert_eq!(light.le(DVec3::Y, DVec3::NEG_Y), Rgb::BLACK);
        assert_eq!(light.pdf(DVec3::ZERO, DVec3::Y, DVec3::Y), 0.0);
    }
}

/// The power is the integral of what leaves: of the irradiance over a sphere around points, of radiance over a surface
/// and its hemispheres.
#[test]
fn power_is_the_integral_of_the_emission() {
    let close = |what: &str, ours: Rgb, integral: f64| {
        assert!((f64::from(ours.r) / integral - 1.0).abs() < 0.01, "{what}: {} instead of {integral}", ours.r);
        assert!((ours.g / ours.r - 0.5).abs() < 1e-6, "{what} lost its colour");
    };
    for kind in points() {
        let light = prepared(kind, Emission::Even, 0);
        let position = light.illuminate(0, DVec3::ZERO).position.unwrap().as_dvec3();
        let mut integral = 0.0;
        let n = 200_000;
        for i in 0..n {
            let z = 1.0 - 2.0 * (f64::from(i) + 0.5) / f64::from(n);
            // A spiral of golden angles.
            let (s, c) = (f64::from(i) * 2.399_963_229_728_653).sin_cos();
            let w = DVec3::new(c * (1.0 - z * z).sqrt(), s * (1.0 - z * z).sqrt(), z);
            integral += f64::from(light.sample(position + w, [0.5; 2]).unwrap().li.r) * 4.0 * PI / f64::from(n);
        }
        close("point", light.power(1.0), integral);
    }
    for kind in surfaces() {
        let light = prepared(kind, Emission::Matte, 4);
        let area = light.surface.as_ref().unwrap().area();
        let (n, mut exitance) = (1000, 0.0);
        for i in 0..n {
            let cos = (f64::from(i) + 0.5) / f64::from(n);
            let w = DVec3::new((1.0 - cos * cos).sqrt(), cos, 0.0);
            exitance += TAU / f64::from(n) * cos * f64::from(light.le(DVec3::Y, w).r);
        }
        close("surface", light.power(1.0), area * exitance);
    }
    let beam = Directional { towards: Vec3::NEG_Y, beam: Some((Vec3::X, 2.0)) };
    let sun = prepared(LightKind::Directional(beam), Emission::Even, 0);
    close("beam", sun.power(10.0), PI * 4.0 * PI * 2.0);
    close("beam wider than the scene", sun.power(1.0), PI * PI * 2.0);
}

#[test]
fn bounds_hold_every_point_and_normal() {
    let mut random = Random(3);
    for kind in surfaces().into_iter().chain(points()) {
        for (emission, samples) in [(Emission::Even, 0), (Emission::Even, 4), (Emission::Matte, 4)] {
            let light = prepared(kind.clone(), emission, if kind_has_area(&kind) { samples } else { 0 });
            let LightBounds { bounds: [min, max], axis, cos_theta_o, power, .. } = light.bounds().unwrap();
            assert_eq!(power, light.power(0.0));
            for _ in 0..500 {
                let Some(sample) = light.sample(DVec3::new(0.1, -1.0, 0.2), uniform(&mut random)) else { continue };
                let p = sample.position.unwrap();
                assert!((p - min).min_element() > -1e-6 && (max - p).min_element() > -1e-6, "{kind:?}: {p}");
                if let Some(surface) = light.matte() {
                    let normal = surface.sample(uniform(&mut random)).normal;
                    assert!(normal.dot(axis) >= cos_theta_o - 1e-9, "{kind:?}: {normal}");
                }
            }
        }
    }
    let sun = Directional { towards: Vec3::NEG_Y, beam: None };
    assert_eq!(prepared(LightKind::Directional(sun), Emission::Even, 0).bounds(), None);
}

fn kind_has_area(kind: &LightKind) -> bool {
    Light::new(kind.clone(), INTENSITY).has_area()
}
