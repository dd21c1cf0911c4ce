//! Random points of a surface as seen from a point: uniform over its solid angle where there is a formula for it, else
//! uniform over its area.
//!
//! | surface | from outside | from within |
//! |---|---|---|
//! | sphere | the cone in which it is seen | all directions |
//! | triangle, parallelogram, disk | its solid angle | |
//! | box | the solid angle of the faces that are seen | the solid angle of all faces |
//! | cylinder, cone, torus, several triangles | the whole area | the whole area |
//!
//! Triangles, parallelograms and disks whose points all are about equally far are sampled by area ([`Flat::is_far`]):
//! there the solid angle gains little and takes longer. So are those of tiny solid angles or nearly edge-on, where
//! formulas lose their digits, and disks that nearly touch the point.

use super::flat::{Flat, density_of_area};
use super::sample::{DiskForm, Form, Near, SurfaceSample, SurfaceSampler};
use super::spherical_ellipse::SphericalEllipse;
use super::spherical_rectangle::SphericalRectangle;
use super::spherical_triangle::SphericalTriangle;
use super::{Cuboid, pick_by_area};
use crate::math::functions::sin_cos;
use crate::math::{Vector, warp};
use canaletto_bvh::lanes::Real64;
use glam::{DVec2, DVec3};
use std::f64::consts::{PI, TAU};

/// The distance of a point from a sphere's surface, as a share of the radius, within which it counts as on it. The
/// sphere's own points see no cone.
const ON_SPHERE: f64 = 1e-5;

/// The largest cosine between the edges of a parallelogram that counts as a rectangle. Edges are rounded to `f32`.
const SQUARE: f64 = 1e-6;

impl SurfaceSampler {
    /// The point at `u` of the unit square, as seen from `p`, with its density per unit of solid angle at `p`. None
    /// where the surface is seen edge-on.
    pub fn sample_from(&self, p: DVec3, u: [f64; 2]) -> Option<SurfaceSample> {
        let (point, normal, pdf) = match &self.form {
            Form::Sphere(center, radius) => match sphere_side(p, *center, *radius) {
                Side::Outside => {
                    let (point, pdf) = cone_points((*center).into(), *radius, p.into(), u);
                    let point = DVec3::from(point);
                    (point, (point - *center).normalize(), pdf)
                }
                Side::Inside => {
                    let (to, direction) = (p - *center, warp::sphere(u));
                    let along = to.dot(direction);
                    let t = (along * along + radius * radius - to.length_squared()).max(0.0).sqrt() - along;
                    let point = p + direction * t;
                    (point, (point - *center).normalize(), 1.0 / (4.0 * PI))
                }
                Side::On => self.area_sample(p, u),
            },
            Form::Flat(flat, near) => match SeenFlat::new(flat, near, p) {
                Some(seen) => seen.sample(flat, p, u)?,
                None => self.area_sample(p, u),
            },
            Form::Box(cuboid, _) => SeenBox::new(cuboid, p).sample(cuboid, p, u)?,
            _ => self.area_sample(p, u),
        };
        (pdf > 0.0 && pdf.is_finite()).then_some(SurfaceSample { point, normal, pdf })
    }

    /// A flat form.
    #[inline(always)]
    pub(crate) fn flat(&self) -> Option<&Flat> {
        if let Form::Flat(flat, _) = &self.form { Some(flat) } else { None }
    }

    /// The centre and the radius of a sphere.
    #[inline(always)]
    pub(crate) fn as_sphere(&self) -> Option<(DVec3, f64)> {
        if let Form::Sphere(center, radius) = &self.form { Some((*center, *radius)) } else { None }
    }

    /// Whether `p` sees a point by [`Flats`](super::Flats) or [`cone_points`].
    #[inline]
    pub(crate) fn has_lanes(&self, p: DVec3) -> bool {
        match &self.form {
            Form::Flat(flat, _) => flat.is_far(p),
            Form::Sphere(center, radius) => sphere_side(p, *center, *radius) == Side::Outside,
            _ => false,
        }
    }

    /// Whether the surface is flat, and `p` isn't on its outer side.
    #[inline]
    pub(crate) fn is_behind(&self, p: DVec3) -> bool {
        self.flat().is_some_and(|flat| flat.normal.dot(p - flat.origin) <= 0.0)
    }

