//! Emitting surfaces as lights.

mod lanes;

use super::direct::PAST_EMITTER;
use super::light_sampler::strength;
use super::light_tree::{ClusterBounds, NormalCone};
use crate::light::attenuation_divisor;
use crate::material::MaterialPoint;
use crate::math::{DRay, Rgb, Transform};
use crate::shape::{Parallelogram, SurfaceSampler};
use crate::world::{Hit, PlacedGeometry, Primitives, World};
use canaletto_bvh::{Aabb, Ray};
use glam::{BVec3, DVec3, Vec3};
pub(super) use lanes::LaneEmitters;
use std::f64::consts::FRAC_PI_2;

/// The most boxes that are compared to find isolated emitters. More are those of large meshes with many emitters.
const MOST_COMPARED: u32 = 1 << 20;

/// How far two triangles may be from a parallelogram, as a share of its size, to be sampled as one.
const ONE_SURFACE: f32 = 1e-6;

/// An emitting surface of which random points are sampled: a shape, a triangle, or two triangles that make a
/// parallelogram.
#[derive(Debug)]
pub(super) struct Emitter {
    sampler: SurfaceSampler,
    place: Place,
    /// The number of the placed geometry and the first primitive.
    of: [u32; 2],
    /// The number of primitives, which follow each other.
    primitives: u32,
    material: u32,
    /// The radiance that leaves the outer side; none if textures change it.
    radiance: Option<Rgb>,
    two_sided: bool,
    /// The coefficients c, l, q of the attenuation by distance; none for surfaces that aren't lights.
    attenuation: Option<[f32; 3]>,
    bounds: ClusterBounds,
    /// Whether nothing else comes so near that a shadow ray could hit it within [`PAST_EMITTER`] of a point.
    pub(super) is_isolated: bool,
}

/// The space of a sampler.
#[derive(Debug)]
enum Place {
    World,
    Still(Box<Transform>),
    /// That of a moving instance at the time of a ray.
    Moving,
}

/// The light of a point of an emitter, as if nothing lay between.
#[derive(Clone, Copy, Debug)]
pub(super) struct EmitterSample {
    /// The point, and the unit direction to it.
    pub(super) point: DVec3,
    pub(super) wi: DVec3,
    /// The radiance that leaves it towards the lit point.
    pub(super) radiance: Rgb,
    /// The density per unit of solid angle at the lit point.
    pub(super) pdf: f64,
}

/// The emitters of a world, found by hits on them.
#[derive(Debug, Default)]
pub(super) struct Emitters {
    pub(super) all: Vec<Emitter>,
    /// For each emitting primitive the number of its geometry, its own and its emitter's, in rising order.
    index: Vec<([u32; 2], u32)>,
}

impl Emitters {
    /// The emitters of a world. Left out are planes and meshes that deform, whose light paths find by chance. So do
    /// paths with the light of materials that `is_taken` refuses. `radius` is that of the scene.
    pub(super) fn new(world: &World, radius: f64, is_taken: impl Fn(u32) -> bool) -> Emitters {
        let mut emitters = Emitters::default();
        let emits = |material: u32| world.materials()[material as usize].may_emit() && is_taken(material);
        for number in world.geometries_with_material(emits) {
            emitters.add(world, number, &emits, radius);
        }
        if !world.moves() && world.all_cast_shadows() && world.unbounded_shapes().next().is_none() {
            emitters.isolate(world, radius);
        }
        emitters
    }

    /// Finds the emitters that nothing else comes near, as long as few boxes are to be compared.
    fn isolate(&mut self, world: &World, radius: f64) {
        // No point is farther from a point of the scene than twice the radius; half as far is left for roundings.
        let margin = (3.0 * radius * f64::from(PAST_EMITTER - 1.0)) as f32;
        let mut compared = 0;
        for emitter in &mut self.all {
            let ClusterBounds { min, max, .. } = emitter.bounds;
            let near = Aabb { min: min.as_vec3() - margin, max: max.as_vec3() + margin };
            let mut is_isolated = world.materials()[emitter.material as usize].is_opaque();
            for number in 0..world.placed_geometry_count() {
                compared += 1;
                if !is_isolated || compared > MOST_COMPARED {
                    break;
                }
                if !near.overlaps(&world.placed_bounds(number)) {
                    continue;
                }
                let placed = world.placed_geometry(number, 0.0);
                let own =
                    if number == emitter.of[0] { emitter.of[1]..emitter.of[1] + emitter.primitives } else { 0..0 };
                for primitive in (0..placed.primitives.len() as u32).filter(|primitive| !own.contains(primitive)) {
                    compared += 1;
                    is_isolated &= compared <= MOST_COMPARED && !near.overlaps(&primitive_bounds(&placed, primitive));
                    if !is_isolated {
                        break;
                    }
                }
            }
            emitter.is_isolated = is_isolated && compared <= MOST_COMPARED;
        }
    }

