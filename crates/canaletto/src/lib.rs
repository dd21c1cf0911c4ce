//! Canaletto's library: from a scene's description to a picture and the explanation of each of its pixels.
//!
//! - A [`scene::Scene`] holds what a file says.
//! - [`world::World::build`] resolves a scene into primitives that rays intersect. It is the last step that can fail.
//! - [`render::render`] makes a picture of a world.
//! - [`explain::explain`] returns the tree of rays of one pixel.
//!
//! The classic part follows a textbook chapter on ray tracing; numbers such as (5.39b) cite its equations. All colours
//! are linear RGB. The library uses no files, no network, no clock and no global state: `canaletto-io` reads and
//! writes.
//!
//! ```
//! use canaletto::camera::Camera;
//! use canaletto::explain::explain;
//! use canaletto::light::{Light, LightKind, Omni};
//! use canaletto::math::Rgb;
//! use canaletto::render::{Job, render};
//! use canaletto::scene::{Extrinsics, FilmSettings, WhittedSettings, Intrinsics, Node, Scene};
//! use canaletto::shape::{Shape, Sphere};
//! use canaletto::world::World;
//! use glam::{DVec3, Vec3};
//!
//! let ball = Node::from(Shape::Sphere(Sphere { center: Vec3::ZERO, radius: 1.0 })).named("ball");
//! let lamp = Light::new(LightKind::Omni(Omni::at(Vec3::new(2.0, 3.0, 4.0))), Rgb::gray(0.9));
//! let scene = Scene { nodes: vec![ball, Node::from(lamp)], ..Scene::default() };
//!
//! let intrinsics = Intrinsics { width: 64, height: 48, ..Intrinsics::default() };
//! let extrinsics = Extrinsics { eye: DVec3::new(0.0, 0.0, 5.0), ..Extrinsics::default() };
//! let camera = Camera::new(&intrinsics, &extrinsics)?;
//! let job = Job::new(camera, FilmSettings::default(), WhittedSettings::default());
//!
//! let world = World::build(scene)?;
//! let picture = render(&world, &job, &())?.picture;
//! let tree = explain(&world, &job, 32, 24)?;
//! assert_eq!(tree.sum(), picture.pixel(32, 24));
//! println!("{tree}");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]
#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

pub mod bake;
pub mod camera;
pub mod causes;
pub mod denoise;
pub mod diagnose;
pub mod explain;
pub mod film;
pub mod form_factor;
pub mod grade;
pub mod integrator;
mod job;
pub mod ladder;
pub mod light;
pub mod material;
pub mod math;
mod named;
mod out_of_range;
mod raster;
pub mod render;
pub mod sampler;
pub mod scene;
pub mod shape;
pub mod texture;
mod word_hash;
pub mod world;

/// The crate of the vectors and matrices in descriptions and in [`math`].
pub use glam;

pub use named::Named;
pub use out_of_range::OutOfRange;
pub use word_hash::WordHash;

pub use canaletto_bvh::{Aabb, InstructionSet, PreparedRay, Ray, memory};
