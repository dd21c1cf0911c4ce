//! Scenes in a form that other ray tracers support: a view, omni lights, and spheres, cylinders and meshes, each of one
//! material.

use std::fmt::Display;

use canaletto::camera::Camera;
use canaletto::light::LightKind;
use canaletto::math::Rgb;
use canaletto::scene::{Content, Intrinsics, Scene, View};
use canaletto::shape::{Mesh, Shape};
use glam::Vec3;

/// A scene for peers.
pub(super) struct Plain<'a> {
    /// The whole scene.
    pub(super) scene: &'a Scene,
    /// The first view, and its camera.
    pub(super) view: &'a View,
    pub(super) camera: Camera,
    /// The distance from the eye at which the picture has height 1.
    pub(super) distance: f64,
    /// The positions and intensities of the lights.
    pub(super) lights: Vec<(Vec3, Rgb)>,
    pub(super) things: Vec<Thing<'a>>,
}

/// An object of one material, which is an index in the scene.
pub(super) struct Thing<'a> {
    pub(super) material: u32,
    pub(super) form: Form<'a>,
}

/// The geometry of an object.
pub(super) enum Form<'a> {
    Mesh(&'a Mesh),
    /// Centres and radii.
    Spheres(Vec<(Vec3, f32)>),
    /// Ends of axes and radii.
    Cylinders(Vec<([Vec3; 2], f32)>),
}

impl<'a> Plain<'a> {
    /// The scene for a picture of this size. Loose spheres of one material form one object.
    pub(super) fn new(scene: &'a Scene, [width, height]: [u32; 2]) -> Result<Self, String> {
        let view = scene.views.first().ok_or("the scene has no camera")?;
        let intrinsics = Intrinsics { width, height, ..view.intrinsics };
        let camera = Camera::new(&intrinsics, &view.extrinsics).map_err(|e| e.to_string())?;
        let distance = 0.5 / (view.intrinsics.fovy.to_radians() / 2.0).tan();
        let mut plain = Self { scene, view, camera, distance, lights: Vec::new(), things: Vec::new() };
        let mut loose: Vec<(u32, Vec<(Vec3, f32)>)> = Vec::new();
        for node in &scene.nodes {
            let mut material = node.material.unwrap_or_default();
            let form = match &node.content {
                Content::Light(light) => {
                    let LightKind::Omni(omni) = &light.kind else { return Err("peers have only omni lights".into()) };
                    let [x, y, z, _] = omni.position;
                    plain.lights.push((Vec3::new(x, y, z), light.intensity));
                    continue;
                }
                Content::Shape(Shape::Sphere(s)) => {
                    match loose.iter_mut().find(|group| group.0 == material) {
                        Some(group) => group.1.push((s.center, s.radius)),
                        None => loose.push((material, vec![(s.center, s.radius)])),
                    }
                    continue;
                }
                Content::Mesh(index) => {
                    let mesh = &scene.meshes[*index as usize];
                    material = node.material.or(mesh.materials.first().copied()).unwrap_or_default();
                    Form::Mesh(mesh)
                }
                Content::Spheres(index) => {
                    let cloud = &scene.spheres[*index as usize];
                    Form::Spheres(cloud.centers.iter().enumerate().map(|(i, &c)| (c, cloud.radius(i))).collect())
                }
                Content::Cylinders(index) => {
                    let cloud = &scene.cylinders[*index as usize];
                    Form::Cylinders(cloud.axes.iter().enumerate().map(|(i, &a)| (a, cloud.radius(i))).collect())
                }
                _ => return Err("peers are given only spheres, meshes, clouds and omni lights".into()),
            };
            plain.things.push(Thing { material, form });
        }
        let of_group = |(material, spheres)| Thing { material, form: Form::Spheres(spheres) };
        plain.things.extend(loose.into_iter().map(of_group));
        Ok(plain)
    }
}

/// Three numbers, joined by `between`.
pub(super) fn joined<T: Display>(numbers: impl Into<[T; 3]>, between: &str) -> String {
    let [x, y, z] = numbers.into();
    format!("{x}{between}{y}{between}{z}")
}
