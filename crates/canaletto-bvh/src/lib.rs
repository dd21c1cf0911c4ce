//! Bounding volume hierarchies and watertight ray kernels.
//!
//! This crate knows boxes, rays and ids, nothing of scenes. [`Bvh::build`] takes one box per primitive; the
//! caller keeps the primitives, permuted by [`Bvh::order`], and answers for a range of them at each leaf. The
//! kernels in [`triangle`] and [`sphere`] are what such an answer calls. [`TriangleBvh`] and [`PrimitiveBvh`] keep their
//! primitives themselves, four of which are tested side by side.
//!
//! What holds everywhere:
//! - A hit has 0 < t ≤ t_max. The upper end is inclusive, so that the caller can break ties by the lowest id.
//! - The tree finds what a loop over all primitives would find, bit for bit: box culling is conservative and the
//!   kernels never report a hit outside of the primitive's own box (see `slab`).
//! - The same bits on every CPU and for any number of threads: only + − × ÷ and sqrt, fused at most in
//!   bounds of which no answer depends on the last bit.
//! - No length is compared with a constant: scaling a scene by a power of two changes no decision.
//! - Rays are finite. One with a zero direction hits nothing. NaN meets nothing and is met by nothing, be it in a ray, a margin, an end or a box;
//!   infinite rays have answers that nothing is told about. Whatever numbers come, memory is safe.
//! - Functions that callers hand over may answer as they like: that spoils the answers about what they were asked about, nothing else.
//! - Rays need a few kilobytes of stack. What needs more finds it where a thread has less ([`with_stack`]).
//!
//! ```
//! use canaletto_bvh::{Aabb, Bvh, Ray, sphere};
//! use glam::Vec3;
//!
//! let centers: Vec<Vec3> = (0..100).map(|i| Vec3::new(i as f32 * 3.0, 0.0, 0.0)).collect();
//! let bounds: Vec<Aabb> = centers.iter().map(|&c| sphere::bounds(c, 1.0)).collect();
//! let bvh = Bvh::build(&bounds)?;
//! let slots: Vec<Vec3> = bvh.order().iter().map(|&id| centers[id as usize]).collect();
//!
//! let ray = Ray::new(Vec3::new(-10.0, 0.0, 0.0), Vec3::X).prepare();
//! let mut nearest = None;
//! bvh.intersect(&ray, f32::INFINITY, |leaf, t_max| {
//!     for slot in leaf.slots() {
//!         if let Some(t) = sphere::intersect(&ray, slots[slot as usize], 1.0, *t_max) {
//!             *t_max = t;
//!             nearest = Some((bvh.order()[slot as usize], t));
//!         }
//!     }
//! });
//! assert_eq!(nearest, Some((0, 9.0)));
//! # Ok::<(), canaletto_bvh::BuildError>(())
//! ```
#![cfg_attr(not(test), deny(clippy::disallowed_methods))]
#![deny(missing_docs)]
// The workspace denies `unsafe`. This is the one crate where modules allow it, for SIMD kernels and memory in large pages.

mod aabb;
mod build;
mod bvh;
mod hit;
pub mod memory;
mod node;
#[cfg(test)]
mod nonsense;
mod primitive;
mod primitive_bvh;
mod ray;
mod simd;
mod slab;
mod stack_space;
mod statistics;
#[cfg(test)]
mod testing;
mod traversal_stats;
mod traverse;
mod triangle_bvh;

pub use aabb::Aabb;
pub use build::{BuildError, Quality};
pub use bvh::{Blocks, Bvh};
pub use hit::PrimitiveHit;
pub use node::Leaf;
pub use primitive::primitive4::{Primitive, UserIntersect, UserPrimitive};
pub use primitive::{sphere, triangle};
pub use primitive_bvh::PrimitiveBvh;
pub use ray::{InflatedRay, PreparedRay, Ray};
pub use simd::{InstructionSet, Kernel};
pub use stack_space::{NoThreads, with_stack};
pub use statistics::Statistics;
pub use traversal_stats::TraversalStats;
pub use triangle_bvh::TriangleBvh;
