//! Geometries: primitives of one kind under their hierarchy.

use crate::math::DRay;
use crate::shape::{
    Cylinder, CylinderCloud, Mesh, Shape, ShapeHit, SphereCloud, Surface, SurfaceDifferential, Triangle,
};
use crate::world::WorldStats;
use crate::world::data::instance::NONE;
use crate::world::data::mesh_tree::MeshTree;
use canaletto_bvh::{
    Aabb, BuildError, FilterFunction, PreparedRay, Primitive, PrimitiveBvh, PrimitiveHit, Quality, Ray, UserPrimitive,
    sphere,
};
use canaletto_parallel::prelude::*;

/// The most shapes that are tested one by one. A tree over twelve shapes took longer.
pub(in crate::world) const MAX_LISTED: usize = 16;

/// Primitives of one kind under one hierarchy: the second level. The id of a primitive is its index in the description.
#[derive(Debug)]
pub(in crate::world) enum Geometry {
    /// Single shapes of any kind, with the object and material (or [`NONE`]) of each. Objects are counted from the
    /// instance's first object. The tree holds copies of the spheres and cylinders.
    Shapes { tree: PrimitiveBvh, shapes: Vec<Shape>, objects: Vec<u32>, materials: Vec<u32> },
    /// A mesh. The tree holds a copy of the corners for ray tests.
    Mesh { triangles: MeshTree, mesh: Box<Mesh> },
    /// A cloud of spheres. The tree holds a copy for ray tests.
    Spheres { tree: PrimitiveBvh, cloud: SphereCloud },
    /// A cloud of cylinders. The tree holds a copy for ray tests.
    Cylinders { tree: PrimitiveBvh, cloud: CylinderCloud },
}

/// A hit on a shape whose id the caller sets.
#[inline(always)]
pub(in crate::world) fn on_shape(ShapeHit { t, part, uv }: ShapeHit) -> PrimitiveHit {
    PrimitiveHit { t, id: PrimitiveHit::NONE, part, uv }
}

/// A hit on a shape, with t confined to the shape's box in the tree.
#[inline(always)]
pub(in crate::world) fn confined(hit: ShapeHit, bounds: &Aabb, ray: &PreparedRay, t_max: f32) -> Option<PrimitiveHit> {
    Some(PrimitiveHit { t: ray.clamp_to_box(bounds, hit.t.into(), t_max)?, ..on_shape(hit) })
}

/// The kernel of shapes that the tree holds no copies of.
fn other(shapes: &[Shape]) -> impl Fn(UserPrimitive, &PreparedRay, f32) -> Option<PrimitiveHit> {
    |asked, ray, t_max| {
        let shape = &shapes[asked.id as usize];
        confined(shape.intersect(ray.ray(), t_max)?, &shape.bounds()?, ray, t_max)
    }
}

/// The kernel of trees that hold spheres only.
fn none(_: UserPrimitive, _: &PreparedRay, _: f32) -> Option<PrimitiveHit> {
    None
}

/// The kernel of a cloud's cylinders.
fn cylinder(cloud: &CylinderCloud) -> impl Fn(UserPrimitive, &PreparedRay, f32) -> Option<PrimitiveHit> {
    let caps = cloud.caps;
    move |UserPrimitive { ends: [base, top], radius, .. }, ray, t_max| {
        let cylinder = Cylinder { base, top, radius, caps };
        confined(cylinder.intersect(ray.ray(), t_max)?, &cylinder.bounds(), ray, t_max)
    }
}

impl Geometry {
    pub(in crate::world) fn shapes(
        shapes: Vec<Shape>,
        objects: Vec<u32>,
        materials: Vec<u32>,
    ) -> Result<Geometry, BuildError> {
        let bounds: Vec<Aabb> = shapes.par_iter().map(|s| s.bounds().unwrap_or(Aabb::EMPTY)).collect();
        let tree = PrimitiveBvh::build(&bounds, |id| match &shapes[id as usize] {
            Shape::Sphere(s) => Primitive::Sphere { center: s.center, radius: s.radius },
            Shape::Cylinder(c) => Primitive::Cylinder { ends: [c.base, c.top], radius: c.radius },
            _ => Primitive::User,
        })?;
        Ok(Geometry::Shapes { tree, shapes, objects, materials })
    }

