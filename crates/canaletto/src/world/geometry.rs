//! Geometries: primitives of one kind in the order of their hierarchy's leaves.

use super::Census;
use crate::math::Line;
use crate::shape::{CylinderCloud, Mesh, Patch, Shape, ShapeHit, SphereCloud, Surface};
use canaletto_bvh::triangle::{self, Triangle};
use canaletto_bvh::{Aabb, Bvh, PreparedRay, sphere};
use glam::Vec3;
use rayon::prelude::*;
use std::ops::Range;

/// Primitives of one kind under one hierarchy: the second level. Primitive ids are positions in the description;
/// slots are positions in leaf order.
#[derive(Debug)]
pub(super) struct Geometry {
    pub(super) bvh: Bvh,
    pub(super) primitives: Primitives,
}

#[derive(Debug)]
pub(super) enum Primitives {
    /// Single shapes of any kind, with the object and material (or [`super::instance::NONE`]) of each, by id.
    Shapes { slots: Vec<Shape>, shapes: Vec<Shape>, objects: Vec<u32>, materials: Vec<u32> },
    /// A mesh; corners are stored once more in slot order, since that is what rays read.
    Mesh { slots: Vec<Triangle>, mesh: Mesh },
    /// A cloud of spheres, its lists in id order; centre and radius in slot order.
    Spheres { slots: Vec<(Vec3, f32)>, cloud: SphereCloud },
    /// A cloud of cylinders.
    Cylinders { slots: Vec<Shape>, cloud: CylinderCloud },
}

/// The nearest hit inside one geometry so far.
#[derive(Clone, Copy, Debug)]
pub(super) struct Nearest {
    pub(super) t: f32,
    pub(super) primitive: u32,
    pub(super) part: u32,
    pub(super) uv: [f32; 2],
}

/// No primitive yet; larger than any id, so that ties go to a real one.
pub(super) const NO_PRIMITIVE: u32 = u32::MAX;

impl Nearest {
    fn offer(&mut self, hit: ShapeHit, primitive: u32) {
        // Ties by the lowest id: the answer doesn't depend on the order in which leaves are met.
        if hit.t < self.t || (hit.t == self.t && primitive < self.primitive) {
            *self = Nearest { t: hit.t, primitive, part: hit.part, uv: hit.uv };
        }
    }
}

/// [`Shape::intersect`], with spheres, the most frequent shape, on the prepared ray.
#[inline]
fn meet(shape: &Shape, ray: &PreparedRay, t_max: f32) -> Option<ShapeHit> {
    match shape {
        Shape::Sphere(s) => sphere::intersect(ray, s.center, s.radius, t_max).map(plain),
        other => meet_other(other, ray, t_max),
    }
}

#[inline(never)]
fn meet_other(shape: &Shape, ray: &PreparedRay, t_max: f32) -> Option<ShapeHit> {
    shape.intersect(&ray.ray, t_max)
}

#[inline]
fn meets_triangle(triangle: &Triangle, mesh: &Mesh, ray: &PreparedRay, t_max: f32) -> bool {
    triangle::intersect(ray, triangle, t_max).is_some_and(|hit| hit.front || !mesh.one_sided)
}

/// The first slot of a leaf for which `met` holds.
#[inline]
fn first(leaf: Range<u32>, mut met: impl FnMut(usize) -> bool) -> Option<u32> {
    leaf.into_iter().find(|&slot| met(slot as usize))
}

/// A hit that needs no more than t.
fn plain(t: f32) -> ShapeHit {
    ShapeHit { t, part: 0, uv: [0.0; 2] }
}

impl Geometry {
    pub(super) fn shapes(
        shapes: Vec<Shape>,
        objects: Vec<u32>,
        materials: Vec<u32>,
    ) -> Result<Geometry, canaletto_bvh::BuildError> {
        let bounds: Vec<Aabb> = shapes.par_iter().map(|s| s.bounds().unwrap_or(Aabb::EMPTY)).collect();
        let bvh = Bvh::build(&bounds)?;
        let slots = bvh.order().iter().map(|&id| shapes[id as usize]).collect();
        Ok(Geometry { bvh, primitives: Primitives::Shapes { slots, shapes, objects, materials } })
    }

    pub(super) fn mesh(mesh: Mesh) -> Result<Geometry, canaletto_bvh::BuildError> {
        let corners = |id: usize| mesh.triangles[id].map(|v| mesh.positions[v as usize]);
        let bounds: Vec<Aabb> =
            (0..mesh.triangles.len()).into_par_iter().map(|id| Aabb::from_points(corners(id))).collect();
        let bvh = Bvh::build(&bounds)?;
        let slots = bvh.order().par_iter().map(|&id| Triangle::new(corners(id as usize))).collect();
        Ok(Geometry { bvh, primitives: Primitives::Mesh { slots, mesh } })
    }

