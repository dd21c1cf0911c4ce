//! Form factors: the share of the light that leaves a diffuse surface and arrives at another one.
//!
//! The form factor from A to B is F = 1/A ∫ over A ∫ over B of cos θ cos θ' / (π r²), where B is visible. Heat transfer
//! calls it the configuration factor or view factor. It obeys the reciprocity A F(A→B) = B F(B→A).
//!
//! - [`point_to_polygon`] is exact for a differential patch and a polygon.
//! - [`polygon_to_polygon`] integrates over two polygons in full view of each other.
//! - [`sample_form_factor`] follows rays between any objects of a world.
//! - [`hemicube`] draws what a point sees, and gives the factors to everything at once.
//! - [`average_hemicube`] is the mean of hemicubes at points of a surface.
//! - [`form_factors`] chooses between them.

mod average_hemicube;
mod between;
mod delta_factors;
mod double_exponential;
mod full_view;
mod hemicube;
#[cfg(test)]
mod literature;
mod point_to_polygon;
mod polygon;
mod polygon_to_polygon;
mod sampled;
#[cfg(test)]
mod testing;
mod unoccluded;

pub use average_hemicube::{AverageHemicube, AverageHemicubeSettings, average_hemicube};
pub use between::{
    FormFactorError, FormFactorMethod, FormFactorProgress, FormFactorSettings, FormFactors, form_factors,
};
pub use hemicube::{HemicubeFormFactors, HemicubeSettings, PrimitiveFormFactor, hemicube};
pub use point_to_polygon::point_to_polygon;
pub use polygon::{area_vector, clip_to_front};
pub(crate) use polygon_to_polygon::polygon_to_polygon_within;
pub use polygon_to_polygon::{AnalyticFormFactor, polygon_to_polygon};
pub use sampled::{SampleSettings, SampledFormFactor, SamplingProgress, Side, sample_form_factor};
