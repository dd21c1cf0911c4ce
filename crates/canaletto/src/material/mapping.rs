//! Mappings: from a point of a surface to coordinates of a texture (5.5).
//!
//! A mapping transforms the point into its space: the object's, the world's, or the object's bounding box as the unit
//! cube. Then it applies the inverse of the transform that places the texture, and projects. All projections share one
//! image: the square from −½ to ½ in x and y, seen from +z with +y upwards, u to the right and v downwards. Every
//! coordinate has its gradient. Footprints and bumps follow by the chain rule, without differences across seams.

use crate::math::Transform;
use crate::shape::SurfaceDifferential;
use crate::texture::{Function, Gradient, TextureKind};
use crate::{OutOfRange, named};
use canaletto_bvh::Aabb;
use glam::{DMat3, DVec2, DVec3};
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};

/// The mapping from a point of a surface to texture coordinates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Mapping {
    /// The projection from space to coordinates.
    pub projection: Projection,
    /// The space of the projection.
    pub space: Space,
    /// The transform that places the texture in that space, as a node's transform places an object.
    pub transform: Transform,
    /// The number of repetitions of an image along u and v in place of one.
    pub repeat: Repeat,
    /// The set of a mesh's texture coordinates, for [`Projection::Uv`]. Surfaces without the set take set 0.
    #[serde(default)]
    pub uv_set: u32,
}

impl Mapping {
    /// The default mapping of a texture.
    pub fn usual(kind: &TextureKind) -> Mapping {
        match kind {
            TextureKind::Constant(_) | TextureKind::Image(_) | TextureKind::VertexColor => Mapping::default(),
            TextureKind::Procedural(procedural) => match procedural.function {
                // A ramp is a texture of a line, namely of u.
                Function::Gradient { shape: Gradient::Linear, axis: None, .. } => Mapping::default(),
                _ => Mapping { projection: Projection::Solid, space: Space::Object, ..Mapping::default() },
            },
            // The grid's cube from 0 to 1 covers the object's bounds, which are a cube around the origin.
            TextureKind::Grid(_) => {
                let transform = Transform::translate(DVec3::splat(-0.5));
                Mapping { projection: Projection::Solid, space: Space::Bounds, transform, ..Mapping::default() }
            }
        }
    }
}

/// A number of repetitions along u and v.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Repeat(pub [f64; 2]);

impl Default for Repeat {
    fn default() -> Repeat {
        Repeat([1.0; 2])
    }
}

/// The projection from space to texture coordinates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Projection {
    /// The surface's own coordinates: the faces of a box (fig. 5.31), the angles of a sphere (5.45), a mesh's uv. The
    /// mapping's space has no effect.
    #[default]
    Uv,
    /// The projection along z.
    Planar,
    /// The faces of the unit cube around the origin (fig. 5.31). The normal's largest component selects the face.
    Box,
    /// The projection from the origin, by (5.45).
    Spherical,
    /// The projection around the y axis. Where the normal is closer to the axis than to its perpendicular plane, the
    /// projection along the axis.
    Cylindrical,
    /// The three pairs of a box's faces, blended by the fourth powers of the normal's components.
    Triplanar,
    /// The point itself, for textures of space.
    Solid,
}

named!(Projection {
    Uv => "uv",
    Planar => "planar",
    Box => "box",
    Spherical => "spherical",
    Cylindrical => "cylindrical",
    Triplanar => "triplanar",
    Solid => "solid",
});

/// The spaces that mappings work in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Space {
    /// The object's own space, before its transforms: the texture moves with the object.
    #[default]
    Object,
    /// The scene's space: objects move through the texture.
    World,
    /// The object's own space, with its bounding box as the cube from −½ to ½. A plane has no such box and keeps its
    /// own units.
    Bounds,
}

named!(Space {
    Object => "object",
    World => "world",
    Bounds => "bounds",
});

/// The input of mappings: a point of a surface in the object's space.
#[derive(Clone, Copy, Debug)]
pub struct Place<'a> {
    /// The point.
    pub point: DVec3,
    /// The unit geometric normal.
    pub normal: DVec3,
    /// The surface's own coordinates.
    pub uv: DVec2,
    /// The derivatives of the surface's coordinates and normal.
    pub surface_differential: &'a SurfaceDifferential,
    /// The transform from the object's space to the world's; `None` is the identity.
    pub to_world: Option<&'a Transform>,
    /// The object's bounds, if it has any.
    pub bounds: Option<Aabb>,
    /// The positions of the origin of coordinates: in the object's space, and in the world's.
    pub origins: [DVec3; 2],
}

