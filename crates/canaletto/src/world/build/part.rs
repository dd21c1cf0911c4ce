//! Parts of a scene while it is flattened: what a walk over nodes has placed, and how many of it.

use crate::light::Light;
use crate::math::Transform;
use crate::shape::Shape;
use crate::world::BuildError;
use crate::world::World;
use crate::world::build::flatten::Builder;
use crate::world::build::single_shapes::SameTransform;
use crate::world::build_error::hierarchy_error;
use crate::world::data::geometry::Geometry;
use crate::world::data::instance::{Instance, NONE, Unbounded};
use crate::world::data::motion::MovingLight;
use crate::world::data::object_numbers::ObjectNumbers;
use glam::DVec3;

/// The result of one walk: of the root, or of a prototype in its own space.
#[derive(Clone, Default)]
pub(in crate::world) struct Part {
    pub(in crate::world) object_numbers: ObjectNumbers,
    pub(in crate::world) shapes: PartShapes,
    /// The shapes that cast no shadow.
    pub(in crate::world) shadowless_shapes: PartShapes,
    /// Shapes under the last transforms that keep shapes out of these lists.
    pub(in crate::world) same_transforms: Vec<SameTransform>,
    pub(in crate::world) instances: Vec<Instance>,
    pub(in crate::world) lights: Vec<Light>,
    pub(in crate::world) moving_lights: Vec<MovingLight>,
    pub(in crate::world) unbounded: Vec<Unbounded>,
}

/// Shapes of a part that become one geometry.
#[derive(Clone, Default)]
pub(in crate::world) struct PartShapes {
    pub(in crate::world) shapes: Vec<Shape>,
    /// The number of the first shape's object.
    pub(in crate::world) first_object: u64,
    /// The numbers of the shapes' objects, counted from the first one.
    pub(in crate::world) objects: Vec<u32>,
    pub(in crate::world) materials: Vec<u32>,
}

impl PartShapes {
    /// Whether the number of this object, counted from the first shape's, fits.
    pub(in crate::world) fn has_room_for(&self, object: u64) -> bool {
        self.shapes.is_empty() || u32::try_from(object - self.first_object).is_ok()
    }

    /// Adds a shape of this object.
    pub(in crate::world) fn push(&mut self, shape: Shape, object: u64, material: u32) {
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
pub(in crate::world) struct FinishedPart {
    pub(in crate::world) object_numbers: ObjectNumbers,
    pub(in crate::world) instances: Vec<Instance>,
    pub(in crate::world) lights: Vec<Light>,
    pub(in crate::world) moving_lights: Vec<MovingLight>,
    pub(in crate::world) unbounded: Vec<Unbounded>,
    /// The origin of the part's coordinates.
    pub(in crate::world) origin: DVec3,
}

impl Builder {
    pub(in crate::world) fn light(&mut self, part: &mut Part, light: Light) -> Result<(), BuildError> {
        check_light(&light, "after its transforms, ")?;
        let points = light.points() as usize + self.light_meshes.count(&light);
        self.count(1, points)?;
        part.lights.push(light);
        Ok(())
    }

    pub(in crate::world) fn unbounded(&mut self, part: &mut Part, shape: Unbounded) -> Result<(), BuildError> {
        self.count(2, 1)?;
        part.unbounded.push(shape);
        Ok(())
    }

    /// The number of instances that may still be placed.
    pub(in crate::world) fn room(&self) -> usize {
        World::MAX_INSTANCES.saturating_sub(self.placed[0])
    }

    pub(in crate::world) fn count_instances(&mut self, more: usize) -> Result<(), BuildError> {
        self.count(0, more)
    }

    /// Counts what is placed before memory is allocated for it: 0 for instances, 1 for light points, 2 for shapes
    /// without bounds.
    pub(in crate::world) fn count(&mut self, what: usize, more: usize) -> Result<(), BuildError> {
        self.placed[what] = self.placed[what].saturating_add(more);
        match what {
            0 if self.placed[0] > World::MAX_INSTANCES => Err(BuildError::TooManyInstances),
            1 if self.placed[1] > World::MAX_LIGHT_POINTS => Err(BuildError::TooManyLights),
            2 if self.placed[2] > World::MAX_UNBOUNDED => Err(BuildError::TooManyPlanes),
            _ => Ok(()),
        }
    }

    /// Turns a part's single shapes into instances.
    pub(in crate::world) fn finish_part(&mut self, mut part: Part) -> Result<FinishedPart, BuildError> {
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
    pub(in crate::world) fn shapes_geometry(&mut self, shapes: PartShapes) -> Result<Option<(u32, u64)>, BuildError> {
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
    pub(in crate::world) fn geometry_instance(
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

    pub(in crate::world) fn instance(&mut self, part: &mut Part, instance: Instance) -> Result<(), BuildError> {
        self.count(0, 1)?;
        part.instances.push(instance);
        Ok(())
    }
}

pub(in crate::world) fn check_light(light: &Light, when: &str) -> Result<(), BuildError> {
    light.check().map_err(|problem| BuildError::Invalid {
        object: light.name.clone().map_or(format!("{} light", light.kind_name()), |n| format!("light \"{n}\"")),
        problem: format!("{when}{problem}"),
    })
}
