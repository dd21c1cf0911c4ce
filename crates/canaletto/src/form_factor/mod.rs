//! Form factors: the share of the light that leaves a diffuse surface and arrives at another one.
//!
//! The form factor from A to B is F = 1/A ∫ over A ∫ over B of cos θ cos θ' / (π r²), where B is visible. Heat transfer
//! calls it the configuration factor or view factor. It obeys the reciprocity A F(A→B) = B F(B→A).
//!
//! - [`point_to_polygon`] is exact for a differential patch and a polygon.
//! - [`polygon_to_polygon`] integrates over two polygons in full view of each other.
//! - [`sample_form_factor`] follows rays between any objects of a world.
//! - [`form_factors`] chooses between them.

mod between;
mod double_exponential;
mod full_view;
#[cfg(test)]
mod literature;
mod point_to_polygon;
mod polygon;
mod polygon_to_polygon;
mod sampled;
mod unoccluded;

pub use between::{FormFactorError, FormFactors, form_factors};
pub use point_to_polygon::point_to_polygon;
pub use polygon::{area_vector, clip_to_front};
pub use polygon_to_polygon::{AnalyticFormFactor, polygon_to_polygon};
pub use sampled::{SampleSettings, SampledFormFactor, SamplingProgress, Side, sample_form_factor};
