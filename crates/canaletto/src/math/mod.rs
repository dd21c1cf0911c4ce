//! Colours, also of glowing bodies, transforms and their motion, rounding-error bounds, polynomial roots, maps of the
//! unit square, and elementary functions of lanes.

mod black_body;
mod dray;
mod error_bound;
pub(crate) mod functions;
mod motion;
mod polynomial;
mod power;
mod ray_differential;
mod rgb;
mod transform;
mod vector;
pub mod warp;

pub use black_body::{BLACK_BODY_TEMPERATURES, black_body};
pub(crate) use canaletto_bvh::{max as larger, min as smaller};
pub use dray::DRay;
pub(crate) use error_bound::offset_origins;
pub use error_bound::{gamma, offset_origin, rounding};
pub use motion::{AnimatedTransform, AnimatedTransformError};
pub use polynomial::{Roots, quadratic, quartic};
pub(crate) use power::{power, power_all};
pub use ray_differential::RayDifferential;
pub use rgb::Rgb;
pub(crate) use rgb::{saturate, saturated};
pub use transform::{NotInvertible, Transform};
pub(crate) use vector::{Affine, Vector};
