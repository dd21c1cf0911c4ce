//! The tree of a single ray that no camera chose.

use super::patch::{PatchNode, PlaceNode};
use super::tree::{RayNode, is_zero};
use crate::math::Rgb;
use serde::Serialize;

/// A ray from any place in any direction, with the rays below it.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct RayTree {
    /// The ray.
    pub ray: RayNode,
    /// The patches under the rays, as in [`PixelTree::patches`](super::PixelTree::patches).
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub patches: Vec<PatchNode>,
    /// The number of further patches, which aren't explained.
    #[serde(skip_serializing_if = "is_zero")]
    pub more_patches: usize,
    /// The places whose light is interpolated, as in [`PixelTree::places`](super::PixelTree::places).
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub places: Vec<PlaceNode>,
    /// The number of further places, which aren't explained.
    #[serde(skip_serializing_if = "is_zero")]
    pub more_places: usize,
    /// The ray's colour as the integrator found it. Equal to [`RayNode::sum`] bit for bit.
    pub color: Rgb,
}
