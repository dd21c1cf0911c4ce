//! Intersections as the chapter computes them, in f64: the quadratic equation of a sphere, the plane and the
//! barycentric coordinates of a triangle, the pairs of faces of a box, and the equations of its exercises.

use super::round_shapes::{of_frustum, of_torus};
use crate::math::DRay;
use crate::shape::{Cone, Cuboid, Cylinder, Parallelogram, Plane, Shape, Sphere, Triangle};
use glam::DVec3;
use serde::Serialize;

/// An object that a ray was tried against.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct TriedObject {
    /// The object's name.
    pub object: String,
    /// The object's number, [`crate::world::World::object_id`].
    pub object_id: u32,
    /// The kind of the object.
    pub kind: &'static str,
    /// t of the nearest place where the ray meets it, in lengths of the direction.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub t: Option<f64>,
    /// The reason why the ray misses it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub missed: Option<String>,
    /// Whether the ray's hit is on it.
    pub is_nearest: bool,
}

/// The chapter's equation for a shape and a ray o + t d. If the shape has a transform of its own, all numbers but t are
/// those of its own space.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(tag = "shape", rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Intersection {
    /// a t² + b t + c = 0 (5.15).
    Sphere {
        /// The centre.
        center: [f64; 3],
        /// The radius.
        radius: f64,
        /// d·d (5.16a).
        a: f64,
        /// 2 d·(o − c) (5.16b).
        b: f64,
        /// (o − c)·(o − c) − r² (5.16c).
        c: f64,
        /// b² − 4ac (5.18).
        discriminant: f64,
        /// t₁ and t₂ (5.20); none if the discriminant is negative.
        #[serde(skip_serializing_if = "Option::is_none")]
        roots: Option<[f64; 2]>,
    },
    /// The plane of the corners (5.27), and the areas on both sides of the point (5.30).
    Triangle {
        /// p₁, p₂ and p₃.
        corners: [[f64; 3]; 3],
        /// n̂ (5.23).
        normal: [f64; 3],
        /// t of the plane (5.27).
        t: f64,
        /// A₁, A₂ and A₃ (5.30).
        areas: [f64; 3],
        /// L₁, L₂ and L₃ (5.31).
        barycentric: [f64; 3],
    },
    /// Where the ray enters and leaves each pair of faces (fig. 5.16). A ray along a pair has no numbers for it.
    Box {
        /// The lowest corner.
        min: [f64; 3],
        /// The highest corner.
        max: [f64; 3],
        /// t of entering and of leaving the pairs of faces in x, y and z.
        faces: [Option<[f64; 2]>; 3],
        /// The last t of entering.
        entering: f64,
        /// The first t of leaving.
        leaving: f64,
    },
    /// The plane (5.27).
    Plane {
        /// A point of the plane.
        point: [f64; 3],
        /// The unit normal.
        normal: [f64; 3],
        /// d·n. 0 if the ray is parallel.
        d_dot_n: f64,
        /// t of the plane.
        t: f64,
    },
    /// The plane (5.27) of the point corner + a u + b v.
    Rectangle {
        /// The corner.
        corner: [f64; 3],
        /// An edge from there.
        u: [f64; 3],
        /// The other edge.
        v: [f64; 3],
        /// The unit normal.
        normal: [f64; 3],
        /// t of the plane (5.27).
        t: f64,
        /// a and b, from 0 to 1 on the rectangle.
        shares: [f64; 2],
    },
    /// a t² + b t + c = 0 for the side of a cylinder or cone: the distance from the axis is the radius (exercise 14).
    Frustum {
        /// The centre of the base.
        base: [f64; 3],
        /// The unit axis from the base to the top.
        axis: [f64; 3],
        /// The length.
        length: f64,
        /// The radii at the base and at the top.
        radii: [f64; 2],
        /// The coefficient of t².
        a: f64,
        /// The coefficient of t.
        b: f64,
        /// The constant coefficient.
        c: f64,
        /// b² − 4ac (5.18).
        discriminant: f64,
        /// t₁ and t₂; none if the discriminant is negative.
        #[serde(skip_serializing_if = "Option::is_none")]
        roots: Option<[f64; 2]>,
        /// The heights over the base at t₁ and t₂, from 0 to the length on the shape.
        #[serde(skip_serializing_if = "Option::is_none")]
        heights: Option<[f64; 2]>,
        /// t at the disks of the base and of the top, where they are met.
        caps: [Option<f64>; 2],
    },
    /// c₀ + c₁ t + c₂ t² + c₃ t³ + c₄ t⁴ = 0.
    Torus {
        /// The centre.
        center: [f64; 3],
        /// The unit axis.
        axis: [f64; 3],
        /// The radius of the circle.
        radius: f64,
        /// The radius of the tube.
        tube: f64,
        /// c₀ to c₄.
        coefficients: [f64; 5],
        /// The real roots in ascending order, four at most.
        roots: [Option<f64>; 4],
    },
}

