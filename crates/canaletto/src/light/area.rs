//! The surfaces of lights, and the points on them that emit: fixed ones, or random ones (5.6). Random points make soft
//! shadows without the steps of fixed points.

use crate::math::warp;
use glam::{DVec3, Vec3};
use std::f64::consts::{PI, TAU};

/// A light's surface in world space.
#[derive(Clone, Debug)]
pub(super) enum Area {
    /// A disk: its centre, two perpendicular radii, and the unit normal of the emitting side.
    Disk(DVec3, [DVec3; 2], DVec3),
    /// A parallelogram: a corner, its two edges, and the unit normal of the emitting side.
    Rectangle(DVec3, [DVec3; 2], DVec3),
    /// A sphere: its centre and radius.
    Sphere(DVec3, f64),
    /// Triangles, counter-clockwise seen from the emitting side.
    Triangles(Triangles),
}

/// Triangles with the cumulative sums of their areas.
#[derive(Clone, Debug)]
pub(super) struct Triangles {
    corners: Vec<[Vec3; 3]>,
    /// The sum of the areas of each triangle and all before it.
    sums: Vec<f64>,
}

impl Triangles {
    /// Triangles with a total area above 0 and finite; none otherwise.
    pub(super) fn new(corners: Vec<[Vec3; 3]>) -> Option<Triangles> {
        let mut sum = 0.0;
        let sums: Vec<f64> = corners
            .iter()
            .map(|triangle| {
                sum += 0.5 * edges(triangle).length();
                sum
            })
            .collect();
        (sum > 0.0 && sum.is_finite()).then_some(Triangles { corners, sums })
    }
}

/// The cross product of two edges. It is along the normal, and its length is twice the area.
fn edges(triangle: &[Vec3; 3]) -> DVec3 {
    let [a, b, c] = triangle.map(|p| p.as_dvec3());
    (b - a).cross(c - a)
}

impl Area {
    pub(super) fn area(&self) -> f64 {
        match self {
            Area::Disk(_, [x, _], _) => PI * x.length_squared(),
            Area::Rectangle(_, [u, v], _) => u.cross(*v).length(),
            Area::Sphere(_, radius) => 4.0 * PI * radius * radius,
            Area::Triangles(triangles) => triangles.sums.last().copied().unwrap_or(0.0),
        }
    }

    /// The point at `u` of the unit square, and the unit normal there. Equal parts of the square map to equal areas.
    pub(super) fn point(&self, [u, v]: [f64; 2]) -> (DVec3, DVec3) {
        match self {
            Area::Disk(center, [x, y], normal) => {
                let p = warp::disk([u, v]);
                (*center + *x * p.x + *y * p.y, *normal)
            }
            Area::Rectangle(corner, [along, up], normal) => (*corner + *along * u + *up * v, *normal),
            Area::Sphere(center, radius) => {
                // Archimedes: equal heights of a sphere have equal areas.
                let z = 1.0 - 2.0 * u;
                let (sin, cos) = libm::sincos(TAU * v);
                let across = (4.0 * u * (1.0 - u)).sqrt();
                let normal = DVec3::new(across * cos, across * sin, z);
                (*center + normal * *radius, normal)
            }
            Area::Triangles(Triangles { corners, sums }) => {
                let wanted = u * self.area();
                let i = sums.partition_point(|sum| *sum <= wanted).min(corners.len() - 1);
                let before = if i == 0 { 0.0 } else { sums[i - 1] };
                let inside = ((wanted - before) / (sums[i] - before)).clamp(0.0, 1.0);
                let [a, b, c] = corners[i].map(|p| p.as_dvec3());
                let root = inside.sqrt();
                let point = a + (b - a) * (root * (1.0 - v)) + (c - a) * (root * v);
                (point, edges(&corners[i]).normalize_or_zero())
            }
        }
    }

