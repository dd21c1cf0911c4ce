//! Staging: the camera, lights and ground of what has none of its own, scaled by its size.

mod fit_camera;
mod node_bounds;
#[cfg(test)]
mod tests;

pub(super) use fit_camera::fit_camera;

use canaletto::light::{Directional, DiskLight, Light, LightKind};
use canaletto::material::{Material, Phong};
use canaletto::math::{Rgb, Transform};
use canaletto::scene::{
    CameraProjection, Content, FilmSettings, Fragment, Intrinsics, Node, SamplePattern, Sampling, Scene, View,
};
use canaletto::shape::{Disk, Mesh, Plane, Shape};
use glam::DVec3;

/// The camera of models, without its placement.
pub(super) const FRAMING: Intrinsics = Intrinsics {
    fovy: 35.0,
    projection: CameraProjection::Perspective,
    width: 960,
    height: 720,
    near: None,
    far: None,
    shift: [0.0; 2],
    lens: None,
    shutter: [0.0; 2],
};

/// The sampling of scenes and models that say nothing of it: smooth edges at the cost of few rays.
pub(crate) const DEFAULT_SAMPLING: Sampling = Sampling::Adaptive { n: 3, threshold: SamplePattern::DEFAULT_THRESHOLD };

/// The view of a scene without a camera, from where models are seen. It frames the boxes of all nodes, and of visible
/// lights near them. `None` if nothing has bounds, or if they are too large to place a camera.
pub(crate) fn default_camera(scene: &Scene) -> Option<View> {
    let mut corners = node_bounds::corners(scene, scene.nodes.iter());
    corners.extend(node_bounds::corners_of_lights(scene, &corners));
    fit_camera(corners.into_iter().map(|p| (p, 0.0)), direction_at(30.0, 20.0), DVec3::Y, FRAMING)
}

/// The scene of a model: its objects on a neutral ground, seen from the front, a little from the right and above (y is
/// up, the front faces +z). The camera points down by more than half its angle of view, so that the horizon stays
/// outside. Edges are sampled adaptively. Objects without a material get one like clay. A model with a camera keeps it,
/// and a model with lights or an environment gets neither lights nor ground.
///
/// `None` if the model's coordinates are too large to place a camera.
pub(super) fn stage(model: Fragment) -> Option<Scene> {
    let is_lit = model.environment.is_some() || has_light(&model);
    let mut scene = Scene::default();
    scene.append(model);
    scene.film = FilmSettings { sampling: DEFAULT_SAMPLING, ..FilmSettings::default() };
    let clay = Phong { kd: Rgb::new(0.62, 0.58, 0.53), ks: Rgb::gray(0.12), n: 25.0, ..Phong::default() };
    let clay = add(&mut scene.materials, Material::new("clay", clay));
    for node in scene.nodes.iter_mut().filter(|node| node.material.is_none()) {
        // A material on the node of a mesh would replace the mesh's own.
        let has_own = match node.content {
            Content::Mesh(index) => scene.meshes.get(index as usize).is_some_and(|mesh| !mesh.materials.is_empty()),
            Content::Light(_) => true,
            _ => false,
        };
        if !has_own {
            node.material = Some(clay);
        }
    }
    // All places are offsets from the origin of the first mesh.
    let origin = scene.meshes.first().map_or(DVec3::ZERO, |mesh| mesh.origin);
    let meshes: Vec<&Mesh> = scene.nodes.iter().filter_map(|node| mesh_in_place(&scene, node)).collect();
    let others = scene.nodes.iter().filter(|node| mesh_in_place(&scene, node).is_none());
    let mut corners = node_bounds::corners(&scene, others);
    corners.iter_mut().for_each(|corner| *corner -= origin);
    let points = || {
        let vertices = meshes.iter().flat_map(|mesh| {
            let shift = mesh.origin - origin;
            mesh.triangles.iter().flatten().map(move |i| mesh.positions[*i as usize].as_dvec3() + shift)
        });
        vertices.chain(corners.iter().copied())
    };
    let view = match scene.views.is_empty() {
        true => Some(fit_camera(points().map(|p| (p, 0.0)), direction_at(30.0, 20.0), DVec3::Y, FRAMING)?),
        false => None,
    };
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    points().for_each(|p| (low, high) = (low.min(p), high.max(p)));
    if let Some(mut view) = view {
        view.extrinsics.eye += origin;
        view.extrinsics.center += origin;
        scene.views.push(view);
    }
    if !is_lit {
        light(&mut scene, [low, high], &Transform::translate(origin))?;
    }
    Some(scene)
}

/// The mesh of a node that isn't moved.
fn mesh_in_place<'a>(scene: &'a Scene, node: &Node) -> Option<&'a Mesh> {
    match node.content {
        Content::Mesh(index) if node.transform.is_usual() => scene.meshes.get(index as usize),
        _ => None,
    }
}

fn has_light(model: &Fragment) -> bool {
    let mut left: Vec<&Node> = model.nodes.iter().chain(&model.prototypes).collect();
    while let Some(node) = left.pop() {
        match &node.content {
            Content::Light(_) => return true,
            Content::Group(children) => left.extend(children),
            _ => {}
        }
    }
    false
}

/// Adds lights and a ground for objects between `low` and `high`, both relative to where `there` moves to. `None` if
/// the coordinates are too large.
fn light(scene: &mut Scene, [low, high]: [DVec3; 2], there: &Transform) -> Option<()> {
    let middle = (low + high) / 2.0;
    let size = (high - low).length().max(1e-30);
    let ground = add(&mut scene.materials, Material::new("ground", Phong { kd: Rgb::gray(0.72), ..Phong::default() }));
    let point = DVec3::new(middle.x, low.y, middle.z).as_vec3();
    let plane = Node::from(Shape::Plane(Plane { point, normal: glam::Vec3::Y })).with_transform(there);
    scene.nodes.push(plane.named("ground").with_material(ground));
    // The key light at the left of the camera casts the shadow; the fill light at the right brightens it.
    let key = DiskLight {
        disk: Disk {
            center: (middle + direction_at(-25.0, 50.0) * (3.0 * size)).as_vec3(),
            normal: direction_at(-25.0, 50.0).as_vec3(),
            radius: (0.2 * size) as f32,
        },
        points: 24,
    };
    if !(key.disk.center.is_finite() && key.disk.radius.is_finite()) {
        return None;
    }
    let fill = Directional { towards: -direction_at(85.0, 25.0).as_vec3(), beam: None };
    let light = |name: &str, kind, intensity, shadows| {
        let light = Light { name: Some(name.into()), shadows, ..Light::new(kind, Rgb::gray(intensity)) };
        Node::from(light).with_transform(there).named(name)
    };
    scene.nodes.push(light("key", LightKind::Disk(key), 0.85, true));
    scene.nodes.push(light("fill", LightKind::Directional(fill), 0.2, false));
    (scene.background, scene.ambient) = (Rgb::gray(0.7), Rgb::gray(0.16));
    Some(())
}

/// Appends to a list; returns the index.
fn add<T>(list: &mut Vec<T>, item: T) -> u32 {
    list.push(item);
    list.len() as u32 - 1
}

/// The unit direction at these angles, in degrees, to the right of the front (+z) and above the ground.
fn direction_at(right: f64, above: f64) -> DVec3 {
    let (sin_r, cos_r) = libm::sincos(right.to_radians());
    let (sin_a, cos_a) = libm::sincos(above.to_radians());
    DVec3::new(sin_r * cos_a, sin_a, cos_r * cos_a)
}
