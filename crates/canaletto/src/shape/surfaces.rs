//! Surfaces of the commonest shapes: the second stage of eight hits side by side, by the formulas of a single hit.

use super::mesh::Corners;
use super::solve;
use super::{Cuboid, Disk, Sphere, Surface};
use crate::math::{DRay, Transform, larger};
use glam::{DVec3, Vec2, Vec3};

/// The number of lanes.
pub(crate) const SURFACES: usize = 8;

/// The bits of all lanes.
const ALL: u32 = (1 << SURFACES) - 1;

/// Eight points or directions: rows of x, y and z.
pub(crate) type DVec3x8 = [[f64; SURFACES]; 3];

/// Eight points or colours.
pub(crate) type Vec3x8 = [[f32; SURFACES]; 3];

/// The value in lane `lane`.
#[inline(always)]
pub(crate) fn dvec3([x, y, z]: &DVec3x8, lane: usize) -> DVec3 {
    DVec3::new(x[lane], y[lane], z[lane])
}

/// The value in lane `lane`.
#[inline(always)]
pub(crate) fn vec3([x, y, z]: &Vec3x8, lane: usize) -> Vec3 {
    Vec3::new(x[lane], y[lane], z[lane])
}

/// Sets the value in lane `lane`.
#[inline(always)]
pub(crate) fn set_dvec3([x, y, z]: &mut DVec3x8, lane: usize, v: DVec3) {
    (x[lane], y[lane], z[lane]) = (v.x, v.y, v.z);
}

/// Sets the value in lane `lane`.
#[inline(always)]
pub(crate) fn set_vec3([x, y, z]: &mut Vec3x8, lane: usize, v: Vec3) {
    (x[lane], y[lane], z[lane]) = (v.x, v.y, v.z);
}

/// The indices of the set bits, in ascending order.
pub(crate) fn set_bits(mut bits: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let index = (bits != 0).then_some(bits.trailing_zeros() as usize);
        bits &= bits.wrapping_sub(1);
        index
    })
}

/// Copies the lanes whose bit is set.
#[inline(always)]
fn take<T: Copy>(to: &mut [[T; SURFACES]; 3], from: &[[T; SURFACES]; 3], bits: u32) {
    for (to, from) in to.iter_mut().zip(from) {
        for i in 0..SURFACES {
            to[i] = if bits >> i & 1 == 1 { from[i] } else { to[i] };
        }
    }
}

/// Eight surfaces for shading without textures: rows of the fields of [`Surface`].
#[derive(Clone, Copy)]
pub(crate) struct Surfaces {
    pub(crate) exact: DVec3x8,
    pub(crate) normal: DVec3x8,
    pub(crate) shading_normal: DVec3x8,
    pub(crate) point: Vec3x8,
    pub(crate) error: Vec3x8,
    pub(crate) shadow_origin: Vec3x8,
}

impl Surfaces {
    /// Eight surfaces of zeros.
    pub(crate) const NOTHING: Surfaces = Surfaces {
        exact: [[0.0; SURFACES]; 3],
        normal: [[0.0; SURFACES]; 3],
        shading_normal: [[0.0; SURFACES]; 3],
        point: [[0.0; SURFACES]; 3],
        error: [[0.0; SURFACES]; 3],
        shadow_origin: [[0.0; SURFACES]; 3],
    };

    /// Sets the surface in lane `lane`.
    #[inline(always)]
    pub(crate) fn set(&mut self, lane: usize, surface: &Surface) {
        set_dvec3(&mut self.exact, lane, surface.exact);
        set_dvec3(&mut self.normal, lane, surface.normal);
        set_dvec3(&mut self.shading_normal, lane, surface.shading_normal);
        set_vec3(&mut self.point, lane, surface.point);
        set_vec3(&mut self.error, lane, surface.error);
        set_vec3(&mut self.shadow_origin, lane, surface.shadow_origin);
    }

