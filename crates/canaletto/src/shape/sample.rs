//! Areas of surfaces, and random points on them: uniform over the area, or as seen from a point.

use super::flat::{Domain, Flat, Flats};
use super::{
    Cone, Cuboid, Cylinder, Disk, Mesh, Parallelogram, Partial, Shape, Sphere, Surface, Torus, Triangle, solve,
    triangle,
};
use crate::math::warp;
use glam::{DVec3, Vec3};
use std::f64::consts::{PI, TAU};

/// A random point of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceSample {
    /// The point.
    pub point: DVec3,
    /// The unit normal there, on the outer (visible) side.
    pub normal: DVec3,
    /// The probability density of the point: per unit of area, or per unit of solid angle seen from a point.
    pub pdf: f64,
}

/// The runtime form of a surface of which random points are sampled.
#[derive(Clone, Debug)]
pub struct SurfaceSampler {
    pub(super) form: Form,
    area: f64,
}

#[derive(Clone, Debug)]
pub(super) enum Form {
    /// A flat surface, and how its solid angle is sampled.
    Flat(Box<Flat>, Near),
    /// The centre and the radius.
    Sphere(DVec3, f64),
    /// The corners of several triangles, counter-clockwise seen from the outer side, and the cumulative sums of the
    /// areas.
    Triangles(Vec<[Vec3; 3]>, Vec<f64>),
    /// The cumulative sums of the areas of the faces.
    Box(Cuboid, [f64; 6]),
    Frustum(Box<FrustumForm>),
    Torus(Box<TorusForm>),
}

/// A flat surface as points close to it see it.
#[derive(Clone, Debug)]
pub(super) enum Near {
    Disk(Box<DiskForm>),
    /// The surface of [`Flat`] itself.
    Parallelogram,
    Triangle(Box<[Vec3; 3]>),
}

/// A disk. Its radii and normal have all digits, which the solid angle of a grazing disk asks for. Those of [`Flat`]
/// have the digits of `f32`.
#[derive(Clone, Debug)]
pub(super) struct DiskForm {
    pub(super) center: DVec3,
    pub(super) radii: [DVec3; 2],
    pub(super) normal: DVec3,
    pub(super) radius: f64,
}

/// A cylinder or cone.
#[derive(Clone, Debug)]
pub(super) struct FrustumForm {
    ends: [DVec3; 2],
    /// The unit axis from the base to the top, and two perpendicular unit vectors across.
    axis: DVec3,
    across: [DVec3; 2],
    radii: [f64; 2],
    /// The angle around the axis at which the surface begins, and that which it covers.
    turn: [f64; 2],
    /// The growth of the radius per unit of height.
    slope: f64,
    /// The cumulative sums of the areas of side, base and top.
    sums: [f64; 3],
}

#[derive(Clone, Debug)]
pub(super) struct TorusForm {
    center: DVec3,
    /// The unit axis, and two perpendicular unit vectors across.
    axis: DVec3,
    across: [DVec3; 2],
    /// The circle's radius.
    ring: f64,
    /// The tube's radius.
    tube: f64,
    /// The largest angle around the tube from the outer equator: π, or less for a spindle torus.
    end: f64,
}

impl Shape {
    /// The area of the surface; none for a plane, which is infinite.
    pub fn area(&self) -> Option<f64> {
        self.sampler().map(|sampler| sampler.area())
    }

