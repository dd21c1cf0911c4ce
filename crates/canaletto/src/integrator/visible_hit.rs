//! The first surface that a ray sees: past holes, and past hidden surfaces of clear bodies.

use super::Probe;
use super::media::{self, Boundary, Media};
use crate::material::{MaterialPoint, reflect};
use crate::math::{DRay, RayDifferential, Rgb, offset_origin};
use crate::shape::Surface;
use crate::world::{Hit, MAX_STALLED, World, touching};
use canaletto_bvh::Ray;
use glam::{DMat3, DVec3, Vec3};

/// The most holes that a ray passes. After that many, the next hole counts as a surface.
const MAX_HOLES: usize = 1 << 16;

/// The directions and points at an interaction. Normals and directions have unit length.
#[derive(Clone, Copy)]
pub(in crate::integrator) struct Frame {
    /// Whether the ray hit the outer side.
    pub(in crate::integrator) outside: bool,
    /// v̂, the direction back along the ray.
    pub(in crate::integrator) wo: DVec3,
    /// The geometric normal on the outer side.
    pub(in crate::integrator) outer: DVec3,
    /// The geometric normal on the viewer's side.
    pub(in crate::integrator) facing: DVec3,
    /// n, the shading normal on the viewer's side.
    pub(in crate::integrator) normal: DVec3,
    /// r, the mirrored direction (5.37).
    pub(in crate::integrator) mirrored: DVec3,
    /// The point before rounding.
    pub(in crate::integrator) exact: DVec3,
    /// The point and its error bound.
    pub(in crate::integrator) point: Vec3,
    pub(in crate::integrator) error: Vec3,
    /// The origin of shadow rays.
    pub(in crate::integrator) start: Vec3,
}

impl Frame {
    /// The frame of a ray in this direction that hits a surface.
    #[inline(always)]
    pub(in crate::integrator) fn new(direction: DVec3, surface: &Surface) -> Frame {
        let Surface { point, exact, error, normal: outer, shading_normal, shadow_origin, .. } = *surface;
        let outside = direction.dot(outer) < 0.0;
        let side = if outside { 1.0 } else { -1.0 };
        let (wo, facing, normal) = (-direction.normalize(), outer * side, shading_normal * side);
        let start = offset_origin(if outside { shadow_origin } else { point }, error, facing, facing);
        Frame { outside, wo, outer, facing, normal, mirrored: reflect(wo, normal), exact, point, error, start }
    }

    /// The `f64` ray that leaves the surface in a direction.
    #[inline]
    pub(in crate::integrator) fn leave(&self, direction: DVec3) -> DRay {
        DRay { origin: self.exact, direction }
    }

    /// The rounded ray of `line`, its origin moved off the surface by the error bound.
    #[inline]
    pub(in crate::integrator) fn rounded(&self, line: &DRay) -> Ray {
        line.from_origin(offset_origin(self.point, self.error, self.outer, line.direction))
    }
}

/// The first surface that a ray sees, past holes and past surfaces that another body hides.
pub(in crate::integrator) struct VisibleHit {
    pub(in crate::integrator) hit: Hit,
    pub(in crate::integrator) surface: Surface,
    pub(in crate::integrator) material: MaterialPoint,
    /// The ray's line, whose origin moves to each hole that it passes.
    pub(in crate::integrator) line: DRay,
    pub(in crate::integrator) footprint: Option<Footprint>,
    /// The bodies that the ray is in at the hit.
    pub(in crate::integrator) inside: u32,
    pub(in crate::integrator) crossing: u32,
}

/// A hit and the bodies that its ray is in: what a ray that goes on from there asks for.
#[derive(Clone, Copy)]
pub(in crate::integrator) struct HitInside {
    pub(in crate::integrator) hit: Hit,
    pub(in crate::integrator) inside: u32,
    pub(in crate::integrator) crossing: u32,
}

impl VisibleHit {
    pub(in crate::integrator) fn hit_inside(&self) -> HitInside {
        HitInside { hit: self.hit, inside: self.inside, crossing: self.crossing }
    }
}

/// The differential of the arriving ray, and its effect at the surface.
#[derive(Clone, Copy)]
pub(in crate::integrator) struct Footprint {
    /// The differential of the arriving ray.
    pub(in crate::integrator) differential: RayDifferential,
    /// The offsets along the surface to the hits of the neighbouring rays.
    pub(in crate::integrator) step: [DVec3; 2],
    /// The derivative of the shading normal along the surface; zero where nothing needs it.
    pub(in crate::integrator) shape_operator: DMat3,
}

impl Footprint {
    pub(in crate::integrator) fn new(
        differential: Option<&RayDifferential>,
        line: &DRay,
        surface: &Surface,
    ) -> Option<Footprint> {
        differential.map(|differential| Footprint {
            differential: *differential,
            step: differential.along(line, surface.exact, surface.normal),
            shape_operator: DMat3::ZERO,
        })
    }
}