    /// The sample at `u` of the surface with a radiance of 1, seen from `p`: the point, and the radiance times the
    /// solid angle over π. The mean over u of the second value times the cosine at `p` is a form factor. None where the
    /// point faces away from `p`.
    pub(super) fn seen(&self, u: [f64; 2], p: DVec3) -> Option<(DVec3, f64)> {
        if let Area::Sphere(center, radius) = self {
            return cap(*center, *radius, u, p);
        }
        let (point, normal) = self.point(u);
        let to_p = p - point;
        let distance2 = to_p.length_squared();
        let cos = normal.dot(to_p) / distance2.sqrt();
        (cos > 0.0).then(|| (point, cos * self.area() / (PI * distance2)))
    }
}

/// [`Area::seen`] of a sphere. Directions are uniform over the cone in which `p` sees the sphere.
fn cap(center: DVec3, radius: f64, [u, v]: [f64; 2], p: DVec3) -> Option<(DVec3, f64)> {
    let to_center = center - p;
    let distance = to_center.length();
    if distance <= radius {
        return None;
    }
    let sin2 = (radius / distance) * (radius / distance);
    // 1 − cos of the cone's half angle, without cancellation.
    let depth = sin2 / (1.0 + (1.0 - sin2).sqrt());
    let lower = u * depth;
    let (cos, sin2_here) = (1.0 - lower, lower * (2.0 - lower));
    let axis = to_center / distance;
    let (x, y) = axis.any_orthonormal_pair();
    let (s, c) = libm::sincos(TAU * v);
    let direction = axis * cos + (x * c + y * s) * sin2_here.sqrt();
    let near = distance * (cos - (sin2 - sin2_here).max(0.0).sqrt());
    Some((p + direction * near, 2.0 * depth))
}

/// Fixed place i of n in the unit square. The places are Hammersley's points, in the middle of their cells.
pub(super) fn fixed(i: u32, n: u32) -> [f64; 2] {
    let mirrored = f64::from(i.reverse_bits()) / 4_294_967_296.0;
    let cells = f64::from(n.next_power_of_two());
    [(f64::from(i) + 0.5) / f64::from(n), mirrored + 0.5 / cells]
}

#[cfg(test)]
mod tests {
    use super::*;

    const N: u32 = 16384;

    fn mean(f: impl Fn([f64; 2]) -> f64) -> f64 {
        (0..N).map(|i| f(fixed(i, N))).sum::<f64>() / f64::from(N)
    }

    /// The mean cosine at the origin towards points of the surface, as lights of even emission give it.
    fn even(area: &Area, normal: DVec3) -> f64 {
        mean(|u| area.point(u).0.normalize().dot(normal))
    }

    /// The form factor of a small surface at the origin to the light, as lights of matte emission give it.
    fn matte(area: &Area, normal: DVec3) -> f64 {
        mean(|u| area.seen(u, DVec3::ZERO).map_or(0.0, |(point, share)| point.normalize().dot(normal).max(0.0) * share))
    }

    fn close(what: &str, ours: f64, exact: f64) {
        println!("{what}: {ours:.6}, exactly {exact:.6}");
        assert!((ours / exact - 1.0).abs() < 2e-3, "{what}: {ours} instead of {exact}");
    }

    fn rectangle(corner: DVec3, u: DVec3, v: DVec3) -> Area {
        Area::Rectangle(corner, [u, v], u.cross(v).normalize())
    }

    /// Checks rectangles of a × b at height h above the origin, with a corner straight above it.
    #[test]
    fn rectangles_agree_with_closed_forms() {
        for (a, b, h) in [(1.0, 1.0, 1.0), (3.0, 0.5, 2.0), (0.2, 4.0, 0.7f64)] {
            let area = rectangle(DVec3::Y * h, DVec3::X * a, DVec3::Z * b);
            let asinh = |x: f64| x.asinh();
            let potential = a * asinh(b / (a * a + h * h).sqrt()) + b * asinh(a / (b * b + h * h).sqrt())
                - h * (a * b / (h * (a * a + b * b + h * h).sqrt())).atan();
            close("rectangle, even", even(&area, DVec3::Y), h * potential / (a * b));
            // The emitting side faces down: z × x is y, so the edges in this order face up and the origin sees the
            // back.
            assert_eq!(matte(&rectangle(DVec3::Y * h, DVec3::Z * b, DVec3::X * a), DVec3::Y), 0.0);
            let (x, y) = (a / h, b / h);
            let (rx, ry) = ((1.0 + x * x).sqrt(), (1.0 + y * y).sqrt());
            let factor = (x / rx * (y / rx).atan() + y / ry * (x / ry).atan()) / TAU;
            close("rectangle, matte", matte(&area, DVec3::Y), factor);
        }
    }

