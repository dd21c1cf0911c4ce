//! Positions are read as `f64` and stored as `f32`. If they are so far from zero that `f32` rounding would be visible,
//! they are offsets from an origin of the file. An example is survey coordinates of millions with details of
//! millimetres.

use super::concat::concat;
use canaletto_parallel::prelude::*;
use glam::{DVec3, Vec3};
use std::borrow::Cow;

/// Positions are far from zero if their largest coordinate is more than this multiple of the size of their bounding
/// box. Rounding to `f32` then loses more than 2⁻²² of that size.
const FAR: f64 = 8.0;

/// The positions of a file or of a part of it: the rounded values and the rounding errors. The errors are dropped where
/// they have no use.
#[derive(Default)]
pub(super) struct Positions {
    rounded: Vec<Vec3>,
    /// The rounding errors: empty, or one for each position.
    rest: Vec<Vec3>,
}

/// The bounding box of the finite points.
pub(super) struct Bounds {
    min: DVec3,
    max: DVec3,
}

impl Bounds {
    pub(super) fn of(points: &[Vec3]) -> Bounds {
        let nothing = || (Vec3::INFINITY, Vec3::NEG_INFINITY);
        let (min, max) = points
            .par_iter()
            .map(|p| if p.is_finite() { (*p, *p) } else { nothing() })
            .reduce(nothing, |a, b| (a.0.min(b.0), a.1.max(b.1)));
        Bounds { min: min.as_dvec3(), max: max.as_dvec3() }
    }

    /// The length of the box's diagonal; infinite without points.
    pub(super) fn diagonal(&self) -> f32 {
        (self.max - self.min).as_vec3().length()
    }

    pub(super) fn size(&self) -> f64 {
        (self.max - self.min).max_element()
    }

    /// The largest absolute coordinate.
    pub(super) fn largest(&self) -> f64 {
        self.min.abs().max(self.max.abs()).max_element()
    }

    /// Whether the largest coordinate is more than `times` the size.
    pub(super) fn is_far(&self, times: f64) -> bool {
        self.largest() > times * self.size()
    }

    /// The centre, rounded to a grid of about the size. Coordinates near zero therefore have the origin zero.
    fn origin(&self) -> DVec3 {
        let middle = (self.min + self.max) * 0.5;
        // A single point is its own origin.
        let step = if self.size() > 0.0 { libm::exp2(libm::ceil(libm::log2(self.size()))) } else { return middle };
        (middle / step).round() * step
    }
}

/// The origin of exact points, and the points as offsets from it; see [`Positions::rebase`].
pub(crate) fn counted(points: impl Iterator<Item = DVec3>) -> (DVec3, Vec<Vec3>) {
    let mut positions = Positions::default();
    points.for_each(|p| positions.push(p.as_vec3(), p));
    positions.rebase()
}

impl Positions {
    /// Positions from lists that were filled elsewhere: rounded values, and rounding errors, which may be empty.
    pub(super) fn from_parts(rounded: Vec<Vec3>, rest: Vec<Vec3>) -> Positions {
        debug_assert!(rest.is_empty() || rest.len() == rounded.len());
        Positions { rounded, rest }
    }

    pub(super) fn len(&self) -> usize {
        self.rounded.len()
    }

    /// Adds a position, rounded to `f32` and in `f64`.
    #[inline]
    pub(super) fn push(&mut self, rounded: Vec3, exact: DVec3) {
        let rest = (exact - rounded.as_dvec3()).as_vec3();
        if rest != Vec3::ZERO || !self.rest.is_empty() {
            self.rest.resize(self.rounded.len(), Vec3::ZERO);
            self.rest.push(rest);
        }
        self.rounded.push(rounded);
    }

    /// Adds a position that isn't finite. It stays NaN and doesn't affect the others.
    pub(super) fn push_non_finite(&mut self) {
        self.rounded.push(Vec3::NAN);
        if !self.rest.is_empty() {
            self.rest.push(Vec3::ZERO);
        }
    }

    /// Drops the rounding errors of a part of a file if its positions can't be [`FAR`] from zero, since the bounding
    /// box of the whole is larger.
    pub(super) fn part(mut self) -> Positions {
        if !self.rest.is_empty() && !Bounds::of(&self.rounded).is_far(FAR / 2.0) {
            self.rest = Vec::new();
        }
        self
    }

    /// Appends other positions.
    pub(super) fn append(&mut self, mut other: Positions) {
        if !self.rest.is_empty() || !other.rest.is_empty() {
            self.rest.resize(self.rounded.len(), Vec3::ZERO);
            other.rest.resize(other.rounded.len(), Vec3::ZERO);
            self.rest.append(&mut other.rest);
        }
        self.rounded.append(&mut other.rounded);
    }

