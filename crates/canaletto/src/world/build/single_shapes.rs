//! Single shapes whose transforms keep them out of the part's own geometry: stretched spheres, for example.
//!
//! Such a shape becomes an instance. An instance with a geometry of its own takes more than a kilobyte, so geometries
//! are shared in two ways. Equal shapes share one geometry. Many shapes with one transform are one instance.

use crate::math::Transform;
use crate::shape::Shape;
use crate::world::BuildError;
use crate::world::build::flatten::Builder;
use crate::world::build::part::{Part, PartShapes};
use crate::world::data::geometry::Geometry;
use crate::world::data::instance::{Instance, NONE};
use glam::DVec3;

/// A shape in its own space, and its place.
#[derive(Clone, Copy)]
pub(in crate::world) struct SingleShape {
    pub(in crate::world) shape: Shape,
    pub(in crate::world) material: u32,
    /// The described object.
    pub(in crate::world) object: u32,
    /// The object's number in the part.
    pub(in crate::world) number: u64,
    pub(in crate::world) transform: Transform,
    /// The origin of the shape's coordinates in its object's space.
    pub(in crate::world) origin: DVec3,
    pub(in crate::world) casts_shadow: bool,
}

/// Shapes of a part under one transform.
#[derive(Clone)]
pub(in crate::world) struct SameTransform {
    transform: Transform,
    casts_shadow: bool,
    /// The number of these shapes that are instances of their own.
    alone: usize,
    /// The shapes after them.
    shapes: PartShapes,
}

/// A geometry of one shape.
pub(in crate::world) struct SharedShape {
    shape: Shape,
    material: u32,
    geometry: u32,
}

/// The number of transforms, and of shapes, that are compared with the next shape. A bound keeps the search short and
/// the memory small if none of them recurs.
const RECENT: usize = 16;

impl Builder {
    /// Places a shape as an instance, or among the shapes with its transform.
    pub(in crate::world) fn place_single(&mut self, single: SingleShape, part: &mut Part) -> Result<(), BuildError> {
        let SingleShape { shape, material, number, transform, origin, casts_shadow, .. } = single;
        if origin == DVec3::ZERO {
            let same = |with: &SameTransform| with.transform == transform && with.casts_shadow == casts_shadow;
            match part.same_transforms.iter_mut().find(|with| same(with)) {
                Some(with) if with.alone >= self.instancing.alone && with.shapes.has_room_for(number) => {
                    with.shapes.push(shape, number, material);
                    return Ok(());
                }
                Some(with) => with.alone += 1,
                None => {
                    if part.same_transforms.len() == RECENT {
                        let oldest = part.same_transforms.remove(0);
                        self.place_same(oldest, part)?;
                    }
                    let shapes = PartShapes::default();
                    part.same_transforms.push(SameTransform { transform, casts_shadow, alone: 1, shapes });
                }
            }
        }
        let geometry = self.single_geometry(&single)?;
        let to_world = (!transform.is_identity()).then_some(transform);
        self.instance(part, Instance { to_world, casts_shadow, ..Instance::of(geometry, number) })
    }

    /// Places the shapes under one transform that aren't instances of their own.
    pub(in crate::world) fn place_same(&mut self, with: SameTransform, part: &mut Part) -> Result<(), BuildError> {
        let SameTransform { transform, casts_shadow, shapes, .. } = with;
        let Some((geometry, first_object)) = self.shapes_geometry(shapes)? else { return Ok(()) };
        let to_world = (!transform.is_identity()).then_some(transform);
        self.instance(part, Instance { to_world, casts_shadow, ..Instance::of(geometry, first_object) })
    }

