//! Item buffers: which primitive is seen at each pixel (Weghorst, Hooper and Greenberg, *Improved Computational Methods
//! for Ray Tracing*, 1984). Hemicubes are made of five of them.

use super::coverage::{NOTHING, ScreenTriangle, Source};
use super::facets::{Tolerance, corners};
use super::projection::Projection;
use super::unshaded_view::{DrawnTile, UnshadedView};
use super::visible_triangle::VisibleTriangle;
use crate::sampler::Sampler;
use crate::shape::Shape;
use crate::world::{Hit, ObjectSurface, World};
use canaletto_bvh::Aabb;
use glam::DVec3;
use std::collections::BTreeMap;
use std::ops::ControlFlow;

/// The near plane's distance over that of the farthest corner of the world's bounds. Depths are as exact near the
/// viewer as far away, so that it only has to be more than 0.
const NEAREST: f64 = 1.0 / (1u64 << 40) as f64;

/// Planes are cut to a box of this size over the distance of the farthest corner of the world's bounds.
const PLANE_SIZE: f64 = 1024.0;

/// A triangle lies in the tangent plane if no corner is higher than this share of the largest coordinates: a few
/// roundings of `f32`.
const IN_TANGENT_PLANE: f64 = 1.0 / (1u32 << 20) as f64;

/// One side of a primitive of the world.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Item {
    /// [`Hit::instance`](crate::world::Hit::instance).
    pub(crate) instance: u32,
    /// [`Hit::primitive`](crate::world::Hit::primitive).
    pub(crate) primitive: u32,
    /// Whether the outer side is seen.
    pub(crate) is_front: bool,
}

/// A view from a point of a surface with a half angle of 45°.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ItemView<'a> {
    pub(crate) point: DVec3,
    /// The surface's unit normal. What lies in its tangent plane isn't seen.
    pub(crate) normal: DVec3,
    /// The unit directions to the right, upwards and forward.
    pub(crate) axes: [DVec3; 3],
    /// What is seen although it may cast no shadow. Nothing else without a shadow is seen.
    pub(crate) receiver: Option<&'a ObjectSurface>,
    /// The pixels along an edge of the whole square, an even number.
    pub(crate) side: u32,
    /// Whether only the upper half of the square is drawn.
    pub(crate) is_upper_half: bool,
    /// The tolerance of tessellations in pixels.
    pub(crate) tolerance: f64,
    /// The seed of the random numbers that decide about partial coverage.
    pub(crate) seed: u64,
}

