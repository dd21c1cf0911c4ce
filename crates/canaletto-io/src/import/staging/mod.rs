//! Staging: the camera, light and ground of what has none of its own, scaled by its size.
//!
//! Pictures by paths get the light of an environment ([`studio`]). The classic integrators get lights of the chapter.

mod classic_lights;
mod fit_camera;
mod framed_points;
mod glossy;
mod node_bounds;
mod settings;
mod studio;
#[cfg(test)]
mod tests;

pub(super) use fit_camera::fit_camera;
pub use settings::{Ground, Moment, PictureQuality, StageLight, Staging, StandardView, UpAxis};

use canaletto::light::environment::EnvironmentKind;
use canaletto::material::{Material, MaterialModel, Phong, StandardSurface};
use canaletto::math::{Rgb, Transform};
use canaletto::scene::{
    CameraProjection, Content, Exposure, FilmSettings, Fragment, Intrinsics, Node, PathSettings, SamplePattern,
    Sampling, Scene, Tone, View,
};
use canaletto::shape::{Plane, Shape};
use framed_points::FramedMeshes;
use glam::{DVec3, Vec3};
use studio::{StageEnvironment, gray, stage_environment};

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

/// The radiance of the background and of the floor, which is 0.78 on screen.
const BACKGROUND: f64 = 0.6;

/// The exposed radiance of a white floor under a sky, which is 0.87 on screen.
const SKY_WHITE: f32 = 0.75;

/// The reflectance of the floor under a sky.
const SKY_FLOOR: f64 = 0.4;

/// The scene of a model. A model with a camera keeps it, and a model with lights or an environment gets neither light
/// nor ground. The staging may say otherwise. `up` is the format's axis.
///
/// `None` if the model's coordinates are too large to place a camera.
pub(super) fn stage(mut model: Fragment, up: UpAxis, staging: &Staging) -> Option<Scene> {
    turn_upright(&mut model, up, staging)?;
    if staging.light.is_some() {
        remove_lights(&mut model);
    }
    let is_lit = model.environment.is_some() || has_light(&model);
    let mut scene = Scene::default();
    scene.append(model);
    if staging.bare {
        return Some(scene);
    }
    give_material(&mut scene, staging);
    if staging.view.is_some() {
        scene.views.clear();
    }
    let mut around = staging.around;
    if staging.turn != 0.0 || staging.turntable.is_some() {
        let still = around.map_or_else(|| framed(&scene, DVec3::Z, DVec3::Y).map(|(_, own)| own), Some)?;
        turn_about(&mut scene, (still[0] + still[1]) / 2.0, staging.turn)?;
        around = staging.turntable.and(Some(swept(still)));
    }
    let [towards, upwards] = staging.view.unwrap_or_default().directions();
    let (view, [low, high]) = match around {
        Some(around) => (fit_camera(corners_of(around).map(|p| (p, 0.0)), towards, upwards, FRAMING)?, around),
        None => framed(&scene, towards, upwards)?,
    };
    if scene.views.is_empty() {
        scene.views.push(view);
    }
    match staging.classic {
        true => {
            scene.film = FilmSettings { sampling: DEFAULT_SAMPLING, ..FilmSettings::default() };
            if !is_lit {
                classic_lights::light(&mut scene, [low, high], staging)?;
            }
        }
        false => {
            scene.integrator = PathSettings::default().into();
            glossy::make_glossy(&mut scene);
            scene.film = FilmSettings {
                sampling: Sampling::Sampled(staging.quality.samples()),
                tone: Some(Tone::PbrNeutral),
                ..FilmSettings::default()
            };
            if !is_lit {
                light(&mut scene, [low, high], staging);
            }
        }
    }
    Some(scene)
}

/// The box that a model's objects fill before their turn, with y upwards. `None` if nothing has bounds.
pub(super) fn extent(mut model: Fragment, up: UpAxis, staging: &Staging) -> Option<[DVec3; 2]> {
    turn_upright(&mut model, up, staging)?;
    let mut scene = Scene::default();
    scene.append(model);
    framed(&scene, DVec3::Z, DVec3::Y).map(|(_, own)| own)
}

