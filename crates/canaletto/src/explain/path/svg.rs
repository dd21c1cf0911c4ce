//! A path as a drawing: its rays one below the other, with the shadow rays to sampled lights.

use super::{PathRay, PathStep, PathTree};
use crate::explain::drawing::DrawnRay;
use crate::explain::outside::OutsideView;
use crate::explain::tree_svg::drawing;
use crate::math::Rgb;

impl PathTree {
    /// The path of the sample with an index as SVG, or of the one nearest to the pixel's colour. `levels` is the number
    /// of rays. Beside it stands the scene from outside, if a view is given with the address of its picture.
    pub fn svg(
        &self,
        chosen: Option<usize>,
        levels: Option<u32>,
        outside: Option<(&OutsideView, &str)>,
    ) -> Option<String> {
        let sample = self.samples.get(chosen.or_else(|| self.nearest_to_mean())?)?;
        let [x, y] = self.pixel;
        let title = format!("pixel ({x}, {y}), path {} of {}", sample.number, self.samples.len());
        Some(drawing(&DrawnRay::of_path(sample, levels)?, &title, outside))
    }
}

impl PathRay {
    /// The light that the path finds at the end of the ray.
    pub(in crate::explain) fn contributions(&self) -> Rgb {
        let mut sum = Rgb::BLACK;
        for step in &self.steps {
            match step {
                PathStep::Found { contribution, .. } | PathStep::Overlay { contribution, .. } => sum += *contribution,
                PathStep::Sampled(node) => sum += node.contribution,
                _ => {}
            }
        }
        sum
    }
}
