//! A place that a rasteriser sees.

use crate::math::{DRay, RayDifferential};
use crate::sampler::Sample;
use crate::world::{Hit, MeshFacet};

/// A visible place of a surface.
pub(crate) struct Fragment<'a> {
    /// The line from the eye to the place.
    pub(crate) line: DRay,
    pub(crate) hit: Hit,
    /// The triangle that stands for the surface, if that is curved.
    pub(crate) facet: Option<MeshFacet<'a>>,
    /// Whether the geometric normal is shaded in place of the shading normal.
    pub(crate) is_flat: bool,
    /// The ray differential to the neighbouring samples, if the world needs it.
    pub(crate) differential: Option<RayDifferential>,
    /// The source of random numbers.
    pub(crate) sample: Sample,
}
