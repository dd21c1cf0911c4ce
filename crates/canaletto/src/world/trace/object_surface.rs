//! The surface of some objects of a world, with random points on it.

use crate::math::{DRay, Transform, gamma};
use crate::scene::ObjectIds;
use crate::shape::{Shape, Surface, SurfaceSampler, pick_by_area, sample_triangle};
use crate::world::World;
use crate::world::data::geometry::Geometry;
use crate::world::data::group::InstancePath;
use crate::world::data::instance::{Instance, NONE};
use crate::world::trace::query::Hit;
use canaletto_bvh::Aabb;
use glam::Vec3;

/// The surface of some objects, as they are when the shutter opens.
#[derive(Clone, Debug)]
pub struct ObjectSurface {
    ids: ObjectIds,
    instances: Vec<PlacedInstance>,
    elements: Vec<Element>,
    /// The cumulative sums of the elements' nominal areas.
    sums: Vec<f64>,
    samplers: Vec<SurfaceSampler>,
    planes: usize,
    bounds: Aabb,
    /// Whether all nominal areas are the true ones.
    is_exact: bool,
    has_holes: bool,
}

/// An instance with some of the objects.
#[derive(Clone, Debug)]
struct PlacedInstance {
    /// The number of the instance in the world.
    number: u32,
    geometry: u32,
    to_world: Option<Transform>,
    /// The factor from areas in the geometry's space to nominal ones.
    stretch: f64,
    /// The transform's determinant, if areas that aren't flat are scaled by their direction.
    determinant: Option<f64>,
}

/// A primitive of an instance.
#[derive(Clone, Copy, Debug)]
struct Element {
    /// Index into [`ObjectSurface::instances`].
    instance: u32,
    primitive: u32,
    /// Index into [`ObjectSurface::samplers`], or [`NONE`] for triangles of meshes.
    sampler: u32,
}

/// A random point of the objects.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ObjectSample {
    /// The surface at the point.
    pub(crate) surface: Surface,
    /// The share of the nominal area that is there: the true area of a piece over its nominal one, times the coverage.
    pub(crate) weight: f64,
}

/// The reason why a surface can't be sampled.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the objects have more than {most} primitives, copies counted", most = ObjectSurface::MAX_PRIMITIVES)]
pub struct TooManyPrimitives;

impl ObjectSurface {
    /// The most primitives, counted once for each copy.
    pub const MAX_PRIMITIVES: usize = 1 << 26;

    /// The objects.
    pub fn ids(&self) -> &ObjectIds {
        &self.ids
    }

    /// The number of planes among the objects. They have no area and no random points.
    pub fn planes(&self) -> usize {
        self.planes
    }

    /// The area of the surface without planes, one side. It is exact unless a transform scales a round shape by
    /// different factors, or a material has holes; see [`ObjectSurface::is_exact`].
    pub fn nominal_area(&self) -> f64 {
        self.sums.last().copied().unwrap_or(0.0)
    }

    /// Whether [`ObjectSurface::nominal_area`] is exact.
    pub fn is_exact(&self) -> bool {
        self.is_exact
    }

    /// The number of primitives, copies counted.
    pub fn primitives(&self) -> usize {
        self.elements.len()
    }

    /// Whether a material on the surface may have holes.
    pub fn has_holes(&self) -> bool {
        self.has_holes
    }

    /// The geometry and number of each primitive, and the transform to the world.
    pub(in crate::world) fn placed_primitives(&self) -> impl Iterator<Item = (u32, u32, Option<&Transform>)> {
        self.elements.iter().map(|element| {
            let instance = &self.instances[element.instance as usize];
            (instance.geometry, element.primitive, instance.to_world.as_ref())
        })
    }