    pub(in crate::world) fn mesh(mesh: Mesh, quality: Quality) -> Result<Geometry, BuildError> {
        let triangles = MeshTree::build(&mesh, quality)?;
        Ok(Geometry::Mesh { triangles, mesh: Box::new(mesh) })
    }

    pub(in crate::world) fn spheres(cloud: SphereCloud) -> Result<Geometry, BuildError> {
        let bounds = |id: usize| sphere::bounds(cloud.centers[id], cloud.radius(id));
        let bounds: Vec<Aabb> = (0..cloud.len()).into_par_iter().map(bounds).collect();
        let sphere = |id: usize| Primitive::Sphere { center: cloud.centers[id], radius: cloud.radius(id) };
        let tree = PrimitiveBvh::build(&bounds, |id| sphere(id as usize))?;
        Ok(Geometry::Spheres { tree, cloud })
    }

    pub(in crate::world) fn cylinders(cloud: CylinderCloud) -> Result<Geometry, BuildError> {
        let bounds: Vec<Aabb> = (0..cloud.len()).into_par_iter().map(|id| cloud.bounds(id)).collect();
        let cylinder = |id: usize| Primitive::Cylinder { ends: cloud.axes[id], radius: cloud.radius(id) };
        let tree = PrimitiveBvh::build(&bounds, |id| cylinder(id as usize))?;
        Ok(Geometry::Cylinders { tree, cloud })
    }

    /// The number of primitives.
    pub(in crate::world) fn len(&self) -> usize {
        match self {
            Geometry::Shapes { shapes, .. } => shapes.len(),
            Geometry::Mesh { triangles, .. } => triangles.len(),
            Geometry::Spheres { cloud, .. } => cloud.len(),
            Geometry::Cylinders { cloud, .. } => cloud.len(),
        }
    }

    /// The number of a primitive as an element of its object, from 1 on; see [`super::World::element_id`].
    pub(in crate::world) fn element_id(&self, primitive: u32) -> u32 {
        match self {
            Geometry::Shapes { .. } => 1,
            Geometry::Mesh { .. } => primitive.saturating_add(1),
            Geometry::Spheres { cloud, .. } => cloud.row(primitive as usize),
            Geometry::Cylinders { cloud, .. } => cloud.row(primitive as usize),
        }
    }

    /// The box around the geometry.
    pub(in crate::world) fn bounds(&self) -> Aabb {
        match self {
            Geometry::Shapes { tree, .. } | Geometry::Spheres { tree, .. } | Geometry::Cylinders { tree, .. } => {
                tree.bounds()
            }
            Geometry::Mesh { triangles, .. } => triangles.bounds(),
        }
    }

    /// The materials that the primitives name, in any order, with [`NONE`] for primitives that name none.
    pub(in crate::world) fn own_materials(&self) -> Vec<u32> {
        match self {
            Geometry::Shapes { materials, .. } => {
                let mut all = materials.clone();
                all.sort_unstable();
                all.dedup();
                all
            }
            Geometry::Mesh { mesh, .. } if !mesh.materials.is_empty() => mesh.materials.clone(),
            Geometry::Mesh { .. } | Geometry::Spheres { .. } | Geometry::Cylinders { .. } => vec![NONE],
        }
    }