    /// The origin, and the positions as offsets from it. The origin is zero unless the positions are far from zero and
    /// rounding lost something.
    pub(super) fn rebase(self) -> (DVec3, Vec<Vec3>) {
        Positions::rebase_all(vec![self])
    }

    /// As [`Positions::rebase`], for the parts of a file, which are concatenated.
    pub(super) fn rebase_all(parts: Vec<Positions>) -> (DVec3, Vec<Vec3>) {
        let (origin, lists) = Positions::rebase_each(parts);
        (origin, concat(lists))
    }

    /// As [`Positions::rebase`], for the meshes of a file, which share one origin.
    pub(super) fn rebase_each(mut parts: Vec<Positions>) -> (DVec3, Vec<Vec<Vec3>>) {
        let mut origin = DVec3::ZERO;
        if parts.iter().any(|part| !part.rest.is_empty()) {
            let mut all = Bounds { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY };
            for part in &parts {
                let Bounds { min, max } = Bounds::of(&part.rounded);
                (all.min, all.max) = (all.min.min(min), all.max.max(max));
            }
            if all.is_far(FAR) {
                origin = all.origin();
                parts.iter_mut().for_each(|part| part.move_to(origin));
            }
        }
        (origin, parts.into_iter().map(|part| part.rounded).collect())
    }

    /// The positions up to a translation, for tests of shape: relative to the first one if they are [`FAR`] from zero.
    pub(super) fn form(&self) -> Cow<'_, [Vec3]> {
        if self.rest.is_empty() || !Bounds::of(&self.rounded).is_far(FAR) {
            return Cow::Borrowed(&self.rounded);
        }
        let exact = |i: usize| self.rounded[i].as_dvec3() + self.rest[i].as_dvec3();
        Cow::Owned((0..self.len()).map(|i| (exact(i) - exact(0)).as_vec3()).collect())
    }

    fn move_to(&mut self, origin: DVec3) {
        let offset = |p: Vec3, rest: Vec3| (p.as_dvec3() - origin + rest.as_dvec3()).as_vec3();
        if self.rest.is_empty() {
            self.rounded.par_iter_mut().for_each(|p| *p = offset(*p, Vec3::ZERO));
        } else {
            self.rounded.par_iter_mut().zip(&self.rest).for_each(|(p, rest)| *p = offset(*p, *rest));
        }
        self.rest = Vec::new();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn positions(list: &[DVec3]) -> Positions {
        let mut positions = Positions::default();
        list.iter().for_each(|p| positions.push(p.as_vec3(), *p));
        positions
    }

    const SURVEY: [DVec3; 3] = [
        DVec3::new(408201.58, 102.4, -4080928.02),
        DVec3::new(408204.58, 102.57, -4080928.32),
        DVec3::new(408201.0, 103.0, -4080926.25),
    ];

    #[test]
    fn survey_coordinates_keep_their_digits() {
        let (origin, offsets) = positions(&SURVEY).rebase();
        assert_eq!(origin.y, 104.0);
        for (offset, exact) in offsets.iter().zip(SURVEY) {
            assert!((origin + offset.as_dvec3() - exact).length() < 2e-7, "{origin} {offset} {exact}");
        }
    }

    #[test]
    fn parts_of_a_file_have_one_origin() {
        let parts = || SURVEY.iter().map(|p| positions(&[*p]).part());
        let mut appended = Positions::default();
        parts().for_each(|part| appended.append(part));
        let whole = positions(&SURVEY).rebase();
        assert_eq!(Positions::rebase_all(parts().collect()), whole);
        assert_eq!(appended.rebase(), whole);
    }

    #[test]
    fn positions_near_zero_are_rounded_as_they_are() {
        let near = [DVec3::new(0.1, 0.2, 0.3), DVec3::new(10.1, 63.0, -7.7)];
        let rounded: Vec<Vec3> = near.iter().map(|p| p.as_vec3()).collect();
        assert_eq!(positions(&near).rebase(), (DVec3::ZERO, rounded));
        // Rounding loses nothing here.
        let whole = [DVec3::new(4e6, 1.0, 0.0), DVec3::new(4e6, 2.0, 0.0)];
        let rounded: Vec<Vec3> = whole.iter().map(|p| p.as_vec3()).collect();
        assert_eq!(positions(&whole).rebase(), (DVec3::ZERO, rounded));
    }
}
