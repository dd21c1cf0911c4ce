//! The default scene of a model: camera, lights and ground, scaled by the model's size.

use super::Imported;
use super::fit_camera::fit_camera;
use canaletto::light::{Directional, DiskLight, Light, LightKind};
use canaletto::material::{Material, Phong};
use canaletto::math::{Rgb, Transform};
use canaletto::scene::{Content, FilmSettings, Intrinsics, Node, Sampling, Scene};
use canaletto::shape::{Plane, Shape};
use glam::DVec3;

/// The camera of models, without its placement.
pub(super) const FRAMING: Intrinsics = Intrinsics {
    fovy: 35.0,
    width: 960,
    height: 720,
    near: 1.0,
    far: 1000.0,
    shift: [0.0; 2],
    lens: None,
    shutter: [0.0; 2],
};

/// The model on a neutral ground, seen from the front, a little from the right and above (y is up, the front faces +z).
/// The camera points down by more than half its angle of view, so that the horizon stays outside. Edges are sampled
/// adaptively.
///
/// `None` if the model's coordinates are too large to place a camera.
pub(super) fn default_scene(model: Imported) -> Option<Scene> {
    let meshes = model.meshes;
    // All positions are offsets from the origin of the file's meshes.
    let origin = meshes.first().map_or(DVec3::ZERO, |mesh| mesh.origin);
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let corners =
        || meshes.iter().flat_map(|m| m.triangles.iter().flatten().map(|i| m.positions[*i as usize].as_dvec3()));
    corners().for_each(|p| (low, high) = (low.min(p), high.max(p)));
    let mut view = fit_camera(corners().map(|p| (p, 0.0)), direction_at(30.0, 20.0), DVec3::Y, FRAMING)?;

    let mut materials = model.materials;
    let next = materials.len() as u32;
    let clay = Phong { kd: Rgb::new(0.62, 0.58, 0.53), ks: Rgb::gray(0.12), n: 25.0, ..Phong::default() };
    materials.push(Material::new("clay", clay));
    materials.push(Material::new("ground", Phong { kd: Rgb::gray(0.72), ..Phong::default() }));

    let middle = (low + high) / 2.0;
    let size = (high - low).length().max(1e-30);
    let mut nodes: Vec<Node> = Vec::new();
    for (index, mesh) in meshes.iter().enumerate() {
        let node = Node::new(Content::Mesh(index as u32)).named(mesh.name.clone());
        nodes.push(if mesh.materials.is_empty() { node.with_material(next) } else { node });
    }
    let point = DVec3::new(middle.x, low.y, middle.z).as_vec3();
    let there = Transform::translate(origin);
    let ground = Node::from(Shape::Plane(Plane { point, normal: glam::Vec3::Y })).with_transform(&there);
    nodes.push(ground.named("ground").with_material(next + 1));
    // The key light at the left of the camera casts the shadow; the fill light at the right brightens it.
    let key = DiskLight {
        position: (middle + direction_at(-25.0, 50.0) * (3.0 * size)).as_vec3(),
        normal: direction_at(-25.0, 50.0).as_vec3(),
        radius: (0.2 * size) as f32,
        points: 24,
    };
    if !(key.position.is_finite() && key.radius.is_finite()) {
        return None;
    }
    let fill = Directional { towards: -direction_at(85.0, 25.0).as_vec3(), beam: None };
    let light = |name: &str, kind, intensity, shadows| {
        let light = Light { name: Some(name.into()), shadows, ..Light::new(kind, Rgb::gray(intensity)) };
        Node::from(light).with_transform(&there).named(name)
    };
    nodes.push(light("key", LightKind::Disk(key), 0.85, true));
    nodes.push(light("fill", LightKind::Directional(fill), 0.2, false));
    view.extrinsics.eye += origin;
    view.extrinsics.center += origin;
    Some(Scene {
        background: Rgb::gray(0.7),
        ambient: Rgb::gray(0.16),
        views: vec![view],
        film: FilmSettings { sampling: Sampling::Adaptive { n: 3, threshold: 0.1 }, ..FilmSettings::default() },
        materials,
        meshes,
        nodes,
        ..Scene::default()
    })
}

/// The unit direction at these angles, in degrees, to the right of the front (+z) and above the ground.
pub(super) fn direction_at(right: f64, above: f64) -> DVec3 {
    let (sin_r, cos_r) = libm::sincos(right.to_radians());
    let (sin_a, cos_a) = libm::sincos(above.to_radians());
    DVec3::new(sin_r * cos_a, sin_a, cos_r * cos_a)
}
