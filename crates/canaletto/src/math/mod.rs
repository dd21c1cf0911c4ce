//! Colours, also of glowing bodies, transforms and their motion, rounding-error bounds, polynomial roots and maps of
//! the unit square.

mod black_body;
mod dray;
mod error_bound;
mod motion;
mod polynomial;
mod power;
mod ray_differential;
mod rgb;
mod transform;
pub mod warp;

pub use black_body::{BLACK_BODY_TEMPERATURES, black_body};
pub(crate) use canaletto_bvh::{max as larger, min as smaller};
pub use dray::DRay;
pub use error_bound::{gamma, offset_origin, rounding};
pub use motion::{AnimatedTransform, AnimatedTransformError};
pub use polynomial::{Roots, quadratic, quartic};
pub(crate) use power::{power, power_all};
pub use ray_differential::RayDifferential;
pub use rgb::Rgb;
pub(crate) use rgb::saturate;
pub use transform::{NotInvertible, Transform};

/// One of two vectors, by its components, so that the compiler vectorises loops over it.
#[inline(always)]
pub(crate) fn select(is_first: bool, first: glam::DVec3, second: glam::DVec3) -> glam::DVec3 {
    glam::DVec3 {
        x: if is_first { first.x } else { second.x },
        y: if is_first { first.y } else { second.y },
        z: if is_first { first.z } else { second.z },
    }
}
