//! The points of a light's surface that emit: fixed ones, or random ones (5.6). Random points make soft shadows without
//! the steps of fixed points.

use crate::shape::SurfaceSampler;
use glam::DVec3;
use std::f64::consts::PI;

/// The sample at `u` of the surface with a radiance of 1, seen from `p`: the point, and the radiance times the solid
/// angle over π. The mean over u of the second value times the cosine at `p` is a form factor. None where the point
/// faces away from `p`.
#[inline]
pub(super) fn seen(surface: &SurfaceSampler, u: [f64; 2], p: DVec3) -> Option<(DVec3, f64)> {
    if surface.is_sphere() {
        // Directions are uniform over a cone of the solid angle 2π (1 − cos θ).
        return surface.cone_point(p, u).map(|(point, versine)| (point, 2.0 * versine));
    }
    let (point, normal) = surface.point(u);
    let to_p = p - point;
    let distance2 = to_p.length_squared();
    let cos = normal.dot(to_p) / distance2.sqrt();
    (cos > 0.0).then(|| (point, cos * surface.area() / (PI * distance2)))
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
    use crate::shape::{Disk, Parallelogram, Shape, Sphere};
    use glam::Vec3;
    use std::f64::consts::TAU;

    const N: u32 = 16384;

    fn mean(f: impl Fn([f64; 2]) -> f64) -> f64 {
        (0..N).map(|i| f(fixed(i, N))).sum::<f64>() / f64::from(N)
    }

    /// The mean cosine at the origin towards points of the surface, as lights of even emission give it.
    fn even(area: &SurfaceSampler, normal: DVec3) -> f64 {
        mean(|u| area.point(u).0.normalize().dot(normal))
    }

    /// The form factor of a small surface at the origin to the light, as lights of matte emission give it.
    fn matte(area: &SurfaceSampler, normal: DVec3) -> f64 {
        mean(|u| {
            seen(area, u, DVec3::ZERO).map_or(0.0, |(point, share)| point.normalize().dot(normal).max(0.0) * share)
        })
    }

    fn close(what: &str, ours: f64, exact: f64) {
        println!("{what}: {ours:.6}, exactly {exact:.6}");
        assert!((ours / exact - 1.0).abs() < 2e-3, "{what}: {ours} instead of {exact}");
    }

    fn rectangle(corner: DVec3, u: DVec3, v: DVec3) -> SurfaceSampler {
        let [corner, u, v] = [corner, u, v].map(|v| v.as_vec3());
        Parallelogram { corner, u, v }.sampler()
    }

    fn disk(height: f64, radius: f64) -> SurfaceSampler {
        let center = Vec3::Y * height as f32;
        Shape::Disk(Disk { center, normal: Vec3::NEG_Y, radius: radius as f32 }).sampler().unwrap()
    }

    fn sphere(center: Vec3, radius: f64) -> SurfaceSampler {
        Shape::Sphere(Sphere { center, radius: radius as f32 }).sampler().unwrap()
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
            let disk = disk(h, r);
            close("disk, even", even(&disk, DVec3::Y), 2.0 * h / (r * r) * ((r * r + h * h).sqrt() - h));
            close("disk, matte", matte(&disk, DVec3::Y), r * r / (r * r + h * h));
            let d = r + h;
            let sphere = sphere(Vec3::Y * d as f32, r);
            close("sphere, even", even(&sphere, DVec3::Y), 1.0 - r * r / (3.0 * d * d));
            close("sphere, matte", matte(&sphere, DVec3::Y), (r / d) * (r / d));
            // Turned, but with the whole sphere above the horizon.
            let turned = DVec3::new((r / d).acos().min(0.5).sin(), (r / d).acos().min(0.5).cos(), 0.0);
            close("sphere aslant, matte", matte(&sphere, turned), (r / d) * (r / d) * turned.y);
        }
        assert_eq!(matte(&sphere(Vec3::X * 0.5, 1.0), DVec3::Y), 0.0, "nothing from within");
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
        let triangles = SurfaceSampler::triangles(corners);
        let whole = rectangle(DVec3::Y, DVec3::X * 2.0, DVec3::Z);
        assert!((triangles.area() - 2.0).abs() < 1e-6);
        close("triangles, even", even(&triangles, DVec3::Y), even(&whole, DVec3::Y));
        close("triangles, matte", matte(&triangles, DVec3::Y), matte(&whole, DVec3::Y));
        let none = |corners| SurfaceSampler::triangles(corners).area() == 0.0;
        assert!(none(vec![[Vec3::ZERO; 3]]) && none(Vec::new()));
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