/// One place of a texture. A mapping has up to three of them, with weights that sum to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TexCoord {
    /// The coordinates.
    pub at: DVec3,
    /// The weight of this place.
    pub weight: f64,
    /// The map from a step along the surface to a change of coordinates, before `last` is applied.
    first: DMat3,
    /// The map from that change to the change of `at`.
    last: DMat3,
    /// Whether the first coordinate is periodic, so that it changes by at most one turn.
    round: bool,
}

impl TexCoord {
    fn new(at: DVec3, rows: [DVec3; 3]) -> TexCoord {
        let first = DMat3::from_cols(rows[0], rows[1], rows[2]).transpose();
        TexCoord { at, weight: 1.0, first, last: DMat3::IDENTITY, round: false }
    }

    /// The change of `at` over a step along the surface. Near a pole, where a small step may go around several times,
    /// the change is limited to one turn.
    pub fn change(&self, step: DVec3) -> DVec3 {
        let mut change = self.first * step;
        if self.round {
            change.x = change.x.clamp(-1.0, 1.0);
        }
        self.last * change
    }

    /// The gradients of the three coordinates in the object's space.
    pub fn gradients(&self) -> [DVec3; 3] {
        let rows = (self.last * self.first).transpose();
        [rows.x_axis, rows.y_axis, rows.z_axis]
    }

    fn repeated(mut self, repeat: Repeat) -> TexCoord {
        let by = DVec3::new(repeat.0[0], repeat.0[1], 1.0);
        self.at *= by;
        self.last = DMat3::from_diagonal(by) * self.last;
        self
    }
}

/// Up to three places of a texture.
#[derive(Clone, Copy, Debug)]
pub struct TexCoords {
    list: [TexCoord; 3],
    len: usize,
}

impl TexCoords {
    fn one(spot: TexCoord) -> TexCoords {
        TexCoords { list: [spot; 3], len: 1 }
    }
}

impl std::ops::Deref for TexCoords {
    type Target = [TexCoord];
    fn deref(&self) -> &[TexCoord] {
        &self.list[..self.len]
    }
}

impl Mapping {
    /// A mapping by this projection in this space.
    pub fn new(projection: Projection, space: Space) -> Mapping {
        Mapping { projection, space, ..Mapping::default() }
    }

    /// Checks every number's range.
    ///
    /// # Errors
    /// An [`OutOfRange`] that names the number, its value and the range.
    pub fn check(&self) -> Result<(), OutOfRange> {
        match self.repeat.0.iter().find(|r| !(r.is_finite() && **r != 0.0)) {
            Some(r) => Err(OutOfRange::new("repeat", format!("is {r} along one side; it must be finite and not 0"))),
            None => Ok(()),
        }
    }

    /// The texture coordinates at a point of a surface.
    pub fn coords(&self, place: &Place) -> TexCoords {
        if self.projection == Projection::Uv {
            return TexCoords::one(self.own(place));
        }
        let (point, rows, normal) = self.enter(place);
        match self.projection {
            Projection::Uv | Projection::Solid => TexCoords::one(TexCoord::new(point, rows)),
            Projection::Planar => TexCoords::one(face(5, point, rows).repeated(self.repeat)),
            Projection::Box => {
                let lean = normal.abs();
                let axis = if lean.x >= lean.y && lean.x >= lean.z {
                    0
                } else if lean.y >= lean.z {
                    1
                } else {
                    2
                };
                TexCoords::one(face(2 * axis + usize::from(normal[axis] > 0.0), point, rows).repeated(self.repeat))
            }
            Projection::Triplanar => {
                let lean = normal * normal;
                let weights = lean * lean / (lean * lean).element_sum();
                let mut list = [0, 1, 2].map(|axis| {
                    let spot = face(2 * axis + usize::from(normal[axis] > 0.0), point, rows).repeated(self.repeat);
                    TexCoord { weight: weights[axis], ..spot }
                });
                list.sort_by(|a, b| b.weight.total_cmp(&a.weight));
                // A place whose weight is less than the last bit of a colour is omitted.
                let len = 1 + usize::from(list[1].weight > 1e-9) + usize::from(list[2].weight > 1e-9);
                TexCoords { list, len }
            }
            Projection::Spherical => TexCoords::one(spherical(point, rows).repeated(self.repeat)),
            Projection::Cylindrical => {
                let spot = if normal.y * normal.y > normal.x * normal.x + normal.z * normal.z {
                    face(2 + usize::from(normal.y > 0.0), point, rows)
                } else {
                    around(point, rows)
                };
                TexCoords::one(spot.repeated(self.repeat))
            }
        }
    }

