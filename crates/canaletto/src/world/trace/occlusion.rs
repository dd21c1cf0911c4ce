//! What lies between the ends of a shadow ray.

use crate::world::data::instance::NONE;

/// What lies between a ray's origin and its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Occlusion {
    /// No surface.
    Nothing,
    /// At least one surface that lets light through, and nothing opaque.
    Clear,
    /// At least one opaque surface.
    Opaque,
}

impl Occlusion {
    pub(in crate::world) fn of(blocked: bool, clear: bool) -> Occlusion {
        match (blocked, clear) {
            (true, _) => Occlusion::Opaque,
            (false, true) => Occlusion::Clear,
            (false, false) => Occlusion::Nothing,
        }
    }
}

/// The last opaque occluder of a light. It is a hint and changes no result.
#[derive(Clone, Copy, Debug)]
pub struct OccluderCache {
    pub(in crate::world) instance: u32,
    /// The slot of the primitive, in leaf order.
    pub(in crate::world) slot: u32,
}

impl OccluderCache {
    /// No occluder.
    pub const NONE: OccluderCache = OccluderCache { instance: NONE, slot: NONE };

    /// The cached slot if it belongs to this instance. Otherwise the cache becomes empty and belongs to this instance.
    pub(in crate::world) fn slot_in(&mut self, instance: u32) -> &mut u32 {
        if self.instance != instance {
            *self = OccluderCache { instance, slot: NONE };
        }
        &mut self.slot
    }
}
