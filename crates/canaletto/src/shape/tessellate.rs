//! Tessellation: triangles whose distance to the exact surface is at most a tolerance.
//!
//! All vertices lie on the surface. Vertices at one place have equal bits, also where texture coordinates or normals
//! differ (uv seams, edges of boxes, rims of caps). The triangles of a closed shape are therefore closed, too.

use super::cuts::{Allowed, Cuts, ViewCuts};
use super::parallelogram::HALVES;
use super::{Cone, Cuboid, Cylinder, Disk, Parallelogram, Partial, Plane, Shape, Sphere, Torus, Triangle, solve};
use crate::math::Transform;
use canaletto_bvh::Aabb;
use glam::{DVec2, DVec3, Vec3};
use std::collections::HashMap;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Triangles that stand for a shape, counter-clockwise when seen from its outer (visible) side.
#[derive(Clone, Debug, Default)]
pub struct Tessellation {
    /// The vertices.
    pub vertices: Vec<TessellationVertex>,
    /// The indices of three vertices for each triangle.
    pub triangles: Vec<[u32; 3]>,
    /// The part of the shape that each triangle stands for, as in [`ShapeHit::part`](super::ShapeHit::part).
    pub parts: Vec<u32>,
}

/// A vertex of a tessellation, a point of the exact surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TessellationVertex {
    /// The point.
    pub point: DVec3,
    /// The unit normal of the exact surface, on the outer side.
    pub normal: DVec3,
    /// The texture coordinates of the exact surface. Vertices at a seam have the coordinates of their own side.
    pub uv: DVec2,
    /// The rule for new vertices between this one and its neighbours.
    pub(super) place: Place,
}

/// The rule for the place of a new vertex on the surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Place {
    /// The place between the vertex's neighbours.
    Between,
    /// A place on the round part of the shape.
    Round,
    /// A place on the rim of the cap at the top or at the base.
    Rim { top: bool },
}

/// The tolerance needs more triangles than the limit allows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the tessellation needs more than {limit} triangles; a larger tolerance needs fewer")]
pub struct TooManyTriangles {
    /// The largest number of triangles allowed.
    pub limit: usize,
}

impl Shape {
    /// Triangles for the shape. No point of a triangle is farther than `tolerance` > 0 from the exact surface.
    ///
    /// The tolerance is a length in the shape's own space. An instance whose triangles should be within a tolerance in
    /// the world divides that by [`Transform::max_stretch`](crate::math::Transform::max_stretch). The number of
    /// triangles grows with 1/√tolerance for each direction in which the surface is curved. Only the part of a plane
    /// inside the finite box `clip` is covered, possibly none; other shapes aren't clipped.
    ///
    /// # Errors
    /// [`TooManyTriangles`] if the number of triangles would exceed `limit`.
    pub fn tessellate(&self, tolerance: f64, clip: &Aabb, limit: usize) -> Result<Tessellation, TooManyTriangles> {
        let grid = self.grid(tolerance, FRAC_PI_2);
        if grid.triangles > limit as f64 {
            return Err(TooManyTriangles { limit });
        }
        let tessellation = self.on_grid(grid, clip);
        if tessellation.triangles.len() > limit { Err(TooManyTriangles { limit }) } else { Ok(tessellation) }
    }

    /// [`Shape::tessellate`] with as much area as the exact shape has after a map. The triangles are those of a shape
    /// that is larger by up to the tolerance. Half the angle of a column or a row is at most `most_angle`, as far as
    /// the limit allows.
    ///
    /// Triangles with corners on a ball have less area than the ball, and what they send, reflect or hide is less by as
    /// much.
    ///
    /// # Errors
    /// As [`Shape::tessellate`].
    pub(crate) fn tessellate_with_area(
        &self,
        (tolerance, most_angle): (f64, f64),
        clip: &Aabb,
        limit: usize,
        to_world: Option<&Transform>,
    ) -> Result<Tessellation, TooManyTriangles> {
        let grid = self.grid(tolerance, most_angle);
        if grid.triangles > limit as f64 {
            return Err(TooManyTriangles { limit });
        }
        let inscribed = self.on_grid(grid, clip);
        if inscribed.triangles.len() > limit {
            return Err(TooManyTriangles { limit });
        }
        let grown = self.area_on(grid, to_world).and_then(|area| self.with_area(area, grid, to_world));
        Ok(grown.map_or(inscribed, |shape| shape.on_grid(grid, clip)))
    }