    /// Whether the coordinates are the surface's own as they are.
    pub(crate) fn is_own(&self) -> bool {
        let Mapping { projection, transform, repeat, uv_set, .. } = self;
        *projection == Projection::Uv && *uv_set == 0 && *repeat == Repeat::default() && transform.is_identity()
    }

    /// The surface's own coordinates, placed by the transform.
    fn own(&self, place: &Place) -> TexCoord {
        let [u, v] = place.surface_differential.gradients;
        let mut spot = TexCoord::new(DVec3::new(place.uv.x, place.uv.y, 0.0), [u, v, DVec3::ZERO]);
        spot.round = place.surface_differential.round;
        if !self.transform.is_identity() {
            let back = self.transform.inverse();
            let flip = DMat3::from_diagonal(DVec3::new(1.0, -1.0, 1.0));
            let at = back.point(DVec3::new(place.uv.x - 0.5, 0.5 - place.uv.y, 0.0));
            spot.at = DVec3::new(at.x + 0.5, 0.5 - at.y, 0.0);
            spot.last = DMat3::from_diagonal(DVec3::new(1.0, -1.0, 0.0)) * back.matrix().matrix3 * flip;
        }
        spot.repeated(self.repeat)
    }

    /// The point in the mapping's space, the gradients of its coordinates in the object's space, and the direction of
    /// the normal.
    fn enter(&self, place: &Place) -> (DVec3, [DVec3; 3], DVec3) {
        let (mut point, mut linear, mut normal) = (place.point, DMat3::IDENTITY, place.normal);
        match (self.space, place.to_world, place.bounds) {
            (Space::World, Some(t), _) => {
                point = t.point(point) + place.origins[1];
                linear = t.matrix().matrix3;
                normal = t.normal(normal).normalize();
            }
            (Space::World, None, _) => point += place.origins[1],
            (Space::Bounds, _, Some(bounds)) => {
                let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
                let size = (max - min).map(|side| if side > 0.0 { side } else { 1.0 });
                point = (point - (min + max) * 0.5) / size;
                linear = DMat3::from_diagonal(size.recip());
            }
            (Space::Object, ..) | (Space::Bounds, _, None) => point += place.origins[0],
        }
        if !self.transform.is_identity() {
            let back = self.transform.inverse();
            point = back.point(point);
            linear = back.matrix().matrix3 * linear;
            normal = back.normal(normal).normalize();
        }
        let rows = linear.transpose();
        (point, [rows.x_axis, rows.y_axis, rows.z_axis], normal)
    }
}

/// The coordinates of fig. 5.31 on a face of the unit cube around the origin. [`crate::shape::ShapeHit::part`] numbers
/// the faces.
fn face(face: usize, p: DVec3, [x, y, z]: [DVec3; 3]) -> TexCoord {
    let (u, v, du, dv) = match face {
        0 => (p.z, -p.y, z, -y),
        1 => (-p.z, -p.y, -z, -y),
        2 => (p.x, -p.z, x, -z),
        3 => (p.x, p.z, x, z),
        4 => (-p.x, -p.y, -x, -y),
        _ => (p.x, -p.y, x, -y),
    };
    TexCoord::new(DVec3::new(u + 0.5, v + 0.5, 0.0), [du, dv, DVec3::ZERO])
}

/// The spherical coordinates of (5.45).
fn spherical(p: DVec3, [x, y, z]: [DVec3; 3]) -> TexCoord {
    let ring2 = p.x * p.x + p.z * p.z;
    let (ring, length2) = (ring2.sqrt(), ring2 + p.y * p.y);
    let mut spot = around(p, [x, y, z]);
    spot.at.y = libm::atan2(ring, p.y) / PI;
    let out = if ring > 0.0 { (x * p.x + z * p.z) / ring } else { z };
    let down = if length2 > 0.0 { (out * p.y - y * ring) / (length2 * PI) } else { DVec3::ZERO };
    let [turn, ..] = spot.gradients();
    TexCoord { round: true, ..TexCoord::new(spot.at, [turn, down, DVec3::ZERO]) }
}

/// The angle around the y axis, and the height from ½ down to −½.
fn around(p: DVec3, [x, y, z]: [DVec3; 3]) -> TexCoord {
    let ring2 = p.x * p.x + p.z * p.z;
    let u = 0.5 * (1.0 + libm::atan2(p.x, p.z) / PI);
    // On the axis itself every step is a full turn.
    let turn = if ring2 > 0.0 { (x * p.z - z * p.x) / (ring2 * TAU) } else { DVec3::splat(f64::MAX.sqrt()) };
    TexCoord { round: true, ..TexCoord::new(DVec3::new(u, 0.5 - p.y, 0.0), [turn, -y, DVec3::ZERO]) }
}

#[cfg(test)]
mod tests;
