//! Diagnosis of black or empty pictures: a few hundred rays test a world and a camera before rendering.
//!
//! Each [`Finding`] is a doubt, not an error. It is reported only where all rays agree.

mod brightness;
mod meshes;
mod ray_trees;

pub use crate::integrator::{Omission, omissions};
pub use brightness::Reason;
pub use meshes::{MeshFinding, doubt_meshes};
pub use ray_trees::{RayTrees, large_ray_trees};

use crate::camera::Camera;
use crate::job::{Job, PlacedJob};
use crate::light::PreparedLight;
use crate::math::DRay;
use crate::world::{Hit, World};
use brightness::Brightness;
use glam::DVec3;
use std::fmt;

/// A reason why a picture shows little or nothing.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Finding {
    /// No camera ray hits anything.
    NothingInView {
        /// The lowest and the highest corner of the world's bounds, if it has any.
        bounds: Option<[DVec3; 2]>,
        /// Whether the whole world lies behind the eye.
        behind: bool,
    },
    /// The eye is inside an opaque object that contains no light that casts shadows.
    EyeInside {
        /// The object's name.
        object: String,
    },
    /// A light that casts shadows is inside an opaque object, and the eye is not.
    LightInside {
        /// The light's name, or its kind and number.
        light: String,
        /// The object's name.
        object: String,
    },
    /// Every visible point is black.
    Black {
        /// The known reasons.
        reasons: Vec<Reason>,
    },
    /// Every visible point is brighter than white in all its colours.
    White {
        /// The least component of red, green and blue.
        least: f32,
    },
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Finding::NothingInView { behind: true, .. } => write!(f, "everything lies behind the eye"),
            Finding::NothingInView { .. } => write!(f, "no camera ray meets anything"),
            Finding::EyeInside { object } => write!(f, "the eye is inside {object}, which is opaque"),
            Finding::LightInside { light, object } => write!(f, "{light} is inside {object}, which is opaque"),
            Finding::Black { reasons } => {
                let why: Vec<String> = reasons.iter().map(Reason::to_string).collect();
                write!(f, "everything in view is black: {}", why.join("; "))
            }
            Finding::White { .. } => write!(f, "everything in view is brighter than white"),
        }
    }
}

/// The largest number of rays along each side of the picture: of the first test, and of the second, after the first hit
/// nothing.
const GRIDS: [u32; 2] = [32, 512];
/// The number of directions in which the surroundings of a point are tested.
const DIRECTIONS: u32 = 64;
/// The largest number of tested points of a light.
const MAX_POINTS: u32 = 16;

/// Findings on why the picture of this job will show little of the world. Lights and lens are tested at the opening of
/// the shutter.
pub fn diagnose(world: &World, job: &Job) -> Vec<Finding> {
    let mut findings = doubts(world, job);
    if findings.is_empty() {
        match brightness::judge(&PlacedJob::new(world, job), job) {
            Some(Brightness::Black(reasons)) if !reasons.is_empty() => findings.push(Finding::Black { reasons }),
            Some(Brightness::White(least)) => findings.push(Finding::White { least }),
            _ => {}
        }
    }
    findings
}

/// The findings that need no shading.
fn doubts(world: &World, job: &Job) -> Vec<Finding> {
    let mut findings = Vec::new();
    if world.primitives() == 0 {
        return findings;
    }
    // Rays, hits and lights have coordinates relative to the world's origin.
    let placed = PlacedJob::new(world, job);
    if !GRIDS.iter().any(|most| anything_in_view(world, &placed, *most)) {
        findings.push(nothing_in_view(world, job));
    }
    if !job.description().has_shadows() {
        return findings;
    }
    let starts = starts(&placed.camera.at(0.0));
    let around_eye = common_object(world, starts.iter().copied());
    let lit = |object: u32| {
        world
            .lights
            .iter()
            .any(|light| !light.light.shadows || light_is_inside(world, light).is_some_and(|o| o.0 == object))
    };
    if let Some((object, name)) = &around_eye
        && !lit(*object)
        && !starts.iter().any(|start| emits_inwards(world, *start))
    {
        findings.push(Finding::EyeInside { object: name.clone() });
    }
    for (index, light) in world.lights.iter().enumerate().filter(|(_, light)| light.light.shadows) {
        if let Some((object, name)) = light_is_inside(world, light)
            && around_eye.as_ref().is_none_or(|(around, _)| *around != object)
        {
            let own = light.light.name.as_ref().map(ToString::to_string);
            let light = own.unwrap_or_else(|| format!("{} light #{}", light.light.kind_name(), index + 1));
            findings.push(Finding::LightInside { light, object: name });
        }
    }
    findings
}

