//! Rays against spheres. `single` tests one, and culls four in f32. `eight` tests eight rays and spheres side by side.

mod eight;
mod single;

pub use eight::intersect_many;
pub(crate) use eight::{LANES, Sphere8};
pub use single::{bounds, intersect, intersect_once};
pub(crate) use single::{cull, cull_any, intersect_inline};
