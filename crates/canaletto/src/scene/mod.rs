//! The scene as a file describes it: plain, serialisable values and indices, without caches or pointers.
//!
//! [`crate::world::World::build`] checks a scene and resolves it into primitives that rays intersect.

mod camera;
mod depth;
mod film;
mod fragment;
mod integrator;
mod node;
mod object_ids;
mod path_settings;
mod radiosity;
mod sparse;

pub use camera::{Aperture, CameraProjection, Extrinsics, Focus, Intrinsics, Lens, View};
pub use film::{Developing, Exposure, FilmSettings, Filter, SamplePattern, SamplerKind, Sampling, Tone, Transfer};
pub use fragment::{Fragment, Offsets};
pub use integrator::{Integrator, Shading, ShadowMethod, Stage, WhittedSettings, ZbufferSettings};
pub use node::{Content, Node};
pub(crate) use object_ids::name_of_unnamed;
pub use object_ids::{ObjectIds, TooManyObjects};
pub use path_settings::{Guiding, PathSettings};
pub use radiosity::{RadiosityMethod, RadiositySettings, RadiosityShow};
pub use sparse::{Sparse, Usual};

use crate::light::environment::Environment;
use crate::material::Material;
use crate::math::Rgb;
use crate::shape::{CylinderCloud, Mesh, SphereCloud};
use crate::texture::{Image, Texture};
use serde::{Deserialize, Serialize};

/// A whole scene. Indices of materials, textures, images, meshes, clouds and prototypes are positions in the lists
/// below.
///
/// ```
/// use canaletto::glam::Vec3;
/// use canaletto::light::{Light, LightKind, Omni};
/// use canaletto::math::Rgb;
/// use canaletto::scene::{Node, Scene};
/// use canaletto::shape::{Shape, Sphere};
///
/// let ball = Shape::Sphere(Sphere { center: Vec3::ZERO, radius: 1.0 });
/// let lamp = Light::new(LightKind::Omni(Omni::at(Vec3::splat(5.0))), Rgb::gray(0.8));
/// let nodes = vec![Node::from(ball).named("ball"), Node::from(lamp)];
/// let scene = Scene { background: Rgb::gray(0.2), nodes, ..Scene::default() };
/// ```
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Scene {
    /// The colour of rays that hit nothing, where there is no environment.
    pub background: Rgb,
    /// The environment around the scene. It replaces the background.
    pub environment: Option<Environment>,
    /// The ambient light Iₐ of (5.33).
    pub ambient: Rgb,
    /// The views that the scene offers. The first one is used where none is named.
    pub views: Vec<View>,
    /// The settings of sampling, reconstruction and developing.
    pub film: FilmSettings,
    /// The integrator that makes the picture.
    pub integrator: Integrator,
    /// The materials, each with its name.
    pub materials: Vec<Material>,
    /// The textures, each with its name.
    pub textures: Vec<Texture>,
    /// The images that textures and the environment use.
    pub images: Vec<Image>,
    /// Triangle meshes.
    pub meshes: Vec<Mesh>,
    /// Clouds of spheres.
    pub spheres: Vec<SphereCloud>,
    /// Clouds of cylinders.
    pub cylinders: Vec<CylinderCloud>,
    /// The nodes that instances repeat. They are not drawn by themselves.
    pub prototypes: Vec<Node>,
    /// The objects to draw, and the lights.
    pub nodes: Vec<Node>,
}