    /// The density per unit of solid angle at `p` with which [`SurfaceSampler::sample_from`] returns this point of the
    /// surface with this unit normal. It is 0 for points that it never returns, such as those of a sphere's averted
    /// side.
    pub fn pdf_from(&self, p: DVec3, point: DVec3, normal: DVec3) -> f64 {
        match &self.form {
            Form::Sphere(center, radius) => match sphere_side(p, *center, *radius) {
                Side::Outside if normal.dot(p - point) > 0.0 => 1.0 / (TAU * versine(p.distance(*center), *radius)),
                Side::Outside => 0.0,
                Side::Inside => 1.0 / (4.0 * PI),
                Side::On => self.area_pdf(p, point, normal),
            },
            Form::Flat(flat, near) => match SeenFlat::new(flat, near, p) {
                Some(seen) => 1.0 / seen.solid_angle(),
                None => self.area_pdf(p, point, normal),
            },
            Form::Box(cuboid, _) => SeenBox::new(cuboid, p).pdf(p, point, normal),
            _ => self.area_pdf(p, point, normal),
        }
    }

    /// A point that is uniform over the area, its normal and its density per unit of solid angle.
    fn area_sample(&self, p: DVec3, u: [f64; 2]) -> (DVec3, DVec3, f64) {
        let (point, normal) = self.point(u);
        (point, normal, self.area_pdf(p, point, normal))
    }

    fn area_pdf(&self, p: DVec3, point: DVec3, normal: DVec3) -> f64 {
        density_of_area(p.into(), point.into(), normal.into(), self.area())
    }

    /// A point on the side of a sphere towards `p`, in a direction uniform over the cone in which `p` sees the sphere.
    /// The versine 1 − cos θ of the cone's half angle follows. None for other forms, and inside the sphere.
    pub(crate) fn cone_point(&self, p: DVec3, [u, v]: [f64; 2]) -> Option<(DVec3, f64)> {
        let Form::Sphere(center, radius) = self.form else { return None };
        if sphere_side(p, center, radius) != Side::Outside {
            return None;
        }
        let (point, versine) = points_and_versines(center.into(), radius, p.into(), [u, v]);
        Some((point.into(), versine))
    }
}

/// Points on spheres that are seen from outside, in directions uniform over the cones in which `p` sees them, and their
/// densities.
#[inline(always)]
pub(crate) fn cone_points<F: Real64>(center: Vector<F>, radius: F, p: Vector<F>, u: [F; 2]) -> (Vector<F>, F) {
    let (point, versine) = points_and_versines(center, radius, p, u);
    (point, F::splat(1.0) / (versine * TAU))
}

/// The points of [`cone_points`], and the versines of the cones' half angles.
#[inline(always)]
fn points_and_versines<F: Real64>(center: Vector<F>, radius: F, p: Vector<F>, [u, v]: [F; 2]) -> (Vector<F>, F) {
    let to_center = center - p;
    let distance = to_center.length();
    let sin = radius / distance;
    let sin2 = sin * sin;
    let versine = versine(distance, radius);
    let lower = u * versine;
    let one = F::splat(1.0);
    let (cos, sin2_here) = (one - lower, lower * (F::splat(2.0) - lower));
    let axis = to_center * (one / distance);
    let [x, y] = axis.orthonormal_pair();
    let [s, c] = sin_cos(v * TAU);
    let direction = axis * cos + (x * c + y * s) * sin2_here.sqrt();
    let near = distance * (cos - (sin2 - sin2_here).max(F::splat(0.0)).sqrt());
    (p + direction * near, versine)
}

/// Where a point lies from a sphere.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Side {
    Outside,
    /// On the surface, but for rounding.
    On,
    Inside,
}

fn sphere_side(p: DVec3, center: DVec3, radius: f64) -> Side {
    let distance = p.distance(center);
    if distance > radius * (1.0 + ON_SPHERE) {
        Side::Outside
    } else if distance < radius * (1.0 - ON_SPHERE) {
        Side::Inside
    } else {
        Side::On
    }
}

/// The versine 1 − cos θ of the half angle at which a sphere is seen, without cancellation.
#[inline(always)]
fn versine<F: Real64>(distance: F, radius: F) -> F {
    let sin = radius / distance;
    let sin2 = sin * sin;
    sin2 / ((F::splat(1.0) - sin2).sqrt() + 1.0)
}