    /// Sets what rays that leave the surface in lane `lane` need: its exact point, its geometric normal, and the
    /// rounded point with its error.
    #[inline(always)]
    pub(crate) fn set_frame(&mut self, lane: usize, exact: &DVec3, normal: &DVec3, point: Vec3, error: Vec3) {
        set_dvec3(&mut self.exact, lane, *exact);
        set_dvec3(&mut self.normal, lane, *normal);
        set_vec3(&mut self.point, lane, point);
        set_vec3(&mut self.error, lane, error);
    }

    /// The surface in lane `lane`, without texture coordinates and colour.
    #[inline(always)]
    pub(crate) fn get(&self, lane: usize) -> Surface {
        Surface {
            point: vec3(&self.point, lane),
            exact: dvec3(&self.exact, lane),
            error: vec3(&self.error, lane),
            normal: dvec3(&self.normal, lane),
            shading_normal: dvec3(&self.shading_normal, lane),
            uv: Vec2::ZERO,
            uv_rest: Vec2::ZERO,
            color: None,
            shadow_origin: vec3(&self.shadow_origin, lane),
        }
    }

    /// Copies the lanes whose bit is set.
    #[inline(always)]
    fn take(&mut self, from: &Surfaces, bits: u32) {
        if bits == ALL {
            *self = *from;
            return;
        }
        take(&mut self.exact, &from.exact, bits);
        take(&mut self.normal, &from.normal, bits);
        take(&mut self.shading_normal, &from.shading_normal, bits);
        take(&mut self.point, &from.point, bits);
        take(&mut self.error, &from.error, bits);
        take(&mut self.shadow_origin, &from.shadow_origin, bits);
    }
}

/// Up to eight spheres, boxes, disks and triangles, each with the line that hits it.
pub(crate) struct SurfaceInputs8 {
    /// The lines' origins and directions.
    origin: DVec3x8,
    pub(crate) direction: DVec3x8,
    /// The parameters of the hits.
    t: [f32; SURFACES],
    center: Vec3x8,
    radius: [f32; SURFACES],
    /// The corners of triangles, the lower and upper corners of boxes, or the normals of disks.
    corners: [Vec3x8; 3],
    /// The faces of boxes.
    part: [u32; SURFACES],
    /// The corners' normals, where they have any.
    normals: [Vec3x8; 3],
    /// The barycentric coordinates on triangles.
    uv: [[f32; SURFACES]; 2],
    /// A bit for each lane with a sphere, a box, a disk, a triangle, and a triangle whose corners have normals.
    spheres: u32,
    boxes: u32,
    disks: u32,
    flat: u32,
    smooth: u32,
    /// A bit for each lane on an instance, the instance, and the transform from its space to the world's.
    moved: u32,
    instance: u32,
    to_world: Transform,
}

impl SurfaceInputs8 {
    /// Inputs without any hit.
    pub(crate) const NONE: SurfaceInputs8 = SurfaceInputs8 {
        origin: [[0.0; SURFACES]; 3],
        direction: [[0.0; SURFACES]; 3],
        t: [0.0; SURFACES],
        center: [[0.0; SURFACES]; 3],
        radius: [1.0; SURFACES],
        corners: [[[0.0; SURFACES]; 3]; 3],
        normals: [[[0.0; SURFACES]; 3]; 3],
        uv: [[0.0; SURFACES]; 2],
        part: [0; SURFACES],
        spheres: 0,
        boxes: 0,
        disks: 0,
        flat: 0,
        smooth: 0,
        moved: 0,
        instance: 0,
        to_world: Transform::IDENTITY,
    };

    /// Removes all hits.
    pub(crate) fn clear(&mut self) {
        (self.spheres, self.boxes, self.disks) = (0, 0, 0);
        (self.flat, self.smooth, self.moved) = (0, 0, 0);
    }

    /// Sets the line of lane `lane`.
    #[inline(always)]
    pub(crate) fn set_line(&mut self, lane: usize, line: &DRay) {
        set_dvec3(&mut self.origin, lane, line.origin);
        set_dvec3(&mut self.direction, lane, line.direction);
    }

