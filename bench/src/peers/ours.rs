//! Our side of the comparison: everything that uses the hierarchy's interface is in this file.

use canaletto_bvh::triangle::{self, Triangle};
use canaletto_bvh::{Aabb, Bvh, Ray};

use super::mesh::Mesh;
use super::rays::{Packet, Segment};
use super::trace::{Hits, Tracer};

/// A mesh in our hierarchy.
pub struct Ours {
    bvh: Bvh,
    slots: Vec<Triangle>,
}

impl Ours {
    /// Builds it, on the current pool of threads.
    pub fn build(mesh: &Mesh) -> Result<Self, String> {
        use rayon::prelude::*;
        let bounds: Vec<Aabb> =
            (0..mesh.triangles.len()).into_par_iter().map(|i| Aabb::from_points(mesh.corners(i))).collect();
        let bvh = Bvh::build(&bounds).map_err(|e| e.to_string())?;
        let slots = bvh.order().par_iter().map(|&id| Triangle::new(mesh.corners(id as usize))).collect();
        Ok(Self { bvh, slots })
    }

    /// Memory of all that tracing needs.
    pub fn bytes(&self) -> usize {
        self.bvh.statistics().bytes + size_of_val(&*self.slots)
    }
}

impl Tracer for Ours {
    fn closest(&self, rays: &[Segment], _packets: &[Packet], _coherent: bool, out: &mut Hits<'_>) {
        for (i, segment) in rays.iter().enumerate() {
            let ray = Ray::new(segment.origin, segment.direction).prepare();
            let mut nearest = (segment.t_max, u32::MAX, 0.0, 0.0);
            self.bvh.intersect(&ray, segment.t_max, |leaf, t_max| {
                for slot in leaf {
                    if let Some(hit) = triangle::intersect(&ray, &self.slots[slot as usize], *t_max) {
                        let id = self.bvh.order()[slot as usize];
                        if hit.t < nearest.0 || id < nearest.1 {
                            *t_max = hit.t;
                            nearest = (hit.t, id, hit.u, hit.v);
                        }
                    }
                }
            });
            (out.t[i], out.id[i], out.u[i], out.v[i]) = nearest;
        }
    }

    fn any(&self, rays: &[Segment], _packets: &[Packet], _coherent: bool, out: &mut [u8]) {
        for (segment, out) in rays.iter().zip(out) {
            let ray = Ray::new(segment.origin, segment.direction).prepare();
            *out = u8::from(self.bvh.occluded(&ray, segment.t_max, |mut leaf| {
                leaf.any(|slot| triangle::intersect(&ray, &self.slots[slot as usize], segment.t_max).is_some())
            }));
        }
    }
}