    /// The geometry of one shape. Equal shapes share it.
    fn single_geometry(&mut self, single: &SingleShape) -> Result<u32, BuildError> {
        let SingleShape { shape, material, object, origin, .. } = *single;
        let same = |shared: &SharedShape| shared.material == material && same_bits(&shared.shape, &shape);
        if origin == DVec3::ZERO
            && let Some(shared) = self.shared_shapes.iter().find(|shared| same(shared))
        {
            self.owners[shared.geometry as usize] = NONE;
            return Ok(shared.geometry);
        }
        let geometry = self.push(Geometry::shapes(vec![shape], vec![0], vec![material]), object)?;
        self.set_origin(geometry, origin);
        if origin == DVec3::ZERO {
            if self.shared_shapes.len() == RECENT {
                self.shared_shapes.remove(0);
            }
            self.shared_shapes.push(SharedShape { shape, material, geometry });
        }
        Ok(geometry)
    }
}

/// Whether shapes are equal, with the signs of zeros in their points.
fn same_bits(a: &Shape, b: &Shape) -> bool {
    let points = |shape: &Shape| {
        let mut bits = [[0; 3]; 3];
        shape.map_points(|i, p| {
            bits[i] = p.to_array().map(f32::to_bits);
            p
        });
        bits
    };
    a == b && points(a) == points(b)
}

#[cfg(test)]
mod tests {
    use crate::math::Transform;
    use crate::scene::{Node, Scene};
    use crate::shape::{Shape, Sphere};
    use crate::world::build::instancing::InstancingPolicy;
    use crate::world::build::reuse::Previous;
    use crate::world::{BuildOptions, OccluderCache, Occlusion, World};
    use canaletto_bvh::Ray;
    use glam::{DVec3, Vec3};

    const COUNT: u32 = 300;

    fn built(alone: usize, place: impl Fn(f32) -> (Vec3, Transform)) -> World {
        let ball = |i: u32| {
            let (center, transform) = place(i as f32);
            let shape = Shape::from(Sphere { center, radius: 0.5 });
            Node { transform: transform.into(), casts_shadow: !i.is_multiple_of(3), ..Node::from(shape) }
        };
        let scene = Scene { nodes: (0..COUNT).map(ball).collect(), ..Scene::default() };
        let policy = InstancingPolicy { alone, ..InstancingPolicy::default() };
        World::lower(scene, &BuildOptions::default(), policy, Previous::default()).unwrap()
    }

    #[test]
    fn stretched_shapes_share_geometries() {
        let stretched = Transform::scale(DVec3::new(1.0, 2.0, 3.0)).unwrap();
        let along = |i: f32| Vec3::new(4.0 * i, 0.0, 0.0);
        let one_transform = |i: f32| (along(i), stretched);
        let equal_shapes = |i: f32| (Vec3::ZERO, Transform::translate(along(i).as_dvec3()).after(&stretched));
        let turning = |i: f32| (Vec3::X * 0.1 * (i % 5.0), Transform::translate(along(i).as_dvec3()).after(&stretched));
        for (place, alone, geometries) in [
            (&one_transform as &dyn Fn(f32) -> (Vec3, Transform), usize::MAX, COUNT as usize),
            // Those with a shadow, and those without.
            (&one_transform, 64, 2 * 64 + 2),
            (&equal_shapes, 64, 1),
            (&turning, 64, 5),
        ] {
            let [world, apart] = [alone, usize::MAX].map(|alone| built(alone, place));
            assert_eq!(world.geometry.geometries.len(), geometries);
            let mut found = 0;
            for i in 0..8 * COUNT {
                let origin = Vec3::new(0.5 * i as f32 - 1.0, 0.07 * (i % 11) as f32, 9.0);
                let ray = Ray::new(origin, Vec3::new(0.01, 0.0, -1.0));
                let all = |world: &World| {
                    world.intersect(&ray, f32::INFINITY).map(|hit| {
                        let blocked = world.occlusion(&ray, f32::INFINITY, 0.0, &mut OccluderCache::NONE.clone())
                            != Occlusion::Nothing;
                        (hit.t.to_bits(), hit.uv.map(f32::to_bits), world.object_id(&hit), blocked)
                    })
                };
                assert_eq!(all(&world), all(&apart), "ray {i}");
                found += u32::from(all(&world).is_some());
            }
            assert!(found > COUNT);
        }
    }
}
