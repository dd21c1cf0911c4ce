//! The form factors between two surfaces of a world, by the best method for them or by a chosen one.

use super::average_hemicube::{AverageHemicube, AverageHemicubeSettings, average_hemicube};
use super::sampled::{SampleSettings, SampledFormFactor, SamplingProgress, Side, sample, sampled_area};
use super::unoccluded::Unoccluded;
use crate::world::{ObjectSurface, World};
use canaletto_bvh::NoThreads;
use std::ops::ControlFlow;

/// How a form factor is computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FormFactorMethod {
    /// The exact factor where it is known, else rays.
    #[default]
    Auto,
    /// The exact factor of polygons in full view of each other.
    Analytic,
    /// Rays alone, without the exact factor of polygons as if nothing were in between.
    Sampled,
    /// Hemicubes at points of A.
    Hemicube,
}

crate::named!(FormFactorMethod {
    Auto => "auto": "The exact factor where it is known, else rays",
    Analytic => "analytic": "The exact factor; flat surfaces in full view of each other have one",
    Sampled => "sampled": "Rays alone, also where an exact factor is known",
    Hemicube => "hemicube": "Pictures of the scene, drawn with a z-buffer from points of A",
});

/// The settings of [`form_factors`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FormFactorSettings {
    /// The method.
    pub method: FormFactorMethod,
    /// The settings of rays.
    pub sampling: SampleSettings,
    /// The settings of hemicubes.
    pub hemicubes: AverageHemicubeSettings,
}

/// How far a method has come.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum FormFactorProgress {
    /// Of rays.
    Rays(SamplingProgress),
    /// The points with hemicubes so far.
    Hemicubes(u32),
}

/// The form factors between two surfaces A and B.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct FormFactors {
    /// The factors from A to B and from B to A.
    pub values: [f64; 2],
    /// Their errors: standard errors of rays, estimates of hemicubes, or else bounds.
    pub errors: [f64; 2],
    /// The areas of A and B, all counted sides; infinite with planes.
    pub areas: [f64; 2],
    /// The standard errors of the areas.
    pub area_errors: [f64; 2],
    /// The factor in the direction that was sampled, if the factors are of rays.
    pub sampled: Option<SampledFormFactor>,
    /// The factor from A to B by hemicubes, if the factors are of them.
    pub hemicubes: Option<AverageHemicube>,
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
    /// The exact factor isn't known.
    #[error("no exact factor is known: a surface is curved, has holes or many triangles, or something is in between")]
    NotAnalytic,
    /// Sampling needs threads that can't be started.
    #[error(transparent)]
    NoThreads(#[from] NoThreads),
}

impl FormFactors {
    /// Whether the method was cancelled.
    pub fn is_cancelled(&self) -> bool {
        self.sampled.as_ref().is_some_and(|sampled| sampled.cancelled) || self.hemicubes.is_some_and(|h| h.cancelled)
    }
}

/// The form factors between two surfaces, each with the sides that count.
///
/// With [`FormFactorMethod::Auto`], triangles and boxes in full view of each other have the exact factor. Otherwise
/// rays are sampled from the smaller surface until the factor from A to B has the standard error of the settings, or
/// the rays are used up, or `progress` breaks. All surfaces are opaque, but holes are open; see
/// [`super::sample_form_factor`] and [`super::average_hemicube`].
///
/// # Errors
/// See [`FormFactorError`].
pub fn form_factors(
    world: &World,
    a: (&ObjectSurface, Side),
    b: (&ObjectSurface, Side),
    settings: &FormFactorSettings,
    progress: &(dyn Fn(&FormFactorProgress) -> ControlFlow<()> + Sync),
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
    let method = settings.method;
    // Rays from the smaller surface arrive more often.
    let is_from_b = areas[1] < areas[0] && method != FormFactorMethod::Hemicube;
    let (first, second) = if is_from_b { (1, 0) } else { (0, 1) };
    let (from, to) = (surfaces[first], surfaces[second]);
    let needs_exact = matches!(method, FormFactorMethod::Auto | FormFactorMethod::Analytic);
    let unoccluded = if needs_exact { Unoccluded::between(world, from, to) } else { None };
    let (mut sampled, mut hemicubes) = (None, None);
    let factor = match &unoccluded {
        Some(exact) if exact.is_full_view => [exact.factor.value, exact.factor.error],
        _ if method == FormFactorMethod::Analytic => return Err(FormFactorError::NotAnalytic),
        _ if method == FormFactorMethod::Hemicube => {
            let report = |points| progress(&FormFactorProgress::Hemicubes(points));
            let average = average_hemicube(world, from, to, &settings.hemicubes, &report)?;
            hemicubes = Some(average);
            [average.value, average.error()]
        }
        _ => {
            let ratio = if is_from_b { areas[0] / areas[1] } else { 1.0 };
            let own = settings.sampling;
            let own = SampleSettings { standard_error: own.standard_error * ratio, ..own };
            let report = |state: &SamplingProgress| progress(&FormFactorProgress::Rays(*state));
            let found = sample(world, from, to, unoccluded.as_ref(), &own, &report)?;
            (areas[first], area_errors[first]) = (found.area, found.area_error);
            let factor = [found.value, found.standard_error];
            sampled = Some(found);
            factor
        }
    };
    for index in [first, second] {
        let is_known = hemicubes.is_none() && (sampled.is_none() || index == first);
        if !is_known && !surfaces[index].0.is_exact() && areas[index].is_finite() {
            [areas[index], area_errors[index]] = sampled_area(world, surfaces[index], settings.sampling.seed);
        }
    }
    // A F(A→B) = B F(B→A).
    let ratio = areas[first] / areas[second];
    let (mut values, mut errors) = ([factor[0]; 2], [factor[1]; 2]);
    (values[second], errors[second]) = (factor[0] * ratio, factor[1] * ratio);
    Ok(FormFactors { values, errors, areas, area_errors, sampled, hemicubes, is_from_b })
}

#[cfg(test)]
mod tests;
