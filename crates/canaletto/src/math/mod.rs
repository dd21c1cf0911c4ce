//! Colours, transforms, rounding-error bounds and polynomial roots.

mod error_bound;
mod line;
mod polynomial;
mod rgb;
mod spread;
mod transform;

pub use error_bound::{gamma, offset_origin, rounding};
pub use line::Line;
pub use polynomial::{Roots, quadratic, quartic};
pub use rgb::Rgb;
pub use spread::Spread;
pub use transform::{NotInvertible, Transform};
