use super::*;
use crate::shape::testing::Random;
use std::f64::consts::{FRAC_PI_2, PI};

const INVERSE_SQUARE: Falloff = Falloff([0.0, 0.0, 1.0]);

fn vector(random: &mut Random) -> DVec3 {
    random.cube().as_dvec3()
}

fn direction(random: &mut Random) -> DVec3 {
    loop {
        let v = vector(random);
        if (0.01..1.0).contains(&v.length_squared()) {
            return v.normalize();
        }
    }
}

/// Small lamps in a room, in a few groups of their own: facing any way, on one side or on both.
fn lamps(random: &mut Random, count: usize) -> Vec<ClusterBounds> {
    let groups: Vec<DVec3> = (0..count.div_ceil(20)).map(|_| vector(random) * 10.0).collect();
    (0..count)
        .map(|i| {
            let (at, half) = (groups[i % groups.len()] + vector(random), DVec3::splat(0.02 * f64::from(random.unit())));
            ClusterBounds {
                min: at - half,
                max: at + half,
                normals: match i % 5 {
                    0 => NormalCone::ALL,
                    _ => NormalCone { axis: direction(random), angle: 0.3 * f64::from(random.unit()) },
                },
                emission_angle: FRAC_PI_2,
                two_sided: i % 7 == 0,
                intensity: f64::from(random.within(0.1, 3.0)),
            }
        })
        .collect()
}

fn receiver(random: &mut Random) -> Receiver {
    Receiver { point: vector(random) * 12.0, normal: direction(random), two_sided: random.unit() < 0.3 }
}

/// The probabilities of all lights at a point sum to 1, the density of a sampled light is its probability, and lights
/// are chosen as often as it says (χ²).
#[test]
fn lights_are_chosen_by_their_probabilities() {
    let mut random = Random(31);
    for count in [1, 2, 7, 8, 9, 60, 700] {
        let lights = lamps(&mut random, count);
        for (falloff, by_cosine) in
            [(INVERSE_SQUARE, true), (Falloff([1.0, 0.0, 0.0]), false), (Falloff([1.0, 0.2, 0.1]), true)]
        {
            let tree = LightTree::new(&lights, falloff, by_cosine, 1.0);
            for _ in 0..4 {
                let receiver = receiver(&mut random);
                let probabilities: Vec<f64> =
                    (0..count as u32).map(|light| tree.probability(&receiver, light)).collect();
                let n = 40_000;
                let (mut counts, mut none) = (vec![0.0; count], 0.0);
                for i in 0..n {
                    let u = (f64::from(i) + f64::from(random.unit())) / f64::from(n);
                    let Some((light, probability)) = tree.sample(&receiver, u) else {
                        none += 1.0;
                        continue;
                    };
                    let expected = probabilities[light as usize];
                    assert!((probability / expected - 1.0).abs() < 1e-12, "{probability}, not {expected}");
                    counts[light as usize] += 1.0;
                }
                let total: f64 = probabilities.iter().sum::<f64>() + none / f64::from(n);
                assert!((total - 1.0).abs() < if none == 0.0 { 1e-9 } else { 1e-3 }, "{count} lights: {total}");
                let (mut chi2, mut cells) = (0.0f64, 0.0f64);
                for (count, probability) in counts.iter().zip(&probabilities) {
                    let expected = probability * f64::from(n);
                    assert!(expected > 0.0 || *count == 0.0);
                    if expected > 10.0 {
                        (chi2, cells) = (chi2 + (count - expected) * (count - expected) / expected, cells + 1.0);
                    }
                }
                // Numbers in strata differ less than independent ones.
                assert!(chi2 < 0.5 * cells + 5.0, "{count} lights: χ² {chi2} of {cells}");
            }
        }
    }
}

/// The irradiance by a lamp of the size 0.
fn irradiance(light: &ClusterBounds, to: &Receiver, by_cosine: bool) -> f64 {
    let d = light.center() - to.point;
    let cos_out = -light.normals.axis.dot(d.normalize());
    let cos_out = if light.two_sided { cos_out.abs() } else { cos_out.max(0.0) };
    let cos_in = to.normal.dot(d.normalize());
    let cos_in = if to.two_sided { cos_in.abs() } else { cos_in }.max(LEAST_COSINE);
    light.intensity * if by_cosine { cos_out } else { 1.0 } * cos_in / d.length_squared()
}

