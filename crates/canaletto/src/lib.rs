//! Canaletto's library: from a scene's description to a picture and the explanation of each of its pixels.
//!
//! The way of a scene: a [`scene::Scene`] says what a file says; [`world::World::build`] resolves it into what
//! rays meet (and is the last step that can fail); [`render::render`] makes a picture; [`explain::explain`] opens one pixel into its tree
//! of rays.
//!
//! The classic part follows a textbook chapter on ray tracing; numbers such as (5.39b) cite its equations. Linear
//! RGB throughout. No files, no network, no clock, no global state: reading and writing live in `canaletto-io`.
#![forbid(unsafe_code)]

pub mod camera;
pub mod explain;
pub mod film;
pub mod integrator;
pub mod light;
pub mod material;
pub mod math;
pub mod render;
pub mod sampler;
pub mod scene;
pub mod shape;
pub mod world;

pub use canaletto_bvh::{Aabb, Ray};
