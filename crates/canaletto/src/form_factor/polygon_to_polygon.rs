//! The form factor between two polygons: the double contour integral.
//!
//! By Stokes' theorem A F = 1/2π ∮ over ∂A ∮ over ∂B of ln r dr·dr' (Sparrow, *A New and Simpler Formulation for
//! Radiative Angle Factors*, 1963). The inner integral along an edge of B has a closed form. The outer integral along
//! an edge of A is computed by double exponential quadrature between the places where the integrand may be singular, so
//! that edges may touch and coincide.

use super::double_exponential::{DoubleExponential, Integral};
use super::point_to_polygon;
use super::polygon::{area_vector, clip_to_front};
use glam::DVec3;
use std::f64::consts::TAU;
use std::sync::LazyLock;

/// The quadrature error that is allowed in a pair of edges, relative to the product of their lengths.
const TOLERANCE: f64 = 1e-13;

static RULE: LazyLock<DoubleExponential> = LazyLock::new(DoubleExponential::new);

/// A form factor with a bound of its error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AnalyticFormFactor {
    /// The form factor, from 0 to 1.
    pub value: f64,
    /// A bound of the absolute error, quadrature and rounding together.
    pub error: f64,
}

/// The form factor from the front of polygon `a` to the front of polygon `b`, with nothing in between. `None` if `a`
/// has no area.
///
/// The polygons are planar, with corners counter-clockwise seen from the front. They may be concave. Each one's part
/// behind the other one's plane is clipped away first.
pub fn polygon_to_polygon(a: &[DVec3], b: &[DVec3]) -> Option<AnalyticFormFactor> {
    polygon_to_polygon_within(TOLERANCE, a, b)
}

/// [`polygon_to_polygon`] with another quadrature error for each pair of edges, relative to the product of their
/// lengths.
pub(crate) fn polygon_to_polygon_within(tolerance: f64, a: &[DVec3], b: &[DVec3]) -> Option<AnalyticFormFactor> {
    let (area_a, area_b) = (area_vector(a), area_vector(b));
    let area = area_a.length();
    if area == 0.0 {
        return None;
    }
    if area_b == DVec3::ZERO {
        return Some(AnalyticFormFactor { value: 0.0, error: 0.0 });
    }
    let front_a = clip_to_front(a, b[0], area_b);
    let front_b = clip_to_front(b, a[0], area_a);
    if front_a.len() < 3 || front_b.len() < 3 {
        return Some(AnalyticFormFactor { value: 0.0, error: 0.0 });
    }
    let exchange = if are_far(&front_a, &front_b) {
        far_exchange(&front_a, &front_b, area_a / area)
    } else {
        contour_exchange(&front_a, &front_b, tolerance)
    };
    let value = (exchange.value / area).clamp(0.0, 1.0);
    Some(AnalyticFormFactor { value, error: exchange.error / area + 4.0 * f64::EPSILON * value })
}

/// The corners relative to a point near both polygons, over a power of two near their size. Equal corners stay equal.
fn normalized(a: &[DVec3], b: &[DVec3]) -> (Vec<DVec3>, Vec<DVec3>, f64) {
    let origin = a[0];
    let size = a.iter().chain(b).fold(0.0, |size: f64, p| size.max((*p - origin).abs().max_element()));
    // The next lower power of two.
    let unit = f64::from_bits(size.to_bits() & f64::INFINITY.to_bits());
    let local = |polygon: &[DVec3]| polygon.iter().map(|p| (*p - origin) / unit).collect();
    (local(a), local(b), unit)
}

/// The area of `a` times the form factor to `b`, by the double contour integral.
fn contour_exchange(a: &[DVec3], b: &[DVec3], tolerance: f64) -> Integral {
    let (a, b, unit) = normalized(a, b);
    let edges = |polygon: &[DVec3]| -> Vec<Edge> {
        let next = polygon.iter().cycle().skip(1);
        polygon.iter().zip(next).filter_map(|(from, to)| Edge::between(*from, *to)).collect()
    };
    let (edges_a, edges_b) = (edges(&a), edges(&b));
    let mut sum = Integral::default();
    // The sum of what rounding may have changed, as a multiple of `f64::EPSILON`.
    let mut rounding = 0.0;
    for outer in &edges_a {
        for inner in &edges_b {
            let cos = outer.direction.dot(inner.direction);
            if cos == 0.0 {
                continue;
            }
            let Integral { value, error } = outer.logarithms(inner, &RULE, tolerance / cos.abs());
            sum.value += cos * value;
            sum.error += cos.abs() * error;
            rounding += cos.abs() * outer.length * (inner.length + value.abs());
        }
    }
    let scale = unit * unit / TAU;
    Integral { value: sum.value * scale, error: (sum.error + 8.0 * f64::EPSILON * rounding) * scale }
}

/// A straight edge.
struct Edge {
    from: DVec3,
    direction: DVec3,
    length: f64,
}

impl Edge {
    fn between(from: DVec3, to: DVec3) -> Option<Edge> {
        let length = from.distance(to);
        (length > 0.0).then(|| Edge { from, direction: (to - from) / length, length })
    }

