//! From rays to colours.

mod counts;
mod probe;
mod whitted;

pub use counts::{RayCount, RayCounts};
pub use probe::{LightTerm, Probe, RayKind};
pub use whitted::Whitted;