/// Whether one of at most `most` × `most` rays through the window hits anything.
fn anything_in_view(world: &World, job: &Job, most: u32) -> bool {
    let camera = job.camera.at(0.0);
    let ([x, y, width, height], [_, full_height]) = (job.window(), camera.size());
    let (columns, rows) = (width.min(most), height.min(most));
    let at = |index: u32, count: u32, side: u32| (f64::from(index) + 0.5) / f64::from(count) * f64::from(side);
    (0..rows).any(|row| {
        let from_top = f64::from(y) + at(row, rows, height);
        (0..columns).any(|column| {
            let line = camera.line(f64::from(x) + at(column, columns, width), f64::from(full_height) - from_top);
            first_hit(world, &line).is_some()
        })
    })
}

fn nothing_in_view(world: &World, job: &Job) -> Finding {
    let bounds = world.bounds();
    if bounds.is_empty() {
        return Finding::NothingInView { bounds: None, behind: false };
    }
    let (low, high) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
    let camera = job.camera.at(0.0);
    let corner = |i: u32| DVec3::select(glam::BVec3::new(i & 1 == 0, i & 2 == 0, i & 4 == 0), low, high);
    let behind = (0..8).all(|i| camera.project(corner(i)).is_none());
    Finding::NothingInView { bounds: Some([low, high]), behind }
}

/// The pixels of a grid of at most `most` columns and rows over the job's window.
fn pixel_grid(job: &Job, most: [u32; 2]) -> Vec<[u32; 2]> {
    let [x, y, width, height] = job.window();
    let (columns, rows) = (width.min(most[0]), height.min(most[1]));
    let at = |index: u32, count: u32, side: u32| ((f64::from(index) + 0.5) / f64::from(count) * f64::from(side)) as u32;
    let pixels = (0..rows).flat_map(|row| (0..columns).map(move |column| [column, row]));
    pixels.map(|[column, row]| [x + at(column, columns, width), y + at(row, rows, height)]).collect()
}

fn first_hit(world: &World, line: &DRay) -> Option<Hit> {
    world.intersect(&line.rounded(), f32::INFINITY)
}

/// The id and the name of the opaque object whose inner side the rays from a point hit in all directions.
fn enclosing_object(world: &World, point: DVec3) -> Option<(u32, String)> {
    let mut around = None;
    for index in 0..DIRECTIONS {
        let line = DRay { origin: point, direction: fibonacci_direction(index) };
        let hit = first_hit(world, &line)?;
        let opaque = world.material(&hit).is_opaque() && world.casts_shadow(hit.instance, hit.primitive);
        let outwards = world.surface(line, &hit).normal.dot(line.direction) > 0.0;
        let id = world.object_id(&hit);
        if !opaque || !outwards || around.as_ref().is_some_and(|(known, _)| *known != id) {
            return None;
        }
        around.get_or_insert_with(|| (id, world.object(&hit).name.clone()));
    }
    around
}

/// Whether the surface around a point may emit from its inner side.
fn emits_inwards(world: &World, point: DVec3) -> bool {
    let hit = first_hit(world, &DRay { origin: point, direction: fibonacci_direction(0) });
    hit.map(|hit| world.material(&hit)).is_some_and(|material| material.two_sided && material.may_emit())
}

/// Where camera rays start: at the eye, or at the corners and the middle of an orthographic camera's window.
fn starts(camera: &Camera) -> Vec<DVec3> {
    if !camera.is_orthographic() {
        return vec![camera.eye()];
    }
    let [w, h] = camera.size().map(f64::from);
    let places = [[0.0, 0.0], [w, 0.0], [0.0, h], [w, h], [w / 2.0, h / 2.0]];
    places.map(|[x, y]| camera.line(x, y).origin).to_vec()
}

