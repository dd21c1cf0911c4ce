//! Form factors from a point to all that it sees, by a hemicube (Cohen and Greenberg, *The Hemi-Cube: A Radiosity
//! Solution for Complex Environments*, 1985).
//!
//! The upper half of a cube stands on the surface, around the point. The rasteriser draws the scene on its top face and
//! on the upper halves of its side faces. Each pixel then adds its delta form factor to what is seen there.

use super::delta_factors::DeltaFactors;
use crate::raster::item_buffer::{Item, ItemView};
use crate::world::{Hit, ObjectSurface, World};
use canaletto_bvh::{NoThreads, with_stack};
use glam::DVec3;
use std::collections::BTreeMap;
use std::ops::ControlFlow;

/// The settings of a hemicube.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HemicubeSettings {
    /// The pixels along an edge of the top face, an even number from 2 to [`HemicubeSettings::MAX_RESOLUTION`]. Others
    /// are moved to the nearest one that is larger, or to the largest.
    pub resolution: u32,
    /// The angle in radians by which the cube is turned around the normal.
    pub turn: f64,
    /// The largest distance in pixels of the triangles that stand for curved surfaces.
    pub tolerance: f64,
    /// The seed of the random numbers that decide where a surface of partial coverage is there.
    pub seed: u64,
}

impl HemicubeSettings {
    /// The largest resolution.
    pub const MAX_RESOLUTION: u32 = 4096;

    /// The resolution that is drawn.
    pub(super) fn side(&self) -> u32 {
        self.resolution.clamp(2, HemicubeSettings::MAX_RESOLUTION).next_multiple_of(2)
    }
}

impl Default for HemicubeSettings {
    fn default() -> HemicubeSettings {
        HemicubeSettings { resolution: 256, turn: 0.0, tolerance: 0.5, seed: 0 }
    }
}

/// The form factor from a point to one side of a primitive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrimitiveFormFactor {
    /// [`Hit::instance`].
    pub instance: u32,
    /// [`Hit::primitive`].
    pub primitive: u32,
    /// The number of the object; see [`World::object_id`].
    pub object: u32,
    /// Whether the outer side is seen.
    pub is_front: bool,
    /// The form factor, > 0.
    pub factor: f64,
}

/// What a hemicube sees.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct HemicubeFormFactors {
    /// The form factors to all sides of primitives that are seen, in the order of instances and primitives.
    pub primitives: Vec<PrimitiveFormFactor>,
    /// The share of the light that meets nothing.
    pub sky: f64,
}

impl HemicubeFormFactors {
    /// The form factors to all objects that are seen, by number, both sides together.
    pub fn objects(&self) -> BTreeMap<u32, f64> {
        let mut objects = BTreeMap::new();
        for PrimitiveFormFactor { object, factor, .. } in &self.primitives {
            *objects.entry(*object).or_insert(0.0) += factor;
        }
        objects
    }
}

/// The form factors from a differential patch to all that it sees. `point` is in the world's coordinates, and `normal`
/// has the length 1. The factors and the sky sum to 1, up to rounding.
///
/// All surfaces are opaque, but holes are open: a surface of partial coverage takes this share of the pixels. What
/// casts no shadow and what lies in the patch's own plane is not seen. The world is as it is when the shutter opens. An
/// object that covers few pixels has a factor with a large relative error, and one that covers no pixel's centre has
/// none.
///
/// # Errors
/// [`NoThreads`] if threads with a larger stack are needed and can't be started.
pub fn hemicube(
    world: &World,
    point: DVec3,
    normal: DVec3,
    settings: &HemicubeSettings,
) -> Result<HemicubeFormFactors, NoThreads> {
    let delta = DeltaFactors::new(settings.side());
    with_stack(super::sampled::stack(world), || match draw(world, [point, normal], None, settings, &delta, &|| false) {
        ControlFlow::Continue(factors) => factors,
        ControlFlow::Break(()) => unreachable!("nothing cancels it"),
    })
}

/// [`hemicube`] with the delta form factors of its resolution. The receiver is seen, too, if it casts no shadow. Breaks
/// if cancelled.
pub(super) fn draw(
    world: &World,
    [point, normal]: [DVec3; 2],
    receiver: Option<&ObjectSurface>,
    settings: &HemicubeSettings,
    delta: &DeltaFactors,
    cancelled: &(dyn Fn() -> bool + Sync),
) -> ControlFlow<(), HemicubeFormFactors> {
    let (x, y) = normal.any_orthonormal_pair();
    let (sin, cos) = (libm::sin(settings.turn), libm::cos(settings.turn));
    let (x, y) = (x * cos + y * sin, y * cos - x * sin);
    let mut sums: BTreeMap<Option<Item>, f64> = BTreeMap::new();
    for (face, forward) in [normal, x, y, -x, -y].into_iter().enumerate() {
        let is_top = face == 0;
        let up = if is_top { y } else { normal };
        let view = ItemView {
            point,
            normal,
            axes: [forward.cross(up), up, forward],
            side: settings.side(),
            receiver,
            is_upper_half: !is_top,
            tolerance: settings.tolerance,
            seed: settings.seed.wrapping_mul(5).wrapping_add(face as u64),
        };
        let weight = |column: usize, row: usize| if is_top { delta.top(column, row) } else { delta.flank(column, row) };
        for (item, sum) in view.sums(world, &weight, cancelled)? {
            *sums.entry(item).or_insert(0.0) += sum;
        }
    }
    let sky = sums.remove(&None).unwrap_or(0.0);
    let primitive = |(item, factor): (Option<Item>, f64)| {
        let Item { instance, primitive, is_front } = item?;
        let hit = Hit { t: 0.0, instance, primitive, part: 0, uv: [0.0; 2], time: 0.0 };
        Some(PrimitiveFormFactor { instance, primitive, object: world.object_id(&hit), is_front, factor })
    };
    ControlFlow::Continue(HemicubeFormFactors { primitives: sums.into_iter().filter_map(primitive).collect(), sky })
}

#[cfg(test)]
mod tests;
