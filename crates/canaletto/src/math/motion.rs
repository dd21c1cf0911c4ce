//! Motion between poses while a shutter is open. Objects move evenly from pose to pose, and turn; a linear blend of
//! matrices would shrink them.
//!
//! A pose is decomposed into translation, rotation and stretch (polar decomposition; Shoemake & Duff, *Matrix Animation
//! and Polar Decomposition*, 1992). Translation and stretch change linearly. The rotation turns by the smaller angle
//! around one axis with constant speed, as slerp does. Blends of two stretches of one sign are invertible, so that no
//! time between two poses flattens the object.

use super::Transform;
use glam::{DAffine3, DMat3, DQuat, DVec3};

/// A path through poses that are evenly spaced over the times 0 to 1.
#[derive(Clone, Debug, PartialEq)]
pub struct AnimatedTransform {
    segments: Vec<Segment>,
}

/// The motion from one pose to the next.
#[derive(Clone, Debug, PartialEq)]
struct Segment {
    translation: [DVec3; 2],
    /// The rotation at the start.
    rotation: DMat3,
    /// The axis and the angle in radians of the turn, if there is one.
    turn: Option<(DVec3, f64)>,
    stretch: [DMat3; 2],
    /// The inverse of the stretch, where it is constant.
    inverse: Option<DMat3>,
}

/// The reason why poses make no path.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum AnimatedTransformError {
    /// A path needs at least two poses.
    #[error("a motion needs at least 2 poses, one at each end of the time that the shutter is open")]
    TooFew,
    /// A pose between a mirrored and an unmirrored one would be flat.
    #[error("a motion can't mirror: between a pose and its mirror image the object would be flat")]
    Mirrors,
    /// A pose can't be decomposed.
    #[error("a pose of the motion scales so differently along its axes that its rotation can't be found")]
    Degenerate,
}

/// The parts of a decomposed pose.
struct Parts {
    translation: DVec3,
    rotation: DMat3,
    stretch: DMat3,
    mirrored: bool,
}

impl AnimatedTransform {
    /// The path through these poses.
    ///
    /// # Errors
    /// [`AnimatedTransformError`] if there are fewer than two, or if no path leads from one to the next.
    pub fn new(poses: &[Transform]) -> Result<AnimatedTransform, AnimatedTransformError> {
        if poses.len() < 2 {
            return Err(AnimatedTransformError::TooFew);
        }
        let parts = poses.iter().map(|pose| decompose(pose.matrix())).collect::<Result<Vec<_>, _>>()?;
        if parts.windows(2).any(|pair| pair[0].mirrored != pair[1].mirrored) {
            return Err(AnimatedTransformError::Mirrors);
        }
        Ok(AnimatedTransform { segments: parts.windows(2).map(|pair| Segment::between(&pair[0], &pair[1])).collect() })
    }

    /// The pose at a time in 0..=1; times outside are clamped.
    pub fn at(&self, time: f64) -> Transform {
        let n = self.segments.len();
        let x = time.clamp(0.0, 1.0) * n as f64;
        let index = (x as usize).min(n - 1);
        self.segments[index].at(x - index as f64)
    }

    /// The bounds, as centre and half size, of all positions of a moving box with this centre and half size.
    ///
    /// Each segment is cut into short turns. Between the ends of a turn no point deviates from its chord by more than
    /// |x''| Δ²/8.
    pub fn swept(&self, center: DVec3, half: DVec3) -> (DVec3, DVec3) {
        /// The largest turn in radians: a thirtieth of a half turn.
        const STEP: f64 = std::f64::consts::PI / 30.0;
        let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let reach = center.abs() + half;
        for segment in &self.segments {
            let angle = segment.turn.map_or(0.0, |(_, angle)| angle);
            let steps = libm::ceil(angle / STEP).max(1.0);
            // x = T + R S p, so that x'' = R'' S p + 2 R' S' p: T and S are linear.
            let size = |m: DMat3| m.to_cols_array().iter().map(|e| e * e).sum::<f64>().sqrt();
            let [a, b] = segment.stretch;
            let acceleration = angle * (angle * size(a).max(size(b)) + 2.0 * size(b - a)) * reach.length();
            let pad = acceleration / (8.0 * steps * steps) * (1.0 + 1e-9);
            for i in 0..=steps as u32 {
                let (c, h) = around(&segment.at(f64::from(i) / steps), center, half);
                min = min.min(c - h - pad);
                max = max.max(c + h + pad);
            }
        }
        let (center, half) = ((min + max) * 0.5, (max - min) * 0.5);
        (center, half + (center.abs() + half) * 1e-12)
    }
}