    /// The area after a map, for shapes that aren't flat or that have a round rim.
    fn area_on(&self, grid: Grid, to_world: Option<&Transform>) -> Option<f64> {
        if self.is_polygonal() {
            return None;
        }
        let own = self.area()?;
        let Some(map) = to_world else { return Some(own) };
        // Richardson's extrapolation: the error of the area falls with the square of the angles. The same error in the
        // shape's own space, where the area is known, cancels most of what is left.
        let twice = Grid { columns: 2 * grid.columns, rows: 2 * grid.rows, ..grid };
        let [near, far] = [grid, twice].map(|grid| self.on_grid(grid, &Aabb::EMPTY));
        let limit = |map: Option<&Transform>| (4.0 * far.area_after(map) - near.area_after(map)) / 3.0;
        Some(own * (limit(Some(map)) / limit(None)))
    }

    /// The shape with larger radii whose triangles have this area after a map. None where there is no such shape.
    fn with_area(&self, area: f64, grid: Grid, to_world: Option<&Transform>) -> Option<Shape> {
        let at = |growth: f64| -> Option<(Shape, f64)> {
            let shape = self.grown(growth)?;
            Some((shape, shape.on_grid(grid, &Aabb::EMPTY).area_after(to_world) / area - 1.0))
        };
        // The secant method; the area is nearly linear in the growth.
        let (mut before, mut missing) = (0.0, at(0.0)?.1);
        let mut growth = -0.5 * missing;
        for _ in 0..8 {
            let (shape, now) = at(growth)?;
            if now.abs() <= 1e-6 {
                return Some(shape);
            }
            let slope = (now - missing) / (growth - before);
            (before, missing) = (growth, now);
            growth -= now / slope;
        }
        None
    }

    /// The shape with radii that are larger by a part of themselves, up to twice as large.
    fn grown(&self, growth: f64) -> Option<Shape> {
        if !(0.0..=1.0).contains(&growth) {
            return None;
        }
        let larger = |radius: f32| (f64::from(radius) * (1.0 + growth)) as f32;
        match *self {
            Shape::Sphere(s) => Some(Shape::Sphere(Sphere { radius: larger(s.radius), ..s })),
            Shape::Disk(s) => Some(Shape::Disk(Disk { radius: larger(s.radius), ..s })),
            Shape::Partial(s) => Some(Shape::Partial(s.with_radii(larger))),
            Shape::Cylinder(s) => Some(Shape::Cylinder(Cylinder { radius: larger(s.radius), ..s })),
            Shape::Cone(s) => {
                let [radius, top_radius] = [s.radius, s.top_radius].map(larger);
                Some(Shape::Cone(Cone { radius, top_radius, ..s }))
            }
            Shape::Torus(s) => {
                let tube = larger(s.tube);
                let keeps_hole = (s.radius <= s.tube) == (s.radius <= tube);
                keeps_hole.then_some(Shape::Torus(Torus { tube, ..s }))
            }
            Shape::Box(_) | Shape::Triangle(_) | Shape::Rectangle(_) | Shape::Plane(_) => None,
        }
    }