    /// The sampler of the surface; none for a plane, which has no uniform points.
    pub fn sampler(&self) -> Option<SurfaceSampler> {
        match self {
            Shape::Sphere(s) => Some(SurfaceSampler::sphere(s)),
            Shape::Box(s) => Some(SurfaceSampler::cuboid(s)),
            Shape::Triangle(Triangle { a, b, c, .. }) => Some(SurfaceSampler::triangles(vec![[*a, *b, *c]])),
            Shape::Plane(_) => None,
            Shape::Disk(s) => Some(SurfaceSampler::disk(s)),
            Shape::Cylinder(Cylinder { base, top, radius, caps }) => {
                Some(SurfaceSampler::frustum([*base, *top], [*radius; 2], *caps))
            }
            Shape::Cone(Cone { base, top, radius, top_radius, caps }) => {
                Some(SurfaceSampler::frustum([*base, *top], [*radius, *top_radius], *caps))
            }
            Shape::Torus(s) => Some(SurfaceSampler::torus(s)),
            Shape::Rectangle(s) => Some(s.sampler()),
            Shape::Partial(s) => Some(SurfaceSampler::partial(s)),
        }
    }
}

impl Mesh {
    /// The sampler of the triangles, in coordinates relative to the mesh's origin.
    pub fn sampler(&self) -> SurfaceSampler {
        SurfaceSampler::triangles((0..self.len()).map(|i| self.corners(i)).collect())
    }
}

impl Parallelogram {
    /// The sampler of the surface.
    pub fn sampler(&self) -> SurfaceSampler {
        let [corner, u, v] = [self.corner, self.u, self.v].map(|v| v.as_dvec3());
        let cross = u.cross(v);
        let (normal, area) = (cross.normalize(), cross.length());
        SurfaceSampler::of_flat(Flat::new(corner, [u, v], normal, area, Domain::Parallelogram), Near::Parallelogram)
    }
}

/// The cross product of two edges. It is along the normal, and its length is twice the area.
pub(super) fn edges(triangle: &[Vec3; 3]) -> DVec3 {
    let [a, b, c] = triangle.map(|p| p.as_dvec3());
    (b - a).cross(c - a)
}

/// The cumulative sums of areas, or of other weights.
fn cumulative(areas: impl Iterator<Item = f64>) -> impl Iterator<Item = f64> {
    areas.scan(0.0, |sum, area| {
        *sum += area;
        Some(*sum)
    })
}

/// The part that `u` of [0, 1) selects, with a probability in proportion to its area, and where `u` lies within its
/// part. `sums` are the [cumulative] sums of the areas.
pub(crate) fn pick_by_area(u: f64, sums: &[f64]) -> (usize, f64) {
    let wanted = u * sums[sums.len() - 1];
    let i = sums.partition_point(|sum| *sum <= wanted).min(sums.len() - 1);
    let before = if i == 0 { 0.0 } else { sums[i - 1] };
    (i, ((wanted - before) / (sums[i] - before)).clamp(0.0, 1.0))
}

/// The surface at `u` of the unit square on a triangle with an area, uniform over it.
pub(crate) fn sample_triangle(corners: [Vec3; 3], u: [f64; 2]) -> Surface {
    solve::surface(on_triangle(&corners, u), triangle::size(corners), edges(&corners).normalize_or_zero(), [0.0; 2])
}

pub(super) fn on_triangle(corners: &[Vec3; 3], [u, v]: [f64; 2]) -> DVec3 {
    let [a, b, c] = corners.map(|p| p.as_dvec3());
    let root = u.sqrt();
    a + (b - a) * (root * (1.0 - v)) + (c - a) * (root * v)
}

impl SurfaceSampler {
    fn of_flat(flat: Flat, near: Near) -> SurfaceSampler {
        let area = flat.area;
        SurfaceSampler { form: Form::Flat(Box::new(flat), near), area }
    }

    fn disk(disk: &Disk) -> SurfaceSampler {
        // A frame in `f32`: a point of a scene is no finer.
        let normal = disk.normal.normalize();
        let (x, y) = normal.any_orthonormal_pair();
        let radius = f64::from(disk.radius);
        let radii = [x.as_dvec3() * radius, y.as_dvec3() * radius];
        let exact_normal = disk.normal.as_dvec3().normalize();
        let exact_radius = radii[0].reject_from_normalized(exact_normal).normalize() * radius;
        let center = disk.center.as_dvec3();
        let exact_radii = [exact_radius, exact_normal.cross(exact_radius)];
        let form = DiskForm { center, radii: exact_radii, normal: exact_normal, radius };
        let flat = Flat::new(center, radii, normal.as_dvec3(), PI * radii[0].length_squared(), Domain::Disk);
        SurfaceSampler::of_flat(flat, Near::Disk(Box::new(form)))
    }

