//! Bounding volume hierarchies and watertight ray kernels.
//!
//! This crate has boxes, rays and ids, and no scenes. [`TriangleBvh`] and [`PrimitiveBvh`] keep their primitives and
//! test four of them side by side. [`Bvh`] is the bare tree: [`Bvh::build`] takes one box per primitive. Its caller
//! keeps the primitives in [`Bvh::order`] and tests them at each leaf, for instance by the kernels in [`triangle`] and
//! [`sphere`].
//!
//! # What holds everywhere
//! - A hit has 0 < t ≤ t_max. The upper end is inclusive, so that the caller can break ties by the lowest id.
//! - The tree finds what a loop over all primitives would find, bit for bit. Box tests are conservative, and kernels
//!   never report a hit outside of the primitive's own box (see `slab`).
//! - Results have equal bits on every CPU and for any number of threads. Kernels use only + − × ÷ and sqrt. They fuse
//!   at most in bounds, where no result depends on the last bit.
//! - No length is compared with a constant: scaling a scene by a power of two changes no decision.
//! - Rays are finite. A ray with a zero direction hits nothing. A NaN in a ray, a margin, an end or a box gives no hit.
//!   Infinite rays have unspecified results. Memory is safe whatever the numbers are.
//! - A callback may return anything: that spoils only the results that depend on it.
//! - Rays need a few kilobytes of stack. Builds find the stack that they need even where a thread has less
//!   ([`with_stack`]).
//!
//! # The code map, in Embree's words
//! | Embree | here | file |
//! |---|---|---|
//! | `PrimRef` | `PrimRef`: a primitive's box and id | `build/prim_ref.rs` |
//! | `HeuristicArrayBinningSAH` | `Bins`, `Plan` | `build/{bins,binning,partition}.rs` |
//! | presplits (`primrefgen_presplit`) | `presplit::split` | `build/presplit.rs` |
//! | `BVHNBuilderSAH`, binary | `build::build`, improved by `reinsertion` | `build/mod.rs` |
//! | `BVHNBuilderSAH`, eight wide | `widen`, `collapse` | `build/` |
//! | `BVHNRefitter` | [`TriangleBvh::refit`] | `triangle_bvh/refit.rs`, `build/refit.rs` |
//! | `BVH8`, `AABBNode` | [`Bvh`], `Node` | `bvh.rs`, `node.rs` |
//! | `NodeRef` | `NodeRef` | `node.rs` |
//! | `Triangle4v` | `Triangle4` | `primitive/triangle4.rs` |
//! | user geometry | [`Primitive::User`], [`UserIntersect`] | `primitive/primitive4.rs` |
//! | `PlueckerIntersector1`, robust | `triangle::intersect`, always robust | `primitive/{triangle,exact4}.rs` |
//! | `TravRay` | [`PreparedRay`], `TraversalRay` | `ray/`, `simd/node_test/` |
//! | `BVHNIntersector1` | `traverse::closest`, `traverse::any` | `traverse/single.rs` |
//! | `BVHNIntersectorStream` | `traverse::trace_stream` | `traverse/stream.rs` |
//! | `BVHNIntersectorKHybrid`, packets | `traverse::packet` | `traverse/packet/` |
//! | stream filtering (no counterpart) | [`RayFilter`] | `traverse/filter.rs` |
//! | `RTCHit` | [`PrimitiveHit`] | `hit.rs` |
//! | filter functions | [`FilterFunction`] | `primitive/primitive4.rs` |
//! | `rtcOccluded1` | [`TriangleBvh::occluded`] | `triangle_bvh.rs` |
//! | ISA selection | [`InstructionSet`], `simd::dispatch` | `instruction_set.rs`, `simd/dispatch.rs` |
//! | `vfloat<M>` for shading | [`lanes`] | `lanes/` |
//!
//! # Layouts
//! ```text
//! Node       256 bytes, 64-aligned
//!   0  boxes     [lower, upper] x [x, y, z] x 8 lanes of f32   192
//! 192  children  8 x NodeRef                                    32
//! 224  orders    8 octants x u32: 8 lanes x 3 bits, far to near 32
//!
//! NodeRef    32 bits
//!   inner node   0 | index:31
//!   leaf         1 | count - 1 : 2 | first slot or block : 29
//!   no child     all ones; its box is empty
//!
//! Triangle4  160 bytes, 32-aligned
//!   0  corners   [a, b, c] x [x, y, z] x 4 lanes of f32        144
//! 144  ids       4 x (4 bits | id:28), the upper bits of the last two: exponent of the size   16
//!
//! Primitive4 128 bytes, 64-aligned
//!   0  base      [x, y, z] x 4 lanes: centres, or one end, or the box's lower corner
//!  48  radius    4 lanes: >= 0 sphere, < 0 cylinder, NaN user primitive
//!  64  top       [x, y, z] x 4 lanes: the other end, or the box's upper corner
//! 112  ids       4 x u32
//!
//! PreparedRay 64 bytes: the ray, -1/direction, the shear of Woop's test, its octant and longest axis
//! ```
//!
//! # How a ray finds its hit
//! 1. [`Ray::prepare`] divides once: reciprocal direction, shear, octant (`ray/`).
//! 2. A node's eight boxes are tested at once in f32 (`simd/node_test/`). The entered children go on the stack in the
//!    node's stored order for the ray's octant, the nearest on top (`traverse/stack.rs`).
//! 3. At a leaf, four triangles are tested side by side in f32, with a bound on the error of their edge functions
//!    (`primitive/edge_error.rs`). Nearly all misses end here.
//! 4. The remaining triangles are refined by an error bound of their own. It decides for most of them whether they are
//!    hit, and gives a lower and an upper bound of t.
//! 5. A triangle that is almost certainly hit before all others is left *pending*. The upper bound of its t already
//!    culls, and its exact test waits until the traversal has ended. In general each ray then makes one exact test.
//!    (Streams have no pending triangles.)
//! 6. The exact test in f64 (`primitive/triangle.rs`) has the last word.
//! 7. A pending triangle that turns out not to be hit has culled wrongly. The ray is then traced again, and each
//!    triangle is tested exactly at its leaf (`retry`). This happens where an origin is so close to a triangle's plane
//!    that f32 can't decide.
//!
//! Spheres and cylinders have a `Candidates` test in place of steps 3 and 4. In single rays and streams the exact test
//! follows at once; in packets spheres and cylinders can be pending.
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
// The workspace denies `unsafe`. In this crate modules allow it, for SIMD kernels and memory in large pages.

mod aabb;
mod build;
mod bvh;
mod hit;
mod instruction_set;
pub mod lanes;
pub mod memory;
mod min_max;
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
pub use instruction_set::{InstructionSet, Kernel};
pub use min_max::{max, min};
pub use node::Leaf;
pub use primitive::primitive4::{FilterFunction, Primitive, UserIntersect, UserPrimitive};
pub use primitive::{sphere, triangle};
pub use primitive_bvh::PrimitiveBvh;
pub use ray::{InflatedRay, PreparedRay, Ray};
pub use stack_space::{NoThreads, with_stack};
pub use statistics::Statistics;
pub use traversal_stats::TraversalStats;
pub use traverse::{RayEnds, RayFilter};
pub use triangle_bvh::TriangleBvh;
