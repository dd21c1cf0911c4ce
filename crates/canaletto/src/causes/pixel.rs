//! The verdict on one pixel: which cause alone closes most of its difference.

use super::Cause;
use super::terms::{Comparison, TermDifferences, surfaces};
use crate::camera::Camera;
use crate::explain::PixelTree;
use crate::film::Developer;
use crate::math::Rgb;
use glam::DVec3;

/// The cause of one pixel's difference.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PixelCause {
    pub(super) cause: Cause,
    pub(super) steps: f64,
    /// The causes with the share of the difference that each closes alone, largest first.
    pub(super) shares: Vec<(Cause, f64)>,
    pub(super) object: Option<String>,
    pub(super) other_object: Option<String>,
    pub(super) light: Option<String>,
}

impl PixelCause {
    pub(super) fn unexplained(steps: f64) -> PixelCause {
        let (cause, shares) = (Cause::Unexplained, Vec::new());
        PixelCause { cause, steps, shares, object: None, other_object: None, light: None }
    }
}

/// The share of a difference that may stay open if one cause is to explain it.
const OPEN: f64 = 0.25;

/// What decides whether pixels differ, and why.
pub(super) struct Judge<'a> {
    pub(super) developer: Developer,
    /// The difference in steps of 8 bits up to which components are equal.
    pub(super) tolerance: f64,
    /// The camera in the scene's coordinates.
    pub(super) camera: &'a Camera,
    /// The distance in pixels between a curved surface and the triangles that the other method draws for it.
    pub(super) tolerance_of_other: f64,
}

impl Judge<'_> {
    /// A colour as the display shows it, in steps of 8 bits.
    fn shown(&self, color: DVec3) -> DVec3 {
        let mut values = [color.as_vec3().to_array()];
        self.developer.develop(&mut values);
        DVec3::from_array(values[0].map(f64::from)) * 255.0
    }

    /// The largest difference of two colours' components in steps of 8 bits, if they differ.
    pub(super) fn difference(&self, [reference, other]: [Rgb; 2]) -> Option<f64> {
        if reference == other {
            return None;
        }
        let steps = (self.shown(wide(reference)) - self.shown(wide(other))).abs().max_element();
        (steps > self.tolerance).then_some(steps)
    }

    /// The cause of the difference of two colours. The trees are the reference's, the reference's at the other method's
    /// places, and the other method's.
    pub(super) fn cause(&self, trees: [&PixelTree; 3], colors: [Rgb; 2], steps: f64) -> PixelCause {
        let [tree, at_places, other] = trees;
        let [reference_color, other_color] = colors.map(wide);
        let mut terms = TermDifferences::default();
        if !std::ptr::eq(tree, at_places) {
            let cause = match surfaces([tree, at_places]) {
                seen if seen.len() > 1 => Cause::Edge,
                seen if seen.iter().any(|seen| seen.is_textured) => Cause::TextureFilter,
                _ => Cause::Sampling,
            };
            terms.add_pixel(cause, wide(at_places.color) - wide(tree.color), [tree, at_places]);
        }
        Comparison { camera: self.camera, tolerance: self.tolerance_of_other }.compare([at_places, other], &mut terms);
        let target = self.shown(other_color);
        let open = |difference: DVec3| (self.shown(reference_color + difference) - target).length();
        let whole = open(DVec3::ZERO).max(f64::MIN_POSITIVE);
        let mut shares: Vec<(Cause, f64)> = terms
            .causes()
            .map(|(cause, difference)| (cause, 1.0 - open(difference) / whole))
            .filter(|(_, share)| *share > 0.0)
            .collect();
        shares.sort_by(|a, b| b.1.total_cmp(&a.1));
        let is_closed = |share: f64| 1.0 - share <= OPEN || whole * (1.0 - share) <= self.tolerance;
        let all = 1.0 - open(terms.causes().map(|(_, difference)| difference).sum()) / whole;
        let cause = match shares.first() {
            _ if !is_closed(all) => Cause::Unexplained,
            Some((cause, share)) if is_closed(*share) => *cause,
            // Also where differences of several causes close nothing alone.
            _ => Cause::Several,
        };
        let subject = shares.first().and_then(|(cause, _)| terms.subject(*cause));
        let owned = |name: Option<&str>| name.map(str::to_owned);
        PixelCause {
            cause,
            steps,
            shares,
            object: subject.and_then(|subject| owned(subject.object)),
            other_object: subject.and_then(|subject| owned(subject.other_object)),
            light: subject.and_then(|subject| owned(subject.light)),
        }
    }
}

/// A colour in double precision.
pub(super) fn wide(color: Rgb) -> DVec3 {
    DVec3::from_array(color.to_array().map(f64::from))
}
