//! Solids: closed opaque bodies, and the places of surfaces that touch or penetrate others.
//!
//! A surface inside a solid, or on the face of one, is covered: no light arrives there. A solid with a light inside is
//! hollow, such as a room that is a single box. It covers nothing, and light arrives on its inner side.

use crate::math::{DRay, rounding};
use crate::shape::Shape;
use crate::world::World;
use crate::world::data::geometry::Geometry;
use crate::world::data::instance::Instance;
use crate::world::data::shells::Shells;
use crate::world::trace::query::Hit;
use canaletto_bvh::{Aabb, BuildError, Bvh, Ray};
use canaletto_parallel::prelude::*;
use glam::{DVec3, Vec3};

/// The largest distance between touching faces, relative to their largest coordinate: eight units in the last place.
const TOUCHING: f32 = 8.0 * f32::EPSILON;

/// The least cosine between the normals of coinciding faces.
const PARALLEL: f64 = 0.999;

/// Directions that axes and faces of scenes hardly have.
const UNALIGNED_DIRECTIONS: [Vec3; 3] =
    [Vec3::new(0.3743, 0.8129, 0.4461), Vec3::new(-0.7219, 0.2917, 0.6276), Vec3::new(0.5417, -0.3371, -0.7702)];

/// The identity of a solid: an instance, and one of its shapes or one of its mesh's material slots.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct SolidId {
    instance: u32,
    part: u32,
}

/// The solids of a world at time 0.
#[derive(Debug)]
pub(crate) struct Solids<'w> {
    world: &'w World,
    /// All geometries, each in its place in the world.
    placed: Vec<Instance>,
    /// The hierarchy over their bounds.
    tree: Bvh,
    bounds: Vec<Aabb>,
    /// For each geometry that is a mesh, its closed parts.
    shells: Vec<Option<Shells>>,
    /// The solids that contain a light, in order.
    hollow: Vec<SolidId>,
}