impl Intersection {
    /// The equation of a shape, if the chapter has one.
    pub(super) fn of(shape: &Shape, ray: &DRay) -> Option<Intersection> {
        match shape {
            Shape::Sphere(sphere) => Some(of_sphere(sphere, ray)),
            Shape::Triangle(Triangle { a, b, c, .. }) => {
                Some(Intersection::of_triangle([a, b, c].map(|p| p.as_dvec3()), ray))
            }
            Shape::Box(cuboid) => Some(of_box(cuboid, ray)),
            Shape::Plane(plane) => Some(of_plane(plane, ray)),
            Shape::Cylinder(Cylinder { base, top, radius, caps }) => {
                Some(of_frustum([*base, *top], [*radius; 2], *caps, ray))
            }
            Shape::Cone(Cone { base, top, radius, top_radius, caps }) => {
                Some(of_frustum([*base, *top], [*radius, *top_radius], *caps, ray))
            }
            Shape::Torus(torus) => Some(of_torus(torus, ray)),
            Shape::Rectangle(sheet) => Some(of_rectangle(sheet, ray)),
            _ => None,
        }
    }

    /// The equation of a triangle.
    pub(super) fn of_triangle([p1, p2, p3]: [DVec3; 3], ray: &DRay) -> Intersection {
        let normal = (p2 - p1).cross(p3 - p1).normalize_or_zero(); // (5.23)
        let t = (p1 - ray.origin).dot(normal) / ray.direction.dot(normal); // (5.27)
        let p = ray.origin + ray.direction * t; // (5.28)
        let area = |from: DVec3, to: DVec3| normal.dot((to - from).cross(p - from)) / 2.0;
        let areas = [area(p2, p3), area(p3, p1), area(p1, p2)]; // (5.30)
        let all: f64 = areas.iter().sum();
        Intersection::Triangle {
            corners: [p1, p2, p3].map(|p| p.to_array()),
            normal: normal.to_array(),
            t,
            areas,
            barycentric: areas.map(|area| area / all), // (5.31)
        }
    }

    /// The reason why there is no hit, if the numbers tell one.
    pub(super) fn missed(&self) -> Option<String> {
        match *self {
            Intersection::Sphere { discriminant, roots: None, .. } => Some(format!("delta = {discriminant:.3e} < 0")),
            Intersection::Sphere { roots: Some([t1, t2]), .. } if t2 <= 0.0 => {
                Some(format!("it lies behind, t = {} and {}", short(t1), short(t2)))
            }
            Intersection::Triangle { t, .. } | Intersection::Rectangle { t, .. } | Intersection::Plane { t, .. }
                if !t.is_finite() =>
            {
                Some("the ray is parallel to its plane".to_owned())
            }
            Intersection::Triangle { t, .. } | Intersection::Rectangle { t, .. } | Intersection::Plane { t, .. }
                if t <= 0.0 =>
            {
                Some(format!("its plane lies behind, t = {}", short(t)))
            }
            Intersection::Triangle { barycentric, .. } if barycentric.iter().any(|&l| l < 0.0) => {
                let [l1, l2, l3] = barycentric.map(short);
                Some(format!("outside of it: L = ({l1}, {l2}, {l3})"))
            }
            Intersection::Rectangle { shares, .. } if shares.iter().any(|s| !(0.0..=1.0).contains(s)) => {
                let [a, b] = shares.map(short);
                Some(format!("outside of it: a = {a}, b = {b}"))
            }
            Intersection::Box { entering, leaving, .. } if entering > leaving => Some(format!(
                "the ray leaves a pair of faces at t = {} before it enters another at t = {}",
                short(leaving),
                short(entering)
            )),
            Intersection::Box { leaving, .. } if leaving <= 0.0 => {
                Some(format!("it lies behind, left at t = {}", short(leaving)))
            }
            Intersection::Frustum { caps: [None, None], roots: None, discriminant, .. } => {
                Some(format!("delta = {discriminant:.3e} < 0"))
            }
            Intersection::Frustum { heights: Some([y1, y2]), length, .. } if self.in_front().is_none() => {
                let (y1, y2) = (short(y1), short(y2));
                Some(format!("it lies behind, or beside: heights {y1} and {y2} of 0 to {}", short(length)))
            }
            Intersection::Torus { roots, .. } if roots.iter().flatten().all(|&t| t <= 0.0) => {
                Some("its equation has no root t > 0".to_owned())
            }
            _ => None,
        }
    }