/// Turns a model whose z is upwards.
fn turn_upright(model: &mut Fragment, up: UpAxis, staging: &Staging) -> Option<()> {
    if staging.up.unwrap_or(up) == UpAxis::Z {
        turn_all(model, &Transform::rotate(DVec3::X, -90.0).ok()?);
    }
    Some(())
}

/// Turns objects about a vertical axis, by an angle in degrees. Lights stay.
fn turn_about(scene: &mut Scene, axis: DVec3, degrees: f64) -> Option<()> {
    let turn = Transform::rotate(DVec3::Y, degrees).ok()?;
    let turn = Transform::translate(axis).after(&turn).after(&Transform::translate(-axis));
    let objects = scene.nodes.iter_mut().filter(|node| !matches!(node.content, Content::Light(_)));
    objects.for_each(|node| turn_node(node, &turn));
    Some(())
}

/// The box around another one at all angles of its turn.
fn swept([low, high]: [DVec3; 2]) -> [DVec3; 2] {
    let (middle, half) = ((low + high) / 2.0, (high - low) / 2.0);
    let radius = libm::hypot(half.x, half.z);
    let half = DVec3::new(radius, half.y, radius);
    [middle - half, middle + half]
}

/// The corners of a box.
fn corners_of([low, high]: [DVec3; 2]) -> impl Iterator<Item = DVec3> + Clone {
    (0..8).map(move |i| DVec3::select(glam::BVec3::new(i & 1 == 0, i & 2 == 0, i & 4 == 0), low, high))
}

/// Turns all that a model has.
fn turn_all(model: &mut Fragment, turn: &Transform) {
    model.nodes.iter_mut().for_each(|node| turn_node(node, turn));
    let turned = |v: &mut DVec3| *v = turn.point(*v);
    for view in &mut model.views {
        for pose in view.motion.iter_mut().chain([&mut view.extrinsics]) {
            [&mut pose.eye, &mut pose.center, &mut pose.up].into_iter().for_each(turned);
        }
    }
}

fn turn_node(node: &mut Node, turn: &Transform) {
    node.transform = turn.after(&node.transform).into();
}

/// Removes the lights of a model, with its environment.
fn remove_lights(model: &mut Fragment) {
    fn without_lights(nodes: &mut Vec<Node>, depth: usize) {
        nodes.retain(|node| !matches!(node.content, Content::Light(_)));
        for node in nodes.iter_mut().filter(|_| depth < Node::MAX_NESTING) {
            if let Content::Group(children) = &mut node.content {
                without_lights(children, depth + 1);
            }
        }
    }
    model.environment = None;
    without_lights(&mut model.nodes, 0);
    without_lights(&mut model.prototypes, 0);
}

/// Gives objects without a material that of the staging, or one like clay.
fn give_material(scene: &mut Scene, staging: &Staging) {
    let lacks = |node: &Node| {
        // A material on the node of a mesh would replace the mesh's own.
        node.material.is_none()
            && match &node.content {
                Content::Mesh(index) => scene.meshes.get(*index as usize).is_none_or(|mesh| mesh.materials.is_empty()),
                Content::Group(children) => children.iter().any(|child| child.material.is_none()),
                Content::Instance(index) => {
                    let repeated = scene.prototypes.get(*index as usize);
                    repeated.is_none_or(|prototype| match &prototype.content {
                        Content::Group(children) => children.iter().any(|child| child.material.is_none()),
                        _ => prototype.material.is_none(),
                    })
                }
                Content::Light(_) => false,
                _ => true,
            }
    };
    let lacking: Vec<usize> = (0..scene.nodes.len()).filter(|i| lacks(&scene.nodes[*i])).collect();
    if lacking.is_empty() {
        return;
    }
    let material = match staging.material {
        Some(surface) => Material::new_standard("model", surface),
        None => Material::new("clay", clay(staging)),
    };
    let material = add(&mut scene.materials, material);
    lacking.into_iter().for_each(|i| scene.nodes[i].material = Some(material));
}