    /// A box around the surface without planes, in the world's coordinates.
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// The point at `u` of the unit square. Equal parts of the square map to equal nominal areas. The surface must have
    /// an area.
    pub(crate) fn sample(&self, world: &World, [u, v]: [f64; 2]) -> ObjectSample {
        let (index, inside) = pick_by_area(u, &self.sums);
        let Element { instance, primitive, sampler } = self.elements[index];
        let instance = &self.instances[instance as usize];
        let local = match self.samplers.get(sampler as usize) {
            Some(sampler) => sampler.surface([inside, v]),
            None => match &world.geometry.geometries[instance.geometry as usize] {
                Geometry::Mesh { mesh, .. } => sample_triangle(mesh.corners(primitive as usize), [inside, v]),
                Geometry::Spheres { cloud, .. } => sampled(cloud.sphere(primitive as usize).into(), [inside, v]),
                Geometry::Cylinders { cloud, .. } => sampled(cloud.cylinder(primitive as usize).into(), [inside, v]),
                Geometry::Shapes { shapes, .. } => sampled(shapes[primitive as usize], [inside, v]),
            },
        };
        let (mut surface, mut weight) = (local, 1.0);
        if let Some(to_world) = &instance.to_world {
            surface = local.transformed(to_world);
            if let Some(determinant) = instance.determinant {
                weight = determinant * to_world.normal(local.normal).length() / instance.stretch;
            }
        }
        let hit = Hit { t: 0.0, instance: instance.number, primitive, part: 0, uv: [0.0; 2], time: 0.0 };
        if world.material(&hit).has_holes() {
            weight *= world.coverage_of_point(&hit, &surface);
        }
        ObjectSample { surface, weight }
    }
}

fn area_of(element: impl Into<Shape>) -> f64 {
    element.into().area().unwrap_or(0.0)
}

fn sampled(shape: Shape, u: [f64; 2]) -> Surface {
    let sampler = shape.sampler().expect("only planes have no sampler, and they have no bounds");
    sampler.surface(u)
}

impl World {
    /// The surface of these objects.
    ///
    /// # Errors
    /// [`TooManyPrimitives`].
    pub fn object_surface(&self, ids: ObjectIds) -> Result<ObjectSurface, TooManyPrimitives> {
        let mut surface = ObjectSurface {
            planes: self.geometry.unbounded.iter().filter(|plane| ids.contains(id(plane.object))).count(),
            ids: ObjectIds::default(),
            instances: Vec::new(),
            elements: Vec::new(),
            sums: Vec::new(),
            samplers: Vec::new(),
            bounds: Aabb::EMPTY,
            is_exact: true,
            has_holes: false,
        };
        // Groups come after the groups that they contain.
        let mut spans: Vec<u64> = Vec::with_capacity(self.geometry.groups.len());
        for group in &self.geometry.groups {
            let last = |instance: &Instance| instance.first_object + self.span_of(instance, &spans);
            spans.push(group.instances.iter().map(last).max().unwrap_or(0));
        }
        let root = &self.geometry.root;
        for (index, instance) in (0..).zip(&root.instances) {
            let span = self.span_of(instance, &spans);
            if !ids.overlaps(id(instance.first_object)..id(instance.first_object + span)) {
                continue;
            }
            if instance.group == NONE {
                self.add_elements(instance, root.first(index), &ids, &mut surface)?;
            } else {
                let path = InstancePath::to(instance, root.first(index), None, &self.geometry.groups);
                self.add_group(&path, &spans, &ids, &mut surface)?;
            }
        }
        surface.ids = ids;
        Ok(surface)
    }

    /// The number of object numbers from an instance's first to its last.
    fn span_of(&self, instance: &Instance, spans: &[u64]) -> u64 {
        match instance.group {
            NONE => match &self.geometry.geometries[instance.geometry as usize] {
                Geometry::Shapes { objects, .. } => objects.iter().max().map_or(0, |last| u64::from(*last) + 1),
                _ => 1,
            },
            group => spans[group as usize],
        }
    }

    fn add_group(
        &self,
        path: &InstancePath,
        spans: &[u64],
        ids: &ObjectIds,
        surface: &mut ObjectSurface,
    ) -> Result<(), TooManyPrimitives> {
        for (index, instance) in (0..).zip(&path.group.instances) {
            let placed = path.placed(instance);
            let span = self.span_of(instance, spans);
            if !ids.overlaps(id(placed.first_object)..id(placed.first_object + span)) {
                continue;
            }
            if instance.group == NONE {
                self.add_elements(&placed, path.number(index), ids, surface)?;
            } else {
                let inner = InstancePath::to(instance, path.number(index), Some(path), &self.geometry.groups);
                self.add_group(&inner, spans, ids, surface)?;
            }
        }
        Ok(())
    }