    fn add(&mut self, world: &World, number: u32, emits: &impl Fn(u32) -> bool, radius: f64) {
        let placed = world.placed_geometry(number, 0.0);
        let moves = world.placed_moves(number);
        if matches!(placed.primitives, Primitives::Mesh(mesh) if mesh.end_pose.is_some()) {
            return;
        }
        let len = placed.primitives.len() as u32;
        let emitting = |primitive: u32| {
            let material = world.material_of_primitive(number, primitive);
            (primitive < len && emits(material)).then_some(material)
        };
        let mut next = 0;
        while next < len {
            let primitive = next;
            next += 1;
            let Some(material) = emitting(primitive) else { continue };
            let corners = |primitive: u32| triangle(&placed.primitives, primitive);
            let pair = corners(primitive)
                .zip(if next < len && emitting(next) == Some(material) { corners(next) } else { None })
                .and_then(|(first, second)| parallelogram(first, second));
            let sampler = match (pair, corners(primitive)) {
                (Some(surface), _) => {
                    next += 1;
                    if moves { Some(surface.sampler()) } else { Some(in_world(&surface, &placed).sampler()) }
                }
                (None, Some(corners)) if moves => Some(SurfaceSampler::triangles(vec![corners])),
                (None, Some(corners)) => {
                    Some(SurfaceSampler::triangles(vec![world_corners(corners, placed.to_world.as_ref())]))
                }
                (None, None) => placed.primitives.shape(primitive).and_then(|(shape, _)| shape.sampler()),
            };
            let Some(sampler) = sampler else { continue };
            let place = match &placed.to_world {
                _ if moves => Place::Moving,
                Some(to_world) if corners(primitive).is_none() => Place::Still(Box::new(*to_world)),
                _ => Place::World,
            };
            let emitter = Emitter::new(world, sampler, place, [number, primitive], next - primitive, material, radius);
            if emitter.bounds.intensity > 0.0 && emitter.bounds.intensity.is_finite() {
                self.index.extend((primitive..next).map(|primitive| ([number, primitive], self.all.len() as u32)));
                self.all.push(emitter);
            }
        }
    }

    /// The index of the emitter that was hit.
    pub(super) fn of_hit(&self, hit: &Hit) -> Option<u32> {
        let found = self.index.binary_search_by_key(&[hit.instance, hit.primitive], |(key, _)| *key);
        found.ok().map(|place| self.index[place].1)
    }
}

/// A box around a primitive in the world; an infinite one if it has no bounds.
fn primitive_bounds(placed: &PlacedGeometry, primitive: u32) -> Aabb {
    let to_world = placed.to_world.as_ref();
    if let Some(corners) = triangle(&placed.primitives, primitive) {
        return Aabb::from_points(world_corners(corners, to_world));
    }
    let Some(bounds) = placed.primitives.shape(primitive).and_then(|(shape, _)| shape.bounds()) else {
        return Aabb { min: Vec3::NEG_INFINITY, max: Vec3::INFINITY };
    };
    let Some(to_world) = to_world else { return bounds };
    let corner = |i: u32| {
        let at = Vec3::select(BVec3::new(i & 1 == 0, i & 2 == 0, i & 4 == 0), bounds.min, bounds.max);
        to_world.point(at.as_dvec3()).as_vec3()
    };
    Aabb::from_points((0..8).map(corner))
}

/// The corners of a primitive that is a triangle, in its own space.
fn triangle(primitives: &Primitives, primitive: u32) -> Option<[Vec3; 3]> {
    match primitives {
        Primitives::Mesh(mesh) => Some(mesh.corners(primitive as usize)),
        Primitives::Shapes(shapes) => match &shapes[primitive as usize] {
            crate::shape::Shape::Triangle(t) => Some([t.a, t.b, t.c]),
            _ => None,
        },
        Primitives::Spheres(_) | Primitives::Cylinders(_) => None,
    }
}

