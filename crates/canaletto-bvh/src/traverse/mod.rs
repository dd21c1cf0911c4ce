//! Rays through the tree: one at a time ([`single`]), many that need not go the same way ([`stream`]), and packets of rays
//! that go nearly the same way ([`packet`]).

mod leaf_visitor;
pub(crate) mod packet;
mod single;
mod stack;
mod stream;

pub(crate) use leaf_visitor::{AnyHitVisitor, ClosestVisitor};
pub(crate) use single::{any, closest, closest_by};
pub(crate) use stream::{NumberedRay, StreamVisitor, trace_stream};