    /// Adds the primitives of the objects in an instance of a geometry.
    fn add_elements(
        &self,
        instance: &Instance,
        number: u32,
        ids: &ObjectIds,
        surface: &mut ObjectSurface,
    ) -> Result<(), TooManyPrimitives> {
        let geometry = &self.geometry.geometries[instance.geometry as usize];
        let is_mesh = matches!(geometry, Geometry::Mesh { .. });
        let to_world = instance.placed(&self.geometry.chains, 0.0);
        let scale = to_world.as_ref().map_or(Some(1.0), Transform::uniform_scale);
        let determinant = to_world.as_ref().map_or(1.0, |t| t.matrix().matrix3.determinant().abs());
        let cube_root = libm::cbrt(determinant);
        let stretch = scale.map_or(cube_root * cube_root, |scale| scale * scale);
        let index = surface.instances.len() as u32;
        let determinant = (scale.is_none() && !is_mesh).then_some(determinant);
        let placed = PlacedInstance { number, geometry: instance.geometry, to_world, stretch, determinant };
        surface.instances.push(placed);
        let mut sum = surface.nominal_area();
        for primitive in 0..geometry.len() as u32 {
            let (sampler, area) = match geometry {
                Geometry::Shapes { objects, shapes, .. } => {
                    if !ids.contains(id(instance.first_object + u64::from(objects[primitive as usize]))) {
                        continue;
                    }
                    let Some(sampler) = shapes[primitive as usize].sampler() else { continue };
                    let area = sampler.area() * stretch;
                    surface.samplers.push(sampler);
                    (surface.samplers.len() as u32 - 1, area)
                }
                Geometry::Mesh { mesh, .. } => {
                    let corners = mesh.corners(primitive as usize).map(Vec3::as_dvec3);
                    let [a, b, c] = to_world.as_ref().map_or(corners, |t| corners.map(|p| t.point(p)));
                    (NONE, 0.5 * (b - a).cross(c - a).length())
                }
                Geometry::Spheres { cloud, .. } => (NONE, area_of(cloud.sphere(primitive as usize)) * stretch),
                Geometry::Cylinders { cloud, .. } => (NONE, area_of(cloud.cylinder(primitive as usize)) * stretch),
            };
            if surface.elements.len() >= ObjectSurface::MAX_PRIMITIVES {
                return Err(TooManyPrimitives);
            }
            sum += area;
            surface.sums.push(sum);
            surface.elements.push(Element { instance: index, primitive, sampler });
            let bounds = instance.bounds(&self.geometry.chains, geometry.primitive_bounds(primitive));
            surface.bounds = surface.bounds.union(bounds);
            surface.has_holes |= self.material_at(instance, primitive).has_holes();
            surface.is_exact &= (is_mesh || scale.is_some()) && !surface.has_holes;
        }
        Ok(())
    }

    /// The coverage at a point of a primitive. A ray from just above the point hits the primitive there, which gives
    /// the coordinates that textures need.
    fn coverage_of_point(&self, hit: &Hit, surface: &Surface) -> f64 {
        let bounds = self.with_instance(hit.instance, |instance| {
            instance.bounds(
                &self.geometry.chains,
                self.geometry.geometries[instance.geometry as usize].primitive_bounds(hit.primitive),
            )
        });
        // Far more than rounding moves the point, and far less than a shape's features.
        let height = f64::from((bounds.max - bounds.min).max_element()) * f64::from(ABOVE)
            + f64::from(surface.error.max_element()) * 8.0;
        let line = DRay { origin: surface.exact + surface.normal * height, direction: -surface.normal };
        let ray = line.rounded().prepare();
        let t_max = (2.0 * height) as f32 * (1.0 + gamma(4));
        let found = self.with_instance(hit.instance, |instance| {
            instance.with_local_ray(&ray, &self.geometry.chains, 0.0, |ray| {
                self.geometry.geometries[instance.geometry as usize].intersect_one(hit.primitive, ray, t_max, 0.0)
            })
        });
        match found {
            Some(found) => {
                let hit = Hit { t: found.t, part: found.part, uv: found.uv, ..*hit };
                f64::from(self.coverage_at(DRay::from(ray.ray()), &hit))
            }
            // The point lies on an edge, up to rounding.
            None => 1.0,
        }
    }
}

/// The height above a point from which it is looked up, relative to the size of its primitive.
const ABOVE: f32 = 1.0 / 1024.0;

/// The number of an object from 1 on, as [`World::object_id`] gives it.
fn id(number: u64) -> u32 {
    u32::try_from(number + 1).unwrap_or(u32::MAX)
}