/// The parallelogram that two triangles make, if they share the edge between them and turn the same way.
fn parallelogram(first: [Vec3; 3], second: [Vec3; 3]) -> Option<Parallelogram> {
    let own = (0..3).find(|i| !second.contains(&first[*i]))?;
    let [corner, u_end, v_end] = [0, 1, 2].map(|k| first[(own + k) % 3]);
    let other = (0..3).find(|i| !first.contains(&second[*i]))?;
    // The shared edge has the other direction in the second triangle.
    if [second[(other + 1) % 3], second[(other + 2) % 3]] != [v_end, u_end] {
        return None;
    }
    let (u, v) = (u_end - corner, v_end - corner);
    let size = u.length().max(v.length());
    let is_one = (second[other] - (u_end + v)).length() <= ONE_SURFACE * size && u.cross(v).length() > 0.0;
    is_one.then_some(Parallelogram { corner, u, v })
}

fn in_world(surface: &Parallelogram, placed: &PlacedGeometry) -> Parallelogram {
    placed.to_world.as_ref().map_or(*surface, |t| surface.transformed(t))
}

/// The corners of a triangle in the world, counter-clockwise seen from its outer side.
fn world_corners(corners: [Vec3; 3], to_world: Option<&Transform>) -> [Vec3; 3] {
    let Some(t) = to_world else { return corners };
    let [a, b, c] = corners.map(|p| t.point(p.as_dvec3()).as_vec3());
    if t.matrix().matrix3.determinant() < 0.0 { [a, c, b] } else { [a, b, c] }
}

/// The factor by which a transform shrinks solid angles around a direction of its inner space: a unit direction w
/// becomes M w, and dω grows by |det M| / |M w|³.
fn solid_angle_ratio(to_world: &Transform, w: DVec3) -> f64 {
    let length = to_world.vector(w).length();
    length * length * length / to_world.matrix().matrix3.determinant().abs()
}

impl Emitter {
    /// The end of a shadow ray to a sampled point, whose distance it is measured in: past the point, or before it if
    /// only what hides the emitter can be hit before.
    #[inline]
    pub(super) fn shadow_end(&self) -> f32 {
        if self.is_isolated { 2.0 - PAST_EMITTER } else { PAST_EMITTER }
    }

    /// The number of the placed geometry and the first primitive.
    pub(super) fn first_primitive(&self) -> [u32; 2] {
        self.of
    }

    fn new(
        world: &World,
        sampler: SurfaceSampler,
        place: Place,
        of: [u32; 2],
        primitives: u32,
        material: u32,
        radius: f64,
    ) -> Emitter {
        let description = &world.materials()[material as usize];
        let [mut min, mut max] = sampler.bounds();
        let (axis, cos) = sampler.normal_cone();
        let mut normals = NormalCone { axis, angle: libm::acos(cos.clamp(-1.0, 1.0)) };
        let mut area = sampler.area();
        let moved;
        let to_world = match &place {
            Place::World => None,
            Place::Still(to_world) => Some(&**to_world),
            Place::Moving => {
                moved = world.placed_geometry(of[0], 0.0).to_world;
                moved.as_ref()
            }
        };
        if let Some(t) = to_world {
            let m = t.matrix().matrix3;
            let (center, half) = (t.point(0.5 * (min + max)), 0.5 * (max - min));
            let half = m.x_axis.abs() * half.x + m.y_axis.abs() * half.y + m.z_axis.abs() * half.z;
            (min, max) = (center - half, center + half);
            // About the area of a stretched surface.
            let scale = libm::cbrt(m.determinant().abs());
            area *= scale * scale;
            normals = match t.uniform_scale() {
                _ if normals.angle > 0.0 && t.uniform_scale().is_none() => NormalCone::ALL,
                _ => NormalCone { axis: t.normal(normals.axis).normalize_or(DVec3::Z), ..normals },
            };
        }
        if let Place::Moving = place {
            let swept = world.placed_bounds(of[0]);
            (min, max, normals) = (swept.min.as_dvec3(), swept.max.as_dvec3(), NormalCone::ALL);
        }
        let point = description.plain();
        let own = point.classic.emission;
        // A texture alone gives the emission: its colours are at most about white.
        let typical = if own.is_black() { Rgb::WHITE } else { own };
        let attenuation = world.visible_light(material).map(|light| light.attenuation);
        let mut emitter = Emitter {
            sampler,
            place,
            of,
            primitives,
            material,
            is_isolated: false,
            radiance: description.textures.is_empty().then(|| seen_emission(point, true)),
            two_sided: description.two_sided,
            attenuation: attenuation.filter(|coefficients| *coefficients != [1.0, 0.0, 0.0]),
            bounds: ClusterBounds {
                min,
                max,
                normals,
                emission_angle: FRAC_PI_2,
                two_sided: description.two_sided,
                intensity: strength(typical) * area,
            },
        };
        emitter.bounds.intensity /= f64::from(emitter.divisor(radius));
        emitter
    }