    fn sphere(sphere: &Sphere) -> SurfaceSampler {
        let radius = f64::from(sphere.radius);
        SurfaceSampler { form: Form::Sphere(sphere.center.as_dvec3(), radius), area: 4.0 * PI * radius * radius }
    }

    /// The sampler of triangles, whose corners are counter-clockwise when seen from the outer side.
    pub fn triangles(corners: Vec<[Vec3; 3]>) -> SurfaceSampler {
        if let [triangle] = corners[..] {
            let [a, b, c] = triangle.map(|corner| corner.as_dvec3());
            let cross = edges(&triangle);
            let (normal, area) = (cross.normalize_or_zero(), 0.5 * cross.length());
            let flat = Flat::new(a, [b - a, c - a], normal, area, Domain::Triangle);
            return SurfaceSampler::of_flat(flat, Near::Triangle(Box::new(triangle)));
        }
        let sums: Vec<f64> = cumulative(corners.iter().map(|triangle| 0.5 * edges(triangle).length())).collect();
        let area = sums.last().copied().unwrap_or(0.0);
        SurfaceSampler { form: Form::Triangles(corners, sums), area }
    }

    fn cuboid(cuboid: &Cuboid) -> SurfaceSampler {
        let size = cuboid.max.as_dvec3() - cuboid.min.as_dvec3();
        let faces = [size.y * size.z, size.z * size.x, size.x * size.y];
        let mut sums = [0.0; 6];
        sums.iter_mut().zip(cumulative(faces.into_iter().flat_map(|area| [area; 2]))).for_each(|(to, sum)| *to = sum);
        SurfaceSampler { form: Form::Box(*cuboid, sums), area: sums[5] }
    }

    fn frustum(ends: [Vec3; 2], radii: [f32; 2], caps: bool) -> SurfaceSampler {
        let (ends, radii) = (ends.map(|p| p.as_dvec3()), radii.map(f64::from));
        let height = ends[0].distance(ends[1]);
        let axis = (ends[1] - ends[0]) / height;
        let slant = (height * height + (radii[1] - radii[0]) * (radii[1] - radii[0])).sqrt();
        let [base, top] = radii.map(|r| if caps { PI * r * r } else { 0.0 });
        let side = PI * (radii[0] + radii[1]) * slant;
        let (sums, across) = ([side, side + base, side + base + top], axis.any_orthonormal_pair().into());
        let slope = (radii[1] - radii[0]) / height;
        let form = Form::Frustum(Box::new(FrustumForm { ends, axis, across, radii, turn: [0.0, TAU], slope, sums }));
        SurfaceSampler { form, area: sums[2] }
    }

    fn partial(partial: &Partial) -> SurfaceSampler {
        let frame = partial.whole.frame();
        let [(base, r0), (top, r1)] = partial.whole.ends();
        let (share, height) = (partial.share(), base.distance(top));
        let slant = (height * height + (r1 - r0) * (r1 - r0)).sqrt();
        let area = share * PI * (r0 + r1) * slant;
        // The base and the top of a disk are its centre and its rim. All of its area is that of the top.
        let (sums, slope) = if partial.is_flat() { ([0.0, 0.0, area], 0.0) } else { ([area; 3], (r1 - r0) / height) };
        let form = FrustumForm {
            ends: [base, top],
            axis: frame.y,
            across: [frame.z, frame.x],
            radii: [r0, r1],
            turn: [TAU * (partial.u(0.0) - 0.5), TAU * share],
            slope,
            sums,
        };
        SurfaceSampler { form: Form::Frustum(Box::new(form)), area }
    }