    /// The nearest hit at or before `t_max` at a time in 0..=1, or [`PrimitiveHit::NONE`]. The caller resolves ties
    /// with hits elsewhere.
    pub(in crate::world) fn intersect(&self, ray: &PreparedRay, t_max: f32, time: f32) -> PrimitiveHit {
        let mut met = PrimitiveHit::none(t_max);
        match self {
            Geometry::Mesh { triangles, mesh } => {
                triangles.intersect(mesh, ray, &mut met, time);
            }
            Geometry::Shapes { tree, shapes, .. } => tree.intersect(ray, &mut met, &other(shapes)),
            Geometry::Spheres { tree, .. } => tree.intersect(ray, &mut met, &none),
            Geometry::Cylinders { tree, cloud } => tree.intersect(ray, &mut met, &cylinder(cloud)),
        }
        met
    }

    /// Whether the primitives move against each other while the shutter is open. Instances of such a geometry have a
    /// chain, even if it stands still, so that whatever asks for motion finds it.
    pub(in crate::world) fn deforms(&self) -> bool {
        matches!(self, Geometry::Mesh { triangles: MeshTree::Moving(_), .. })
    }

    /// Whether a test of all primitives is cheaper than a traversal of the tree.
    #[inline]
    pub(in crate::world) fn is_few(&self) -> bool {
        match self {
            Geometry::Mesh { .. } => false,
            Geometry::Shapes { shapes, .. } => shapes.len() <= MAX_LISTED,
            Geometry::Spheres { tree, .. } | Geometry::Cylinders { tree, .. } => tree.is_few(),
        }
    }

    /// Whether it is a list of few shapes.
    pub(in crate::world) fn is_list(&self) -> bool {
        matches!(self, Geometry::Shapes { .. }) && self.is_few()
    }

    /// [`Geometry::intersect`] for a ray that isn't prepared, at a geometry that [is few](Geometry::is_few) and thus no
    /// mesh. Such geometries rarely need a prepared ray.
    pub(in crate::world) fn intersect_few(&self, ray: &Ray, t_max: f32) -> PrimitiveHit {
        let mut met = PrimitiveHit::none(t_max);
        match self {
            Geometry::Spheres { tree, .. } => tree.intersect_few(ray, &mut met, &none),
            Geometry::Cylinders { tree, cloud } => tree.intersect_few(ray, &mut met, &cylinder(cloud)),
            _ => return self.intersect(&ray.prepare(), t_max, 0.0),
        }
        met
    }

    /// [`Geometry::occluded`] for a ray that isn't prepared.
    pub(in crate::world) fn occluded_few(&self, ray: &Ray, t_max: f32, blocks: &mut FilterFunction) -> Option<u32> {
        match self {
            Geometry::Spheres { tree, .. } => tree.occluded_few(ray, t_max, &none, blocks),
            Geometry::Cylinders { tree, cloud } => tree.occluded_few(ray, t_max, &cylinder(cloud), blocks),
            _ => self.occluded(&ray.prepare(), t_max, 0.0, blocks),
        }
    }

    /// The hit of a ray on one primitive at or before `t_max`, at a time in 0..=1.
    pub(in crate::world) fn intersect_one(
        &self,
        primitive: u32,
        ray: &PreparedRay,
        t_max: f32,
        time: f32,
    ) -> Option<ShapeHit> {
        let id = primitive as usize;
        match self {
            Geometry::Shapes { shapes, .. } => shapes[id].intersect(ray.ray(), t_max),
            Geometry::Mesh { mesh, .. } => {
                let [a, b, c] = mesh.corners_at(id, time);
                Triangle { a, b, c, one_sided: mesh.one_sided }.intersect(ray.ray(), t_max)
            }
            Geometry::Spheres { cloud, .. } => cloud.sphere(id).intersect(ray.ray(), t_max),
            Geometry::Cylinders { cloud, .. } => cloud.cylinder(id).intersect(ray.ray(), t_max),
        }
    }

