//! The triangles of objects that are flat piece by piece, and the bodies that may stand between such triangles.

use crate::math::Transform;
use crate::shape::{Cuboid, Shape, Triangle};
use crate::world::World;
use crate::world::data::geometry::Geometry;
use crate::world::data::instance::{Instance, NONE};
use crate::world::trace::object_surface::ObjectSurface;
use canaletto_bvh::Aabb;
use glam::{DVec3, Vec3};

impl World {
    /// The triangles of a surface, counter-clockwise seen from the front, with boxes as twelve. `None` if it isn't flat
    /// everywhere, has holes, or has more than `most` triangles.
    pub(crate) fn flat_triangles(&self, surface: &ObjectSurface, most: usize) -> Option<Vec<[DVec3; 3]>> {
        if surface.planes() > 0 || surface.primitives() > most || surface.has_holes() {
            return None;
        }
        let mut triangles = Vec::new();
        for (geometry, primitive, to_world) in surface.placed_primitives() {
            let mut add = |corners: [Vec3; 3]| triangles.push(placed_triangle(corners, to_world));
            match &self.geometry.geometries[geometry as usize] {
                Geometry::Mesh { mesh, .. } => add(mesh.corners(primitive as usize)),
                Geometry::Shapes { shapes, .. } => match &shapes[primitive as usize] {
                    Shape::Triangle(Triangle { a, b, c, .. }) => add([*a, *b, *c]),
                    Shape::Rectangle(sheet) => sheet.halves().into_iter().for_each(add),
                    Shape::Box(cuboid) => box_triangles(cuboid).into_iter().for_each(add),
                    _ => return None,
                },
                _ => return None,
            }
            if triangles.len() > most {
                return None;
            }
        }
        Some(triangles)
    }

    /// Bodies around everything that reaches into a box when the shutter opens, each as the points of which it is the
    /// hull. `None` if there are more than `most`, or a plane cuts the box.
    pub(crate) fn bodies_within(&self, bounds: &Aabb, most: usize) -> Option<Vec<Vec<DVec3>>> {
        let corners = box_corners(bounds, None);
        for plane in &self.geometry.unbounded {
            let Shape::Plane(plane) = &plane.shape else { return None };
            let height = |corner: &DVec3| (*corner - plane.point.as_dvec3()).dot(plane.normal.as_dvec3());
            if !(corners.iter().all(|c| height(c) >= 0.0) || corners.iter().all(|c| height(c) <= 0.0)) {
                return None;
            }
        }
        let mut bodies = Vec::new();
        for instance in &self.geometry.root.instances {
            let around = self.tables_bounds(instance);
            if !around.overlaps(bounds) {
                continue;
            }
            if instance.group != NONE || self.geometry.geometries[instance.geometry as usize].len() > most {
                bodies.push(box_corners(&around, None));
            } else {
                self.add_bodies(instance, bounds, &mut bodies);
            }
            if bodies.len() > most {
                return None;
            }
        }
        Some(bodies)
    }

    fn tables_bounds(&self, instance: &Instance) -> Aabb {
        match self.geometry.groups.get(instance.group as usize) {
            Some(group) => instance.bounds(&self.geometry.chains, group.tree.bounds()),
            None => self.bounds_of(instance),
        }
    }

    fn add_bodies(&self, instance: &Instance, bounds: &Aabb, bodies: &mut Vec<Vec<DVec3>>) {
        let geometry = &self.geometry.geometries[instance.geometry as usize];
        let to_world = instance.placed(&self.geometry.chains, 0.0);
        for primitive in 0..geometry.len() as u32 {
            let own = geometry.primitive_bounds(primitive);
            if !instance.bounds(&self.geometry.chains, own).overlaps(bounds) {
                continue;
            }
            let to_world = to_world.as_ref();
            let mut add = |corners: [Vec3; 3]| bodies.push(placed_triangle(corners, to_world).to_vec());
            match geometry {
                Geometry::Mesh { mesh, .. } => add(mesh.corners(primitive as usize)),
                Geometry::Shapes { shapes, .. } => match &shapes[primitive as usize] {
                    Shape::Triangle(Triangle { a, b, c, .. }) => add([*a, *b, *c]),
                    Shape::Rectangle(sheet) => sheet.halves().into_iter().for_each(add),
                    // A box is hollow, and the surfaces may be inside.
                    Shape::Box(cuboid) => box_triangles(cuboid).into_iter().for_each(add),
                    _ => bodies.push(box_corners(&own, to_world)),
                },
                _ => bodies.push(box_corners(&own, to_world)),
            }
        }
    }
}

/// A triangle in the world. A mirroring transform keeps the outer side of normals, but turns the corners.
fn placed_triangle(corners: [Vec3; 3], to_world: Option<&Transform>) -> [DVec3; 3] {
    let [a, b, c] = corners.map(Vec3::as_dvec3);
    match to_world {
        None => [a, b, c],
        Some(t) if t.matrix().matrix3.determinant() < 0.0 => [a, c, b].map(|p| t.point(p)),
        Some(t) => [a, b, c].map(|p| t.point(p)),
    }
}

fn box_corners(bounds: &Aabb, to_world: Option<&Transform>) -> Vec<DVec3> {
    let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
    let corner = |k: u32| {
        let upper = |bit: u32| k >> bit & 1 == 1;
        let pick = |bit: u32, min: f64, max: f64| if upper(bit) { max } else { min };
        let p = DVec3::new(pick(0, min.x, max.x), pick(1, min.y, max.y), pick(2, min.z, max.z));
        to_world.map_or(p, |t| t.point(p))
    };
    (0..8).map(corner).collect()
}

/// The faces of a box, seen from outside.
fn box_triangles(cuboid: &Cuboid) -> [[Vec3; 3]; 12] {
    let corner = |k: usize| {
        let pick = |bit: usize| if k >> bit & 1 == 1 { cuboid.max } else { cuboid.min };
        Vec3::new(pick(0).x, pick(1).y, pick(2).z)
    };
    let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    std::array::from_fn(|k| {
        let [a, b, c, d] = faces[k / 2].map(corner);
        if k % 2 == 0 { [a, b, c] } else { [a, c, d] }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::form_factor::area_vector;
    use crate::scene::{Node, Scene};

    /// A box's triangles close it, and face outwards under any transform.
    #[test]
    fn boxes_become_triangles() {
        let cuboid = Cuboid { min: Vec3::new(1.0, 2.0, 3.0), max: Vec3::new(2.0, 4.0, 6.0) };
        for (scale, volume) in
            [(DVec3::ONE, 6.0), (DVec3::new(-1.0, 1.0, 1.0), 6.0), (DVec3::new(2.0, -1.0, 1.0), 12.0)]
        {
            let turn = Transform::rotate(DVec3::ONE, 30.0).unwrap().after(&Transform::scale(scale).unwrap());
            let node = Node::from(Shape::Box(cuboid)).named("box").with_transform(&turn);
            let scene = Scene { nodes: vec![node], ..Scene::default() };
            let ids = scene.objects_named("box").unwrap();
            let world = World::build(scene).unwrap();
            let triangles = world.flat_triangles(&world.object_surface(ids).unwrap(), 12).unwrap();
            assert_eq!(triangles.len(), 12);
            let vectors = || triangles.iter().map(|triangle| area_vector(triangle));
            assert!(vectors().sum::<DVec3>().length() < 1e-12);
            let six: f64 = triangles.iter().map(|[a, b, c]| a.dot(b.cross(*c))).sum();
            assert!((six / 6.0 - volume).abs() < 1e-9, "{scale}: {}", six / 6.0);
        }
    }
}
