//! Rays through a million spheres and a million cylinders: Canaletto against Embree's spheres and cones.

use canaletto::shape::Cylinder;
use canaletto_bvh::{Aabb, PreparedRay, Primitive, PrimitiveBvh, PrimitiveHit, Ray, UserPrimitive, sphere};
use glam::Vec3;
use rayon::prelude::*;
use serde_json::{Value, json};

use super::embree::Part;
use super::rays::{self, RaySet, Run, Segment, View};
use super::stages::{COUNT, cylinder, sphere};
use super::trace::{Hits, Options, Tracer, hits, introduce, pool, rounds};
use crate::say;

/// One hierarchy for each cloud, as in worlds. Ids of cylinders follow those of spheres.
struct Ours {
    spheres: PrimitiveBvh,
    cylinders: PrimitiveBvh,
}

fn build() -> Result<Ours, String> {
    let grown = |rounds: Vec<(Aabb, Primitive)>| {
        let bounds: Vec<Aabb> = rounds.par_iter().map(|round| round.0).collect();
        PrimitiveBvh::build(&bounds, |id| rounds[id as usize].1).map_err(|e| e.to_string())
    };
    let ball = |i| {
        let (center, radius) = sphere(i);
        (sphere::bounds(center, radius), Primitive::Sphere { center, radius })
    };
    let stick = |i| {
        let (ends, radius) = cylinder(i);
        (closed(ends, radius).bounds(), Primitive::Cylinder { ends, radius })
    };
    Ok(Ours {
        spheres: grown((0..COUNT).into_par_iter().map(ball).collect())?,
        cylinders: grown((0..COUNT).into_par_iter().map(stick).collect())?,
    })
}

fn closed([base, top]: [Vec3; 2], radius: f32) -> Cylinder {
    Cylinder { base, top, radius, caps: true }
}

/// The exact kernel of cylinders, as worlds use it.
fn ask(UserPrimitive { ends, radius, .. }: UserPrimitive, ray: &PreparedRay, t_max: f32) -> Option<PrimitiveHit> {
    let cylinder = closed(ends, radius);
    let hit = cylinder.intersect(ray.ray(), t_max)?;
    let t = ray.clamp_to_box(&cylinder.bounds(), hit.t.into(), t_max)?;
    Some(PrimitiveHit { part: hit.part, ..PrimitiveHit::none(t) })
}

fn none(_: UserPrimitive, _: &PreparedRay, _: f32) -> Option<PrimitiveHit> {
    None
}

/// The number of rays in a query.
const CHUNK: usize = 256;

/// Stores the hits of spheres, which win ties.
fn keep(first: usize, nearest: &mut [PrimitiveHit], out: &mut Hits<'_>) {
    for (i, met) in nearest.iter_mut().enumerate() {
        let i = first + i;
        (out.t[i], out.id[i], out.u[i], out.v[i]) = (met.t, met.id, 0.0, 0.0);
        met.id = if met.id == PrimitiveHit::NONE { PrimitiveHit::NONE } else { 0 };
    }
}

/// Stores the hits of cylinders that are closer.
fn add(first: usize, nearest: &[PrimitiveHit], out: &mut Hits<'_>) {
    for (i, met) in nearest.iter().enumerate() {
        let i = first + i;
        if met.t < out.t[i] || out.id[i] == PrimitiveHit::NONE && met.id != PrimitiveHit::NONE {
            (out.t[i], out.id[i]) = (met.t, COUNT as u32 + met.id);
        }
    }
}

impl Tracer for Ours {
    fn closest(&self, Run { own, t_max, coherent, .. }: Run<'_>, out: &mut Hits<'_>) {
        let (mut prepared, mut nearest) = (Vec::with_capacity(CHUNK), Vec::with_capacity(CHUNK));
        for (chunk, (rays, t_max)) in own.chunks(CHUNK).zip(t_max.chunks(CHUNK)).enumerate() {
            nearest.clear();
            nearest.extend(t_max.iter().map(|&t_max| PrimitiveHit::none(t_max)));
            if coherent {
                self.spheres.intersect_coherent(rays, &mut nearest, &none);
                keep(chunk * CHUNK, &mut nearest, out);
                self.cylinders.intersect_coherent(rays, &mut nearest, &ask);
            } else {
                prepare(rays, &mut prepared);
                self.spheres.intersect_stream(&prepared, &mut nearest, &none);
                keep(chunk * CHUNK, &mut nearest, out);
                self.cylinders.intersect_stream(&prepared, &mut nearest, &ask);
            }
            add(chunk * CHUNK, &nearest, out);
        }
    }