    /// The bounds of the emitted light. The intensity is that of a surface without textures.
    pub(super) fn bounds(&self) -> ClusterBounds {
        self.bounds
    }

    /// Calls `f` with the transform from the sampler's space to the world's.
    fn with_place<T>(&self, world: &World, time: f32, f: impl FnOnce(Option<&Transform>) -> T) -> T {
        match &self.place {
            Place::World => f(None),
            Place::Still(to_world) => f(Some(to_world)),
            Place::Moving => f(world.placed_geometry(self.of[0], time).to_world.as_ref()),
        }
    }

    /// The light of the point at `u` of the unit square, as seen from `p`. None where no light leaves towards `p`.
    pub(super) fn sample_from(&self, world: &World, time: f32, p: DVec3, u: [f64; 2]) -> Option<EmitterSample> {
        if self.has_lanes(p) {
            let sample = LaneEmitters::<f64>::gather(|_| self).sample(p.into(), u);
            let [point, wi] = [sample.point, sample.wi].map(DVec3::from);
            let radiance = sample.radiance.into();
            return sample.lit.then_some(EmitterSample { point, wi, radiance, pdf: sample.pdf });
        }
        let (point, pdf, outside) = self.with_place(world, time, |to_world| {
            let local = to_world.map_or(p, |t| t.inverse().point(p));
            let sample = self.sampler.sample_from(local, u)?;
            let outside = sample.normal.dot(local - sample.point) > 0.0;
            Some(match to_world {
                None => (sample.point, sample.pdf, outside),
                Some(t) => {
                    let w = (sample.point - local).normalize();
                    (t.point(sample.point), sample.pdf * solid_angle_ratio(t, w), outside)
                }
            })
        })?;
        if !(outside || self.two_sided) || !pdf.is_finite() {
            return None;
        }
        let radiance = match self.radiance {
            Some(radiance) => radiance,
            None => self.textured(world, time, p, point)?,
        };
        let radiance = radiance / self.divisor(p.distance(point));
        let wi = (point - p).try_normalize()?;
        (!radiance.is_black()).then_some(EmitterSample { point, wi, radiance, pdf })
    }

    /// What the radiance is divided by at a distance.
    fn divisor(&self, distance: f64) -> f32 {
        self.attenuation.map_or(1.0, |coefficients| attenuation_divisor(coefficients, distance as f32))
    }

    /// The radiance that leaves a textured point towards `p`.
    fn textured(&self, world: &World, time: f32, p: DVec3, point: DVec3) -> Option<Rgb> {
        let line = DRay { origin: p, direction: point - p };
        let ray = Ray::new(p.as_vec3(), line.direction.as_vec3());
        let [number, first] = self.of;
        let hits = (first..first + self.primitives)
            .filter_map(|primitive| world.intersect_primitive(&ray, [number, primitive], time));
        let hit = hits.min_by(|a, b| (a.t - 1.0).abs().total_cmp(&(b.t - 1.0).abs()))?;
        let mut surface = world.surface(line, &hit);
        let material = world.material(&hit);
        let material = world.material_point(material, (line, &hit), &mut surface, None, &mut ());
        Some(seen_emission(&material, line.direction.dot(surface.normal) < 0.0))
    }

    /// The density per unit of solid angle at `p` with which [`Emitter::sample_from`] returns a point of the surface
    /// with this unit normal.
    pub(super) fn pdf_from(&self, world: &World, time: f32, p: DVec3, point: DVec3, normal: DVec3) -> f64 {
        let pdf = self.with_place(world, time, |to_world| match to_world {
            None => self.sampler.pdf_from(p, point, normal),
            Some(t) => {
                let [from, to] = [p, point].map(|p| t.inverse().point(p));
                // Normals go the other way by the transpose.
                let local = (t.matrix().matrix3.transpose() * normal).normalize();
                self.sampler.pdf_from(from, to, local) * solid_angle_ratio(t, (to - from).normalize())
            }
        });
        if pdf.is_finite() { pdf } else { 0.0 }
    }
}

/// The emission of what is there of a surface, under its overlay.
pub(super) fn seen_emission(material: &MaterialPoint, outside: bool) -> Rgb {
    let emission = material.emitted(outside);
    if emission.is_black() { emission } else { emission * (material.coverage * (1.0 - material.overlay.1)) }
}

#[cfg(test)]
mod tests;
