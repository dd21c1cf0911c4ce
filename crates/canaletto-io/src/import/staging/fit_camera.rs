//! A camera that frames a model as large as the margin allows.

use canaletto::scene::{Extrinsics, Intrinsics, View};
use glam::{DMat3, DVec3};

/// A point that must be visible, with a radius around it.
pub(in crate::import) type Ball = (DVec3, f64);

/// The margin on each side, as a fraction of the picture's height or width.
const MARGIN: f64 = 0.08;

/// The view along the negative of the unit direction `towards` (from the model to the eye) that contains all balls. The
/// four planes of the view pyramid, moved in by the margin, touch two balls in the tighter direction. In the other
/// direction the balls are centred. `None` if there are no balls or they are not finite.
pub(in crate::import) fn fit_camera(
    balls: impl Iterator<Item = Ball> + Clone,
    towards: DVec3,
    up: DVec3,
    intrinsics: Intrinsics,
) -> Option<View> {
    // Camera space: x to the right, y upwards, z ahead.
    let right = up.cross(towards).normalize();
    let axes = DMat3::from_cols(right, towards.cross(right), -towards);
    let tan_y = libm::tan(intrinsics.fovy.to_radians() / 2.0) * (1.0 - 2.0 * MARGIN);
    let tan_x = tan_y * f64::from(intrinsics.width) / f64::from(intrinsics.height);
    let (secant_x, secant_y) = (libm::hypot(tan_x, 1.0), libm::hypot(tan_y, 1.0));
    // The positions of the right, left, upper and lower planes: ±x − tan z ≤ ±eye.x − tan eye.z.
    let mut reach = [f64::NEG_INFINITY; 4];
    let (mut near, mut far) = (f64::INFINITY, f64::NEG_INFINITY);
    for (point, radius) in balls.clone() {
        let p = axes.transpose() * point;
        let sides = [p.x - tan_x * p.z, -p.x - tan_x * p.z, p.y - tan_y * p.z, -p.y - tan_y * p.z];
        let swell = [radius * secant_x, radius * secant_x, radius * secant_y, radius * secant_y];
        for i in 0..4 {
            reach[i] = reach[i].max(sides[i] + swell[i]);
        }
        (near, far) = (near.min(p.z - radius), far.max(p.z + radius));
    }
    let [x_plus, x_minus, y_plus, y_minus] = reach;
    let depth = (-(x_plus + x_minus) / (2.0 * tan_x)).min(-(y_plus + y_minus) / (2.0 * tan_y));
    // A single point, or points behind one another, have no extent; the eye stays at a small distance.
    let size = (far - near).max(near.abs().max(far.abs()) * 1e-6).max(1e-30);
    let depth = if near - depth < size * 1e-3 { near - size } else { depth };
    let mut eye = DVec3::new((x_plus - x_minus) / 2.0, (y_plus - y_minus) / 2.0, depth);
    for _ in 0..PASSES {
        center(&mut eye, balls.clone().map(|(point, radius)| (axes.transpose() * point, radius)));
    }
    let eye = axes * eye;
    let center = eye - towards * ((near + far) / 2.0 - depth);
    if !eye.is_finite() || !center.is_finite() {
        return None;
    }
    let intrinsics = Intrinsics { near: Some((near - depth) / 2.0), ..intrinsics };
    Some(View { name: "main".into(), intrinsics, extrinsics: Extrinsics { eye, center, up }, motion: Vec::new() })
}

/// The number of centring passes; each one at least halves the remaining offset.
const PASSES: usize = 4;

/// Moves the eye sideways so that the outermost points of this pass are equally far from the middle on both sides.
fn center(eye: &mut DVec3, balls: impl Iterator<Item = Ball>) {
    // The largest and smallest slope in each direction, with their position and depth.
    let mut most = [[f64::NEG_INFINITY, 0.0, 1.0]; 2];
    let mut least = [[f64::INFINITY, 0.0, 1.0]; 2];
    for (p, radius) in balls {
        let depth = p.z - eye.z;
        for (axis, (place, from)) in [(p.x, eye.x), (p.y, eye.y)].into_iter().enumerate() {
            let (high, low) = ((place + radius - from) / depth, (place - radius - from) / depth);
            if high > most[axis][0] {
                most[axis] = [high, place + radius, depth];
            }
            if low < least[axis][0] {
                least[axis] = [low, place - radius, depth];
            }
        }
    }
    let middle = |axis: usize| {
        let ([_, a, a_depth], [_, b, b_depth]) = (most[axis], least[axis]);
        (a * b_depth + b * a_depth) / (a_depth + b_depth)
    };
    (eye.x, eye.y) = (middle(0), middle(1));
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The position of a point in the picture: −1 to 1 in each direction.
    fn project(view: &View, p: DVec3) -> (f64, f64) {
        let Extrinsics { eye, center, up } = view.extrinsics;
        let ahead = (center - eye).normalize();
        let right = ahead.cross(up).normalize();
        let (v, tan) = (p - eye, (view.intrinsics.fovy.to_radians() / 2.0).tan());
        let aspect = f64::from(view.intrinsics.width) / f64::from(view.intrinsics.height);
        let z = v.dot(ahead);
        assert!(z > view.intrinsics.near.unwrap());
        (v.dot(right) / z / tan / aspect, v.dot(right.cross(ahead)) / z / tan)
    }

    fn check(points: &[DVec3]) {
        let intrinsics = Intrinsics { fovy: 35.0, width: 960, height: 720, ..Intrinsics::default() };
        let towards = DVec3::new(0.5, 0.3, 0.8).normalize();
        let view = fit_camera(points.iter().map(|p| (*p, 0.0)), towards, DVec3::Y, intrinsics).unwrap();
        let seen: Vec<(f64, f64)> = points.iter().map(|p| project(&view, *p)).collect();
        let largest = seen.iter().map(|(x, y)| x.abs().max(y.abs())).fold(0.0, f64::max);
        assert!((largest - 0.84).abs() < 1e-9, "{largest}");
        for pick in [|s: &(f64, f64)| s.0, |s: &(f64, f64)| s.1] {
            let (low, high) = seen.iter().map(pick).fold((1.0f64, -1.0f64), |(l, h), v| (l.min(v), h.max(v)));
            assert!((low + high).abs() < 1e-3, "{low} {high} is not near the middle");
        }
    }

    #[test]
    fn the_tighter_direction_touches_the_margin() {
        let cube: Vec<DVec3> =
            (0..8).map(|i| DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2))).collect();
        check(&cube);
        check(&cube.iter().map(|p| *p * DVec3::new(100.0, 1.0, 1.0)).collect::<Vec<_>>());
        check(&cube.iter().map(|p| *p * DVec3::new(1e-9, 2e-8, 1e-9) + 3e-7).collect::<Vec<_>>());
    }

    #[test]
    fn no_size_and_no_points_pass() {
        let with = |balls: &[Ball]| fit_camera(balls.iter().copied(), DVec3::Z, DVec3::Y, Intrinsics::default());
        assert!(with(&[]).is_none());
        let view = with(&[(DVec3::new(1.0, 2.0, 3.0), 0.0)]).unwrap();
        assert!(view.extrinsics.eye.z > 3.0 && view.intrinsics.near.unwrap() > 0.0);
        let view = with(&[(DVec3::ZERO, 1.0)]).unwrap();
        // The cone that touches the sphere: sin = r / distance.
        let tan = 0.84 * 30f64.to_radians().tan();
        assert!((view.extrinsics.eye.z - tan.hypot(1.0) / tan).abs() < 1e-9);
    }
}