    /// [`Geometry::intersect`] for many rays. It is fastest if neighbouring rays are nearly parallel. `met` holds the
    /// `t_max` of each ray and takes the results.
    pub(in crate::world) fn intersect_coherent(&self, rays: &[Ray], met: &mut [PrimitiveHit]) {
        match self {
            Geometry::Mesh { triangles, mesh } => triangles.intersect_coherent(mesh, rays, met),
            Geometry::Shapes { tree, shapes, .. } => tree.intersect_coherent(rays, met, &other(shapes)),
            Geometry::Spheres { tree, .. } => tree.intersect_coherent(rays, met, &none),
            Geometry::Cylinders { tree, cloud } => tree.intersect_coherent(rays, met, &cylinder(cloud)),
        }
    }

    /// Sets `t_max` to −∞ for each ray that hits something at or before it. It is fastest if neighbouring rays are
    /// nearly parallel.
    pub(in crate::world) fn occluded_coherent(&self, rays: &[Ray], t_max: &mut [f32]) {
        match self {
            Geometry::Mesh { triangles, mesh } => triangles.occluded_coherent(mesh, rays, t_max),
            Geometry::Shapes { tree, shapes, .. } => tree.occluded_coherent(rays, t_max, &other(shapes)),
            Geometry::Spheres { tree, .. } => tree.occluded_coherent(rays, t_max, &none),
            Geometry::Cylinders { tree, cloud } => tree.occluded_coherent(rays, t_max, &cylinder(cloud)),
        }
    }

    /// The slot of a primitive that is hit at or before `t_max` and for which `blocks` returns true, if there is one.
    /// `blocks` is called through a pointer, so that the kernels are compiled once.
    pub(in crate::world) fn occluded(
        &self,
        ray: &PreparedRay,
        t_max: f32,
        time: f32,
        blocks: &mut FilterFunction,
    ) -> Option<u32> {
        match self {
            Geometry::Mesh { triangles, mesh } => triangles.occluded(mesh, ray, t_max, time, blocks),
            Geometry::Shapes { tree, shapes, .. } => tree.occluded(ray, t_max, &other(shapes), blocks),
            Geometry::Spheres { tree, .. } => tree.occluded(ray, t_max, &none, blocks),
            Geometry::Cylinders { tree, cloud } => tree.occluded(ray, t_max, &cylinder(cloud), blocks),
        }
    }

    /// Whether the primitive in this slot is hit at or before `t_max`.
    pub(in crate::world) fn blocks(&self, place: u32, ray: &PreparedRay, t_max: f32, time: f32) -> bool {
        match self {
            Geometry::Mesh { triangles, mesh } => triangles.is_hit_at(mesh, place, ray, t_max, time),
            Geometry::Shapes { tree, shapes, .. } => tree.is_hit_at(place, ray, t_max, &other(shapes)),
            Geometry::Spheres { tree, .. } => tree.is_hit_at(place, ray, t_max, &none),
            Geometry::Cylinders { tree, cloud } => tree.is_hit_at(place, ray, t_max, &cylinder(cloud)),
        }
    }

    /// [`Geometry::intersect`] by a test of every primitive: the reference for tests of the hierarchy.
    pub(in crate::world) fn intersect_brute_force(&self, ray: &PreparedRay, t_max: f32, time: f32) -> PrimitiveHit {
        let mut met = PrimitiveHit::none(t_max);
        match self {
            Geometry::Mesh { triangles, mesh } => {
                triangles.intersect_brute_force(mesh, ray, &mut met, time);
            }
            Geometry::Shapes { tree, shapes, .. } => tree.intersect_brute_force(ray, &mut met, &other(shapes)),
            Geometry::Spheres { tree, .. } => tree.intersect_brute_force(ray, &mut met, &none),
            Geometry::Cylinders { tree, cloud } => tree.intersect_brute_force(ray, &mut met, &cylinder(cloud)),
        }
        met
    }