    fn any(&self, Run { own, t_max, coherent, .. }: Run<'_>, out: &mut [u8]) {
        let (mut prepared, mut ends) = (Vec::with_capacity(CHUNK), Vec::with_capacity(CHUNK));
        for ((rays, t_max), out) in own.chunks(CHUNK).zip(t_max.chunks(CHUNK)).zip(out.chunks_mut(CHUNK)) {
            ends.clear();
            ends.extend_from_slice(t_max);
            if coherent {
                self.spheres.occluded_coherent(rays, &mut ends, &none);
                self.cylinders.occluded_coherent(rays, &mut ends, &ask);
            } else {
                prepare(rays, &mut prepared);
                self.spheres.occluded_stream(&prepared, &mut ends, &none);
                self.cylinders.occluded_stream(&prepared, &mut ends, &ask);
            }
            for (out, t) in out.iter_mut().zip(&ends) {
                *out = u8::from(*t == f32::NEG_INFINITY);
            }
        }
    }
}

fn prepare(rays: &[Ray], prepared: &mut Vec<PreparedRay>) {
    prepared.clear();
    prepared.extend(rays.iter().map(Ray::prepare));
}

/// An equal ray with a direction of length 1.
fn unit(segment: &Segment) -> Segment {
    let length = segment.direction.length();
    Segment { t_max: segment.t_max * length, direction: segment.direction / length, ..*segment }
}

/// The view of the scene of `pictures`.
const VIEW: View = View {
    eye: Vec3::new(70.0, -80.0, 60.0),
    target: Vec3::new(0.0, 0.0, -4.0),
    fovy: 40.0,
    light: Vec3::new(-40.0, 30.0, 90.0),
    extent: 45.0,
};

/// The normal of a sphere or of a cylinder's side at a point. It is accurate enough for a cylinder's ends.
fn normal(id: u32, point: Vec3) -> Vec3 {
    let id = u64::from(id);
    if id < COUNT {
        return point - sphere(id).0;
    }
    let ([base, top], _) = cylinder(id - COUNT);
    let axis = (top - base).normalize();
    let out = point - base;
    out - axis * out.dot(axis)
}

/// Compares, prints, and returns everything as JSON.
pub fn run(options: &Options) -> Result<Value, String> {
    let embree = introduce(options);
    let parts = [
        Part::Spheres((0..COUNT).map(sphere).map(|(center, r)| center.extend(r).to_array()).collect()),
        Part::cylinders((0..COUNT).map(cylinder)),
    ];
    let everyone = pool(options.threads.iter().copied().max().unwrap_or(1))?;
    let ours = everyone.install(build)?;
    let scene = embree.as_ref().map(|embree| embree.build(&parts, options.settings)).transpose()?;
    let sets = |name: &str| match options.sets.as_slice() {
        [] => ["primary", "shadow", "ao"].contains(&name),
        named => named.iter().any(|s| s == name),
    };
    let mut sets = everyone.install(|| rays::make(&VIEW, options.size, sets, normal, |rays| hits(&ours, rays)));
    // Embree intersects cones in wrong places for directions of a length other than 1.
    for set in &mut sets {
        *set = RaySet::new(set.name, set.any, set.coherent, set.rays.iter().map(unit).collect());
    }
    let ours_mib = (ours.spheres.statistics().bytes + ours.cylinders.statistics().bytes) >> 20;
    let theirs = scene.as_ref().map_or("-".into(), |scene| (scene.bytes >> 20).to_string());
    say!("{COUNT} spheres and {COUNT} cylinders; {ours_mib} MiB, Embree {theirs} MiB beside the shared buffers");
    let rows = rounds("clouds", VIEW.extent, &sets, &ours, scene.as_ref(), options.into())?;
    Ok(json!({ "what": "clouds", "embree": embree.as_ref().map(|e| e.version()), "size": options.size,
        "rounds": options.rounds, "clock": format!("{:?}", options.clock), "rows": rows }))
}