    /// ∫ ln r ds from a point to all points of the edge.
    fn logarithm(&self, point: DVec3) -> f64 {
        let r = point - self.from;
        let foot = r.dot(self.direction);
        let height = (r - self.direction * foot).length();
        // The antiderivative of ln √(t² + h²).
        let at = |t: f64| {
            let r2 = t * t + height * height;
            if r2 == 0.0 { 0.0 } else { t * (0.5 * libm::log(r2) - 1.0) + height * libm::atan2(t, height) }
        };
        at(self.length - foot) - at(-foot)
    }

    /// ∫∫ ln r ds' ds over both edges. The tolerance is relative to the product of the edges' lengths.
    fn logarithms(&self, inner: &Edge, rule: &DoubleExponential, tolerance: f64) -> Integral {
        // The integrand is singular nearest to the inner edge's ends, and where the two lines are nearest to each
        // other.
        let to_inner = inner.from - self.from;
        let cos = self.direction.dot(inner.direction);
        let foot = to_inner.dot(self.direction);
        let nearest = (foot - cos * to_inner.dot(inner.direction)) / (1.0 - cos * cos);
        let mut stops = [foot, foot + cos * inner.length, nearest, self.length];
        stops = stops.map(|stop| if stop.is_finite() { stop.clamp(0.0, self.length) } else { 0.0 });
        stops.sort_by(f64::total_cmp);
        let mut sum = Integral::default();
        let mut from = 0.0;
        for to in stops {
            if to > from {
                let tolerance = tolerance * inner.length * (to - from);
                let part = rule.integrate(from, to, tolerance, |s| inner.logarithm(self.from + self.direction * s));
                sum.value += part.value;
                sum.error += part.error;
                from = to;
            }
        }
        sum
    }
}

/// Whether the polygons are so far from each other that logarithms of distances cancel and the integrand of cubature is
/// smooth.
fn are_far(a: &[DVec3], b: &[DVec3]) -> bool {
    let ball = |polygon: &[DVec3]| {
        let center = polygon.iter().sum::<DVec3>() / polygon.len() as f64;
        (center, polygon.iter().fold(0.0, |radius: f64, p| radius.max(p.distance(center))))
    };
    let ((center_a, radius_a), (center_b, radius_b)) = (ball(a), ball(b));
    center_a.distance(center_b) > 4.0 * (radius_a + radius_b)
}

/// The area of `a` times the form factor to `b`, by cubature of [`point_to_polygon`] over triangles around a corner of
/// `a`, which cancel where they leave a concave polygon.
fn far_exchange(a: &[DVec3], b: &[DVec3], normal: DVec3) -> Integral {
    let mut sums = [0.0; 2];
    let mut magnitude = 0.0;
    for pair in a[1..].windows(2) {
        let (u, v) = (pair[0] - a[0], pair[1] - a[0]);
        let area = 0.5 * u.cross(v).dot(normal);
        let at = |point: [f64; 2]| point_to_polygon(a[0] + u * point[0] + v * point[1], normal, b);
        let means = [triangle_mean(&GAUSS_4, at), triangle_mean(&GAUSS_6, at)];
        sums[0] += area * means[0];
        sums[1] += area * means[1];
        magnitude += area.abs();
    }
    let error = (sums[1] - sums[0]).abs() + 8.0 * f64::EPSILON * magnitude;
    Integral { value: sums[1], error }
}

/// The nodes and weights of Gauss's rule of four nodes on 0..1.
const GAUSS_4: [[f64; 2]; 4] = [
    [0.069_431_844_202_973_71, 0.173_927_422_568_726_93],
    [0.330_009_478_207_571_87, 0.326_072_577_431_273_07],
    [0.669_990_521_792_428_1, 0.326_072_577_431_273_07],
    [0.930_568_155_797_026_3, 0.173_927_422_568_726_93],
];

/// The nodes and weights of Gauss's rule of six nodes on 0..1.
const GAUSS_6: [[f64; 2]; 6] = [
    [0.033_765_242_898_423_99, 0.085_662_246_189_585_18],
    [0.169_395_306_766_867_74, 0.180_380_786_524_069_3],
    [0.380_690_406_958_401_55, 0.233_956_967_286_345_52],
    [0.619_309_593_041_598_4, 0.233_956_967_286_345_52],
    [0.830_604_693_233_132_3, 0.180_380_786_524_069_3],
    [0.966_234_757_101_576, 0.085_662_246_189_585_18],
];

/// The mean of `f` over the triangle of coordinates x, y ≥ 0 with x + y ≤ 1, by a product of Gauss's rules on the
/// square that is folded onto it.
fn triangle_mean(rule: &[[f64; 2]], f: impl Fn([f64; 2]) -> f64) -> f64 {
    let mut sum = 0.0;
    for &[x, wx] in rule {
        for &[y, wy] in rule {
            sum += wx * wy * 2.0 * (1.0 - x) * f([x, y * (1.0 - x)]);
        }
    }
    sum
}

#[cfg(test)]
mod tests;
