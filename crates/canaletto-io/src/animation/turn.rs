//! Interpolation of rotations between keys, in the shorter direction.
//!
//! Between two keys the rotation turns uniformly around one axis (slerp: K. Shoemake, "Animating rotation with
//! quaternion curves", SIGGRAPH 1985). Through several keys it follows the pyramid of Barry and Goldman with slerp in
//! place of straight lines (J. Schlag, "Using geometric constructions to interpolate orientation with quaternions",
//! Graphics Gems II, 1991). This is the Catmull-Rom spline of rotations, for keys at any times. At the ends the missing
//! neighbour is extrapolated uniformly, so that two keys alone make a plain slerp.

use super::curve::Curve;
use glam::{DQuat, DVec3};

/// The rotation of a curve at a time; the four numbers of its keys are a quaternion x y z w. At a key it is exactly
/// that of the key.
pub(crate) fn turned(curve: &Curve, time: f64) -> DQuat {
    let (index, u) = curve.place(time);
    let quat = |i: usize| curve.keys().get(i).map_or(DQuat::IDENTITY, |key| DQuat::from_slice(&key.values));
    let time_of = |i: usize| curve.keys()[i].time;
    let (b, c) = (quat(index), if u == 0.0 { quat(index) } else { quat(index + 1) });
    let ease = curve.keys()[index].ease;
    if u == 0.0 {
        return b;
    }
    if let Some(share) = ease.share(u) {
        return slerp(b, c, share);
    }
    let c = near(b, c);
    let (before, after) = curve.same_way(index);
    let (tb, tc) = (time_of(index), time_of(index + 1));
    let (a, ta) =
        if before { (near(b, quat(index - 1)), time_of(index - 1)) } else { (slerp(b, c, -1.0), 2.0 * tb - tc) };
    let (d, td) =
        if after { (near(c, quat(index + 2)), time_of(index + 2)) } else { (slerp(c, b, -1.0), 2.0 * tc - tb) };
    let t = tb + (tc - tb) * u;
    let part = |p: DQuat, tp: f64, q: DQuat, tq: f64| slerp(p, q, (t - tp) / (tq - tp));
    let (ab, bc, cd) = (part(a, ta, b, tb), part(b, tb, c, tc), part(c, tc, d, td));
    part(part(ab, ta, bc, tc), tb, part(bc, tb, cd, td), tc)
}

/// The quaternion of the rotation `q`, q or −q, that is nearer to `to`.
fn near(to: DQuat, q: DQuat) -> DQuat {
    if to.dot(q) < 0.0 { -q } else { q }
}

/// The point at a fraction of the shorter great circle from p to q, extrapolated for fractions outside 0 to 1.
fn slerp(p: DQuat, q: DQuat, share: f64) -> DQuat {
    let q = near(p, q);
    // The angle is computed from its tangent, which is exact for small angles, unlike the cosine.
    let angle = 2.0 * libm::atan2((p - q).length(), (p + q).length());
    let sin = libm::sin(angle);
    if angle < 1e-8 {
        return (p * (1.0 - share) + q * share).normalize();
    }
    (p * (libm::sin((1.0 - share) * angle) / sin) + q * (libm::sin(share * angle) / sin)).normalize()
}

/// The quaternion of a rotation in degrees around an axis; `None` if the axis has no direction.
pub(crate) fn quaternion([x, y, z, degrees]: [f64; 4]) -> Option<DQuat> {
    let axis = DVec3::new(x, y, z).try_normalize()?;
    let (sin, cos) = libm::sincos((degrees % 720.0).to_radians() / 2.0);
    let v = axis * sin;
    Some(DQuat::from_xyzw(v.x, v.y, v.z, cos))
}

/// The axis of a rotation and its angle in degrees, 0 to 180.
pub(crate) fn axis_angle(q: DQuat) -> [f64; 4] {
    let q = if q.w < 0.0 { -q } else { q };
    let v = DVec3::new(q.x, q.y, q.z);
    match v.try_normalize() {
        Some(axis) => [axis.x, axis.y, axis.z, (2.0 * libm::atan2(v.length(), q.w)).to_degrees()],
        None => [0.0, 1.0, 0.0, 0.0],
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Ease, Key};
    use super::*;

    fn curve(ease: Ease, keys: &[(f64, [f64; 4])]) -> Curve {
        let key =
            |&(time, turn): &(f64, [f64; 4])| Key { time, values: quaternion(turn).unwrap().to_array().into(), ease };
        Curve::new(keys.iter().map(key).collect())
    }

    fn angle_between(p: DQuat, q: DQuat) -> f64 {
        axis_angle(p * q.inverse())[3]
    }

    #[test]
    fn the_short_way_round() {
        let of = |from, to| curve(Ease::Linear, &[(0.0, [0.0, 1.0, 0.0, from]), (4.0, [0.0, 1.0, 0.0, to])]);
        let degrees = |c: &Curve, t| {
            let [_, y, _, d] = axis_angle(turned(c, t));
            d * y
        };
        assert!((degrees(&of(0.0, 270.0), 1.0) + 22.5).abs() < 1e-12);
        assert!((degrees(&of(10.0, 90.0), 1.0) - 30.0).abs() < 1e-12);
        assert!((degrees(&of(170.0, -170.0), 2.0).abs() - 180.0).abs() < 1e-12);
    }

    /// Rotations about one axis are numbers: the pyramid must equal the Catmull-Rom spline of the angles.
    #[test]
    fn around_one_axis_it_is_the_spline_of_the_angles() {
        let keys = [(0.0, 0.0), (1.0, 30.0), (3.0, 50.0), (4.0, 120.0)];
        let turns = curve(Ease::Spline, &keys.map(|(t, d)| (t, [0.0, 0.0, 1.0, d])));
        let numbers =
            Curve::new(keys.iter().map(|&(time, d)| Key { time, values: vec![d], ease: Ease::Spline }).collect());
        for i in 10..=30 {
            let t = f64::from(i) / 10.0; // between keys that have both neighbours
            let [.., d] = axis_angle(turned(&turns, t));
            assert!((d - numbers.at(t)[0]).abs() < 1e-9, "{t}: {d}");
        }
    }

    #[test]
    fn smooth_turns_have_no_corners() {
        let turns = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 80.0], [1.0, 0.0, 1.0, 100.0], [0.0, 0.0, 1.0, 20.0]];
        let times = [0.0, 2.0, 3.0, 7.0];
        let keys: Vec<_> = times.into_iter().zip(turns).collect();
        let curve = curve(Ease::Smooth, &keys);
        for (t, turn) in &keys {
            assert!(angle_between(turned(&curve, *t), quaternion(*turn).unwrap()) < 1e-6);
        }
        for t in [2.0, 3.0] {
            let e = 1e-4;
            let (a, b, c) = (turned(&curve, t - e), turned(&curve, t), turned(&curve, t + e));
            // The angular velocity on both sides of the key.
            let speed = |p: DQuat, q: DQuat| {
                let [x, y, z, d] = axis_angle(near(p, q) * p.inverse());
                DVec3::new(x, y, z) * (d / e)
            };
            assert!((speed(a, b) - speed(b, c)).length() < 0.05, "{} {}", speed(a, b), speed(b, c));
        }
    }
}