    /// The columns and rows that a tolerance needs.
    fn grid(&self, tolerance: f64, most_angle: f64) -> Grid {
        // A tolerance that isn't a positive number asks for infinitely many triangles.
        let tolerance = tolerance.max(0.0);
        let least = (FRAC_PI_2 / most_angle).ceil().max(2.0);
        let chords = |radius: f64, tolerance: f64| {
            let chords = chords(radius, tolerance);
            if most_angle < FRAC_PI_2 { chords.max(2.0 * least) } else { chords }
        };
        let of = |columns: f64, rows: f64, triangles: f64| Grid {
            columns: columns as usize,
            rows: rows as usize,
            triangles,
        };
        match self {
            Shape::Sphere(s) => {
                // A cell's plane is r cos² φ from the centre, where φ is half the angle of a column and of a row.
                let half_angle = libm::asin((tolerance / f64::from(s.radius)).sqrt().min(1.0));
                let rows = (FRAC_PI_2 / half_angle).ceil().max(least);
                of(2.0 * rows, rows, 4.0 * rows * (rows - 1.0))
            }
            Shape::Box(_) | Shape::Triangle(_) | Shape::Rectangle(_) | Shape::Plane(_) => of(0.0, 0.0, 0.0),
            Shape::Disk(s) => {
                let columns = chords(s.radius.into(), tolerance);
                of(columns, 0.0, columns)
            }
            Shape::Partial(s) => {
                let radius = s.whole.ends().map(|(_, radius)| radius).into_iter().fold(0.0, f64::max);
                let columns = (chords(radius, tolerance) * s.share()).ceil().max(1.0);
                of(columns, 0.0, if s.is_flat() { columns } else { 2.0 * columns })
            }
            Shape::Cylinder(Cylinder { radius, .. }) => {
                let columns = chords((*radius).into(), tolerance);
                of(columns, 0.0, 2.0 * columns)
            }
            Shape::Cone(Cone { radius, top_radius, .. }) => {
                let columns = chords(radius.max(*top_radius).into(), tolerance);
                of(columns, 0.0, columns)
            }
            Shape::Torus(s) => {
                let [ring, tube] = [s.radius, s.tube].map(f64::from);
                // The chords around the axis and those around the tube take half of the tolerance each.
                let (columns, rows) = (chords(ring + tube, 0.5 * tolerance), chords(tube, 0.5 * tolerance));
                of(columns, rows, columns * rows)
            }
        }
    }

    fn on_grid(&self, Grid { columns, rows, .. }: Grid, clip: &Aabb) -> Tessellation {
        let rows = if let Shape::Torus(torus) = self {
            ((rows as f64 * (torus_end(torus) / PI)).ceil() as usize).max(3)
        } else {
            rows
        };
        self.on_cuts(&Cuts::even(columns), &Cuts::even(rows), clip)
    }

    fn on_cuts(&self, columns: &Cuts, rows: &Cuts, clip: &Aabb) -> Tessellation {
        match self {
            Shape::Sphere(s) => Tessellation::sphere(s, columns, rows),
            Shape::Box(s) => Tessellation::cuboid(s),
            Shape::Triangle(s) => Tessellation::triangle(s),
            Shape::Rectangle(s) => Tessellation::rectangle(s),
            Shape::Plane(s) => Tessellation::plane(s, clip),
            Shape::Disk(s) => Tessellation::disk(s, columns),
            Shape::Partial(s) => Tessellation::partial(s, columns),
            Shape::Cylinder(Cylinder { base, top, radius, caps }) => {
                Tessellation::frustum(&FrustumFrame::new([*base, *top], [*radius; 2]), *caps, columns)
            }
            Shape::Cone(Cone { base, top, radius, top_radius, caps }) => {
                Tessellation::frustum(&FrustumFrame::new([*base, *top], [*radius, *top_radius]), *caps, columns)
            }
            Shape::Torus(s) => Tessellation::torus(s, columns, rows),
        }
    }

    /// Triangles for a curved shape that are finer where the view allows a smaller deviation: none for other shapes.
    ///
    /// # Errors
    /// [`TooManyTriangles`] if the number of triangles would exceed `limit`.
    pub(crate) fn tessellate_for_view(
        &self,
        allowed: Allowed,
        limit: usize,
    ) -> Result<Option<Tessellation>, TooManyTriangles> {
        let Some(ViewCuts { columns, rows }) = ViewCuts::new(self, allowed) else { return Ok(None) };
        if columns.len().saturating_mul(rows.len()) > limit / 2 {
            return Err(TooManyTriangles { limit });
        }
        Ok(Some(self.on_cuts(&columns, &rows, &Aabb::EMPTY)))
    }
}

/// The angle around a torus's tube from the outer equator at which the tube ends. A spindle torus has poles instead of
/// the part of the tube inside it.
pub(super) fn torus_end(torus: &Torus) -> f64 {
    let [ring, tube] = [torus.radius, torus.tube].map(f64::from);
    if ring <= tube { libm::acos(-ring / tube) } else { PI }
}