    #[test]
    fn disks_and_spheres_agree_with_closed_forms() {
        for (r, h) in [(1.0, 1.0), (0.1, 2.0), (3.0, 1.5f64)] {
            let disk = Area::Disk(DVec3::Y * h, [DVec3::X * r, DVec3::Z * r], DVec3::NEG_Y);
            close("disk, even", even(&disk, DVec3::Y), 2.0 * h / (r * r) * ((r * r + h * h).sqrt() - h));
            close("disk, matte", matte(&disk, DVec3::Y), r * r / (r * r + h * h));
            let d = r + h;
            let sphere = Area::Sphere(DVec3::Y * d, r);
            close("sphere, even", even(&sphere, DVec3::Y), 1.0 - r * r / (3.0 * d * d));
            close("sphere, matte", matte(&sphere, DVec3::Y), (r / d) * (r / d));
            // Turned, but with the whole sphere above the horizon.
            let turned = DVec3::new((r / d).acos().min(0.5).sin(), (r / d).acos().min(0.5).cos(), 0.0);
            close("sphere aslant, matte", matte(&sphere, turned), (r / d) * (r / d) * turned.y);
        }
        assert_eq!(matte(&Area::Sphere(DVec3::X * 0.5, 1.0), DVec3::Y), 0.0, "nothing from within");
    }

    /// A rectangle cut into unequal triangles emits as the rectangle does.
    #[test]
    fn triangles_shine_by_their_area() {
        let p = |x: f32, z: f32| Vec3::new(x, 1.0, z);
        let corners = vec![
            [p(0.0, 0.0), p(2.0, 0.0), p(0.2, 0.1)],
            [p(2.0, 0.0), p(2.0, 1.0), p(0.2, 0.1)],
            [p(2.0, 1.0), p(0.0, 1.0), p(0.2, 0.1)],
            [p(0.0, 1.0), p(0.0, 0.0), p(0.2, 0.1)],
            // A triangle without an area.
            [p(0.0, 0.0), p(1.0, 0.0), p(2.0, 0.0)],
        ];
        // z grows towards the viewer: seen from below these triangles are counter-clockwise.
        let triangles = Area::Triangles(Triangles::new(corners).unwrap());
        let whole = rectangle(DVec3::Y, DVec3::X * 2.0, DVec3::Z);
        assert!((triangles.area() - 2.0).abs() < 1e-6);
        close("triangles, even", even(&triangles, DVec3::Y), even(&whole, DVec3::Y));
        close("triangles, matte", matte(&triangles, DVec3::Y), matte(&whole, DVec3::Y));
        assert!(Triangles::new(vec![[Vec3::ZERO; 3]]).is_none() && Triangles::new(Vec::new()).is_none());
    }

    #[test]
    fn fixed_points_fill_the_square_evenly() {
        for n in [1, 2, 16, 100, 4096] {
            let points: Vec<[f64; 2]> = (0..n).map(|i| fixed(i, n)).collect();
            assert!(points.iter().flatten().all(|v| (0.0..1.0).contains(v)));
            let [x, y] = [0, 1].map(|k| points.iter().map(|p| p[k]).sum::<f64>() / f64::from(n));
            assert!((x - 0.5).abs() < 1e-9 && (y - 0.5).abs() < 1.0 / f64::from(n), "{n}: {x} {y}");
        }
    }
}
