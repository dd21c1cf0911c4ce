//! No surface shadows itself: a light at the eye lights everything that the eye sees, at any distance from zero.

use super::*;
use canaletto::math::{Transform, offset_origin};
use canaletto::scene::{Content, Node};
use canaletto_bvh::Ray;
use glam::DVec3;

/// A shape, and the least radius of its hollows. Only a hollow shape can shadow another part of itself.
type Case = (&'static str, Option<f64>);

const SHAPES: [Case; 10] = [
    ("sphere { center 0 0 0; radius 1", None),
    ("box { min -0.7 -0.6 -0.8; max 0.7 0.6 0.8", None),
    ("cylinder { base -0.6 -0.7 0.2; top 0.5 0.8 -0.1; radius 0.5", None),
    ("cylinder { base 0 -1 0; top 0 1 0; radius 0.6", None),
    ("cone { base -0.5 -0.8 0; top 0.5 0.9 0.3; radius 0.8", None),
    ("cone { base -0.5 -0.8 0; top 0.5 0.9 0.3; radius 0.8; top-radius 0.3", None),
    ("cylinder { base -0.6 -0.7 0.2; top 0.5 0.8 -0.1; radius 0.5; caps #false", Some(0.5)),
    ("torus { center 0 0 0; axis 0.2 1 0.3; radius 1; tube 0.35", Some(0.65)),
    ("torus { center 0 0 0; axis 0 1 0; radius 1; tube 0.1", Some(0.9)),
    ("torus { center 0 0 0; axis 0 0 1; radius 0.8; tube 0.6", Some(0.2)),
];

/// Traces eye rays to the shape at this distance from zero, then shadow rays to the eye and in random directions.
/// Returns the number of shadow rays and of occluded ones. A small object at zero keeps the origin of the world's
/// coordinates there.
fn shadowed((shape, hollow): Case, transform: &str, distance: f64, turn: u32) -> (usize, usize) {
    let text = format!("camera {{ eye 3 2 4; center 0 0 0; fovy 35; size 90 90 }}\n{shape}{transform}");
    let mut scene = scene(&text, &[]);
    let angle = f64::from(turn) * 2.4;
    let height = libm::sin(f64::from(turn) * 1.3) * 0.6;
    let offset = DVec3::new(libm::cos(angle), height, libm::sin(angle)) * distance;
    let there = Transform::translate(offset);
    scene.nodes = vec![Node { transform: there.into(), ..Node::new(Content::Group(scene.nodes)) }];
    let mut view = scene.views.remove(0);
    view.extrinsics.eye += offset;
    view.extrinsics.center += offset;
    scene.nodes.extend(super::scene("sphere { center 0 0 0; radius 1e-3 }", &[]).nodes);
    let camera = Camera::of(&view).expect("a camera");
    let world = World::build(scene).expect("a world");
    assert_eq!(world.origin(), DVec3::ZERO);
    let (mut points, mut dark, mut state) = (0, 0, 1 + turn);
    let mut random = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state >> 8) / f64::from(1 << 23) - 1.0
    };
    for pixel in 0..90 * 90 {
        let line = camera.line(f64::from(pixel % 90) + 0.5, f64::from(pixel / 90) + 0.5);
        let Some(hit) = world.intersect(&line.rounded(), f32::INFINITY) else { continue };
        let surface = world.surface(line, &hit);
        let outer =
            if hollow.is_none() || surface.normal.dot(line.direction) < 0.0 { surface.normal } else { -surface.normal };
        let away = DVec3::new(random(), random(), random()).normalize_or(outer);
        let away = if away.dot(outer) < 0.0 { -away } else { away };
        for to_light in [view.extrinsics.eye - surface.exact, away * 5.0] {
            let cos = to_light.normalize().dot(outer);
            // The eye never sees a closed body from inside.
            if cos < 1e-6 {
                dark += usize::from(hollow.is_none() && cos < -1e-6);
                continue;
            }
            points += 1;
            let origin = offset_origin(surface.point, surface.error, surface.normal, to_light);
            let Some(blocker) = world.intersect(&Ray::new(origin, to_light.as_vec3()), 1.0) else { continue };
            // In a hollow, a chord at this angle to the wall ends at 2 r cos θ.
            let way = f64::from(blocker.t) * to_light.length();
            dark += usize::from(hollow.is_none_or(|radius| way < 0.5 * radius * cos));
        }
    }
    (points, dark)
}

#[test]
fn no_shape_shadows_itself() {
    // Each shape is tested in its own place and with transforms.
    let transforms = [" }", "; rotate-x 33; scale 1.3 }", "; scale 1.2 1.1 1.1; rotate-z 20 }"];
    let (mut points, mut wrong) = (0, Vec::new());
    for case in SHAPES {
        for transform in transforms {
            for distance in [0.0, 1e2, 1e3, 1e4, 3e4, 1e5] {
                for turn in 0..TURNS {
                    let (all, dark) = shadowed(case, transform, distance, turn);
                    points += all;
                    if dark > 0 {
                        wrong.push(format!("{}{transform} at {distance}, turn {turn}: {dark} of {all}", case.0));
                    }
                }
            }
        }
    }
    assert!(wrong.is_empty(), "of {points} points: {}\n{}", wrong.len(), wrong.join("\n"));
}

/// The number of places at each distance.
const TURNS: u32 = 2;