/// The opaque object that contains all points of a light.
fn light_is_inside(world: &World, light: &PreparedLight) -> Option<(u32, String)> {
    let step = light.points().div_ceil(MAX_POINTS).max(1);
    let positions = (0..light.points())
        .step_by(step as usize)
        .map(|index| light.illuminate(index, DVec3::ZERO).position.map(|p| p.as_dvec3()))
        .collect::<Option<Vec<DVec3>>>()?;
    common_object(world, positions.into_iter())
}

/// The opaque object that contains all of these points.
fn common_object(world: &World, points: impl Iterator<Item = DVec3>) -> Option<(u32, String)> {
    let mut around: Option<(u32, String)> = None;
    for point in points {
        let object = enclosing_object(world, point)?;
        if around.as_ref().is_some_and(|known| known.0 != object.0) {
            return None;
        }
        around = Some(object);
    }
    around
}

/// Uniform directions over the sphere: steps of the golden angle on slices of equal area.
fn fibonacci_direction(index: u32) -> DVec3 {
    const GOLDEN_ANGLE: f64 = 2.399_963_229_728_653;
    let z = 1.0 - (2.0 * f64::from(index) + 1.0) / f64::from(DIRECTIONS);
    let (radius, angle) = ((1.0 - z * z).sqrt(), GOLDEN_ANGLE * f64::from(index));
    DVec3::new(radius * libm::cos(angle), radius * libm::sin(angle), z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::{DiskLight, Light, LightKind, Omni};
    use crate::material::{Material, Phong};
    use crate::math::Rgb;
    use crate::scene::{
        Extrinsics, FilmSettings, Integrator, Intrinsics, Node, Scene, WhittedSettings, ZbufferSettings,
    };
    use crate::shape::{Cuboid, Disk, Plane, Shape, Sphere};
    use glam::Vec3;

    fn ball(center: Vec3, radius: f32) -> Node {
        Node::from(Shape::Sphere(Sphere { center, radius })).named("ball")
    }

    fn lamp(at: Vec3) -> Node {
        Node::from(Light::new(LightKind::Omni(Omni::at(at)), Rgb::WHITE))
    }

    fn findings(eye: [f64; 3], center: [f64; 3], nodes: Vec<Node>) -> Vec<Finding> {
        let clear = Phong { opacity: 0.5, ..Phong::default() };
        let scene = Scene { nodes, materials: vec![Material::new("clear", clear)], ..Scene::default() };
        let place = Extrinsics { eye: eye.into(), center: center.into(), up: DVec3::Y };
        let camera = Camera::new(&Intrinsics::default(), &place).unwrap();
        diagnose(&World::build(scene).unwrap(), &Job::new(camera, FilmSettings::default(), WhittedSettings::default()))
    }

    const AWAY: Vec3 = Vec3::new(0.0, 9.0, 9.0);

    fn floor() -> Node {
        Node::from(Shape::Plane(Plane { point: Vec3::NEG_Y, normal: Vec3::Y })).named("floor")
    }

    /// The reasons for a black ball on a floor in this light.
    fn why_black(light: Light) -> Vec<Reason> {
        let nodes = vec![ball(Vec3::ZERO, 1.0), floor(), Node::from(Light { name: Some("lamp".into()), ..light })];
        match &findings([0.0, 1.0, 6.0], [0.0; 3], nodes)[..] {
            [Finding::Black { reasons }] => reasons.clone(),
            [] => Vec::new(),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn a_black_picture_is_explained() {
        let omni = |at: Vec3, light: f32| Light::new(LightKind::Omni(Omni::at(at)), Rgb::gray(light));
        let blocked = Reason::LightBlocked { light: "lamp".into(), object: "floor".into() };
        assert_eq!(why_black(omni(AWAY, 1.0)), [], "a lit scene");
        assert_eq!(why_black(omni(Vec3::new(0.0, -5.0, 5.0), 1.0)), [Reason::LightBehind("lamp".into())]);
        assert_eq!(why_black(omni(AWAY, 0.0)), [Reason::LightOff("lamp".into())]);
        assert_eq!(why_black(omni(AWAY, 1e-9)), [Reason::LightDoesNotReach("lamp".into())]);
        // A ball alone above the floor: light from below would reach it, if it is strong enough.
        for (light, reason) in [(1.0, blocked), (1e-9, Reason::LightDoesNotReach("lamp".into()))] {
            let lamp = Light { name: Some("lamp".into()), ..omni(Vec3::new(0.0, -5.0, 0.5), light) };
            let below = vec![ball(Vec3::new(0.0, 3.0, 0.0), 1.0), floor(), Node::from(lamp)];
            let found = findings([0.0, 0.5, 3.0], [0.0, 3.0, 0.0], below);
            assert_eq!(found, [Finding::Black { reasons: vec![reason] }]);
        }
        let black = Phong { kd: Rgb::BLACK, ..Phong::default() };
        let mirror = Phong { k: Rgb::WHITE, ..black };
        let by = |integrator: Integrator, phong: Phong, more: Vec<Node>| {
            let nodes = [vec![ball(Vec3::ZERO, 1.0).with_material(0), lamp(AWAY)], more].concat();
            let scene = Scene { nodes, materials: vec![Material::new("m", phong)], ..Scene::default() };
            let place = Extrinsics { eye: DVec3::Z * 5.0, center: DVec3::ZERO, up: DVec3::Y };
            let camera = Camera::new(&Intrinsics::default(), &place).unwrap();
            diagnose(&World::build(scene).unwrap(), &Job::new(camera, FilmSettings::default(), integrator))
        };
        let one = WhittedSettings { max_depth: 1, ..WhittedSettings::default() };
        let depth_one_with = |phong: Phong, more: Vec<Node>| by(one.into(), phong, more);
        let depth_one = |phong: Phong| depth_one_with(phong, Vec::new());
        assert_eq!(depth_one(black), [Finding::Black { reasons: vec![Reason::BlackMaterial("m".into())] }]);
        assert_eq!(depth_one(mirror), [Finding::Black { reasons: vec![Reason::NotFollowed] }]);
        assert_eq!(depth_one(Phong::default()), []);
        let rasterised = by(ZbufferSettings::default().into(), mirror, Vec::new());
        assert_eq!(rasterised, [Finding::Black { reasons: vec![Reason::NotFollowed] }]);
        // The lit ball in front of the black one is too small for the first grid.
        assert_eq!(depth_one_with(black, vec![ball(Vec3::Z * 1.5, 0.03)]), []);
    }

    #[test]
    fn emission_is_looked_for_on_its_side() {
        let found = |shape: Shape, two_sided: bool| {
            let lamp = Phong { kd: Rgb::BLACK, emission: Rgb::gray(0.5), ..Phong::default() };
            let materials = vec![Material::new("lamp", lamp).with_two_sided(two_sided)];
            let nodes = vec![Node::from(shape).with_material(0).named("shade")];
            let place = Extrinsics { eye: DVec3::Z * 5.0, center: DVec3::ZERO, up: DVec3::Y };
            let camera = Camera::new(&Intrinsics::default(), &place).unwrap();
            let world = World::build(Scene { nodes, materials, ..Scene::default() }).unwrap();
            diagnose(&world, &Job::new(camera, FilmSettings::default(), WhittedSettings::default()))
        };
        let disk = |normal: Vec3| Shape::Disk(Disk { center: Vec3::ZERO, normal, radius: 1.0 });
        let turned_away = Finding::Black { reasons: vec![Reason::EmitsOutwards("lamp".into())] };
        assert_eq!((found(disk(Vec3::Z), false), found(disk(Vec3::NEG_Z), true)), (vec![], vec![]));
        assert_eq!(found(disk(Vec3::NEG_Z), false), [turned_away]);
        let around = Shape::Sphere(Sphere { center: Vec3::ZERO, radius: 9.0 });
        assert_eq!(found(around, false)[0], Finding::EyeInside { object: "shade".into() });
        assert_eq!(found(around, true), []);
    }

    #[test]
    fn a_white_picture_is_told() {
        let lit = |light: f32| {
            let lamp = Node::from(Light::new(LightKind::Omni(Omni::at(Vec3::new(0.0, 30.0, 90.0))), Rgb::gray(light)));
            findings([0.0, 3.0, 6.0], [0.0, -1.0, 0.0], vec![floor(), lamp])
        };
        assert_eq!(lit(1.0), []);
        assert!(matches!(lit(1000.0)[..], [Finding::White { least }] if least > 100.0), "{:?}", lit(1000.0));
    }

    #[test]
    fn a_plain_scene_is_without_doubts() {
        assert_eq!(findings([0.0, 0.0, 5.0], [0.0; 3], vec![ball(Vec3::ZERO, 1.0), lamp(AWAY)]), []);
        // The ball is too small for the first grid.
        assert_eq!(findings([0.0, 0.0, 5.0], [0.1, 0.1, 0.0], vec![ball(Vec3::ZERO, 0.01), lamp(AWAY)]), []);
    }

    #[test]
    fn nothing_in_view_says_where_things_are() {
        let all = |center| findings([0.0, 0.0, 5.0], center, vec![ball(Vec3::ZERO, 1.0), lamp(AWAY)]);
        let around_ball = |found: &[Finding]| match found {
            [Finding::NothingInView { bounds: Some([low, high]), behind }] => {
                assert!((*low + 1.0).length() < 1e-6 && (*high - 1.0).length() < 1e-6, "{low} {high}");
                *behind
            }
            other => panic!("{other:?}"),
        };
        assert!(around_ball(&all([0.0, 0.0, 9.0])));
        assert!(!around_ball(&all([4.0, 0.0, 4.0])));
        let floor = Node::from(Shape::Plane(Plane { point: Vec3::ZERO, normal: Vec3::Y }));
        let up = findings([0.0, 1.0, 0.0], [0.0, 9.0, 1.0], vec![floor]);
        assert_eq!(up, [Finding::NothingInView { bounds: None, behind: false }]);
    }

    #[test]
    fn an_eye_inside_needs_a_light_inside() {
        let inside =
            |lights: Vec<Node>| findings([0.0; 3], [1.0, 0.0, 0.0], [vec![ball(Vec3::ZERO, 3.0)], lights].concat());
        assert_eq!(inside(vec![lamp(AWAY)]), [Finding::EyeInside { object: "ball".into() }]);
        assert_eq!(inside(vec![lamp(AWAY), lamp(Vec3::Y)]), [], "a room with a lamp");
        let mut through = Light::new(LightKind::Omni(Omni::at(AWAY)), Rgb::WHITE);
        through.shadows = false;
        assert_eq!(inside(vec![Node::from(through)]), []);
        let clear = findings([0.0; 3], [1.0, 0.0, 0.0], vec![ball(Vec3::ZERO, 3.0).with_material(0), lamp(AWAY)]);
        assert_eq!(clear, [], "a clear ball lets light in");
    }

    #[test]
    fn a_light_inside_an_opaque_body_is_told() {
        let at = |node| findings([0.0, 0.0, 9.0], [0.0; 3], vec![ball(Vec3::ZERO, 1.0), node]);
        let told = |light: &str| vec![Finding::LightInside { light: light.into(), object: "ball".into() }];
        assert_eq!(at(lamp(Vec3::splat(0.3))), told("omni light #1"));
        assert_eq!(at(lamp(Vec3::splat(0.7))), []);
        let disk = |radius| {
            let disk = DiskLight { disk: Disk { center: Vec3::ZERO, normal: Vec3::Y, radius }, points: 40 };
            at(Node::from(Light { name: Some("key".into()), ..Light::new(LightKind::Disk(disk), Rgb::WHITE) }))
        };
        assert_eq!(disk(0.5), told("key"));
        assert_eq!(disk(2.0), [], "part of it shines");
        // The eye is beside the box, though inside the bounds of box and floor together.
        let cube = Node::from(Shape::Box(Cuboid { min: Vec3::splat(-1.0), max: Vec3::ONE })).named("box");
        let floor = Node::from(Shape::Plane(Plane { point: Vec3::NEG_Y, normal: Vec3::Y }));
        assert_eq!(findings([0.0, 0.0, 9.0], [0.0; 3], vec![cube, floor, lamp(Vec3::new(1.2, 0.0, 0.0))]), []);
    }

    #[test]
    fn directions_are_spread_evenly() {
        let sum: DVec3 = (0..DIRECTIONS).map(fibonacci_direction).sum();
        assert!(sum.length() < 0.5, "{sum}");
        assert!((0..DIRECTIONS).all(|i| (fibonacci_direction(i).length() - 1.0).abs() < 1e-12));
    }
}