/// The box around a moved box.
fn around(t: &Transform, center: DVec3, half: DVec3) -> (DVec3, DVec3) {
    let m = t.matrix().matrix3;
    (t.point(center), m.x_axis.abs() * half.x + m.y_axis.abs() * half.y + m.z_axis.abs() * half.z)
}

impl Segment {
    fn between(a: &Parts, b: &Parts) -> Segment {
        let q = DQuat::from_mat3(&(b.rotation * a.rotation.transpose()));
        // Of the two quaternions of a rotation the one with w ≥ 0 has the smaller angle.
        let q = if q.w < 0.0 { -q } else { q };
        let v = DVec3::new(q.x, q.y, q.z);
        let sin = v.length();
        let turns = a.rotation != b.rotation && sin > 0.0;
        let turn = turns.then(|| (v / sin, 2.0 * libm::atan2(sin, q.w)));
        let stays = a.stretch == b.stretch;
        Segment {
            translation: [a.translation, b.translation],
            rotation: a.rotation,
            turn,
            stretch: [a.stretch, b.stretch],
            inverse: stays.then(|| a.stretch.inverse()),
        }
    }

    /// The pose at the fraction `f` in 0..=1 of the segment.
    fn at(&self, f: f64) -> Transform {
        let [from, to] = self.translation;
        let translation = from + (to - from) * f;
        let rotation = match self.turn {
            Some((axis, angle)) => rotation(axis, angle * f) * self.rotation,
            None => self.rotation,
        };
        let [a, b] = self.stretch;
        let (stretch, inverse) = match self.inverse {
            Some(inverse) => (a, inverse),
            None => {
                let stretch = a * (1.0 - f) + b * f;
                (stretch, stretch.inverse())
            }
        };
        let back = inverse * rotation.transpose();
        Transform::from_parts(
            DAffine3 { matrix3: rotation * stretch, translation },
            DAffine3 { matrix3: back, translation: -(back * translation) },
        )
    }
}

/// The rotation around a unit axis by an angle in radians (Rodrigues).
fn rotation(axis: DVec3, angle: f64) -> DMat3 {
    let (sin, cos) = libm::sincos(angle);
    let (a, s) = (axis * (1.0 - cos), axis * sin);
    DMat3::from_cols(
        DVec3::new(cos, s.z, -s.y) + a * axis.x,
        DVec3::new(-s.z, cos, s.x) + a * axis.y,
        DVec3::new(s.y, -s.x, cos) + a * axis.z,
    )
}

