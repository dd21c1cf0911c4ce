//! The form factors between two surfaces of a world, by the best method for them.

use super::sampled::{SampleSettings, SampledFormFactor, SamplingProgress, Side, sample, sampled_area};
use super::unoccluded::Unoccluded;
use crate::world::{ObjectSurface, World};
use canaletto_bvh::NoThreads;
use std::ops::ControlFlow;

/// The form factors between two surfaces A and B.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct FormFactors {
    /// The factors from A to B and from B to A.
    pub values: [f64; 2],
    /// Their errors: bounds if [`FormFactors::sampled`] is empty, else standard errors.
    pub errors: [f64; 2],
    /// The areas of A and B, all counted sides; infinite with planes.
    pub areas: [f64; 2],
    /// The standard errors of the areas.
    pub area_errors: [f64; 2],
    /// The factor in the direction that was sampled, if the factors aren't exact.
    pub sampled: Option<SampledFormFactor>,
    /// Whether the sampled rays left B.
    pub is_from_b: bool,
}

/// The reason why form factors can't be computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FormFactorError {
    /// The surface with this index has no area: 0 for A, 1 for B.
    #[error("surface {0} has no area")]
    NoArea(usize),
    /// The surface A has planes, which are infinite: nothing of its light arrives at a finite surface.
    #[error("a plane is infinite, so that its form factors are 0")]
    Infinite,
    /// Sampling needs threads that can't be started.
    #[error(transparent)]
    NoThreads(#[from] NoThreads),
}

/// The form factors between two surfaces, each with the sides that count.
///
/// Triangles and boxes in full view of each other have the exact factor. Otherwise rays are sampled from the smaller
/// surface until the factor from A to B has the standard error of the settings, or the rays are used up, or `progress`
/// breaks. All surfaces are opaque, but holes are open; see [`super::sample_form_factor`].
///
/// # Errors
/// See [`FormFactorError`].
pub fn form_factors(
    world: &World,
    a: (&ObjectSurface, Side),
    b: (&ObjectSurface, Side),
    settings: &SampleSettings,
    progress: &(dyn Fn(&SamplingProgress) -> ControlFlow<()> + Sync),
) -> Result<FormFactors, FormFactorError> {
    let surfaces = [a, b];
    if a.0.planes() > 0 {
        return Err(FormFactorError::Infinite);
    }
    if let Some(index) = surfaces.iter().position(|(s, _)| s.planes() == 0 && s.nominal_area() == 0.0) {
        return Err(FormFactorError::NoArea(index));
    }
    let mut areas = surfaces.map(|(surface, side)| match surface.planes() {
        0 => surface.nominal_area() * f64::from(side.count()),
        _ => f64::INFINITY,
    });
    let mut area_errors = [0.0; 2];
    // Rays from the smaller surface arrive more often.
    let is_from_b = areas[1] < areas[0];
    let (first, second) = if is_from_b { (1, 0) } else { (0, 1) };
    let (from, to) = (surfaces[first], surfaces[second]);
    let unoccluded = Unoccluded::between(world, from, to);
    let (factor, sampled) = match &unoccluded {
        Some(exact) if exact.is_full_view => ([exact.factor.value, exact.factor.error], None),
        _ => {
            let ratio = if is_from_b { areas[0] / areas[1] } else { 1.0 };
            let settings = SampleSettings { standard_error: settings.standard_error * ratio, ..*settings };
            let sampled = sample(world, from, to, unoccluded.as_ref(), &settings, progress)?;
            (areas[first], area_errors[first]) = (sampled.area, sampled.area_error);
            if !to.0.is_exact() && areas[second].is_finite() {
                [areas[second], area_errors[second]] = sampled_area(world, to, settings.seed);
            }
            ([sampled.value, sampled.standard_error], Some(sampled))
        }
    };
    // A F(A→B) = B F(B→A).
    let ratio = areas[first] / areas[second];
    let (mut values, mut errors) = ([factor[0]; 2], [factor[1]; 2]);
    (values[second], errors[second]) = (factor[0] * ratio, factor[1] * ratio);
    Ok(FormFactors { values, errors, areas, area_errors, sampled, is_from_b })
}

#[cfg(test)]
#[path = "between_tests.rs"]
mod tests;