    /// The nearest t in front of the origin.
    pub(super) fn nearest(&self) -> Option<f64> {
        if self.missed().is_some() { None } else { self.in_front() }
    }

    fn in_front(&self) -> Option<f64> {
        let of = |candidates: &[f64]| candidates.iter().copied().find(|&t| t > 0.0);
        match *self {
            Intersection::Frustum { roots, heights, length, caps, .. } => {
                let sides = roots.into_iter().flatten().zip(heights.into_iter().flatten());
                let sides = sides.filter(|(_, y)| (0.0..=length).contains(y)).map(|(t, _)| t);
                sides.chain(caps.into_iter().flatten()).filter(|&t| t > 0.0).min_by(f64::total_cmp)
            }
            Intersection::Torus { roots, .. } => roots.into_iter().flatten().find(|&t| t > 0.0),
            Intersection::Sphere { roots, .. } => of(&roots?),
            Intersection::Triangle { t, .. } | Intersection::Rectangle { t, .. } | Intersection::Plane { t, .. } => {
                of(&[t])
            }
            Intersection::Box { entering, leaving, .. } => of(&[entering, leaving]),
        }
    }
}

/// A number of a message.
fn short(v: f64) -> String {
    super::number::Number(v, super::number::Digits::Significant(4)).to_string()
}

fn of_sphere(Sphere { center, radius }: &Sphere, ray: &DRay) -> Intersection {
    let (center, radius) = (center.as_dvec3(), f64::from(*radius));
    let from_center = ray.origin - center;
    let a = ray.direction.dot(ray.direction); // (5.16a)
    let b = 2.0 * ray.direction.dot(from_center); // (5.16b)
    let c = from_center.dot(from_center) - radius * radius; // (5.16c)
    let discriminant = b * b - 4.0 * a * c; // (5.18)
    let roots = (discriminant >= 0.0).then(|| [-1.0, 1.0].map(|sign| (-b + sign * discriminant.sqrt()) / (2.0 * a)));
    Intersection::Sphere { center: center.to_array(), radius, a, b, c, discriminant, roots } // (5.20)
}

fn of_box(Cuboid { min, max }: &Cuboid, ray: &DRay) -> Intersection {
    let (min, max) = (min.as_dvec3().to_array(), max.as_dvec3().to_array());
    let (origin, direction) = (ray.origin.to_array(), ray.direction.to_array());
    let (mut entering, mut leaving) = (f64::NEG_INFINITY, f64::INFINITY);
    let faces = [0, 1, 2].map(|axis| {
        let (o, d) = (origin[axis], direction[axis]);
        if d == 0.0 {
            // Along the faces, the ray is between them for all t or for none.
            if o < min[axis] || o > max[axis] {
                entering = f64::INFINITY;
            }
            return None;
        }
        let (first, last) = if d > 0.0 { (min[axis], max[axis]) } else { (max[axis], min[axis]) };
        let pair = [(first - o) / d, (last - o) / d];
        entering = entering.max(pair[0]);
        leaving = leaving.min(pair[1]);
        Some(pair)
    });
    Intersection::Box { min, max, faces, entering, leaving }
}

fn of_rectangle(sheet: &Parallelogram, ray: &DRay) -> Intersection {
    let [corner, u, v] = [sheet.corner, sheet.u, sheet.v].map(|p| p.as_dvec3());
    let (normal, cross) = (sheet.normal(), u.cross(v));
    let t = (corner - ray.origin).dot(normal) / ray.direction.dot(normal); // (5.27)
    let p = ray.origin + ray.direction * t - corner; // (5.28)
    let shares = [p.cross(v), u.cross(p)].map(|part| part.dot(normal) / cross.dot(normal));
    let [corner, u, v, normal] = [corner, u, v, normal].map(|p| p.to_array());
    Intersection::Rectangle { corner, u, v, normal, t, shares }
}

fn of_plane(Plane { point, normal }: &Plane, ray: &DRay) -> Intersection {
    let (point, normal) = (point.as_dvec3(), normal.as_dvec3().normalize());
    let d_dot_n = ray.direction.dot(normal);
    let t = (point - ray.origin).dot(normal) / d_dot_n; // (5.27)
    Intersection::Plane { point: point.to_array(), normal: normal.to_array(), d_dot_n, t }
}