impl ItemView<'_> {
    /// The sums over pixels of a weight, which is given for column and row from the lower left corner of what is drawn:
    /// for each item that is seen there, and for no item. Breaks if cancelled.
    pub(crate) fn sums(
        &self,
        world: &World,
        weight: &(dyn Fn(usize, usize) -> f64 + Sync),
        cancelled: &(dyn Fn() -> bool + Sync),
    ) -> ControlFlow<(), BTreeMap<Option<Item>, f64>> {
        let farthest = farthest(world, self.point);
        let half = self.side as i32 / 2;
        let (below, rows) = if self.is_upper_half { (half, half) } else { (0, 2 * half) };
        let near = farthest * NEAREST;
        let projection = Projection::square_along(self.axes, self.point, 1.0, self.side, near);
        let reach = (DVec3::splat(farthest * PLANE_SIZE)).as_vec3();
        let view = Aabb { min: self.point.as_vec3() - reach, max: self.point.as_vec3() + reach };
        let tolerance = Tolerance::around(self.point, self.tolerance, self.side, view);
        let is_there = |[x, y]: [f64; 2], source: Source| {
            // A material of partial coverage is a screen door: each pixel of each triangle is there or not.
            let pixel = [x as u32, y as u32];
            let index = source.primitive.wrapping_mul(0x9e37_79b1) ^ source.triangle;
            // In (0, 1], so that nothing is where the coverage is 0.
            (1.0 - Sampler::new(self.seed, 0, pixel).uniform(index, source.instance)) as f32
        };
        let view = UnshadedView {
            world,
            projection: &projection,
            tolerance: &tolerance,
            corner: [0, below],
            size: [2 * half, rows],
            compares_curves: true,
            with_unbounded: true,
            is_drawn: |_| true,
            is_seen: &|triangle| self.stops_light(world, triangle.source) && !self.is_in_tangent_plane(triangle),
            least_coverage: &is_there,
        };
        let tiles = view.draw(cancelled, |tile| self.sums_of(tile, below, weight))?;
        let mut sums = BTreeMap::new();
        for (item, sum) in tiles.into_iter().flatten() {
            *sums.entry(item).or_insert(0.0) += sum;
        }
        ControlFlow::Continue(sums)
    }

    /// Whether the primitive of a triangle casts a shadow, or belongs to the receiver.
    fn stops_light(&self, world: &World, Source { instance, primitive, .. }: Source) -> bool {
        let hit = Hit { t: 0.0, instance, primitive, part: 0, uv: [0.0; 2], time: 0.0 };
        world.casts_shadow(instance, primitive)
            || self.receiver.is_some_and(|receiver| receiver.ids().contains(world.object_id(&hit)))
    }

    /// Whether a triangle lies in the plane through the point across the normal. Rounding may lift it a little.
    fn is_in_tangent_plane(&self, triangle: &ScreenTriangle) -> bool {
        let half = f64::from(self.side / 2);
        let [right, up, forward] = self.axes;
        let corners = triangle.corners_in_pixels().map(|[x, y]| {
            let direction = forward + right * (x / half - 1.0) + up * (y / half - 1.0);
            direction / f64::from(triangle.depth(x, y))
        });
        let size = corners.iter().fold(self.point.abs().max_element(), |size, corner| size.max(corner.length()));
        corners.iter().all(|corner| corner.dot(self.normal) <= IN_TANGENT_PLANE * size)
    }

    /// The sums over one tile.
    fn sums_of(
        &self,
        tile: &mut DrawnTile,
        below: i32,
        weight: &(dyn Fn(usize, usize) -> f64 + Sync),
    ) -> Vec<(Option<Item>, f64)> {
        let (mut sums, mut nothing) = (vec![None; tile.triangles()], None);
        let [width, height] = tile.size.map(|n| n as usize);
        let [left, low] = [tile.corner[0] as usize, (tile.corner[1] - below) as usize];
        for row in 0..height {
            for column in 0..width {
                let number = tile.visibility.number(0, row * width + column);
                let sum = if number == NOTHING { &mut nothing } else { &mut sums[number as usize] };
                *sum.get_or_insert(0.0) += weight(left + column, low + row);
            }
        }
        let mut items: Vec<(Option<Item>, f64)> = nothing.map(|sum| (None, sum)).into_iter().collect();
        for (number, sum) in (0..).zip(sums) {
            let Some(sum) = sum else { continue };
            items.push((tile.triangle(number).map(|triangle| self.item(&triangle)), sum));
        }
        items
    }

    fn item(&self, triangle: &VisibleTriangle) -> Item {
        let Source { instance, primitive, .. } = triangle.source;
        let point = triangle.to_world.map_or(self.point, |t| t.inverse().point(self.point));
        let [a, b, c] = triangle.corners.map(|corner| corner.as_dvec3() - point);
        // The corners run counter-clockwise, seen from the outer side.
        Item { instance, primitive, is_front: a.dot(b.cross(c)) < 0.0 }
    }
}

/// The distance of the farthest corner of the world's bounds, and at least that of each plane.
fn farthest(world: &World, point: DVec3) -> f64 {
    let bounds = world.local_bounds();
    let corners = (!bounds.is_empty()).then(|| corners(&bounds)).into_iter().flatten();
    let planes = world.unbounded_shapes().filter_map(|shape| match shape {
        Shape::Plane(plane) => Some((point - plane.point.as_dvec3()).dot(plane.normal.as_dvec3()).abs()),
        _ => None,
    });
    corners.map(|corner| (corner - point).length()).chain(planes).fold(0.0, f64::max)
}