/// M = T R S: the rotation nearest to M by Newton's iteration R ← (R + R⁻ᵀ)/2 (Higham 1986).
fn decompose(m: &DAffine3) -> Result<Parts, AnimatedTransformError> {
    let linear = m.matrix3;
    let determinant = linear.determinant();
    let mirrored = determinant < 0.0;
    let sign = if mirrored { -1.0 } else { 1.0 };
    let mut r = linear * (sign / libm::cbrt(determinant.abs()));
    for _ in 0..100 {
        let next = (r + r.inverse().transpose()) * 0.5;
        let change = (next - r).to_cols_array().iter().map(|e| e.abs()).fold(0.0, f64::max);
        r = next;
        if change <= 1e-15 {
            break;
        }
    }
    let off = (r * r.transpose() - DMat3::IDENTITY).to_cols_array().iter().map(|e| e.abs()).fold(0.0, f64::max);
    if !r.is_finite() || off > 1e-9 {
        return Err(AnimatedTransformError::Degenerate);
    }
    let s = r.transpose() * linear;
    let stretch = (s + s.transpose()) * 0.5;
    Ok(Parts { translation: m.translation, rotation: r, stretch, mirrored })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn poses() -> [Transform; 3] {
        let turned = |axis, degrees| Transform::rotate(axis, degrees).unwrap();
        let scaled = |x, y, z| Transform::scale(DVec3::new(x, y, z)).unwrap();
        [
            Transform::translate(DVec3::new(1.0, 2.0, 3.0)).after(&scaled(2.0, 1.0, 0.5)),
            turned(DVec3::new(1.0, 1.0, 0.2), 170.0).after(&scaled(1.0, 3.0, 1.0)).after(&turned(DVec3::X, 30.0)),
            Transform::translate(DVec3::new(-4.0, 0.0, 0.0)).after(&turned(DVec3::Z, -100.0)),
        ]
    }

    fn differ(a: &Transform, b: &Transform) -> f64 {
        [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z].map(|p| (a.point(p) - b.point(p)).length()).into_iter().sum()
    }

    #[test]
    fn paths_go_through_their_poses() {
        let path = AnimatedTransform::new(&poses()).unwrap();
        for (pose, time) in poses().iter().zip([0.0, 0.5, 1.0]) {
            assert!(differ(&path.at(time), pose) < 1e-13, "{time}");
        }
        for i in 0..100 {
            let pose = path.at(f64::from(i) / 99.0);
            let p = DVec3::new(0.3, -2.0, 5.0);
            assert!((pose.inverse().point(pose.point(p)) - p).length() < 1e-12);
        }
    }

    #[test]
    fn turns_are_even_and_keep_lengths() {
        let path = AnimatedTransform::new(&[Transform::IDENTITY, Transform::rotate(DVec3::Y, 120.0).unwrap()]).unwrap();
        for i in 0..=12 {
            let f = f64::from(i) / 12.0;
            assert!(differ(&path.at(f), &Transform::rotate(DVec3::Y, 120.0 * f).unwrap()) < 1e-14);
        }
        // The smaller angle: 270° is 90° backwards.
        let path = AnimatedTransform::new(&[Transform::IDENTITY, Transform::rotate(DVec3::Y, 270.0).unwrap()]).unwrap();
        assert!(differ(&path.at(0.5), &Transform::rotate(DVec3::Y, -45.0).unwrap()) < 1e-14);
    }

    #[test]
    fn moves_are_exact() {
        let path =
            AnimatedTransform::new(&[Transform::IDENTITY, Transform::translate(DVec3::new(3.0, 0.0, -1.0))]).unwrap();
        assert_eq!(path.at(0.25), Transform::translate(DVec3::new(0.75, 0.0, -0.25)));
        assert_eq!((path.at(-1.0), path.at(0.0)), (Transform::IDENTITY, Transform::IDENTITY));
    }

    #[test]
    fn what_makes_no_path_says_why() {
        let mirror = Transform::scale(DVec3::new(-1.0, 1.0, 1.0)).unwrap();
        assert_eq!(AnimatedTransform::new(&[mirror]), Err(AnimatedTransformError::TooFew));
        assert_eq!(AnimatedTransform::new(&[mirror, Transform::IDENTITY]), Err(AnimatedTransformError::Mirrors));
        let path = AnimatedTransform::new(&[mirror, Transform::translate(DVec3::X).after(&mirror)]).unwrap();
        assert!(differ(&path.at(0.5), &Transform::translate(DVec3::X * 0.5).after(&mirror)) < 1e-15);
        let needle = Transform::scale(DVec3::new(1e-160, 1e160, 1.0)).unwrap();
        assert_eq!(AnimatedTransform::new(&[needle, needle]), Err(AnimatedTransformError::Degenerate));
    }

    /// Compares points of the box at many times with its swept bounds: all are inside, and the bounds are not much
    /// larger.
    #[test]
    fn swept_bounds_hold_the_box_at_all_times() {
        let (center, half) = (DVec3::new(0.5, -1.0, 2.0), DVec3::new(0.5, 0.25, 1.0));
        let path = AnimatedTransform::new(&poses()).unwrap();
        let (c, h) = path.swept(center, half);
        let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for i in 0..=5000 {
            let pose = path.at(f64::from(i) / 5000.0);
            for corner in 0..8 {
                let sign = |bit: u32| if corner >> bit & 1 == 0 { -1.0 } else { 1.0 };
                let p = pose.point(center + half * DVec3::new(sign(0), sign(1), sign(2)));
                (min, max) = (min.min(p), max.max(p));
            }
        }
        assert!((c - h).cmple(min).all() && (c + h).cmpge(max).all(), "{:?} {:?}", (c - h, c + h), (min, max));
        assert!((h * 2.0).cmple((max - min) * 1.05).all(), "{h} {}", (max - min) / 2.0);
    }
}