    /// Sets the hit of lane `lane` to a sphere.
    #[inline(always)]
    pub(crate) fn set_sphere(&mut self, lane: usize, sphere: &Sphere, t: f32) {
        set_vec3(&mut self.center, lane, sphere.center);
        self.radius[lane] = sphere.radius;
        self.t[lane] = t;
        self.spheres |= 1 << lane;
    }

    /// Sets the hit of lane `lane` to a face of a box.
    #[inline(always)]
    pub(crate) fn set_cuboid(&mut self, lane: usize, cuboid: &Cuboid, part: u32) {
        set_vec3(&mut self.corners[0], lane, cuboid.min);
        set_vec3(&mut self.corners[1], lane, cuboid.max);
        self.part[lane] = part;
        self.boxes |= 1 << lane;
    }

    /// Sets the hit of lane `lane` to a disk.
    #[inline(always)]
    pub(crate) fn set_disk(&mut self, lane: usize, disk: &Disk) {
        set_vec3(&mut self.center, lane, disk.center);
        set_vec3(&mut self.corners[0], lane, disk.normal);
        self.radius[lane] = disk.radius;
        self.disks |= 1 << lane;
    }

    /// Sets the hit of lane `lane` to a triangle.
    #[inline(always)]
    pub(crate) fn set_triangle(&mut self, lane: usize, triangle: &Corners, t: f32, [u, v]: [f32; 2]) {
        for (to, &position) in self.corners.iter_mut().zip(&triangle.positions) {
            set_vec3(to, lane, position);
        }
        self.t[lane] = t;
        (self.uv[0][lane], self.uv[1][lane]) = (u, v);
        if let Some(normals) = &triangle.normals {
            for (to, &normal) in self.normals.iter_mut().zip(normals) {
                set_vec3(to, lane, normal);
            }
            self.smooth |= 1 << lane;
        } else {
            self.flat |= 1 << lane;
        }
    }

    /// Places the triangle that lane `lane` will hold on this instance. Returns false if other lanes are on another
    /// instance, since there is one transform for all lanes.
    #[inline]
    pub(crate) fn set_instance(&mut self, lane: usize, instance: u32, to_world: &Transform) -> bool {
        if self.moved == 0 {
            (self.instance, self.to_world) = (instance, *to_world);
        } else if self.instance != instance {
            return false;
        }
        self.moved |= 1 << lane;
        true
    }

    #[inline(always)]
    fn flat_triangle(&self, lane: usize) -> Corners {
        let [a, b, c] = &self.corners;
        Corners { positions: [vec3(a, lane), vec3(b, lane), vec3(c, lane)], normals: None }
    }

    #[inline(always)]
    fn smooth_triangle(&self, lane: usize) -> Corners {
        let [a, b, c] = &self.normals;
        Corners { normals: Some([vec3(a, lane), vec3(b, lane), vec3(c, lane)]), ..self.flat_triangle(lane) }
    }

    #[inline(always)]
    fn line(&self, lane: usize) -> DRay {
        DRay { origin: dvec3(&self.origin, lane), direction: dvec3(&self.direction, lane) }
    }

    /// The line of lane `lane` in the space of its primitive.
    #[inline(always)]
    fn local(&self, lane: usize) -> DRay {
        let line = self.line(lane);
        let moved = DRay {
            origin: self.to_world.back().transform_point3(line.origin),
            direction: self.to_world.back().transform_vector3(line.direction),
        };
        if self.moved >> lane & 1 == 1 { moved } else { line }
    }

