//! Parts of a scene while it is flattened: what a walk over nodes has placed, and how many of it.

use super::BuildError;
use super::World;
use super::build::hierarchy_error;
use super::flatten::Builder;
use super::geometry::Geometry;
use super::instance::{Instance, NONE, Unbounded};
use super::motion::MovingLight;
use super::object_numbers::ObjectNumbers;
use super::single_shapes::SameTransform;
use crate::light::Light;
use crate::math::Transform;
use crate::shape::Shape;
use glam::DVec3;

/// The result of one walk: of the root, or of a prototype in its own space.
#[derive(Clone, Default)]
pub(super) struct Part {
    pub(super) object_numbers: ObjectNumbers,
    pub(super) shapes: PartShapes,
    /// The shapes that cast no shadow.
    pub(super) shadowless_shapes: PartShapes,
    /// Shapes under the last transforms that keep shapes out of these lists.
    pub(super) same_transforms: Vec<SameTransform>,
    pub(super) instances: Vec<Instance>,
    pub(super) lights: Vec<Light>,
    pub(super) moving_lights: Vec<MovingLight>,
    pub(super) unbounded: Vec<Unbounded>,
}

/// Shapes of a part that become one geometry.
#[derive(Clone, Default)]
pub(super) struct PartShapes {
    pub(super) shapes: Vec<Shape>,
    /// The number of the first shape's object.
    pub(super) first_object: u64,
    /// The numbers of the shapes' objects, counted from the first one.
    pub(super) objects: Vec<u32>,
    pub(super) materials: Vec<u32>,
}

impl PartShapes {
    /// Whether the number of this object, counted from the first shape's, fits.
    pub(super) fn has_room_for(&self, object: u64) -> bool {
        self.shapes.is_empty() || u32::try_from(object - self.first_object).is_ok()
    }

    /// Adds a shape of this object.
    pub(super) fn push(&mut self, shape: Shape, object: u64, material: u32) {
        debug_assert!(self.has_room_for(object));
        if self.shapes.is_empty() {
            self.first_object = object;
        }
        self.shapes.push(shape);
        self.objects.push((object - self.first_object) as u32);
        self.materials.push(material);
    }
}

/// A part whose single shapes have become instances.
pub(super) struct FinishedPart {
    pub(super) object_numbers: ObjectNumbers,
    pub(super) instances: Vec<Instance>,
    pub(super) lights: Vec<Light>,
    pub(super) moving_lights: Vec<MovingLight>,
    pub(super) unbounded: Vec<Unbounded>,
    /// The origin of the part's coordinates.
    pub(super) origin: DVec3,
}

impl Builder {
    pub(super) fn light(&mut self, part: &mut Part, light: Light) -> Result<(), BuildError> {
        check_light(&light, "after its transforms, ")?;
        let points = light.points() as usize + self.light_meshes.count(&light);
        self.count(1, points)?;
        part.lights.push(light);
        Ok(())
    }

    pub(super) fn unbounded(&mut self, part: &mut Part, shape: Unbounded) -> Result<(), BuildError> {
        self.count(2, 1)?;
        part.unbounded.push(shape);
        Ok(())
    }

    /// The number of instances that may still be placed.
    pub(super) fn room(&self) -> usize {
        World::MAX_INSTANCES.saturating_sub(self.placed[0])
    }

    pub(super) fn count_instances(&mut self, more: usize) -> Result<(), BuildError> {
        self.count(0, more)
    }

    /// Counts what is placed before memory is allocated for it: 0 for instances, 1 for light points, 2 for shapes
    /// without bounds.
    pub(super) fn count(&mut self, what: usize, more: usize) -> Result<(), BuildError> {
        self.placed[what] = self.placed[what].saturating_add(more);
        match what {
            0 if self.placed[0] > World::MAX_INSTANCES => Err(BuildError::TooManyInstances),
            1 if self.placed[1] > World::MAX_LIGHT_POINTS => Err(BuildError::TooManyLights),
            2 if self.placed[2] > World::MAX_UNBOUNDED => Err(BuildError::TooManyPlanes),
            _ => Ok(()),
        }
    }

    /// Turns a part's single shapes into instances.
    pub(super) fn finish_part(&mut self, mut part: Part) -> Result<FinishedPart, BuildError> {
        for same in std::mem::take(&mut part.same_transforms) {
            self.place_same(same, &mut part)?;
        }
        let Part { object_numbers, shapes, shadowless_shapes, mut instances, lights, moving_lights, unbounded, .. } =
            part;
        for (shapes, casts_shadow) in [(shapes, true), (shadowless_shapes, false)] {
            if let Some((geometry, first_object)) = self.shapes_geometry(shapes)? {
                instances.push(Instance { casts_shadow, ..Instance::of(geometry, first_object) });
            }
        }
        Ok(FinishedPart { object_numbers, instances, lights, moving_lights, unbounded, origin: DVec3::ZERO })
    }

    /// The geometry of shapes and the number of its first object, unless there are none.
    pub(super) fn shapes_geometry(&mut self, shapes: PartShapes) -> Result<Option<(u32, u64)>, BuildError> {
        let PartShapes { shapes, first_object, objects, materials } = shapes;
        if shapes.is_empty() {
            return Ok(None);
        }
        let geometry = Geometry::shapes(shapes, objects, materials).map_err(|e| hierarchy_error("shapes", &e))?;
        self.geometries.push(geometry);
        self.owners.push(NONE);
        Ok(Some((self.geometries.len() as u32 - 1, first_object)))
    }

    /// Adds the geometry of the part's last object, with its own and its inherited material.
    pub(super) fn geometry_instance(
        &mut self,
        part: &mut Part,
        geometry: u32,
        [material, inherited]: [u32; 2],
        to_world: Option<Transform>,
        casts_shadow: bool,
    ) -> Result<(), BuildError> {
        let instance = Instance::of(geometry, part.object_numbers.last());
        self.instance(part, Instance { material, inherited, to_world, casts_shadow, ..instance })
    }

    pub(super) fn instance(&mut self, part: &mut Part, instance: Instance) -> Result<(), BuildError> {
        self.count(0, 1)?;
        part.instances.push(instance);
        Ok(())
    }
}

pub(super) fn check_light(light: &Light, when: &str) -> Result<(), BuildError> {
    light.check().map_err(|problem| BuildError::Invalid {
        object: light.name.clone().map_or(format!("{} light", light.kind_name()), |n| format!("light \"{n}\"")),
        problem: format!("{when}{problem}"),
    })
}
