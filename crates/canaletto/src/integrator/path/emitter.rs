//! Emitting surfaces as lights.

use crate::material::Material;
use crate::math::{Rgb, Transform};
use crate::shape::SurfaceSampler;
use crate::world::{Hit, PlacedGeometry, Primitives, World};
use glam::{DVec3, Vec3};
use std::collections::HashMap;
use std::f64::consts::PI;

/// The most placed geometries and primitives that are looked through for emitting ones.
const MOST_PRIMITIVES: u64 = 1 << 24;

/// An emitting surface of which random points are sampled: a shape, or the triangles of a mesh with one material.
#[derive(Debug)]
pub(super) struct Emitter {
    sampler: SurfaceSampler,
    /// The transform from the sampler's space to the world's and back, which scales all directions alike.
    similarity: Option<Box<[Transform; 2]>>,
    two_sided: bool,
    /// The power, without textures.
    power: Rgb,
}

/// The emitters of a world, found by hits on them.
#[derive(Debug, Default)]
pub(super) struct Emitters {
    pub(super) all: Vec<Emitter>,
    /// The index of the emitter by the number of the instance and by the primitive, or by the material of meshes.
    index: HashMap<[u32; 2], u32>,
}

impl Emitters {
    /// The emitters of a world. Left out are surfaces that move, planes, and round shapes that a transform stretches:
    /// paths find their light by chance. So do paths with the light of materials that `is_taken` refuses.
    pub(super) fn new(world: &World, is_taken: impl Fn(u32) -> bool) -> Emitters {
        let mut emitters = Emitters::default();
        if !world.may_emit() {
            return emitters;
        }
        let mut left = MOST_PRIMITIVES;
        for number in 0..world.placed_geometry_count() {
            let placed = world.placed_geometry(number, 0.0);
            let Some(rest) = left.checked_sub(placed.primitives.len() as u64 + 1) else { break };
            left = rest;
            emitters.add(world, number, &placed, &is_taken);
        }
        emitters
    }

    fn add(&mut self, world: &World, number: u32, placed: &PlacedGeometry, is_taken: &impl Fn(u32) -> bool) {
        let emitting = |primitive: u32| {
            let material = world.material_of_primitive(number, primitive);
            (world.materials()[material as usize].may_emit() && is_taken(material)).then_some(material)
        };
        let end = world.placed_geometry(number, 1.0).to_world;
        if placed.to_world.as_ref().map(Transform::matrix) != end.as_ref().map(Transform::matrix) {
            return;
        }
        if let Primitives::Mesh(mesh) = placed.primitives {
            let mut parts: Vec<(u32, Vec<[Vec3; 3]>)> = Vec::new();
            for triangle in 0..mesh.len() {
                let Some(material) = emitting(triangle as u32) else { continue };
                let corners = world_corners(mesh.corners(triangle), placed.to_world.as_ref());
                match parts.iter_mut().find(|(of, _)| *of == material) {
                    Some((_, part)) => part.push(corners),
                    None => parts.push((material, vec![corners])),
                }
            }
            for (material, corners) in parts {
                let emitter =
                    Emitter::new(SurfaceSampler::triangles(corners), None, &world.materials()[material as usize]);
                self.push([number, material], emitter);
            }
            return;
        }
        for primitive in 0..placed.primitives.len() as u32 {
            let Some(material) = emitting(primitive) else { continue };
            let Some((shape, _)) = placed.primitives.shape(primitive) else { continue };
            let Some(sampler) = shape.sampler() else { continue };
            let similarity = match &placed.to_world {
                None => None,
                Some(t) if t.uniform_scale().is_some() => Some(Box::new([*t, t.inverse()])),
                Some(_) => continue,
            };
            self.push([number, primitive], Emitter::new(sampler, similarity, &world.materials()[material as usize]));
        }
    }

    fn push(&mut self, key: [u32; 2], emitter: Emitter) {
        if emitter.sampler.area() > 0.0 && emitter.sampler.area().is_finite() {
            self.index.insert(key, self.all.len() as u32);
            self.all.push(emitter);
        }
    }

    /// The index of the emitter that was hit.
    pub(super) fn of_hit(&self, world: &World, hit: &Hit) -> Option<u32> {
        if hit.instance == Hit::UNBOUNDED { None } else { self.of(world, hit.instance, hit.primitive) }
    }

    /// The index of the emitter that a primitive of an instance belongs to.
    fn of(&self, world: &World, instance: u32, primitive: u32) -> Option<u32> {
        if self.all.is_empty() {
            return None;
        }
        let part = if world.is_mesh(instance) { world.material_of_primitive(instance, primitive) } else { primitive };
        self.index.get(&[instance, part]).copied()
    }
}

/// The corners of a triangle in the world, counter-clockwise seen from its outer side.
fn world_corners(corners: [Vec3; 3], to_world: Option<&Transform>) -> [Vec3; 3] {
    let Some(t) = to_world else { return corners };
    let [a, b, c] = corners.map(|p| t.point(p.as_dvec3()).as_vec3());
    if t.matrix().matrix3.determinant() < 0.0 { [a, c, b] } else { [a, b, c] }
}

impl Emitter {
    fn new(sampler: SurfaceSampler, similarity: Option<Box<[Transform; 2]>>, material: &Material) -> Emitter {
        let scale = similarity.as_ref().and_then(|both| both[0].uniform_scale()).unwrap_or(1.0).abs();
        let sides = if material.two_sided { 2.0 } else { 1.0 };
        let own = material.phong().emission;
        // A texture alone gives the emission: its colours are at most about white.
        let radiance = if own.is_black() { Rgb::WHITE } else { own };
        let power = (radiance * (PI * sampler.area() * scale * scale * sides) as f32).saturated();
        Emitter { sampler, similarity, two_sided: material.two_sided, power }
    }

    /// The power that the surface emits.
    pub(super) fn power(&self) -> Rgb {
        self.power
    }

    /// The point at `u` of the unit square, as seen from `p`. None from behind, and edge-on.
    pub(super) fn sample_from(&self, p: DVec3, u: [f64; 2]) -> Option<DVec3> {
        let local = self.similarity.as_ref().map_or(p, |both| both[1].point(p));
        let sample = self.sampler.sample_from(local, u)?;
        if !self.two_sided && sample.normal.dot(local - sample.point) <= 0.0 {
            return None;
        }
        Some(self.similarity.as_ref().map_or(sample.point, |both| both[0].point(sample.point)))
    }

    /// The density per unit of solid angle at `p` with which [`Emitter::sample_from`] returns a point of the surface
    /// with this unit normal.
    pub(super) fn pdf_from(&self, p: DVec3, point: DVec3, normal: DVec3) -> f64 {
        let pdf = match self.similarity.as_deref() {
            None => self.sampler.pdf_from(p, point, normal),
            // Solid angles are those of the sampler's space, since it is similar.
            Some([_, to_local]) => {
                let normal = to_local.vector(normal).normalize();
                self.sampler.pdf_from(to_local.point(p), to_local.point(point), normal)
            }
        };
        if pdf.is_finite() { pdf } else { 0.0 }
    }
}