    pub(super) fn spheres(cloud: SphereCloud) -> Result<Geometry, canaletto_bvh::BuildError> {
        let bounds: Vec<Aabb> =
            (0..cloud.len()).into_par_iter().map(|id| sphere::bounds(cloud.centers[id], cloud.radius(id))).collect();
        let bvh = Bvh::build(&bounds)?;
        let slots = bvh.order().par_iter().map(|&id| (cloud.centers[id as usize], cloud.radius(id as usize))).collect();
        Ok(Geometry { bvh, primitives: Primitives::Spheres { slots, cloud } })
    }

    pub(super) fn cylinders(cloud: CylinderCloud) -> Result<Geometry, canaletto_bvh::BuildError> {
        let shape = |id: usize| Shape::Cylinder(cloud.cylinder(id));
        let bounds: Vec<Aabb> =
            (0..cloud.len()).into_par_iter().map(|id| shape(id).bounds().unwrap_or(Aabb::EMPTY)).collect();
        let bvh = Bvh::build(&bounds)?;
        let slots = bvh.order().par_iter().map(|&id| shape(id as usize)).collect();
        Ok(Geometry { bvh, primitives: Primitives::Cylinders { slots, cloud } })
    }

    /// How many primitives it has.
    pub(super) fn len(&self) -> usize {
        self.bvh.order().len()
    }

    /// The first and last object of its shapes; `None` where the instance says which object it is.
    pub(super) fn objects(&self) -> Option<(u32, u32)> {
        match &self.primitives {
            Primitives::Shapes { objects, .. } => Some((*objects.iter().min()?, *objects.iter().max()?)),
            _ => None,
        }
    }

    /// The nearest hit at or before `t_max` (ties with a hit elsewhere are the caller's).
    pub(super) fn intersect(&self, ray: &PreparedRay, t_max: f32) -> Option<Nearest> {
        let mut nearest = Nearest { t: t_max, primitive: NO_PRIMITIVE, part: 0, uv: [0.0; 2] };
        let order = self.bvh.order();
        let (nearest_ref, bvh) = (&mut nearest, &self.bvh);
        match &self.primitives {
            Primitives::Shapes { slots, .. } | Primitives::Cylinders { slots, .. } => {
                bvh.intersect(ray, t_max, |leaf, t_max| {
                    for slot in leaf.map(|s| s as usize) {
                        if let Some(hit) = meet(&slots[slot], ray, *t_max) {
                            nearest_ref.offer(hit, order[slot]);
                            *t_max = nearest_ref.t;
                        }
                    }
                });
            }
            Primitives::Mesh { slots, mesh } => {
                bvh.intersect(ray, t_max, |leaf, t_max| {
                    for slot in leaf.map(|s| s as usize) {
                        if let Some(hit) = triangle::intersect(ray, &slots[slot], *t_max)
                            && (hit.front || !mesh.one_sided)
                        {
                            nearest_ref.offer(ShapeHit { t: hit.t, part: 0, uv: [hit.u, hit.v] }, order[slot]);
                            *t_max = nearest_ref.t;
                        }
                    }
                });
            }
            Primitives::Spheres { slots, .. } => {
                bvh.intersect(ray, t_max, |leaf, t_max| {
                    for slot in leaf.map(|s| s as usize) {
                        let (center, radius) = slots[slot];
                        if let Some(t) = sphere::intersect(ray, center, radius, *t_max) {
                            nearest_ref.offer(plain(t), order[slot]);
                            *t_max = nearest_ref.t;
                        }
                    }
                });
            }
        }
        (nearest.primitive != NO_PRIMITIVE).then_some(nearest)
    }

    /// The slot of a primitive that is met at or before `t_max` and `blocks`, if there is one.
    pub(super) fn occluded(&self, ray: &PreparedRay, t_max: f32, mut blocks: impl FnMut(u32) -> bool) -> Option<u32> {
        let order = self.bvh.order();
        let mut blocker = None;
        match &self.primitives {
            Primitives::Shapes { slots, .. } | Primitives::Cylinders { slots, .. } => {
                self.bvh.occluded(ray, t_max, |leaf| {
                    blocker = first(leaf, |slot| meet(&slots[slot], ray, t_max).is_some() && blocks(order[slot]));
                    blocker.is_some()
                })
            }
            Primitives::Mesh { slots, mesh } => self.bvh.occluded(ray, t_max, |leaf| {
                blocker = first(leaf, |slot| meets_triangle(&slots[slot], mesh, ray, t_max) && blocks(order[slot]));
                blocker.is_some()
            }),
            Primitives::Spheres { slots, .. } => self.bvh.occluded(ray, t_max, |leaf| {
                blocker = first(leaf, |slot| {
                    sphere::intersect(ray, slots[slot].0, slots[slot].1, t_max).is_some() && blocks(order[slot])
                });
                blocker.is_some()
            }),
        };
        blocker
    }