/// How many times as far as the nearest point of a disk the farthest one must be, so that its solid angle is sampled.
/// [`Flat::is_far`] leaves out most points of which it isn't.
const UNEVEN: f64 = 3.0;

/// A disk as seen from `p`, with its radii away from the foot of the perpendicular and across. None where the area has
/// to be sampled.
fn seen_disk(disk: &DiskForm, p: DVec3) -> Option<(SphericalEllipse, [DVec3; 2])> {
    let (from, [x, y]) = (disk.center - p, disk.radii);
    let offset = DVec2::new(from.dot(x), from.dot(y)) / disk.radius;
    let (height, length) = (from.dot(disk.normal), offset.length());
    let across = [(length - disk.radius).max(0.0), length + disk.radius];
    let [nearest2, farthest2] = across.map(|across| height * height + across * across);
    if farthest2 < UNEVEN * UNEVEN * nearest2 {
        return None;
    }
    let seen = SphericalEllipse::new(height, length, disk.radius)?;
    let away = offset.normalize_or(DVec2::X);
    Some((seen, [x * away.x + y * away.y, y * away.x - x * away.y]))
}

/// The point in this direction of the plane through `on` with this normal; none along the plane.
fn in_plane(p: DVec3, direction: DVec3, on: DVec3, normal: DVec3) -> Option<DVec3> {
    let t = normal.dot(on - p) / normal.dot(direction);
    (t > 0.0 && t.is_finite()).then(|| p + direction * t)
}

/// A flat surface as seen from a point close to it.
enum SeenFlat {
    /// A disk, with its radii away from the foot of the perpendicular and across.
    Disk(SphericalEllipse, [DVec3; 2], DVec3),
    Triangle(SphericalTriangle),
    Rectangle(SphericalRectangle),
    /// The triangles of a parallelogram on both sides of the diagonal from the corner.
    Halves([SphericalTriangle; 2]),
}

impl SeenFlat {
    /// None where the area has to be sampled.
    fn new(flat: &Flat, near: &Near, p: DVec3) -> Option<SeenFlat> {
        if flat.is_far(p) {
            return None;
        }
        match near {
            Near::Disk(disk) => seen_disk(disk, p).map(|(seen, radii)| SeenFlat::Disk(seen, radii, disk.normal)),
            Near::Triangle(corners) => {
                SphericalTriangle::new(corners.map(|corner| corner.as_dvec3() - p)).map(SeenFlat::Triangle)
            }
            Near::Parallelogram => {
                let ([u, v], normal) = (flat.edges, flat.normal);
                let (from, lengths) = (flat.origin - p, [u.length(), v.length()]);
                if u.dot(v).abs() <= SQUARE * lengths[0] * lengths[1] {
                    let across = u / lengths[0];
                    let start = [from.dot(across), from.dot(normal.cross(across))];
                    let [x, y] = [0, 1].map(|k| [start[k], start[k] + lengths[k]]);
                    return SphericalRectangle::new(x, y, from.dot(normal)).map(SeenFlat::Rectangle);
                }
                let half = |through: DVec3| SphericalTriangle::new([from, from + through, from + u + v]);
                Some(SeenFlat::Halves([half(u)?, half(v)?]))
            }
        }
    }

    fn solid_angle(&self) -> f64 {
        match self {
            SeenFlat::Disk(seen, ..) => seen.solid_angle(),
            SeenFlat::Triangle(seen) => seen.solid_angle(),
            SeenFlat::Rectangle(seen) => seen.solid_angle(),
            SeenFlat::Halves([a, b]) => a.solid_angle() + b.solid_angle(),
        }
    }

    /// The point at `u` of the unit square, its normal and its density.
    fn sample(&self, flat: &Flat, p: DVec3, u: [f64; 2]) -> Option<(DVec3, DVec3, f64)> {
        let in_plane = |direction| in_plane(p, direction, flat.origin, flat.normal);
        let (point, normal) = match self {
            SeenFlat::Disk(seen, [away, across], normal) => {
                let [x, y] = seen.sample(u);
                (flat.origin + *across * x + *away * y, *normal)
            }
            SeenFlat::Triangle(seen) => (in_plane(seen.sample(u))?, flat.normal),
            SeenFlat::Rectangle(seen) => {
                let [x, y] = seen.sample(u);
                (flat.origin + flat.edges[0] * x + flat.edges[1] * y, flat.normal)
            }
            SeenFlat::Halves(halves) => {
                let solid_angles = halves.each_ref().map(|half| half.solid_angle());
                let (half, inside) = pick_by_area(u[0], &[solid_angles[0], solid_angles[0] + solid_angles[1]]);
                (in_plane(halves[half].sample([inside, u[1]]))?, flat.normal)
            }
        };
        Some((point, normal, 1.0 / self.solid_angle()))
    }
}

