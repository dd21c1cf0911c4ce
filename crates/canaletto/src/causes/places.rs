//! The places at which a rasteriser takes its samples.

use crate::explain::PixelTree;

/// The places of a rasteriser's samples with their weights; none if the method traces rays.
pub(super) fn of_raster(tree: &PixelTree) -> Option<Vec<([f64; 2], f64)>> {
    let mut places: Vec<([f64; 2], f64)> = Vec::new();
    for sample in &tree.samples {
        sample.raster.as_ref()?;
        match places.iter_mut().find(|(place, _)| *place == sample.position) {
            Some((_, weight)) => *weight += sample.weight,
            None => places.push((sample.position, sample.weight)),
        }
    }
    Some(places)
}

/// Whether the samples of a ray tracer have these places, without a lens and at rest.
pub(super) fn are_of(places: &[([f64; 2], f64)], tree: &PixelTree) -> bool {
    let is_plain = |time: Option<f64>, lens: Option<[f64; 2]>| time.is_none() && lens.is_none();
    places.len() == tree.samples.len()
        && places
            .iter()
            .zip(&tree.samples)
            .all(|((place, _), sample)| *place == sample.position && is_plain(sample.time, sample.lens))
}