fn clay(staging: &Staging) -> MaterialModel {
    let color = Rgb::new(0.62, 0.58, 0.53);
    if staging.classic {
        return Phong { kd: color, ks: Rgb::gray(0.12), n: 25.0, ..Phong::default() }.into();
    }
    let mut surface = StandardSurface::default();
    (surface.base.color, surface.specular.roughness) = (color, 0.5);
    surface.into()
}

/// The view that frames a scene from a direction, and the box around its objects.
fn framed(scene: &Scene, towards: DVec3, up: DVec3) -> Option<(View, [DVec3; 2])> {
    let mut meshes = FramedMeshes::new(scene);
    let mut others: Vec<&Node> = scene.nodes.iter().filter(|node| !meshes.add(node)).collect();
    if !meshes.are_few() {
        (meshes, others) = (FramedMeshes::new(scene), scene.nodes.iter().collect());
    }
    // All places are offsets from the origin of the first mesh.
    let origin = scene.meshes.first().map_or(DVec3::ZERO, |mesh| mesh.origin);
    let corners = node_bounds::corners(scene, others.into_iter());
    let points = || meshes.corners().chain(corners.iter().copied()).map(move |p| p - origin);
    let mut view = fit_camera(points().map(|p| (p, 0.0)), towards, up, FRAMING)?;
    view.extrinsics.eye += origin;
    view.extrinsics.center += origin;
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    points().for_each(|p| (low, high) = (low.min(p), high.max(p)));
    Some((view, [low + origin, high + origin]))
}

/// Adds the staging's light and a floor under objects between `low` and `high`.
fn light(scene: &mut Scene, [low, high]: [DVec3; 2], staging: &Staging) {
    let which = staging.light.unwrap_or_default();
    let view = &scene.views[0].extrinsics;
    let towards = (view.eye - view.center).normalize_or(DVec3::Z);
    let background = staging.background.map_or(BACKGROUND, |color| color.luminance().into());
    let StageEnvironment { mut environment, image, floor } = stage_environment(which, towards, background);
    if let (EnvironmentKind::LatLong { image: index, .. }, Some(image)) = (&mut environment.kind, image) {
        *index = add(&mut scene.images, image);
    }
    let is_sky = which == StageLight::Sky;
    // The background of a sky isn't seen. It is what shadows are measured by in pictures with an alpha.
    let bare = if is_sky { Rgb::from(floor.map(|v| (v * SKY_FLOOR) as f32)) } else { gray(BACKGROUND) };
    scene.background = staging.background.unwrap_or(bare);
    environment.visible = is_sky && staging.background.is_none();
    scene.environment = Some(environment);
    let white = Rgb::from(floor.map(|v| v as f32)).luminance();
    scene.film.exposure = Some(Exposure::Stops(if is_sky { libm::log2f(SKY_WHITE / white) } else { 0.0 }));
    let color = match staging.ground {
        Ground::None => return,
        Ground::Color(color) => color,
        Ground::Shadow if is_sky => gray(SKY_FLOOR),
        // The lit floor has the background's radiance, so that no horizon is seen.
        Ground::Shadow => {
            let radiance = scene.background.to_array();
            Rgb::from([0, 1, 2].map(|c| (f64::from(radiance[c]) / floor[c]).min(1.0) as f32))
        }
    };
    let middle = (low + high) / 2.0;
    let place = Transform::translate(DVec3::new(middle.x, low.y, middle.z));
    let material = add_ground(scene, color, Vec3::ZERO, &place);
    scene.materials[material as usize].shadow_catcher = staging.ground == Ground::Shadow;
}

/// Adds a floor of a colour through a point, which is placed. Returns the index of its material.
fn add_ground(scene: &mut Scene, kd: Rgb, point: Vec3, place: &Transform) -> u32 {
    let material = add(&mut scene.materials, Material::new("ground", Phong { kd, ..Phong::default() }));
    let plane = Node::from(Shape::Plane(Plane { point, normal: Vec3::Y }));
    scene.nodes.push(plane.with_transform(place).named("ground").with_material(material));
    material
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
