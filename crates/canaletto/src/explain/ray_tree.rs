//! The tree of a single ray that no camera chose.

use super::patch::RadiosityTerms;
use super::tree::RayNode;
use crate::math::Rgb;
use serde::Serialize;

/// A ray from any place in any direction, with the rays below it.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct RayTree {
    /// The ray.
    pub ray: RayNode,
    /// What lights the surfaces that the rays meet.
    #[serde(flatten)]
    pub radiosity: RadiosityTerms,
    /// The ray's colour as the integrator found it. Equal to [`RayNode::sum`] bit for bit.
    pub color: Rgb,
}
