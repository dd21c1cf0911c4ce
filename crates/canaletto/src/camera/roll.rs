//! The roll of a camera whose view direction is along its own `up`, where (5.3b) is undefined.

use super::axes;
use crate::scene::Extrinsics;
use glam::DVec3;

/// Returns `place` with an `up` that continues the roll of `before`. The picture's upward side of `before` is turned by
/// the smallest rotation that maps the old optical axis to the new one. Returns `None` if either place has no optical
/// axis, or if `before` has no roll itself.
pub fn continue_roll(place: &Extrinsics, before: &Extrinsics) -> Option<Extrinsics> {
    let [_, upwards, backwards] = axes(*before).ok()?;
    let z = (place.eye - place.center).try_normalize()?;
    Some(Extrinsics { up: turned(upwards, backwards, z), ..*place })
}

/// Whether (5.3) defines a roll for the place.
pub fn has_roll(place: &Extrinsics) -> bool {
    axes(*place).is_ok()
}

/// Whether the roll of `place` differs by a quarter turn or more from the one that [`continue_roll`] gives it.
pub fn flips_roll(place: &Extrinsics, before: &Extrinsics) -> bool {
    match (axes(*place), continue_roll(place, before).map(axes)) {
        (Ok([_, own, _]), Some(Ok([_, continued, _]))) => own.dot(continued) <= 0.0,
        _ => false,
    }
}

/// The vector `v` after the smallest rotation that maps unit vector `from` to unit vector `to`. It is Rodrigues'
/// formula, with the sine and the cosine from the products of both vectors.
fn turned(v: DVec3, from: DVec3, to: DVec3) -> DVec3 {
    let (axis, cos) = (from.cross(to), from.dot(to));
    if cos <= -1.0 {
        // A half turn around `v`, which is perpendicular to `from`.
        return v;
    }
    v + axis.cross(v) + axis.cross(axis.cross(v)) / (1.0 + cos)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(eye: DVec3) -> Extrinsics {
        Extrinsics { eye, center: DVec3::ZERO, up: DVec3::Y }
    }

    #[test]
    fn the_roll_is_that_of_the_place_before() {
        let before = at(DVec3::new(0.0, 8.0, 1.0));
        let above = at(DVec3::new(0.0, 8.0, 0.0));
        assert!(!has_roll(&above));
        let kept = continue_roll(&above, &before).unwrap();
        // The camera comes from +z and faces down, so that up in the picture is -z.
        assert!((kept.up - DVec3::NEG_Z).length() < 1e-12, "{}", kept.up);
        assert!(has_roll(&kept));
        assert_eq!(continue_roll(&before, &above), None);
    }

    #[test]
    fn the_way_over_the_pole_flips() {
        let (before, after) = (at(DVec3::new(0.0, 8.0, 1.0)), at(DVec3::new(0.0, 8.0, -1.0)));
        assert!(flips_roll(&after, &before));
        assert!(!flips_roll(&at(DVec3::new(0.1, 8.0, 1.1)), &before));
        let kept = continue_roll(&after, &before).unwrap();
        assert!(!flips_roll(&kept, &before));
    }

    #[test]
    fn the_smallest_turn_takes_one_axis_to_the_other() {
        let (from, to) = (DVec3::new(1.0, 2.0, 3.0).normalize(), DVec3::new(-2.0, 0.5, 1.0).normalize());
        assert!((turned(from, from, to) - to).length() < 1e-14);
        let across = from.cross(to);
        assert!((turned(across, from, to) - across).length() < 1e-14, "the axis of the turn stays");
        assert_eq!(turned(DVec3::Y, DVec3::X, DVec3::NEG_X), DVec3::Y);
    }
}