/// Among as many small lamps as a node has children, each is chosen in proportion to the light that arrives from it.
#[test]
fn few_lamps_are_chosen_by_the_light_that_arrives() {
    let mut random = Random(32);
    for _ in 0..50 {
        let lights: Vec<ClusterBounds> = (0..ARITY)
            .map(|i| {
                let at = vector(&mut random) * 5.0;
                let normals = NormalCone { axis: direction(&mut random), angle: 0.0 };
                let intensity = f64::from(random.within(0.1, 3.0));
                ClusterBounds { min: at, max: at, normals, emission_angle: FRAC_PI_2, two_sided: i % 2 == 0, intensity }
            })
            .collect();
        for by_cosine in [true, false] {
            let tree = LightTree::new(&lights, INVERSE_SQUARE, by_cosine, 1.0);
            let to = receiver(&mut random);
            let lit = |light: &ClusterBounds| {
                let faces = -light.normals.axis.dot(light.center() - to.point) > 0.0;
                if light.two_sided || faces { irradiance(light, &to, by_cosine) } else { 0.0 }
            };
            let exact: Vec<f64> = lights.iter().map(lit).collect();
            let total: f64 = exact.iter().sum();
            assert!((tree.importance(&to) / total - 1.0).abs() < 1e-3, "{} and {total}", tree.importance(&to));
            for (light, exact) in (0..).zip(&exact) {
                let probability = tree.probability(&to, light);
                assert!((probability - exact / total).abs() < 1e-4, "{probability} instead of {}", exact / total);
            }
        }
    }
}

/// A light that can shine on a point is never left out, wherever the point is: on all lamps, in them and between them.
#[test]
fn no_light_is_left_out() {
    let mut random = Random(33);
    let lights = lamps(&mut random, 300);
    let tree = LightTree::new(&lights, INVERSE_SQUARE, true, 1.0);
    for i in 0..300 {
        let near = &lights[i];
        let point = near.center() + vector(&mut random) * [0.0, 0.01, 0.3][i % 3];
        let to = Receiver { point, normal: direction(&mut random), two_sided: false };
        for (number, light) in (0..).zip(&lights) {
            let d = (to.point - light.center()).normalize_or_zero();
            let leaving = libm::acos(light.normals.axis.dot(d).clamp(-1.0, 1.0));
            let leaving = if light.two_sided { leaving.min(PI - leaving) } else { leaving };
            if leaving < light.normals.angle + FRAC_PI_2 - 1e-3 {
                assert!(tree.probability(&to, number) > 0.0, "{light:?} at {to:?}");
            }
        }
    }
}

/// The bounds of two clusters hold the corners of both boxes, and all normals of both cones.
#[test]
fn bounds_hold_both_clusters() {
    let mut random = Random(35);
    for _ in 0..2000 {
        let pair = [(); 2].map(|()| {
            let (a, b) = (vector(&mut random), vector(&mut random));
            let angle = PI * f64::from(random.unit()) * f64::from(random.unit());
            ClusterBounds {
                min: a.min(b),
                max: a.max(b),
                normals: NormalCone { axis: direction(&mut random), angle },
                emission_angle: FRAC_PI_2,
                two_sided: random.unit() < 0.3,
                intensity: 1.0,
            }
        });
        let both = pair[0].union(pair[1]);
        for one in pair {
            assert!(both.min.cmple(one.min).all() && both.max.cmpge(one.max).all());
            let across =
                one.normals.axis.cross(both.normals.axis).normalize_or(one.normals.axis.any_orthogonal_vector());
            for turn in 0..8 {
                // Normals on the edge of the cone, the one that is farthest from the axis of both among them.
                let around = glam::DQuat::from_axis_angle(one.normals.axis, f64::from(turn) * 0.25 * PI);
                let tilt = glam::DQuat::from_axis_angle(around * across, -one.normals.angle);
                let normal = tilt * one.normals.axis;
                let angle = normal.dot(both.normals.axis).clamp(-1.0, 1.0).acos();
                assert!(angle <= both.normals.angle + 1e-6, "{angle} beyond {both:?} of {pair:?}");
            }
        }
        assert_eq!(both.two_sided, pair[0].two_sided || pair[1].two_sided);
    }
}

