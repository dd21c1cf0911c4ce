//! Clear bodies: closed surfaces of materials that let light through, filled with their medium.
//!
//! A ray that crosses such a surface enters or leaves the body. The bodies that a ray is in determine the media between
//! which it is refracted. Where bodies overlap, one of them fills the place and hides the others. It is the body with
//! the highest priority (Schmidt & Budge, *Simple Nested Dielectrics in Ray Traced Images*, 2002). Among equal
//! priorities it is the body with the smallest volume, so that a body within another needs no priority. Surfaces that
//! aren't closed refract rays but hold no medium.

use crate::material::{Material, PreparedMaterial};
use crate::math::DRay;
use crate::shape::{Shape, ShapeHit};
use crate::world::World;
use crate::world::data::geometry::Geometry;
use crate::world::data::instance::Instance;
use crate::world::data::shells::{OpenEdges, Shells};
use crate::world::trace::query::Hit;
use canaletto_bvh::{Aabb, Ray};
use glam::{DVec3, Vec3};
use std::collections::BTreeMap;

/// The identity of a clear body: an instance, and one of its shapes or one of its mesh's materials.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct BodyId {
    instance: u32,
    part: u32,
}

/// A clear body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Body {
    pub(crate) id: BodyId,
    /// Index into [`World::materials`].
    pub(crate) material: u32,
    /// η, the index of refraction, before textures.
    pub(crate) eta: f32,
    priority: f32,
    volume: f64,
    /// Whether a ray may be in the body more than once, as in a mesh whose parts overlap.
    pub(crate) overlaps_itself: bool,
}

impl Body {
    /// A body without a surface.
    #[cfg(test)]
    pub(crate) const fn example(part: u32, eta: f32, priority: f32, volume: f64, overlaps_itself: bool) -> Body {
        Body { id: BodyId { instance: 0, part }, material: 0, eta, priority, volume, overlaps_itself }
    }

    /// Whether this body, and not the other, fills the place that they share.
    pub(crate) fn fills_before(&self, other: &Body) -> bool {
        let by_volume = || other.volume.total_cmp(&self.volume);
        // Among equals, the later one in the scene fills, as paint goes over paint.
        self.priority.total_cmp(&other.priority).then_with(by_volume).then(self.id.cmp(&other.id)).is_gt()
    }
}

/// A mesh whose medium fills nothing around its open edges.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct OpenMesh<'w> {
    /// The name of the object.
    pub(crate) object: &'w str,
    pub(crate) material: &'w Material,
    /// The number of its open edges.
    pub(crate) edges: u32,
}

impl PreparedMaterial {
    /// Whether a closed surface of this material bounds a body: light passes everywhere by refraction.
    fn fills(&self) -> bool {
        !self.is_opaque() && !self.has_holes()
    }
}

/// Directions that axes and faces of scenes hardly have.
const UNALIGNED_DIRECTIONS: [Vec3; 3] =
    [Vec3::new(0.3743, 0.8129, 0.4461), Vec3::new(-0.7219, 0.2917, 0.6276), Vec3::new(0.5417, -0.3371, -0.7702)];

impl World {
    /// Whether any material of the scene may let light through.
    #[inline]
    pub(crate) fn has_clear(&self) -> bool {
        self.media.has_clear
    }