    /// The second stage of a hit at a time in 0..=1, in this geometry's space.
    pub(in crate::world) fn surface(&self, line: DRay, primitive: u32, hit: &ShapeHit, time: f32) -> Surface {
        let id = primitive as usize;
        match self {
            Geometry::Shapes { shapes, .. } => shapes[id].surface(line, hit),
            Geometry::Mesh { mesh, .. } => mesh.surface_at(id, &line, hit, time),
            Geometry::Spheres { cloud, .. } => cloud.surface(id, line, hit),
            Geometry::Cylinders { cloud, .. } => cloud.surface(id, line, hit),
        }
    }

    /// [`Geometry::surface`] without texture coordinates, which may be undefined.
    pub(in crate::world) fn surface_without_uv(
        &self,
        line: DRay,
        primitive: u32,
        hit: &ShapeHit,
        time: f32,
    ) -> Surface {
        let id = primitive as usize;
        match self {
            Geometry::Shapes { shapes, .. } => shapes[id].surface_without_uv(line, hit),
            Geometry::Mesh { mesh, .. } => mesh.surface_at(id, &line, hit, time),
            Geometry::Spheres { cloud, .. } => cloud.surface_without_uv(id, line, hit),
            Geometry::Cylinders { cloud, .. } => cloud.surface_without_uv(id, line, hit),
        }
    }

    /// The surface differential at a hit with this surface at a time in 0..=1, in the geometry's space.
    pub(in crate::world) fn surface_differential(
        &self,
        primitive: u32,
        hit: &ShapeHit,
        surface: &Surface,
        time: f32,
    ) -> SurfaceDifferential {
        let id = primitive as usize;
        match self {
            Geometry::Shapes { shapes, .. } => shapes[id].surface_differential(surface, hit),
            Geometry::Mesh { mesh, .. } => mesh.surface_differential(id, hit.uv[0], hit.uv[1], time),
            Geometry::Spheres { cloud, .. } => cloud.surface_differential(id, surface, hit),
            Geometry::Cylinders { cloud, .. } => cloud.surface_differential(id, surface, hit),
        }
    }

    /// The box around a primitive.
    pub(in crate::world) fn primitive_bounds(&self, primitive: u32) -> Aabb {
        let id = primitive as usize;
        match self {
            Geometry::Shapes { shapes, .. } => shapes[id].bounds().unwrap_or(Aabb::EMPTY),
            Geometry::Mesh { mesh, .. } => mesh.triangle_bounds(id),
            Geometry::Spheres { cloud, .. } => cloud.bounds(id),
            Geometry::Cylinders { cloud, .. } => cloud.bounds(id),
        }
    }

    /// Calls `f` with all primitives that may overlap a box, and possibly others, until it returns false.
    pub(in crate::world) fn overlapping(&self, bounds: &Aabb, f: impl FnMut(u32) -> bool) {
        match self {
            Geometry::Mesh { triangles, .. } => triangles.overlapping(bounds, f),
            Geometry::Shapes { tree, .. } | Geometry::Spheres { tree, .. } | Geometry::Cylinders { tree, .. } => {
                tree.overlapping(bounds, f);
            }
        }
    }

    /// The bounds of the object that a primitive belongs to, in this geometry's space.
    pub(in crate::world) fn object_bounds(&self, primitive: u32) -> Option<Aabb> {
        match self {
            Geometry::Shapes { shapes, .. } => shapes[primitive as usize].bounds(),
            _ => Some(self.bounds()),
        }
    }

