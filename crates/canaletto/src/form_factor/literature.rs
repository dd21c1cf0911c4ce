//! Published form factors in closed form, for tests. The numbers such as C-11 are those of J. R. Howell, *A Catalog of
//! Radiation Heat Transfer Configuration Factors* (thermalradiation.net).

use std::f64::consts::{PI, TAU};

/// C-11: equal rectangles of a × b, parallel and opposite at the distance c.
pub(super) fn parallel_rectangles(a: f64, b: f64, c: f64) -> f64 {
    let (x, y) = (a / c, b / c);
    let (rx, ry) = ((1.0 + x * x).sqrt(), (1.0 + y * y).sqrt());
    let logarithm = (rx * rx * ry * ry / (1.0 + x * x + y * y)).sqrt().ln();
    2.0 / (PI * x * y) * (logarithm + x * ry * (x / ry).atan() + y * rx * (y / rx).atan() - x * x.atan() - y * y.atan())
}

/// The sum over both ends of four intervals, with alternating signs.
fn alternating(intervals: [[f64; 2]; 4], g: impl Fn([f64; 4]) -> f64) -> f64 {
    let term = |bits: usize| {
        let ends = std::array::from_fn(|k| intervals[k][bits >> k & 1]);
        if bits.count_ones().is_multiple_of(2) { g(ends) } else { -g(ends) }
    };
    (0..16).map(term).sum()
}

/// C-13: a rectangle x × y and a rectangle ξ × η in parallel planes at the distance z.
pub(super) fn rectangles_in_parallel_planes(x: [f64; 2], y: [f64; 2], xi: [f64; 2], eta: [f64; 2], z: f64) -> f64 {
    let g = |[x, y, xi, eta]: [f64; 4]| {
        let (u, v) = (x - xi, y - eta);
        let (ru, rv) = (u.hypot(z), v.hypot(z));
        (v * ru * (v / ru).atan() + u * rv * (u / rv).atan() - z * z / 2.0 * (u * u + v * v + z * z).ln()) / TAU
    };
    alternating([x, y, xi, eta], g) / ((x[1] - x[0]) * (y[1] - y[0]))
}

/// C-14: a rectangle of width w and one of height h at a right angle, with a common edge of length l.
pub(super) fn perpendicular_rectangles(w: f64, h: f64, l: f64) -> f64 {
    let (w, h) = (w / l, h / l);
    let (w2, h2) = (w * w, h * h);
    let both = w2 + h2;
    let logarithm = ((1.0 + w2) * (1.0 + h2) / (1.0 + both)).ln()
        + w2 * (w2 * (1.0 + both) / ((1.0 + w2) * both)).ln()
        + h2 * (h2 * (1.0 + both) / ((1.0 + h2) * both)).ln();
    (w * (1.0 / w).atan() + h * (1.0 / h).atan() - both.sqrt() * (1.0 / both.sqrt()).atan() + logarithm / 4.0)
        / (PI * w)
}

/// C-15: a rectangle x × y and a rectangle ξ × η in perpendicular planes. x and ξ are distances from the line where the
/// planes meet, along which y and η lie.
pub(super) fn rectangles_in_perpendicular_planes(x: [f64; 2], y: [f64; 2], xi: [f64; 2], eta: [f64; 2]) -> f64 {
    let g = |[x, y, xi, eta]: [f64; 4]| {
        let (v, r2) = (y - eta, x * x + xi * xi);
        let r = r2.sqrt();
        let angle = if r > 0.0 { v * r * (v / r).atan() } else { 0.0 };
        let d2 = r2 + v * v;
        let logarithm = if d2 > 0.0 { 0.25 * (r2 - v * v) * d2.ln() } else { 0.0 };
        (angle - logarithm) / TAU
    };
    alternating([x, y, xi, eta], g) / ((x[1] - x[0]) * (y[1] - y[0]))
}

/// B-3: a patch and a parallel rectangle of a × b at the distance c, a corner of which lies on the patch's normal.
pub(super) fn patch_to_parallel_rectangle(a: f64, b: f64, c: f64) -> f64 {
    let (x, y) = (a / c, b / c);
    let (rx, ry) = ((1.0 + x * x).sqrt(), (1.0 + y * y).sqrt());
    (x / rx * (y / rx).atan() + y / ry * (x / ry).atan()) / TAU
}

/// B-4: a patch and a rectangle of height a and width b that stands on the patch's plane at the distance c. A lower
/// corner lies straight ahead of the patch.
pub(super) fn patch_to_perpendicular_rectangle(a: f64, b: f64, c: f64) -> f64 {
    let (x, y) = (a / b, c / b);
    let diagonal = x.hypot(y);
    ((1.0 / y).atan() - y / diagonal * (1.0 / diagonal).atan()) / TAU
}

/// B-12: a patch and a parallel disk of radius r at the distance h, whose centre lies on the patch's normal.
pub(super) fn patch_to_disk(r: f64, h: f64) -> f64 {
    r * r / (h * h + r * r)
}

/// C-41: parallel coaxial disks of radii r1 and r2 at the distance a.
pub(super) fn coaxial_disks(r1: f64, r2: f64, a: f64) -> f64 {
    let (r1, r2) = (r1 / a, r2 / a);
    let x = 1.0 + (1.0 + r2 * r2) / (r1 * r1);
    0.5 * (x - (x * x - 4.0 * (r2 / r1) * (r2 / r1)).sqrt())
}

/// C-78: the inner side of a cylinder of radius r and height h, to itself.
pub(super) fn cylinder_to_itself(r: f64, h: f64) -> f64 {
    let h = h / (2.0 * r);
    1.0 + h - (1.0 + h * h).sqrt()
}

/// C-79: the base of a cylinder of radius r and height h to the inner side.
pub(super) fn cylinder_base_to_side(r: f64, h: f64) -> f64 {
    let h = h / (2.0 * r);
    2.0 * h * ((1.0 + h * h).sqrt() - h)
}

/// C-109: the inner side of a cone of radius r and height h to its base.
pub(super) fn cone_to_base(r: f64, h: f64) -> f64 {
    r / r.hypot(h)
}

/// C-125: a sphere to a disk of radius r whose axis passes through the sphere's centre, at the distance a from it.
pub(super) fn sphere_to_disk(r: f64, a: f64) -> f64 {
    let r = r / a;
    0.5 * (1.0 - 1.0 / (1.0 + r * r).sqrt())
}

/// C-135: the inner side of a sphere of radius r2 to a sphere of radius r1 around the same centre.
pub(super) fn outer_to_inner_sphere(r1: f64, r2: f64) -> f64 {
    r1 * r1 / (r2 * r2)
}

/// A sphere to a rectangle of a × b at the distance c from its centre, a corner of which is nearest to the centre
/// (Feingold and Gupta, *New Analytical Approach to the Evaluation of Configuration Factors in Radiation From Spheres
/// and Infinitely Long Cylinders*, 1970).
pub(super) fn sphere_to_rectangle(a: f64, b: f64, c: f64) -> f64 {
    (a * b / (c * (a * a + b * b + c * c).sqrt())).atan() / (2.0 * TAU)
}