    fn torus(torus: &Torus) -> SurfaceSampler {
        let [ring, tube] = [torus.radius, torus.tube].map(f64::from);
        let axis = torus.axis.as_dvec3().normalize();
        let across = axis.any_orthonormal_pair().into();
        let end = if ring < tube { libm::acos(-ring / tube) } else { PI };
        let form = TorusForm { center: torus.center.as_dvec3(), axis, across, ring, tube, end };
        // Twice the integral of 2π (R + r cos ψ) r over ψ from 0 to the end.
        let area = 4.0 * PI * tube * form.sum_to(end);
        SurfaceSampler { form: Form::Torus(Box::new(form)), area }
    }

    /// The area of the surface.
    pub fn area(&self) -> f64 {
        self.area
    }

    /// The point at `u` of the unit square, with its density per unit of area. Equal parts of the square map to equal
    /// areas. The surface must have an area.
    pub fn sample(&self, u: [f64; 2]) -> SurfaceSample {
        let (point, normal) = self.point(u);
        SurfaceSample { point, normal, pdf: self.pdf() }
    }

    /// The density of [`SurfaceSampler::sample`] at every point, per unit of area.
    pub fn pdf(&self) -> f64 {
        1.0 / self.area
    }

    /// The point at `u` of the unit square, and the unit normal there.
    pub(crate) fn point(&self, [u, v]: [f64; 2]) -> (DVec3, DVec3) {
        match &self.form {
            Form::Flat(flat, _) => (Flats::gather(|_| flat).points([u, v]).into(), flat.normal),
            Form::Sphere(center, radius) => {
                let normal = warp::sphere([u, v]);
                (*center + normal * *radius, normal)
            }
            Form::Triangles(corners, sums) => {
                let (i, inside) = pick_by_area(u, sums);
                (on_triangle(&corners[i], [inside, v]), edges(&corners[i]).normalize_or_zero())
            }
            Form::Box(cuboid, sums) => {
                let (face, inside) = pick_by_area(u, sums);
                let (min, max) = (cuboid.min.as_dvec3(), cuboid.max.as_dvec3());
                let (axis, upper) = (face / 2, face % 2 == 1);
                let mut share = DVec3::ZERO;
                (share[(axis + 1) % 3], share[(axis + 2) % 3]) = (inside, v);
                share[axis] = if upper { 1.0 } else { 0.0 };
                (min + (max - min) * share, DVec3::AXES[axis] * if upper { 1.0 } else { -1.0 })
            }
            Form::Frustum(frustum) => frustum.point([u, v]),
            Form::Torus(torus) => torus.point([u, v]),
        }
    }

    /// The surface at `u` of the unit square, without texture coordinates.
    pub(crate) fn surface(&self, u: [f64; 2]) -> Surface {
        let (point, normal) = self.point(u);
        let [min, max] = self.bounds();
        solve::surface(point, min.abs().max(max.abs()).max_element(), normal, [0.0; 2])
    }

