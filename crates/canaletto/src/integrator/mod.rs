//! Integrators: from rays to colours.

mod counts;
mod probe;
mod whitted;

pub use counts::{RayCount, RayCounts};
pub use probe::{LightTerm, Probe, RayKind};
pub(crate) use whitted::BUNDLE;
pub use whitted::Whitted;