    /// The meshes with a medium that aren't closed. A mesh that is used several times is named once.
    pub(crate) fn open_meshes(&self) -> Vec<OpenMesh<'_>> {
        let is_filled = |material: &PreparedMaterial| material.fills() && !material.medium.is_vacuum();
        if !self.shading.materials.iter().any(is_filled) {
            return Vec::new();
        }
        let open_edges =
            |shells: &Option<Box<Shells>>| shells.as_ref().map_or_else(Vec::new, |s| s.open_edges().to_vec());
        let mut open: Vec<Vec<OpenEdges>> = self.media.shells.iter().map(open_edges).collect();
        let mut left = open.iter().filter(|edges| !edges.is_empty()).count();
        let mut found = Vec::new();
        for number in 0..self.geometry.root.leaves {
            if left == 0 {
                break;
            }
            self.with_instance(number, |instance| {
                let edges = &mut open[instance.geometry as usize];
                let material_at =
                    |edges: &OpenEdges| &self.shading.materials[self.material_of(instance, edges.triangle) as usize];
                let Some(first) = edges.iter().find(|edges| is_filled(material_at(edges))) else { return };
                let hit = Hit { t: 0.0, instance: number, primitive: first.triangle, part: 0, uv: [0.0; 2], time: 0.0 };
                let filled = edges.iter().filter(|edges| is_filled(material_at(edges)));
                found.push(OpenMesh {
                    object: &self.object(&hit).name,
                    material: material_at(first),
                    edges: filled.map(|edges| edges.count).sum(),
                });
                edges.clear();
                left -= 1;
            });
        }
        found
    }

    /// The clear body whose surface was hit, if the surface is closed.
    pub(crate) fn body(&self, hit: &Hit) -> Option<Body> {
        let material = self.material(hit);
        if hit.instance == Hit::UNBOUNDED || !material.fills() {
            return None;
        }
        let (part, volume, overlaps_itself) =
            self.with_instance(hit.instance, |instance| self.part_of(instance, hit))?;
        let id = BodyId { instance: hit.instance, part };
        let number = self.material_index(hit);
        Some(Body {
            id,
            material: number,
            eta: material.plain().classic.eta,
            priority: material.priority,
            volume,
            overlaps_itself,
        })
    }

    /// The closed part of an instance that was hit, its volume, and whether it overlaps itself.
    fn part_of(&self, instance: &Instance, hit: &Hit) -> Option<(u32, f64, bool)> {
        let id = hit.primitive as usize;
        let (part, volume, overlaps) = match &self.geometry.geometries[instance.geometry as usize] {
            Geometry::Shapes { shapes, .. } => (hit.primitive, solid(&shapes[id])?, false),
            Geometry::Spheres { cloud, .. } => (hit.primitive, solid(&Shape::Sphere(cloud.sphere(id)))?, false),
            Geometry::Cylinders { cloud, .. } => (hit.primitive, solid(&Shape::Cylinder(cloud.cylinder(id)))?, false),
            Geometry::Mesh { .. } => {
                let (slot, volume) = self.media.shells[instance.geometry as usize].as_ref()?.around(hit.primitive)?;
                (slot, volume, true)
            }
        };
        let scale =
            instance.placed(&self.geometry.chains, hit.time).map_or(1.0, |t| t.matrix().matrix3.determinant().abs());
        Some((part, volume * scale, overlaps))
    }

    /// The clear bodies that contain a point, each with its count. For meshes, rays from the point find the count.
    pub(crate) fn bodies_around(&self, point: DVec3, time: f32) -> Vec<(Body, i32)> {
        let (p, Aabb { min, max }) = (point.as_vec3(), self.media.clear_bounds);
        if !(p.cmpge(min).all() && p.cmple(max).all()) {
            return Vec::new();
        }
        let mut counts: BTreeMap<BodyId, (Body, [i32; 3])> = BTreeMap::new();
        for (way, direction) in UNALIGNED_DIRECTIONS.into_iter().enumerate() {
            let ray = Ray::new(point.as_vec3(), direction);
            let mut along = Vec::new();
            self.each_between(&ray, f32::INFINITY, time, &mut |hit| along.push(hit));
            along.sort_unstable_by_key(|hit| (hit.instance, hit.primitive));
            along.dedup_by_key(|hit| (hit.instance, hit.primitive));
            let line = DRay { origin: point, direction: direction.as_dvec3() };
            for hit in &along {
                let Some(body) = self.body(hit) else { continue };
                let count = if body.overlaps_itself {
                    if self.surface_without_uv(line, hit).normal.dot(line.direction) > 0.0 { 1 } else { -1 }
                } else {
                    i32::from(self.contains(hit, point))
                };
                counts.entry(body.id).or_insert((body, [0; 3])).1[way] += count;
            }
        }
        // A ray through an edge may count two triangles instead of one. The median of three counts is right.
        let middle = |(body, mut counts): (Body, [i32; 3])| {
            counts.sort_unstable();
            (counts[1] > 0).then_some((body, counts[1]))
        };
        counts.into_values().filter_map(middle).collect()
    }

    /// How often a ray that starts in a clear body is in it, from the surfaces ahead: each exit counts 1, each entry
    /// −1. For a shape, the first surface decides.
    pub(crate) fn containment_count(&self, ray: &Ray, time: f32, body: &Body) -> i32 {
        let BodyId { instance, part } = body.id;
        let mut ahead = Vec::new();
        self.with_instance(instance, |placed| {
            let geometry = &self.geometry.geometries[placed.geometry as usize];
            placed.with_local_ray(&ray.prepare(), &self.geometry.chains, time, |ray| {
                let mut meet = |primitive: u32| {
                    if let Some(ShapeHit { t, part, uv }) = geometry.intersect_one(primitive, ray, f32::INFINITY, time)
                    {
                        ahead.push(Hit { t, instance, primitive, part, uv, time });
                    }
                    false
                };
                if body.overlaps_itself {
                    geometry.occluded(ray, f32::INFINITY, time, &mut meet);
                } else {
                    meet(part);
                }
            });
        });
        let line = DRay::from(ray);
        let leaves = |hit: &Hit| self.surface_without_uv(line, hit).normal.dot(line.direction) > 0.0;
        if !body.overlaps_itself {
            return ahead.first().map_or(0, |hit| i32::from(leaves(hit)));
        }
        ahead.retain(|hit| self.body(hit).is_some_and(|found| found.id == body.id));
        let mut ways: Vec<_> = ahead.iter().map(|hit| (hit.t.to_bits(), leaves(hit))).collect();
        // A ray through an edge hits two triangles in one place.
        ways.sort_unstable();
        ways.dedup();
        ways.iter().map(|&(_, leaves)| if leaves { 1 } else { -1 }).sum()
    }

    /// Whether a point lies in the shape that was hit.
    fn contains(&self, hit: &Hit, point: DVec3) -> bool {
        self.with_instance(hit.instance, |instance| {
            let id = hit.primitive as usize;
            let local = instance.placed(&self.geometry.chains, hit.time).map_or(point, |t| t.inverse().point(point));
            match &self.geometry.geometries[instance.geometry as usize] {
                Geometry::Shapes { shapes, .. } => shapes[id].contains(local),
                Geometry::Spheres { cloud, .. } => Shape::Sphere(cloud.sphere(id)).contains(local),
                Geometry::Cylinders { cloud, .. } => Shape::Cylinder(cloud.cylinder(id)).contains(local),
                Geometry::Mesh { .. } => false,
            }
        })
    }

    /// Calls `f` at least once with each primitive that a ray hits at or before `t_max`, in no order. The hits name the
    /// primitive and its part; their t is 0.
    pub(in crate::world) fn each_between(&self, ray: &Ray, t_max: f32, time: f32, f: &mut dyn FnMut(Hit)) {
        let nowhere = Hit { t: 0.0, instance: Hit::UNBOUNDED, primitive: 0, part: 0, uv: [0.0; 2], time };
        for (primitive, unbounded) in (0..).zip(&self.geometry.unbounded) {
            if let Some(ShapeHit { part, uv, .. }) = unbounded.shape.intersect(ray, t_max) {
                f(Hit { primitive, part, uv, ..nowhere });
            }
        }
        self.any_instance(&ray.prepare(), t_max, &mut |instance, number| {
            let geometry = &self.geometry.geometries[instance.geometry as usize];
            instance.with_local_ray(&ray.prepare(), &self.geometry.chains, time, |ray| {
                geometry.occluded(ray, t_max, time, &mut |primitive| {
                    if let Some(ShapeHit { part, uv, .. }) = geometry.intersect_one(primitive, ray, t_max, time) {
                        f(Hit { instance: number, primitive, part, uv, ..nowhere });
                    }
                    false
                })
            });
            false
        });
    }
}

/// The volume of a closed shape.
fn solid(shape: &Shape) -> Option<f64> {
    shape.is_closed().then(|| shape.volume())
}

/// For each mesh that may be clear, its closed parts.
pub(in crate::world) fn shells(
    geometries: &[Geometry],
    may_be_clear: impl Fn(usize) -> bool + Sync,
) -> Vec<Option<Box<Shells>>> {
    let of = |(index, geometry): (usize, &Geometry)| match geometry {
        Geometry::Mesh { mesh, .. } if may_be_clear(index) && !mesh.one_sided => Some(Box::new(Shells::of(mesh))),
        _ => None,
    };
    geometries.iter().enumerate().map(of).collect()
}
