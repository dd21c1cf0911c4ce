//! Colours, transforms and their motion, rounding-error bounds, polynomial roots and maps of the unit square.

mod error_bound;
mod line;
mod motion;
mod polynomial;
mod power;
mod rgb;
mod spread;
mod transform;
pub mod warp;

pub use error_bound::{gamma, offset_origin, rounding};
pub use line::Line;
pub use motion::{NoPath, Path};
pub use polynomial::{Roots, quadratic, quartic};
pub(crate) use power::{power, power_all};
pub use rgb::Rgb;
pub(crate) use rgb::saturate;
pub use spread::Spread;
pub use transform::{NotInvertible, Transform};