/// The colour of the environment, or of the background without one.
#[inline]
pub(in crate::integrator) fn background<P: Probe + ?Sized>(
    world: &World,
    direction: DVec3,
    differential: Option<&RayDifferential>,
    probe: &mut P,
) -> Rgb {
    let Some(environment) = &world.environment else { return world.background };
    let lookup = environment.lookup(direction, differential.map_or([DVec3::ZERO; 2], |d| d.direction));
    probe.environment_lookup(&lookup);
    lookup.radiance
}

/// The first visible surface of a ray: past holes, and past surfaces of clear bodies that another body hides. `inside`
/// are the bodies that the ray starts in. `first_crossing` is the coinciding surface at the ray's origin that comes
/// before `found`.
#[inline(never)]
pub(in crate::integrator) fn visible_hit<P: Probe + ?Sized>(
    world: &World,
    media: &mut Media,
    (mut line, mut ray, mut found, differential): (DRay, Ray, Option<Hit>, Option<&RayDifferential>),
    [mut inside, mut first_crossing]: [u32; 2],
    time: f32,
    probe: &mut P,
) -> Option<VisibleHit> {
    let mut differential = differential.copied();
    let mut stalled = 0;
    for passed in 0.. {
        let mut crossing = first_crossing;
        // A coinciding surface at the origin has t = 0.
        let mut hit = media.crossing(first_crossing).map(|crossing| Hit { t: 0.0, ..crossing.hit }).or(found)?;
        let material = world.material(&hit);
        let mut known = None;
        if first_crossing == media::NONE && world.has_clear() && (inside != media::NONE || !material.is_opaque()) {
            let surface = world.surface_without_uv(line, &hit);
            match media.boundary(world, (&line, &ray), (&hit, &surface), &mut inside, &mut |hit| probe.hidden(hit)) {
                Boundary::Plain => known = Some(surface),
                Boundary::At(first) => {
                    crossing = first;
                    let first = media.crossing(first).map_or(hit, |crossing| crossing.hit);
                    known = (first == hit).then_some(surface);
                    hit = first;
                }
                Boundary::Hidden(beyond) if passed < MAX_HOLES && stalled <= MAX_STALLED => {
                    inside = beyond;
                    let step =
                        differential.map(|differential| differential.along(&line, surface.exact, surface.normal));
                    differential = differential.zip(step).map(|(differential, step)| differential.passed(step));
                    line.origin = surface.exact;
                    let origin = offset_origin(surface.point, touching(&surface), surface.normal, line.direction);
                    stalled = if advances(&ray, origin) { 0 } else { stalled + 1 };
                    ray = line.from_origin(origin);
                    found = world.intersect_at(&ray, f32::INFINITY, time);
                    continue;
                }
                Boundary::Hidden(_) => {}
            }
        }
        let material = world.material(&hit);
        // Only probes use these texture coordinates. Textures use those of the object.
        let mut surface = match known {
            Some(surface) if !probe.is_active() => surface,
            _ if !probe.is_active() => world.surface_without_uv(line, &hit),
            _ => world.surface(line, &hit),
        };
        let (next, touches) = media.crossing(crossing).map_or((media::NONE, false), |c| (c.next, c.touches));
        if touches {
            surface.error = touching(&surface);
        }
        let footprint = Footprint::new(differential.as_ref(), &line, &surface);
        let step = footprint.map(|f| f.step);
        let material = world.material_point(material, (line, &hit), &mut surface, step, probe);
        if material.coverage > 0.0 || passed >= MAX_HOLES || stalled > MAX_STALLED {
            let footprint = footprint.map(|footprint| {
                if !material.is_mirror() && !material.is_clear() {
                    return footprint;
                }
                let side = if line.direction.dot(surface.normal) < 0.0 { 1.0 } else { -1.0 };
                let shape_operator = world.surface_differential(line, &hit).shape_operator * side;
                Footprint { shape_operator, ..footprint }
            });
            return Some(VisibleHit { hit, surface, material, line, footprint, inside, crossing });
        }
        probe.hole(&hit);
        inside = media.crossing(crossing).map_or(inside, |crossing| crossing.beyond);
        first_crossing = next;
        line.origin = surface.exact;
        differential = footprint.map(|f| f.differential.passed(f.step));
        if first_crossing == media::NONE {
            let origin = offset_origin(surface.point, surface.error, surface.normal, line.direction);
            stalled = if advances(&ray, origin) { 0 } else { stalled + 1 };
            ray = line.from_origin(origin);
            found = world.intersect_at(&ray, f32::INFINITY, time);
        }
    }
    None
}

/// Whether an origin lies farther along a ray than the ray's own. A surface that is flatter than roundings sends rays
/// back to where they came from, and would be hit again and again.
fn advances(ray: &Ray, origin: Vec3) -> bool {
    (origin - ray.origin).dot(ray.direction) > 0.0
}