/// A face of a box as seen from a point.
#[derive(Clone, Copy)]
struct SeenFace {
    axis: usize,
    upper: bool,
    /// None if its area has to be sampled.
    spherical: Option<SphericalRectangle>,
    area: f64,
    /// The solid angle, or an estimate of it.
    weight: f64,
}

/// The faces of a box that a point sees.
struct SeenBox {
    faces: [SeenFace; 6],
    count: usize,
    total: f64,
}

impl SeenBox {
    fn new(cuboid: &Cuboid, p: DVec3) -> SeenBox {
        let (min, max) = (cuboid.min.as_dvec3() - p, cuboid.max.as_dvec3() - p);
        let is_outside = min.max_element() > 0.0 || max.min_element() < 0.0;
        let none = SeenFace { axis: 0, upper: false, spherical: None, area: 0.0, weight: 0.0 };
        let mut seen = SeenBox { faces: [none; 6], count: 0, total: 0.0 };
        for face in 0..6 {
            let (axis, upper) = (face / 2, face % 2 == 1);
            let z = if upper { max[axis] } else { min[axis] };
            // From outside, the upper face is seen from above it, and the lower one from below.
            if z == 0.0 || is_outside && upper != (z < 0.0) {
                continue;
            }
            let [x, y] = [1, 2].map(|k| [min[(axis + k) % 3], max[(axis + k) % 3]]);
            let area = (x[1] - x[0]) * (y[1] - y[0]);
            let spherical = SphericalRectangle::new(x, y, z);
            let weight = match &spherical {
                Some(spherical) => spherical.solid_angle(),
                None => {
                    let [x, y] = [x, y].map(|ends| 0.5 * (ends[0] + ends[1]));
                    let distance2 = x * x + y * y + z * z;
                    (z.abs() * area / (distance2 * distance2.sqrt())).min(TAU)
                }
            };
            if weight > 0.0 {
                seen.faces[seen.count] = SeenFace { axis, upper, spherical, area, weight };
                seen.count += 1;
                seen.total += weight;
            }
        }
        seen
    }

    fn sample(&self, cuboid: &Cuboid, p: DVec3, u: [f64; 2]) -> Option<(DVec3, DVec3, f64)> {
        let faces = &self.faces[..self.count];
        let mut rest = u[0] * self.total;
        let index = faces[..self.count.checked_sub(1)?].iter().take_while(|face| {
            let passed = rest >= face.weight;
            rest -= if passed { face.weight } else { 0.0 };
            passed
        });
        let face = &faces[index.count()];
        let u = [(rest / face.weight).clamp(0.0, 1.0), u[1]];
        let [x, y] = face.spherical.as_ref().map_or(u, |spherical| spherical.sample(u));
        let mut share = DVec3::ZERO;
        (share[(face.axis + 1) % 3], share[(face.axis + 2) % 3]) = (x, y);
        share[face.axis] = if face.upper { 1.0 } else { 0.0 };
        let (min, max) = (cuboid.min.as_dvec3(), cuboid.max.as_dvec3());
        let point = min + (max - min) * share;
        let normal = DVec3::AXES[face.axis] * if face.upper { 1.0 } else { -1.0 };
        Some((point, normal, self.density(face, p, point, normal)))
    }

    fn density(&self, face: &SeenFace, p: DVec3, point: DVec3, normal: DVec3) -> f64 {
        let density = match &face.spherical {
            Some(spherical) => 1.0 / spherical.solid_angle(),
            None => density_of_area(p.into(), point.into(), normal.into(), face.area),
        };
        density * face.weight / self.total
    }

    fn pdf(&self, p: DVec3, point: DVec3, normal: DVec3) -> f64 {
        let axis = normal.abs().max_position();
        let face = self.faces[..self.count].iter().find(|face| face.axis == axis && face.upper == (normal[axis] > 0.0));
        face.map_or(0.0, |face| self.density(face, p, point, normal))
    }
}

#[cfg(test)]
mod tests;