    pub(in crate::world) fn count(&self, stats: &mut WorldStats) {
        let n = self.len() as u64;
        let list = |bytes: usize, len: usize| (bytes * len) as u64;
        stats.bytes += match self {
            Geometry::Shapes { tree, .. } | Geometry::Spheres { tree, .. } | Geometry::Cylinders { tree, .. } => {
                tree.statistics().bytes as u64
            }
            Geometry::Mesh { triangles, .. } => triangles.bytes() as u64,
        };
        stats.bytes += match self {
            Geometry::Shapes { shapes, .. } => {
                stats.shapes += n;
                list(size_of::<Shape>() + 8, shapes.len())
            }
            Geometry::Mesh { mesh, .. } => {
                stats.triangles += n;
                let sets: usize = mesh.more_uvs.iter().map(Vec::len).sum();
                list(12, mesh.positions.len() + mesh.normals.len() + mesh.colors.len() + mesh.triangles.len())
                    + list(8, mesh.uvs.len() + sets)
                    + list(16, mesh.tangents.len())
                    + list(4, mesh.slots.len() + mesh.alphas.len())
                    + mesh.end_pose.as_ref().map_or(0, |pose| {
                        list(12, pose.positions.len() + pose.normals.len()) + list(16, pose.tangents.len())
                    })
            }
            Geometry::Spheres { cloud, .. } => {
                stats.cloud_spheres += n;
                list(12, cloud.len())
                    + list(4, cloud.radii.len())
                    + list(12, cloud.colors.len())
                    + list(4, cloud.rows.len())
            }
            Geometry::Cylinders { cloud, .. } => {
                stats.cloud_cylinders += n;
                list(24, cloud.len())
                    + list(4, cloud.radii.len())
                    + list(12, cloud.colors.len())
                    + list(4, cloud.rows.len())
            }
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shape::testing::Random;
    use crate::shape::{Cone, Sphere, Torus};
    use canaletto_bvh::InstructionSet;
    use glam::Vec3;
    use std::cell::Cell;

    fn real(met: PrimitiveHit) -> Option<PrimitiveHit> {
        (met.id != PrimitiveHit::NONE).then_some(met)
    }

    /// Cylinders from rods to needles and disks, some along axes, some side by side.
    fn cylinders(count: usize, caps: bool, scale: f32, random: &mut Random) -> CylinderCloud {
        let mut cloud = CylinderCloud { caps, ..CylinderCloud::default() };
        for i in 0..count {
            let base = random.vector() * [1.0, 1.0, 100.0][i % 3];
            let mut axis = random.vector() * [0.3, 1.0, 1e-2][random.below(3)];
            if i % 4 == 0 {
                axis *= Vec3::AXES[random.below(3)];
            }
            let radius = (0.5 + 0.5 * random.signed().abs()) * [0.1, 1e-3, 1e-6][random.below(3)];
            cloud.axes.push([base * scale, (base + axis.normalize_or(Vec3::X) * axis.length().max(1e-3)) * scale]);
            cloud.radii.push(radius * scale);
        }
        cloud
    }

    /// A ray at, beside or along a cylinder: through rims, in the planes of caps, and tangential. It starts anywhere,
    /// also on the cylinder or in it.
    fn ray_near(cylinder: &Cylinder, scale: f32, random: &mut Random) -> Ray {
        let axis = cylinder.top - cylinder.base;
        let out = axis.normalize().cross(random.vector()).normalize_or(Vec3::X) * cylinder.radius;
        let height = [0.0, 1.0, 0.5 + 0.5 * random.signed(), random.signed() * 3.0][random.below(4)];
        let off = [1.0, 1.0 + random.signed() * 10f32.powi(-(random.below(8) as i32)), random.signed(), 0.0];
        let target = cylinder.base + axis * height + out * off[random.below(4)];
        let mut direction = match random.below(5) {
            0 => axis + out * random.signed() * 10f32.powi(-(random.below(8) as i32)),
            1 => out.cross(axis) / axis.length() + axis * random.signed() * [0.0, 1.0][random.below(2)],
            2 => out * random.signed() + out.cross(axis) / axis.length() * random.signed(),
            _ => random.vector() * scale,
        };
        direction[random.below(3)] *= [1.0, 1.0, 1.0, 0.0, 1e-20][random.below(5)];
        let back = [0.0, 1.0, 3.0, 1e3][random.below(4)] * (0.5 + 0.5 * random.signed());
        Ray::new(target - direction * back, direction * [1.0, 1e-3, 1.0 / scale, 1e3][random.below(4)])
    }

    #[test]
    fn cylinders_side_by_side_are_met_as_one_by_one() {
        let random = &mut Random(51);
        let mut hits = 0;
        for round in 0..24 {
            let scale = [1.0, 1e-3, 1e4, 1e-12, 1e12, 1e-25][round % 6];
            let cloud = cylinders([4, 40, 200][round % 3], round % 2 == 0, scale, random);
            let rays: Vec<Ray> =
                (0..2000).map(|_| ray_near(&cloud.cylinder(random.below(cloud.len())), scale, random)).collect();
            let geometry = Geometry::cylinders(cloud).unwrap();
            let Geometry::Cylinders { tree, cloud } = &geometry else { panic!() };
            let prepared: Vec<PreparedRay> = rays.iter().map(Ray::prepare).collect();
            for set in InstructionSet::available() {
                set.limit();
                let mut stream = vec![PrimitiveHit::none(f32::INFINITY); rays.len()];
                tree.intersect_stream(&prepared, &mut stream, &cylinder(cloud));
                for (ray, met) in prepared.iter().zip(stream) {
                    let expected = real(geometry.intersect_brute_force(ray, f32::INFINITY, 0.0));
                    let bits = |n: Option<PrimitiveHit>| n.map(|n| (n.t.to_bits(), n.id, n.part));
                    assert_eq!(bits(real(met)), bits(expected), "{scale} {:?}", ray.ray());
                    let t = expected.map_or(1.0, |n| n.t);
                    for t_max in [f32::INFINITY, t, t.next_down()] {
                        let expected = expected.filter(|n| n.t <= t_max);
                        assert_eq!(
                            bits(real(geometry.intersect(ray, t_max, 0.0))),
                            bits(expected),
                            "{scale} {:?}",
                            ray.ray()
                        );
                        let place = geometry.occluded(ray, t_max, 0.0, &mut |_| true);
                        assert_eq!(place.is_some(), expected.is_some(), "{scale} {:?} {t_max}", ray.ray());
                        assert!(place.is_none_or(|place| geometry.blocks(place, ray, t_max, 0.0)));
                    }
                    hits += usize::from(expected.is_some());
                }
            }
        }
        assert!(hits > 20_000, "{hits}");
    }

    #[test]
    fn cylinders_are_met_by_rays_together_as_by_each() {
        let random = &mut Random(54);
        let mut hits = 0;
        for round in 0..240 {
            let scale = [1.0, 1e-3, 1e4, 1e-12, 1e12, 1e-25][round % 6];
            let cloud = cylinders([4, 40, 200][round / 6 % 3], round % 4 < 2, scale, random);
            // Most of the cylinders lie ahead of the first ray; the others hardly differ from it.
            let first = ray_near(&cloud.cylinder(random.below(cloud.len())), scale, random);
            let size = first.direction.abs().max_element();
            let rays: Vec<Ray> = (0..100)
                .map(|_| {
                    let turned = random.vector() * size * [0.0, 1e-5, 1e-3, 0.03][random.below(4)];
                    Ray::new(first.origin, first.direction + turned)
                })
                .collect();
            let geometry = Geometry::cylinders(cloud).unwrap();
            let expected: Vec<Option<PrimitiveHit>> = rays
                .iter()
                .map(|ray| real(geometry.intersect_brute_force(&ray.prepare(), f32::INFINITY, 0.0)))
                .collect();
            let ends: Vec<f32> = expected.iter().map(|n| n.map_or(f32::INFINITY, |n| n.t)).collect();
            for set in InstructionSet::available() {
                set.limit();
                for end in 0..3 {
                    let up_to = |&t: &f32| [f32::INFINITY, t, t.next_down()][end];
                    let mut met: Vec<PrimitiveHit> = ends.iter().map(|t| PrimitiveHit::none(up_to(t))).collect();
                    geometry.intersect_coherent(&rays, &mut met);
                    let mut any: Vec<f32> = ends.iter().map(up_to).collect();
                    geometry.occluded_coherent(&rays, &mut any);
                    for (i, (met, any)) in met.into_iter().zip(any).enumerate() {
                        let expected = expected[i].filter(|_| end < 2);
                        let bits = |n: Option<PrimitiveHit>| n.map(|n| (n.t.to_bits(), n.id, n.part));
                        assert_eq!(bits(real(met)), bits(expected), "{scale} {:?}", rays[i]);
                        assert_eq!(any == f32::NEG_INFINITY, expected.is_some(), "{scale} {:?}", rays[i]);
                    }
                }
                hits += expected.iter().flatten().count();
            }
        }
        assert!(hits > 5_000, "{hits}");
    }

    #[test]
    fn few_cylinders_that_are_missed_are_asked_for() {
        let random = &mut Random(52);
        let axis = |random: &mut Random| (random.vector(), random.vector() * 0.2);
        let axes = (0..4000).map(|_| axis(random)).map(|(at, way)| [at, at + way]).collect();
        let cloud = CylinderCloud { axes, radii: vec![0.01], ..CylinderCloud::default() };
        let Ok(Geometry::Cylinders { tree, cloud }) = Geometry::cylinders(cloud) else { panic!() };
        let (asked, met) = (Cell::new(0), Cell::new(0));
        let kernel = cylinder(&cloud);
        let ask = |what: UserPrimitive, ray: &PreparedRay, t_max: f32| {
            asked.set(asked.get() + 1);
            let answer = kernel(what, ray, t_max);
            met.set(met.get() + usize::from(answer.is_some()));
            answer
        };
        for _ in 0..1000 {
            let ray = Ray::new(random.vector() * 2.0, random.vector()).prepare();
            tree.intersect(&ray, &mut PrimitiveHit::none(f32::INFINITY), &ask);
        }
        assert!(met.get() > 150 && asked.get() * 9 < met.get() * 10, "{asked:?} {met:?}");
    }

    #[test]
    fn shapes_of_all_kinds_are_met_as_one_by_one() {
        let random = &mut Random(53);
        let mut hits = 0;
        for _ in 0..8 {
            let shapes: Vec<Shape> = (0..60)
                .map(|i| {
                    let (center, axis, radius) = (random.vector(), random.vector(), 0.2 + 0.1 * random.signed());
                    let top = center + axis * 0.3;
                    match i % 4 {
                        0 => Cylinder { base: center, top, radius, caps: i % 8 == 0 }.into(),
                        1 => Shape::Cone(Cone { base: center, top, radius, top_radius: 0.1, caps: i % 8 == 1 }),
                        2 => Shape::Torus(Torus { center, axis, radius, tube: 0.05 }),
                        _ => Sphere { center, radius }.into(),
                    }
                })
                .collect();
            let near: Vec<Ray> = (0..1000)
                .map(|i| {
                    let bounds = shapes[i % 60].bounds().unwrap();
                    let target = bounds.min + (bounds.max - bounds.min) * (0.5 + 0.5 * random.vector());
                    let origin = random.vector() * 3.0;
                    Ray::new(origin, target - origin)
                })
                .collect();
            let geometry = Geometry::shapes(shapes, vec![0; 60], vec![0; 60]).unwrap();
            for ray in near.iter().map(Ray::prepare) {
                let [tree, all] = [
                    geometry.intersect(&ray, f32::INFINITY, 0.0),
                    geometry.intersect_brute_force(&ray, f32::INFINITY, 0.0),
                ]
                .map(|n| (n.t.to_bits(), n.id, n.part));
                assert_eq!(tree, all, "{:?}", ray.ray());
                hits += usize::from(tree.1 != PrimitiveHit::NONE);
            }
        }
        assert!(hits > 2000, "{hits}");
    }
}