/// The columns and rows of the triangles of a round shape, and about the number of triangles.
#[derive(Clone, Copy, Debug)]
struct Grid {
    columns: usize,
    rows: usize,
    triangles: f64,
}

/// The number of equal chords of a circle, at least 3, that are nowhere farther than `tolerance` from it: the sagitta
/// r (1 − cos φ) = 2 r sin² (φ/2) of half a chord's angle φ.
fn chords(radius: f64, tolerance: f64) -> f64 {
    let half_angle = 2.0 * libm::asin((0.5 * tolerance / radius).sqrt().min(1.0));
    (PI / half_angle).ceil().max(3.0)
}

/// The body of a cylinder or cone with a frame around its axis.
pub(super) struct FrustumFrame {
    pub(super) base: DVec3,
    pub(super) axis: DVec3,
    pub(super) x: DVec3,
    pub(super) z: DVec3,
    pub(super) height: f64,
    radii: [f64; 2],
}

impl FrustumFrame {
    pub(super) fn new([base, top]: [Vec3; 2], radii: [f32; 2]) -> FrustumFrame {
        let (base, top) = (base.as_dvec3(), top.as_dvec3());
        let solve::Frame { x, y: axis, z } = solve::Frame::around(top - base);
        FrustumFrame { base, axis, x, z, height: (top - base).length(), radii: radii.map(f64::from) }
    }

    /// The distances from the axis and the heights of the base and the top.
    pub(super) fn ends(&self) -> [[f64; 2]; 2] {
        [[self.radii[0], 0.0], [self.radii[1], self.height]]
    }

    fn radius(&self, h: f64) -> f64 {
        self.radii[0] + (self.radii[1] - self.radii[0]) * (h / self.height)
    }

    /// The point of the side at height `h` in the direction `out` from the axis.
    pub(super) fn point(&self, h: f64, out: DVec3) -> DVec3 {
        self.base + self.axis * h + out * self.radius(h)
    }

    /// The normal of the side in the direction `out` from the axis.
    pub(super) fn normal(&self, out: DVec3) -> DVec3 {
        (out - self.axis * ((self.radii[1] - self.radii[0]) / self.height)).normalize()
    }

    /// The texture coordinates of a point of a cap.
    pub(super) fn cap_uv(&self, point: DVec3, top: bool) -> DVec2 {
        let (h, r, z) = if top { (self.height, self.radii[1], self.z) } else { (0.0, self.radii[0], -self.z) };
        let across = point - self.base - self.axis * h;
        DVec2::new(across.dot(self.x), across.dot(z)) * (0.5 / r) + 0.5
    }
}

/// The direction of cut `i` of the columns around +y, the inverse of (5.45a). The first one, at u = 0, is at −z, and so
/// is the last.
fn around(i: usize, columns: &Cuts) -> DVec3 {
    let (sin, cos) = libm::sincos(TAU * (columns.at(i % columns.len()) - 0.5));
    DVec3::new(sin, 0.0, cos)
}

impl Tessellation {
    /// The area of the triangles.
    pub fn area(&self) -> f64 {
        self.area_after(None)
    }

    /// The area of the triangles after a map.
    fn area_after(&self, map: Option<&Transform>) -> f64 {
        let point = |v: u32| self.vertices[v as usize].point;
        let moved = |way: DVec3| map.map_or(way, |map| map.vector(way));
        let cross = |&[a, b, c]: &[u32; 3]| moved(point(b) - point(a)).cross(moved(point(c) - point(a)));
        self.triangles.iter().map(|corners| 0.5 * cross(corners).length()).sum()
    }

    /// A number for the place of each vertex. Vertices at one place have equal numbers, which count from 0.
    pub fn places(&self) -> Vec<u32> {
        let mut places = Places::default();
        self.vertices.iter().map(|v| places.id(v.point)).collect()
    }

    fn add(&mut self, point: DVec3, normal: DVec3, uv: DVec2, place: Place) -> u32 {
        self.vertices.push(TessellationVertex { point, normal, uv, place });
        self.vertices.len() as u32 - 1
    }

    fn push(&mut self, part: u32, triangles: impl IntoIterator<Item = [u32; 3]>) {
        self.triangles.extend(triangles);
        self.parts.resize(self.triangles.len(), part);
    }