    /// Whether the primitive in this slot is met at or before `t_max`.
    pub(super) fn blocks(&self, slot: u32, ray: &PreparedRay, t_max: f32) -> bool {
        let slot = slot as usize;
        match &self.primitives {
            Primitives::Shapes { slots, .. } | Primitives::Cylinders { slots, .. } => {
                meet(&slots[slot], ray, t_max).is_some()
            }
            Primitives::Mesh { slots, mesh } => meets_triangle(&slots[slot], mesh, ray, t_max),
            Primitives::Spheres { slots, .. } => sphere::intersect(ray, slots[slot].0, slots[slot].1, t_max).is_some(),
        }
    }

    /// The same question answered by trying every primitive: the oracle that the hierarchy is tested against.
    pub(super) fn intersect_brute_force(&self, ray: &PreparedRay, t_max: f32) -> Option<Nearest> {
        let mut nearest = Nearest { t: t_max, primitive: NO_PRIMITIVE, part: 0, uv: [0.0; 2] };
        for (slot, &id) in self.bvh.order().iter().enumerate() {
            let hit = match &self.primitives {
                Primitives::Shapes { slots, .. } | Primitives::Cylinders { slots, .. } => {
                    slots[slot].intersect(&ray.ray, nearest.t)
                }
                Primitives::Mesh { slots, mesh } => triangle::intersect(ray, &slots[slot], nearest.t)
                    .filter(|hit| hit.front || !mesh.one_sided)
                    .map(|hit| ShapeHit { t: hit.t, part: 0, uv: [hit.u, hit.v] }),
                Primitives::Spheres { slots, .. } => {
                    sphere::intersect(ray, slots[slot].0, slots[slot].1, nearest.t).map(plain)
                }
            };
            if let Some(hit) = hit {
                nearest.offer(hit, id);
            }
        }
        (nearest.primitive != NO_PRIMITIVE).then_some(nearest)
    }

    /// The second stage of a hit, in this geometry's space.
    pub(super) fn surface(&self, line: Line, primitive: u32, hit: &ShapeHit) -> Surface {
        let id = primitive as usize;
        match &self.primitives {
            Primitives::Shapes { shapes, .. } => shapes[id].surface(line, hit),
            Primitives::Mesh { mesh, .. } => mesh.surface(id, hit.uv[0], hit.uv[1]),
            Primitives::Spheres { cloud, .. } => cloud.surface(id, line, hit),
            Primitives::Cylinders { cloud, .. } => cloud.surface(id, line, hit),
        }
    }

    /// How the surface goes on around a hit with this surface, in this geometry's space.
    pub(super) fn patch(&self, primitive: u32, hit: &ShapeHit, surface: &Surface) -> Patch {
        let id = primitive as usize;
        match &self.primitives {
            Primitives::Shapes { shapes, .. } => shapes[id].patch(surface, hit),
            Primitives::Mesh { mesh, .. } => mesh.patch(id, hit.uv[0], hit.uv[1]),
            Primitives::Spheres { cloud, .. } => cloud.patch(id, surface, hit),
            Primitives::Cylinders { cloud, .. } => cloud.patch(id, surface, hit),
        }
    }

    /// The bounds of the object that a primitive belongs to, in this geometry's space.
    pub(super) fn object_bounds(&self, primitive: u32) -> Option<Aabb> {
        match &self.primitives {
            Primitives::Shapes { shapes, .. } => shapes[primitive as usize].bounds(),
            _ => Some(self.bvh.bounds()),
        }
    }

    pub(super) fn count(&self, census: &mut Census) {
        let n = self.len() as u64;
        let list = |bytes: usize, len: usize| (bytes * len) as u64;
        census.bytes += self.bvh.statistics().bytes as u64;
        census.bytes += match &self.primitives {
            Primitives::Shapes { slots, .. } => {
                census.shapes += n;
                list(2 * size_of::<Shape>() + 8, slots.len())
            }
            Primitives::Mesh { slots, mesh } => {
                census.triangles += n;
                list(size_of::<Triangle>(), slots.len())
                    + list(12, mesh.positions.len() + mesh.normals.len() + mesh.colors.len() + mesh.triangles.len())
                    + list(8, mesh.uvs.len())
                    + list(4, mesh.slots.len())
            }
            Primitives::Spheres { cloud, .. } => {
                census.cloud_spheres += n;
                list(28, cloud.len()) + list(4, cloud.radii.len()) + list(12, cloud.colors.len())
            }
            Primitives::Cylinders { slots, cloud } => {
                census.cloud_cylinders += n;
                list(size_of::<Shape>(), slots.len()) + list(28, cloud.len()) + list(12, cloud.colors.len())
            }
        };
    }
}