/// Lights in one place, in a row, and in a row of growing distances make trees of bounded depth.
#[test]
fn every_arrangement_makes_a_tree() {
    let point = |p: DVec3| ClusterBounds {
        min: p,
        max: p,
        normals: NormalCone::ALL,
        emission_angle: PI,
        two_sided: false,
        intensity: 1.0,
    };
    let arrangements: [&dyn Fn(u32) -> DVec3; 4] =
        [&|_| DVec3::ONE, &|i| DVec3::X * f64::from(i), &|i| DVec3::Y * 2f64.powi(i as i32 % 200 - 100), &|i| {
            DVec3::new(f64::from(i % 30), f64::from(i / 30), 1e-3)
        }];
    for at in arrangements {
        let lights: Vec<ClusterBounds> = (0..900).map(|i| point(at(i))).collect();
        let tree = LightTree::new(&lights, INVERSE_SQUARE, false, 1.0);
        let to = Receiver { point: DVec3::new(0.3, 0.4, 5.0), normal: DVec3::NEG_Z, two_sided: false };
        let total: f64 = (0..900).map(|light| tree.probability(&to, light)).sum();
        assert!((total - 1.0).abs() < 1e-9, "{total}");
        assert!(tree.nodes.len() < 900 * 2 / 3, "{} nodes", tree.nodes.len());
    }
    let nothing = LightTree::new(&[], INVERSE_SQUARE, true, 1.0);
    assert_eq!(nothing.sample(&receiver(&mut Random(1)), 0.5), None);
}

/// The unit of length changes no choice.
#[test]
fn the_unit_of_length_changes_no_probability() {
    let mut random = Random(34);
    let lights = lamps(&mut random, 100);
    let scaled = |scale: f64| -> Vec<ClusterBounds> {
        let scaled = |b: &ClusterBounds| ClusterBounds {
            min: b.min * scale,
            max: b.max * scale,
            intensity: b.intensity * scale * scale,
            ..*b
        };
        lights.iter().map(scaled).collect()
    };
    let tree = LightTree::new(&lights, INVERSE_SQUARE, true, 1.0);
    for scale in [2f64.powi(-40), 2f64.powi(30)] {
        let other = LightTree::new(&scaled(scale), INVERSE_SQUARE, true, 1.0);
        for _ in 0..100 {
            let (to, u) = (receiver(&mut random), f64::from(random.unit()));
            let there = Receiver { point: to.point * scale, ..to };
            assert_eq!(tree.sample(&to, u), other.sample(&there, u));
            assert_eq!(tree.importance(&to), other.importance(&there));
        }
    }
}

/// So it is for a single point, whose falloff is by its scene's size.
#[test]
fn the_unit_of_length_changes_no_importance_of_one_point() {
    let light = |scale: f64| ClusterBounds {
        min: DVec3::splat(0.3 * scale),
        max: DVec3::splat(0.3 * scale),
        normals: NormalCone::ALL,
        emission_angle: PI,
        two_sided: false,
        intensity: 2.0,
    };
    let tree = |scale: f64| {
        let (linear, square) = ((0.2 / scale) as f32, (0.1 / (scale * scale)) as f32);
        LightTree::new(&[light(scale)], Falloff([0.3, linear, square]), false, 5.0 * scale)
    };
    let mut random = Random(35);
    for scale in [2f64.powi(-20), 2.0, 2f64.powi(15)] {
        for _ in 0..100 {
            let to = receiver(&mut random);
            let there = Receiver { point: to.point * scale, ..to };
            assert_eq!(tree(1.0).importance(&to), tree(scale).importance(&there));
        }
    }
}