    /// The triangles between the vertices of a grid that begins at the first vertex, with `columns` + 1 vertices in a
    /// row. The cells at a pole are single triangles.
    fn push_grid(&mut self, columns: usize, rows: usize, poles: bool) {
        let at = |i: usize, j: usize| (j * (columns + 1) + i) as u32;
        for (i, j) in (0..columns).flat_map(|i| (0..rows).map(move |j| (i, j))) {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i, j + 1), at(i + 1, j + 1)];
            match j {
                0 if poles => self.push(0, [[a, c, d]]),
                _ if poles && j == rows - 1 => self.push(0, [[a, c, b]]),
                _ => self.push(0, [[a, c, d], [a, d, b]]),
            }
        }
    }

    /// A sphere as columns around +y and rows from pole to pole.
    pub(super) fn sphere(sphere: &Sphere, columns: &Cuts, rows: &Cuts) -> Tessellation {
        let (c, r) = (sphere.center.as_dvec3(), f64::from(sphere.radius));
        let mut tessellation = Tessellation::default();
        for j in 0..=rows.len() {
            let (sin, cos) = libm::sincos(rows.times(PI, j));
            for i in 0..=columns.len() {
                let pole = j == 0 || j == rows.len();
                let direction = match j {
                    0 => DVec3::Y,
                    _ if j == rows.len() => DVec3::NEG_Y,
                    _ => around(i, columns) * sin + DVec3::Y * cos,
                };
                let u = if pole { columns.middle(i) } else { columns.at(i) };
                tessellation.add(c + direction * r, direction, DVec2::new(u, rows.at(j)), Place::Round);
            }
        }
        tessellation.push_grid(columns.len(), rows.len(), true);
        tessellation
    }

    /// The two triangles of each face of a box.
    pub(super) fn cuboid(cuboid: &Cuboid) -> Tessellation {
        let (min, max) = (cuboid.min.as_dvec3(), cuboid.max.as_dvec3());
        let mut tessellation = Tessellation::default();
        // For each face: the corner where u = v = 0 (true: max), and the axes of u and v (fig. 5.31).
        let faces = [
            ([false, true, false], 2, 1),
            ([true, true, true], 2, 1),
            ([false, false, true], 0, 2),
            ([false, true, false], 0, 2),
            ([true, true, false], 0, 1),
            ([false, true, true], 0, 1),
        ];
        for (face, (corner, u, v)) in faces.into_iter().enumerate() {
            let normal = DVec3::AXES[face / 2] * if face % 2 == 1 { 1.0 } else { -1.0 };
            let [a, b, c, d] = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(i, j)| {
                let mut side = corner;
                side[u] ^= i == 1;
                side[v] ^= j == 1;
                let at = |axis: usize| if side[axis] { max[axis] } else { min[axis] };
                let uv = DVec2::new(f64::from(i), f64::from(j));
                tessellation.add(DVec3::new(at(0), at(1), at(2)), normal, uv, Place::Between)
            });
            tessellation.push(face as u32, [[a, c, d], [a, d, b]]);
        }
        tessellation
    }

    /// The triangle itself.
    pub(super) fn triangle(t: &Triangle) -> Tessellation {
        let mut tessellation = Tessellation::default();
        let [a, b, c] = [t.a, t.b, t.c].map(Vec3::as_dvec3);
        let normal = (b - a).cross(c - a).normalize_or(DVec3::Z);
        let uv = [DVec2::ZERO, DVec2::X, DVec2::Y];
        let corners = [0, 1, 2].map(|i| tessellation.add([a, b, c][i], normal, uv[i], Place::Between));
        tessellation.push(0, [corners]);
        tessellation
    }

    /// The two halves of a rectangle.
    pub(super) fn rectangle(sheet: &Parallelogram) -> Tessellation {
        let mut tessellation = Tessellation::default();
        let uv = [DVec2::Y, DVec2::ONE, DVec2::X, DVec2::ZERO];
        for (corner, uv) in sheet.corners().into_iter().zip(uv) {
            tessellation.add(corner.as_dvec3(), sheet.normal(), uv, Place::Between);
        }
        for (part, half) in (0..).zip(HALVES) {
            tessellation.push(part, [half.map(|i| i as u32)]);
        }
        tessellation
    }

    /// The polygon in which a plane cuts a box (Sutherland and Hodgman, *Reentrant Polygon Clipping*, 1974).
    fn plane(plane: &Plane, clip: &Aabb) -> Tessellation {
        let solve::Frame { x, y: normal, z } = solve::Frame::around(plane.normal.as_dvec3());
        let (min, max) = (clip.min.as_dvec3(), clip.max.as_dvec3());
        let origin = plane.point.as_dvec3();
        // A square around the box's middle that covers the box's section.
        let middle = (min + max) * 0.5 - origin;
        let (u, v, half) = (middle.dot(x), middle.dot(z), (max - min).length());
        // Corners are coordinates along x and z, counter-clockwise where the normal points at the viewer.
        let mut polygon = [(-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0)]
            .map(|(i, j)| DVec2::new(u + i * half, v + j * half))
            .to_vec();
        let point = |uv: DVec2| origin + x * uv.x + z * uv.y;
        for axis in 0..3 {
            for depth in [|p: f64, [min, _]: [f64; 2]| p - min, |p: f64, [_, max]: [f64; 2]| max - p] {
                let depth = |uv: DVec2| depth(point(uv)[axis], [min[axis], max[axis]]);
                let corners = std::mem::take(&mut polygon);
                for (i, &to) in corners.iter().enumerate() {
                    let from = corners[(i + corners.len() - 1) % corners.len()];
                    let (d, e) = (depth(from), depth(to));
                    if (d < 0.0) != (e < 0.0) {
                        polygon.push(from + (to - from) * (d / (d - e)));
                    }
                    if e >= 0.0 {
                        polygon.push(to);
                    }
                }
            }
        }
        let mut tessellation = Tessellation::default();
        for &uv in &polygon {
            tessellation.add(point(uv), normal, uv, Place::Between);
        }
        tessellation.push(0, (2..polygon.len() as u32).map(|i| [0, i - 1, i]));
        tessellation
    }

    /// A disk as triangles around its centre.
    fn disk(disk: &Disk, columns: &Cuts) -> Tessellation {
        let (center, r) = (disk.center.as_dvec3(), f64::from(disk.radius));
        let frame = solve::Frame::around(disk.normal.as_dvec3());
        let mut tessellation = Tessellation::default();
        tessellation.add(center, frame.y, DVec2::splat(0.5), Place::Between);
        for i in 0..columns.len() {
            let d = around(i, columns);
            let point = center + (frame.x * d.x + frame.z * d.z) * r;
            tessellation.add(point, frame.y, DVec2::new(d.x, d.z) * 0.5 + 0.5, Place::Between);
        }
        let rim = |i: usize| (1 + i % columns.len()) as u32;
        tessellation.push(0, (0..columns.len()).map(|i| [0, rim(i), rim(i + 1)]));
        tessellation
    }

    /// The side of a cylinder or cone as columns, and its caps as triangles around their centres.
    pub(super) fn frustum(frame: &FrustumFrame, caps: bool, columns: &Cuts) -> Tessellation {
        let out = |i: usize| {
            let d = around(i, columns);
            frame.x * d.x + frame.z * d.z
        };
        let mut tessellation = Tessellation::default();
        for (j, h) in [(0, frame.height), (1, 0.0)] {
            for i in 0..=columns.len() {
                let uv = DVec2::new(columns.at(i), f64::from(j));
                tessellation.add(frame.point(h, out(i)), frame.normal(out(i)), uv, Place::Round);
            }
        }
        let row = columns.len() as u32 + 1;
        for i in 0..columns.len() as u32 {
            let [a, b, c, d] = [i, i + 1, row + i, row + i + 1];
            tessellation.push(0, (frame.radii[1] > 0.0).then_some([a, d, b]));
            tessellation.push(0, (frame.radii[0] > 0.0).then_some([a, c, d]));
        }
        for (part, top) in [(2, true), (1, false)] {
            let (h, r) = if top { (frame.height, frame.radii[1]) } else { (0.0, frame.radii[0]) };
            if !caps || r == 0.0 {
                continue;
            }
            let normal = if top { frame.axis } else { -frame.axis };
            let center = tessellation.add(frame.base + frame.axis * h, normal, DVec2::splat(0.5), Place::Between);
            let rim: Vec<u32> = (0..=columns.len())
                .map(|i| {
                    let point = frame.point(h, out(i));
                    tessellation.add(point, normal, frame.cap_uv(point, top), Place::Rim { top })
                })
                .collect();
            tessellation.push(
                part,
                (0..columns.len())
                    .map(|i| if top { [center, rim[i], rim[i + 1]] } else { [center, rim[i + 1], rim[i]] }),
            );
        }
        tessellation
    }

    /// A part of a round shape as columns between its ends.
    fn partial(partial: &Partial, columns: &Cuts) -> Tessellation {
        let frame = partial.whole.frame();
        let [base, top] = partial.whole.ends();
        let mut tessellation = Tessellation::default();
        let slope = (top.1 - base.1) / base.0.distance(top.0);
        for (v, (center, radius)) in [(0.0, top), (1.0, base)] {
            for i in 0..=columns.len() {
                let out = partial.out(&frame, columns.at(i));
                let (normal, uv) = if partial.is_flat() {
                    let square = DVec2::new(out.dot(frame.x), out.dot(frame.z)) * (0.5 * radius / top.1) + 0.5;
                    (frame.y, square)
                } else {
                    ((out - frame.y * slope).normalize(), DVec2::new(partial.u(columns.at(i)), v))
                };
                tessellation.add(center + out * radius, normal, uv, Place::Between);
            }
        }
        let row = columns.len() as u32 + 1;
        for i in 0..columns.len() as u32 {
            let [a, b, c, d] = [i, i + 1, row + i, row + i + 1];
            // A disk's rim is seen from its axis as the side's top is seen from outside, but the other way round.
            let turned = |[p, q, r]: [u32; 3]| if partial.is_flat() { [p, r, q] } else { [p, q, r] };
            tessellation.push(0, (top.1 > 0.0).then_some(turned([a, d, b])));
            tessellation.push(0, (base.1 > 0.0).then_some(turned([a, c, d])));
        }
        tessellation
    }

    /// A torus as columns around its axis and rows around its tube.
    fn torus(torus: &Torus, columns: &Cuts, rows: &Cuts) -> Tessellation {
        let center = torus.center.as_dvec3();
        let frame = solve::Frame::around(torus.axis.as_dvec3());
        let [ring, tube] = [torus.radius, torus.tube].map(f64::from);
        let poles = ring <= tube;
        // The angle around the tube from the outer equator, towards −axis.
        let end = torus_end(torus);
        let mut tessellation = Tessellation::default();
        for j in 0..=rows.len() {
            let pole = poles && (j == 0 || j == rows.len());
            // The last row of a closed tube is the first.
            let row = if poles { j } else { j % rows.len() };
            let angle = end * (rows.times(2.0, row) - 1.0);
            let (sin, cos) = libm::sincos(angle);
            let v = 0.5 + 0.5 * (end / PI) * (rows.times(2.0, j) - 1.0);
            for i in 0..=columns.len() {
                let d = around(i, columns);
                let out = frame.x * d.x + frame.z * d.z;
                let normal = out * cos - frame.y * sin;
                let across = if pole { DVec3::ZERO } else { out * (ring + tube * cos) };
                let u = if pole { columns.middle(i) } else { columns.at(i) };
                let point = center + across - frame.y * (tube * sin);
                tessellation.add(point, normal, DVec2::new(u, v), Place::Round);
            }
        }
        tessellation.push_grid(columns.len(), rows.len(), poles);
        tessellation
    }
}

/// Numbers for places. Equal bits have equal numbers.
#[derive(Default)]
pub(super) struct Places {
    map: HashMap<[u64; 3], u32>,
}

impl Places {
    pub(super) fn id(&mut self, point: DVec3) -> u32 {
        // −0 becomes 0.
        let key = (point + 0.0).to_array().map(f64::to_bits);
        let next = self.map.len() as u32;
        *self.map.entry(key).or_insert(next)
    }

    /// The number of different places.
    pub(super) fn len(&self) -> usize {
        self.map.len()
    }
}

#[cfg(test)]
mod tests;