    /// A bit for each triangle that is [large](Corners::is_large) relative to the distance of its hit. The loops run
    /// over lanes, so that the compiler vectorises.
    #[inline(always)]
    fn large(&self) -> u32 {
        if self.flat | self.smooth == 0 {
            return 0;
        }
        let (mut size, mut longest) = ([0.0f32; SURFACES], [0.0f64; SURFACES]);
        let [a, b, c] = &self.corners;
        for axis in 0..3 {
            for i in 0..SURFACES {
                let sides = larger((c[axis][i] - a[axis][i]).abs(), (b[axis][i] - a[axis][i]).abs());
                size[i] = larger(sides, size[i]);
            }
        }
        let mut direction = self.direction;
        if self.moved != 0 {
            for i in 0..SURFACES {
                set_dvec3(&mut direction, i, self.local(i).direction);
            }
        }
        for row in &direction {
            for i in 0..SURFACES {
                longest[i] = if row[i].abs() > longest[i] { row[i].abs() } else { longest[i] };
            }
        }
        let mut bits = 0;
        for i in 0..SURFACES {
            bits |= u32::from(solve::is_large(size[i].into(), longest[i], self.t[i])) << i;
        }
        bits
    }

    /// Computes the surfaces of all hits. It must be called from a kernel.
    #[inline(always)]
    pub(crate) fn surfaces(&self, into: &mut Surfaces) {
        let mut found = Surfaces::NOTHING;
        if self.spheres != 0 {
            for i in 0..SURFACES {
                let sphere = Sphere { center: vec3(&self.center, i), radius: self.radius[i] };
                found.set(i, &sphere.surface_without_uv(self.line(i), self.t[i]));
            }
            into.take(&found, self.spheres);
        }
        if self.boxes != 0 {
            for i in 0..SURFACES {
                let cuboid = Cuboid { min: vec3(&self.corners[0], i), max: vec3(&self.corners[1], i) };
                found.set(i, &cuboid.surface_without_uv(self.line(i), self.part[i]));
            }
            into.take(&found, self.boxes);
        }
        if self.disks != 0 {
            for i in 0..SURFACES {
                let (center, normal) = (vec3(&self.center, i), vec3(&self.corners[0], i));
                let disk = Disk { center, normal, radius: self.radius[i] };
                found.set(i, &disk.surface_without_uv(self.line(i)));
            }
            into.take(&found, self.disks);
        }
        if self.flat != 0 {
            for i in 0..SURFACES {
                found.set(i, &self.flat_triangle(i).surface(self.uv[0][i], self.uv[1][i]));
            }
            into.take(&found, self.flat);
        }
        if self.smooth != 0 {
            for i in 0..SURFACES {
                found.set(i, &self.smooth_triangle(i).surface(self.uv[0][i], self.uv[1][i]));
            }
            into.take(&found, self.smooth);
        }
        let large = self.large();
        if large & self.flat != 0 {
            for i in 0..SURFACES {
                found.set(i, &self.flat_triangle(i).on_line(&self.local(i)).0);
            }
            into.take(&found, large & self.flat);
        }
        if large & self.smooth != 0 {
            for i in 0..SURFACES {
                found.set(i, &self.smooth_triangle(i).on_line(&self.local(i)).0);
            }
            into.take(&found, large & self.smooth);
        }
        if self.moved != 0 {
            for i in 0..SURFACES {
                found.set(i, &into.get(i).transformed(&self.to_world));
            }
            into.take(&found, self.moved);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::ShapeHit;
    use super::super::testing::Random;
    use super::*;
    use canaletto_bvh::{InstructionSet, Kernel};

    struct Find<'a>(&'a SurfaceInputs8, &'a mut Surfaces);

    impl Kernel for Find<'_> {
        type Answer = ();

        #[inline(always)]
        fn run(self) {
            self.0.surfaces(self.1);
        }
    }

    /// A random vector, often along an axis, sometimes zero.
    fn vector(random: &mut Random) -> Vec3 {
        let keep = [(); 3].map(|()| if random.one_in(3) { 0.0 } else { 1.0 });
        random.cube() * Vec3::from(keep)
    }

    /// The bits of all numbers.
    fn bits(surface: &Surface) -> ([u64; 9], [u32; 9]) {
        let dvec3 = [surface.exact, surface.normal, surface.shading_normal].map(|v| v.to_array().map(f64::to_bits));
        let vec3 = [surface.point, surface.error, surface.shadow_origin].map(|v| v.to_array().map(f32::to_bits));
        let dvec3: [u64; 9] = dvec3.as_flattened().try_into().unwrap();
        let vec3: [u32; 9] = vec3.as_flattened().try_into().unwrap();
        // All NaN are one.
        let is_nan = |bits: u64| f64::from_bits(bits).is_nan();
        (
            dvec3.map(|bits| if is_nan(bits) { u64::MAX } else { bits }),
            vec3.map(|bits| if f32::from_bits(bits).is_nan() { u32::MAX } else { bits }),
        )
    }

    #[test]
    fn surfaces_side_by_side_are_those_one_by_one() {
        let random = &mut Random(61);
        for round in 0..4000 {
            let scale = [1.0, 1e-3, 1e4, 1e-30, 1e30][round % 5];
            let to_world = Transform::rotate(DVec3::new(1.0, 2.0, 3.0), f64::from(random.within(-180.0, 180.0)))
                .unwrap()
                .after(&Transform::scale(DVec3::new(-1.0, 0.5, 3.0)).unwrap());
            let mut surface_inputs = SurfaceInputs8::NONE;
            let mut known = Surfaces::NOTHING;
            let expected: [Surface; SURFACES] = std::array::from_fn(|lane| {
                let line = DRay {
                    origin: (vector(random) * scale * if random.one_in(2) { 100.0 } else { 1.0 }).as_dvec3(),
                    direction: vector(random).as_dvec3(),
                };
                surface_inputs.set_line(lane, &line);
                match (random.unit() * 6.0) as u32 {
                    4 => {
                        let min = vector(random) * scale;
                        let cuboid = Cuboid { min, max: min + vector(random).abs() * scale };
                        let part = (random.unit() * 5.99) as u32;
                        surface_inputs.set_cuboid(lane, &cuboid, part);
                        cuboid.surface_without_uv(line, part)
                    }
                    5 => {
                        let disk = Disk { center: vector(random) * scale, normal: vector(random), radius: scale };
                        surface_inputs.set_disk(lane, &disk);
                        disk.surface_without_uv(line)
                    }
                    0 => {
                        let sphere = Sphere { center: vector(random) * scale, radius: scale };
                        // The lines need not hit the sphere.
                        let t = random.within(-scale, scale);
                        surface_inputs.set_sphere(lane, &sphere, t);
                        sphere.surface_without_uv(line, t)
                    }
                    1 => {
                        let surface = Surface::at(line.origin, DVec3::Y, Vec2::ZERO);
                        known.set(lane, &surface);
                        surface
                    }
                    smooth => {
                        let mut three = || std::array::from_fn(|_| vector(random));
                        let (positions, normals) = (three().map(|p| p * scale), three());
                        let triangle = Corners { positions, normals: (smooth == 2).then_some(normals) };
                        let [u, v] = [(); 2].map(|()| random.within(-0.5, 1.5));
                        // Some triangles are large relative to the distance of the hit.
                        let t = random.within(0.0, scale) * if random.one_in(2) { 1e-3 } else { 1.0 };
                        let moves = random.one_in(2);
                        // Eight lanes have one transform.
                        if moves {
                            assert!(surface_inputs.set_instance(lane, 7, &to_world));
                            assert!(!surface_inputs.set_instance(lane, 8, &to_world));
                        }
                        surface_inputs.set_triangle(lane, &triangle, t, [u, v]);
                        let line = if moves { line.to_local(&to_world) } else { line };
                        let surface = triangle.at(&line, &ShapeHit { t, part: 0, uv: [u, v] });
                        if moves { surface.transformed(&to_world) } else { surface }
                    }
                }
            });
            for set in InstructionSet::available() {
                set.limit();
                let mut found = known;
                InstructionSet::run(Find(&surface_inputs, &mut found));
                for (lane, expected) in expected.iter().enumerate() {
                    assert_eq!(bits(&found.get(lane)), bits(expected), "round {round}, number {lane}: {expected:?}");
                }
            }
        }
    }
}
