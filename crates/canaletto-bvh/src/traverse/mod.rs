//! Rays through the tree. Read the files in this order:
//!
//! 1. `single`: one ray, closest hit and any hit, as Embree's `BVHNIntersector1`. The traversal loop stands here, with
//!    its steps marked.
//! 2. `stack`: the traversal stack that single rays and streams share.
//! 3. `leaf_visitor`: the traits of the leaf tests. Their bodies are in `triangle_bvh/leaves.rs` and
//!    `primitive_bvh/leaves.rs`.
//! 4. `stream`: many incoherent rays, 32 of them in flight, as Embree's `BVHNIntersectorStream`.
//! 5. `packet`: up to 64 coherent rays in groups of sixteen, as Embree's hybrid packets. A packet has a traversal loop
//!    of its own.
//! 6. `filter`: many rays through a tree over instances. Each node passes the rays that enter a child on to it.
//!
//! The node test is in `simd/node_test/`. All kinds of traversal return equal hits, bit for bit.

mod filter;
mod leaf_visitor;
pub(crate) mod packet;
mod single;
mod stack;
mod stream;

pub use filter::{RayEnds, RayFilter};
pub(crate) use leaf_visitor::{AnyHitVisitor, ClosestVisitor};
pub(crate) use single::{any, closest, closest_by};
pub(crate) use stream::{NumberedRay, StreamVisitor, trace_stream};
