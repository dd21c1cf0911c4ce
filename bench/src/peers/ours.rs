//! Our side of the comparison: everything that uses the hierarchy's interface is in this file.

use canaletto_bvh::{Nearest, Quality, Ray, Triangles};
use glam::Vec3;

use super::mesh::Mesh;
use super::rays::{Packet, Segment};
use super::trace::{Hits, Tracer};

/// A mesh in our hierarchy.
pub struct Ours {
    triangles: Triangles,
}

impl Ours {
    /// Builds it, on the current pool of threads.
    pub fn build(mesh: &Mesh, quality: Quality) -> Result<Self, String> {
        let triangles = Triangles::build_with(quality, mesh.triangles.len(), |id| mesh.corners(id as usize))
            .map_err(|e| e.to_string())?;
        Ok(Self { triangles })
    }

    /// Nodes and primitives that a random ray is expected to visit.
    pub fn expected_visits(&self) -> f64 {
        self.triangles.statistics().sah_cost
    }

    /// Memory of all that tracing needs.
    pub fn bytes(&self) -> usize {
        self.triangles.statistics().bytes
    }
}

/// Rays that are asked about at a time.
const CHUNK: usize = 1024;

impl Tracer for Ours {
    fn closest(&self, rays: &[Segment], _packets: &[Packet], coherent: bool, out: &mut Hits<'_>) {
        let (mut chunk_rays, mut nearest) = ([Ray::new(Vec3::ZERO, Vec3::ZERO); CHUNK], [Nearest::before(0.0); CHUNK]);
        for (number, rays) in rays.chunks(CHUNK).enumerate() {
            let (chunk_rays, nearest) = (&mut chunk_rays[..rays.len()], &mut nearest[..rays.len()]);
            for ((segment, own), nearest) in rays.iter().zip(&mut *chunk_rays).zip(&mut *nearest) {
                (own.origin, own.direction) = (segment.origin, segment.direction);
                *nearest = Nearest::before(segment.t_max);
            }
            if coherent {
                self.triangles.intersect_coherent(chunk_rays, nearest, false);
            } else {
                self.triangles.intersect_stream(chunk_rays, nearest, false);
            }
            for (i, hit) in nearest.iter().enumerate() {
                let i = number * CHUNK + i;
                (out.t[i], out.id[i], out.u[i], out.v[i]) = (hit.t, hit.id, hit.u, hit.v);
            }
        }
    }

    fn any(&self, rays: &[Segment], _packets: &[Packet], coherent: bool, out: &mut [u8]) {
        let (mut chunk_rays, mut t_max) = ([Ray::new(Vec3::ZERO, Vec3::ZERO); CHUNK], [0.0; CHUNK]);
        for (rays, out) in rays.chunks(CHUNK).zip(out.chunks_mut(CHUNK)) {
            let (chunk_rays, t_max) = (&mut chunk_rays[..rays.len()], &mut t_max[..rays.len()]);
            for ((segment, own), t_max) in rays.iter().zip(&mut *chunk_rays).zip(&mut *t_max) {
                (own.origin, own.direction) = (segment.origin, segment.direction);
                *t_max = segment.t_max;
            }
            if coherent {
                self.triangles.occluded_coherent(chunk_rays, t_max, false);
            } else {
                self.triangles.occluded_stream(chunk_rays, t_max, false);
            }
            for (out, t) in out.iter_mut().zip(t_max) {
                *out = u8::from(*t == f32::NEG_INFINITY);
            }
        }
    }
}
