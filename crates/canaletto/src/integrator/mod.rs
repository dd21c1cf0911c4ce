//! Integrators: from rays to colours.

mod counts;
mod probe;
mod whitted;

pub use counts::{RayCount, RayCounts};
pub use probe::{LightTerm, Probe, RayKind};
pub(crate) use whitted::BATCH_SIZE;
pub use whitted::Whitted;