impl<'w> Solids<'w> {
    /// The solids of a world. Those that contain one of the `lights` are hollow, and those with a primitive that shines
    /// inwards: `glowing` has instances and primitives.
    ///
    /// # Errors
    /// If the hierarchy over the instances can't be built.
    pub(crate) fn new(world: &'w World, lights: &[Vec3], glowing: &[(u32, u32)]) -> Result<Solids<'w>, BuildError> {
        let shells = world
            .geometry
            .geometries
            .par_iter()
            .map(|geometry| match geometry {
                Geometry::Mesh { mesh, .. } if !mesh.one_sided => Some(Shells::of(mesh)),
                _ => None,
            })
            .collect();
        let placed: Vec<Instance> =
            (0..world.geometry.root.leaves).map(|number| world.with_instance(number, |instance| *instance)).collect();
        let bounds: Vec<Aabb> = placed.iter().map(|instance| world.bounds_of(instance)).collect();
        let tree = Bvh::build(&bounds)?;
        let mut solids = Solids { world, placed, tree, bounds, shells, hollow: Vec::new() };
        let mut hollow: Vec<SolidId> = lights.iter().flat_map(|&light| solids.around(light)).collect();
        hollow.extend(glowing.iter().filter_map(|&(instance, primitive)| solids.of(instance, primitive)));
        hollow.sort_unstable();
        hollow.dedup();
        solids.hollow = hollow;
        Ok(solids)
    }

    /// The solid that a primitive bounds, if it is closed and opaque.
    pub(crate) fn of(&self, instance: u32, primitive: u32) -> Option<SolidId> {
        let placed = self.placed.get(instance as usize)?;
        let id = primitive as usize;
        let part = match &self.world.geometry.geometries[placed.geometry as usize] {
            Geometry::Shapes { shapes, .. } => shapes[id].is_closed().then_some(primitive)?,
            Geometry::Spheres { .. } => primitive,
            Geometry::Cylinders { cloud, .. } => cloud.caps.then_some(primitive)?,
            Geometry::Mesh { .. } => self.shells[placed.geometry as usize].as_ref()?.around(primitive)?.0,
        };
        let blocks = self.world.casts_shadow(instance, primitive) && self.world.is_opaque(instance, primitive);
        blocks.then_some(SolidId { instance, part })
    }

    /// Whether light may arrive on the inner side of a solid.
    pub(crate) fn is_hollow(&self, solid: SolidId) -> bool {
        self.hollow.binary_search(&solid).is_ok()
    }

    /// The solids that contain a point.
    fn around(&self, point: Vec3) -> Vec<SolidId> {
        let mut found = Vec::new();
        let here = Aabb { min: point, max: point };
        self.each_near(&here, |instance, primitive| {
            let Some(solid) = self.of(instance, primitive).filter(|solid| !found.contains(solid)) else { return };
            if self.contains(solid, point) {
                found.push(solid);
            }
        });
        found
    }

    /// Calls `f` with the instance and primitive of those whose boxes overlap `bounds`. A mesh whose box contains all
    /// of `bounds` is named at least once for each closed part, too, even where no triangle is near.
    fn each_near(&self, bounds: &Aabb, mut f: impl FnMut(u32, u32)) {
        self.tree.overlapping(bounds, |leaf| {
            for slot in leaf.slots() {
                let number = self.tree.order()[slot as usize];
                if !self.bounds[number as usize].overlaps(bounds) {
                    continue;
                }
                let placed = &self.placed[number as usize];
                let geometry = &self.world.geometry.geometries[placed.geometry as usize];
                let local =
                    placed.placed(&self.world.geometry.chains, 0.0).map_or(*bounds, |t| moved(&t.inverse(), bounds));
                if let Some(shells) = &self.shells[placed.geometry as usize] {
                    shells.examples().for_each(|triangle| f(number, triangle));
                }
                geometry.overlapping(&local, |primitive| {
                    f(number, primitive);
                    true
                });
            }
            true
        });
    }

    /// Whether a point lies in a solid.
    fn contains(&self, solid: SolidId, point: Vec3) -> bool {
        let placed = &self.placed[solid.instance as usize];
        let to_world = placed.placed(&self.world.geometry.chains, 0.0);
        let local = || to_world.map_or(point.as_dvec3(), |t| t.inverse().point(point.as_dvec3()));
        let geometry = &self.world.geometry.geometries[placed.geometry as usize];
        let id = solid.part as usize;
        match geometry {
            Geometry::Shapes { shapes, .. } => shapes[id].contains(local()),
            Geometry::Spheres { cloud, .. } => Shape::Sphere(cloud.sphere(id)).contains(local()),
            Geometry::Cylinders { cloud, .. } => Shape::Cylinder(cloud.cylinder(id)).contains(local()),
            Geometry::Mesh { .. } => {
                let mut counts = UNALIGNED_DIRECTIONS
                    .map(|direction| self.exits(placed, geometry, solid, &Ray::new(point, direction)));
                // A ray through an edge may count two triangles instead of one. The median of three counts is right.
                counts.sort_unstable();
                counts[1] > 0
            }
        }
    }

    /// How often a ray leaves a mesh's closed part minus how often it enters it.
    fn exits(&self, placed: &Instance, geometry: &Geometry, solid: SolidId, ray: &Ray) -> i32 {
        let Geometry::Mesh { mesh, .. } = geometry else { return 0 };
        let Some(shells) = &self.shells[placed.geometry as usize] else { return 0 };
        let mut met = Vec::new();
        placed.with_local_ray(&ray.prepare(), &self.world.geometry.chains, 0.0, |local| {
            geometry.occluded(local, f32::INFINITY, 0.0, &mut |triangle| {
                if shells.around(triangle).is_some_and(|(slot, _)| slot == solid.part)
                    && geometry.intersect_one(triangle, local, f32::INFINITY, 0.0).is_some()
                {
                    let [a, b, c] = mesh.corners(triangle as usize).map(Vec3::as_dvec3);
                    let leaves = (b - a).cross(c - a).dot(local.ray().direction.as_dvec3()) > 0.0;
                    met.push((triangle, leaves));
                }
                false
            });
        });
        met.sort_unstable();
        met.dedup();
        met.iter().map(|&(_, leaves)| if leaves { 1 } else { -1 }).sum()
    }

    /// The boxes in which other surfaces may touch or penetrate a primitive's surface inside these bounds, without
    /// those of the same mesh.
    pub(crate) fn contacts(&self, instance: u32, primitive: u32, bounds: &Aabb) -> Vec<Aabb> {
        let near = Vec3::splat(bounds.min.abs().max(bounds.max.abs()).max_element() * TOUCHING);
        let grown = Aabb { min: bounds.min - near, max: bounds.max + near };
        let mut boxes = Vec::new();
        let of_mesh = |number: u32| {
            matches!(
                self.world.geometry.geometries[self.placed[number as usize].geometry as usize],
                Geometry::Mesh { .. }
            )
        };
        self.tree.overlapping(&grown, |leaf| {
            for slot in leaf.slots() {
                let number = self.tree.order()[slot as usize];
                let placed = &self.placed[number as usize];
                if number == instance && of_mesh(number) || !self.bounds[number as usize].overlaps(&grown) {
                    continue;
                }
                let geometry = &self.world.geometry.geometries[placed.geometry as usize];
                let local =
                    placed.placed(&self.world.geometry.chains, 0.0).map_or(grown, |t| moved(&t.inverse(), &grown));
                geometry.overlapping(&local, |other| {
                    let at = placed.bounds(&self.world.geometry.chains, geometry.primitive_bounds(other));
                    if (number, other) != (instance, primitive) && at.overlaps(&grown) {
                        boxes.push(at.intersection(&grown));
                    }
                    true
                });
            }
            true
        });
        boxes
    }

    /// Whether a point of a primitive's surface is covered on the side of `normal`: it lies in a solid or on the face
    /// of one, or in a surface that is hit instead of this one.
    pub(crate) fn covers(&self, instance: u32, primitive: u32, point: DVec3, normal: DVec3) -> bool {
        let at = point.as_vec3();
        let error = rounding(at).max(Vec3::splat(at.abs().max_element() * TOUCHING));
        let [below, above] = [-normal, normal].map(|side| crate::math::offset_origin(at, error, normal, side));
        // A facet of a curved body lies inside that body, which doesn't cover it.
        let own = self.of(instance, primitive);
        if self.around(above).into_iter().any(|solid| Some(solid) != own && !self.is_hollow(solid)) {
            return true;
        }
        let ray = Ray { origin: below, direction: above - below };
        let line = DRay { origin: below.as_dvec3(), direction: (above - below).as_dvec3() };
        let mut covered = false;
        self.world.each_between(&ray, 1.0, 0.0, &mut |hit| {
            // Ties between hits go to the lowest id.
            if (hit.instance, hit.primitive) < (instance, primitive) {
                let normal_there = self.world.surface_without_uv(line, &Hit { t: 0.5, ..hit }).normal;
                covered |= normal_there.dot(normal).abs() > PARALLEL;
            }
        });
        covered
    }
}

/// The box around a box in another space.
fn moved(to: &crate::math::Transform, Aabb { min, max }: &Aabb) -> Aabb {
    let (min, max) = (min.as_dvec3(), max.as_dvec3());
    let (center, half) = crate::world::data::motion::around(to, (min + max) * 0.5, (max - min) * 0.5);
    crate::world::data::motion::outwards(center, half)
}