    /// The smallest and the largest coordinates of the surface.
    pub fn bounds(&self) -> [DVec3; 2] {
        let around = |center: DVec3, extent: DVec3| [center - extent, center + extent];
        let of_points = |points: &mut dyn Iterator<Item = DVec3>| {
            points.fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[min, max], p| [min.min(p), max.max(p)])
        };
        match &self.form {
            Form::Flat(flat, _) => {
                let (origin, [a, b]) = (flat.origin, flat.edges);
                match flat.domain {
                    Domain::Disk => around(origin, (a * a + b * b).map(f64::sqrt)),
                    Domain::Parallelogram => of_points(&mut [DVec3::ZERO, a, b, a + b].into_iter().map(|p| origin + p)),
                    Domain::Triangle => of_points(&mut [DVec3::ZERO, a, b].into_iter().map(|p| origin + p)),
                }
            }
            Form::Sphere(center, radius) => around(*center, DVec3::splat(*radius)),
            Form::Triangles(corners, _) => of_points(&mut corners.iter().flatten().map(|p| p.as_dvec3())),
            Form::Box(cuboid, _) => [cuboid.min.as_dvec3(), cuboid.max.as_dvec3()],
            Form::Frustum(frustum) => {
                let end = |i: usize| around(frustum.ends[i], solve::disk_extent(frustum.axis, frustum.radii[i]));
                of_points(&mut [end(0), end(1)].into_iter().flatten())
            }
            Form::Torus(torus) => {
                let ring = solve::disk_extent(torus.axis, torus.ring);
                around(torus.center, ring + torus.tube)
            }
        }
    }

    /// The axis of a cone around all normals, and the cosine of the cone's half angle.
    pub fn normal_cone(&self) -> (DVec3, f64) {
        match &self.form {
            Form::Flat(flat, _) => (flat.normal, 1.0),
            Form::Triangles(corners, _) => {
                let axis = corners.iter().map(edges).sum::<DVec3>().normalize_or(DVec3::Z);
                let cosines = corners.iter().filter_map(|triangle| edges(triangle).try_normalize());
                (axis, cosines.map(|normal| normal.dot(axis)).fold(1.0, f64::min))
            }
            Form::Frustum(form) if form.sums[1] == 0.0 => (form.axis, 1.0),
            Form::Sphere(..) | Form::Box(..) | Form::Frustum(_) | Form::Torus(_) => (DVec3::Z, -1.0),
        }
    }

    /// Whether the surface is a sphere.
    pub(crate) fn is_sphere(&self) -> bool {
        matches!(self.form, Form::Sphere(..))
    }
}

impl FrustumForm {
    fn point(&self, [u, v]: [f64; 2]) -> (DVec3, DVec3) {
        let ([x, y], [r0, r1]) = (self.across, self.radii);
        let (part, inside) = pick_by_area(u, &self.sums);
        let (sin, cos) = libm::sincos(self.turn[0] + self.turn[1] * v);
        let out = x * cos + y * sin;
        if part > 0 {
            let end = part - 1;
            let normal = if end == 0 { -self.axis } else { self.axis };
            return (self.ends[end] + out * (self.radii[end] * inside.sqrt()), normal);
        }
        // The area up to a height is in proportion to the growth of the squared radius, so that r² is uniform.
        let r = (r0 * r0 + inside * (r1 * r1 - r0 * r0)).sqrt();
        let share = if r + r0 > 0.0 { inside * (r0 + r1) / (r + r0) } else { 0.0 };
        let on_axis = self.ends[0] + (self.ends[1] - self.ends[0]) * share;
        (on_axis + out * r, (out - self.axis * self.slope).normalize())
    }
}

impl TorusForm {
    /// The integral of the distance R + r cos ψ from the axis, over the angle ψ around the tube from 0.
    fn sum_to(&self, angle: f64) -> f64 {
        self.ring * angle + self.tube * libm::sin(angle)
    }

    fn point(&self, [u, v]: [f64; 2]) -> (DVec3, DVec3) {
        let wanted = (2.0 * u - 1.0) * self.sum_to(self.end);
        // Newton's method, kept between bounds of the root.
        let (mut low, mut high, mut angle) = (-self.end, self.end, (2.0 * u - 1.0) * self.end);
        for _ in 0..64 {
            let excess = self.sum_to(angle) - wanted;
            if excess > 0.0 {
                high = angle
            } else {
                low = angle
            }
            let newton = angle - excess / (self.ring + self.tube * libm::cos(angle));
            let next = if low < newton && newton < high { newton } else { 0.5 * (low + high) };
            if (next - angle).abs() <= f64::EPSILON * self.end {
                break;
            }
            angle = next;
        }
        let ((sin, cos), (s, c)) = (libm::sincos(TAU * v), libm::sincos(angle));
        let out = self.across[0] * cos + self.across[1] * sin;
        let normal = out * c + self.axis * s;
        (self.center + out * self.ring + normal * self.tube, normal)
    }
}

#[cfg(test)]
mod tests;
