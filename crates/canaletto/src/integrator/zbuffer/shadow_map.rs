//! Shadow maps: the depths that a light sees (Williams, *Casting Curved Shadows on Curved Surfaces*, 1978).
//!
//! A point is in shadow where its map holds a nearer surface. Depths are compared at the centres of texels, with the
//! depth that the point's tangent plane has there. Only what differs by more than a texel's width counts as nearer. The
//! mean of four texels is weighted by the distances to their centres (Reeves, Salesin and Cook, *Rendering Antialiased
//! Shadows with Depth Maps*, 1987).
//!
//! Shapes without bounds are in no map. A shadow ray is tested with each of them.

use crate::integrator::shading::ShadowLookup;
use crate::light::{LightKind, PreparedLight};
use crate::material::PreparedMaterial;
use crate::raster::facets::{Tolerance, corners};
use crate::raster::projection::{Projection, depth_plane};
use crate::raster::unshaded_view::UnshadedView;
use crate::world::{Hit, World};
use canaletto_bvh::Ray;
use glam::{DVec3, Vec3};
use std::ops::ControlFlow;

/// The nearest and the farthest depth of a map have at most this ratio.
const NEAREST: f64 = 1.0 / (1u32 << 20) as f64;

/// A map in one direction.
struct ShadowMap {
    projection: Projection,
    side: i32,
    /// The depths in rows from below.
    depths: Vec<f32>,
}

/// The maps of all lights.
pub(super) struct ShadowMaps<'w> {
    world: &'w World,
    /// For each light its maps; none if it casts no shadows.
    lights: Vec<Vec<ShadowMap>>,
    /// The numbers of the shapes without bounds that cast shadows.
    unbounded: Vec<u32>,
}

/// Whether a surface blocks light, as far as a map can tell.
fn casts_shadows(material: &PreparedMaterial) -> bool {
    material.plain().classic.opacity >= 0.5
}

impl<'w> ShadowMaps<'w> {
    /// The bytes of all maps, if each has this side.
    pub(super) fn bytes(world: &World, side: u32) -> u64 {
        let maps: usize = world.lights.iter().map(|light| projections(world, light, side).len()).sum();
        maps as u64 * u64::from(side) * u64::from(side) * size_of::<f32>() as u64
    }

    /// Draws the maps. Breaks if cancelled.
    pub(super) fn draw(
        world: &'w World,
        side: u32,
        cancelled: &(dyn Fn() -> bool + Sync),
    ) -> ControlFlow<(), ShadowMaps<'w>> {
        let mut lights = Vec::new();
        for light in &world.lights {
            let mut maps = Vec::new();
            for (projection, tolerance) in projections(world, light, side) {
                let depths = draw(world, &projection, &tolerance, side as i32, cancelled)?;
                maps.push(ShadowMap { projection, side: side as i32, depths });
            }
            lights.push(maps);
        }
        // What a map would leave out casts no shadow without bounds either, such as a medium without a surface.
        let blocks = |&number: &u32| {
            let hit = Hit { instance: Hit::UNBOUNDED, primitive: number, t: 0.0, part: 0, uv: [0.0; 2], time: 0.0 };
            world.casts_shadow(Hit::UNBOUNDED, number) && casts_shadows(world.material(&hit))
        };
        let unbounded = (0..world.unbounded_shapes().count() as u32).filter(blocks).collect();
        ControlFlow::Continue(ShadowMaps { world, lights, unbounded })
    }
}

/// The projections of a light's maps, and the tolerance of their triangles: less than the width of a texel, so that no
/// surface is in the shadow of its own triangles.
fn projections(world: &World, light: &PreparedLight, side: u32) -> Vec<(Projection, Tolerance)> {
    let bounds = world.local_bounds();
    if !light.light.shadows || bounds.is_empty() {
        return Vec::new();
    }
    let center = (bounds.min.as_dvec3() + bounds.max.as_dvec3()) * 0.5;
    let radius = (bounds.max.as_dvec3() - bounds.min.as_dvec3()).length() * 0.5;
    let Some([low, high]) = light.bounds().map(|b| b.bounds) else {
        let towards = light.illuminate(0, center).direction;
        let tolerance = Tolerance::parallel(radius / f64::from(side));
        return vec![(Projection::parallel(center, radius, -towards, side), tolerance)];
    };
    let position = (low + high) * 0.5;
    let farthest = corners(&bounds).map(|p| (p - position).length()).fold(0.0, f64::max);
    let near = farthest * NEAREST;
    if near.is_nan() || near <= 0.0 {
        return Vec::new();
    }
    let tolerance = |tangent: f64| Tolerance::around(position, tangent, side, bounds);
    if let LightKind::Spot(spot) = &light.light.kind {
        let axis = (spot.target.as_dvec3() - spot.position.as_dvec3()).normalize();
        // A margin for the texels around the edge of the cone.
        let tangent = 1.02 * libm::tan(f64::from(spot.outer()).to_radians());
        if tangent > 0.0 && tangent <= 1.0 && axis.is_finite() {
            let tolerance = tolerance(tangent);
            return vec![(Projection::square(position, axis, tangent, side, near), tolerance)];
        }
    }
    let axes = [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z];
    axes.map(|axis| (Projection::square(position, axis, 1.0, side, near), tolerance(1.0))).to_vec()
}

/// The depths of one map.
fn draw(
    world: &World,
    projection: &Projection,
    tolerance: &Tolerance,
    side: i32,
    cancelled: &(dyn Fn() -> bool + Sync),
) -> ControlFlow<(), Vec<f32>> {
    let view = UnshadedView {
        world,
        projection,
        tolerance,
        corner: [0; 2],
        size: [side; 2],
        compares_curves: false,
        with_unbounded: false,
        is_drawn: casts_shadows,
        is_seen: &|triangle| world.casts_shadow(triangle.source.instance, triangle.source.primitive),
        least_coverage: &|_, _| 0.5,
    };
    let tiles = view.draw(cancelled, |tile| (tile.corner, tile.size, tile.visibility.depths().to_vec()))?;
    let mut depths = vec![f32::NEG_INFINITY; side as usize * side as usize];
    for ([x, y], [width, _], values) in tiles {
        for (row, values) in values.chunks(width as usize).enumerate() {
            let start = (y as usize + row) * side as usize + x as usize;
            depths[start..start + width as usize].copy_from_slice(values);
        }
    }
    ControlFlow::Continue(depths)
}

impl ShadowMap {
    /// The share of light that reaches a point with this unit geometric normal, if the map covers the point.
    fn passed(&self, point: DVec3, normal: DVec3) -> Option<f32> {
        let at = self.projection.point(point);
        if at.z <= 0.0 {
            return None;
        }
        let (x, y) = (at.x / at.z, at.y / at.z);
        let side = f64::from(self.side);
        if !(0.0..side).contains(&x) || !(0.0..side).contains(&y) {
            return None;
        }
        // The width of a texel at the point's depth.
        let texel = at.z / self.projection.scale();
        let (u, v) = normal.any_orthonormal_pair();
        let neighbours = [point, point + u * texel, point + v * texel].map(|p| self.projection.point(p));
        let own = at.w / at.z;
        let [farthest, nearest] = self.projection.depths_around(own, texel * side * 0.5);
        let (plane, _) = depth_plane(&neighbours);
        let [left, below] = [x, y].map(|v| (v - 0.5).floor());
        let (fx, fy) = (x - 0.5 - left, y - 0.5 - below);
        let mut passed = 0.0;
        for (i, j) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let weight = (if i == 0 { 1.0 - fx } else { fx }) * (if j == 0 { 1.0 - fy } else { fy });
            let [column, row] = [left + f64::from(i), below + f64::from(j)];
            let [cx, cy] = [column, row].map(|v| v.clamp(0.0, side - 1.0));
            let depth = self.depths[cy as usize * self.side as usize + cx as usize];
            let tangent = plane.x * (cx + 0.5) + plane.y * (cy + 0.5) + plane.z;
            // Where the plane is seen edge on, its depth at the texel says nothing about the point.
            let receiver = if tangent.is_finite() { tangent.max(farthest).min(nearest) } else { own };
            if f64::from(depth) <= self.projection.nearer(receiver, texel) {
                passed += weight;
            }
        }
        Some(passed as f32)
    }
}

impl ShadowLookup for ShadowMaps<'_> {
    fn passed(&self, light: u32, [start, to]: [Vec3; 2], t_max: f32, point: DVec3, normal: DVec3) -> f32 {
        let ray = Ray::new(start, to);
        let blocks = |&number: &u32| self.world.unbounded_shape(number).intersect(&ray, t_max).is_some();
        if self.unbounded.iter().any(blocks) {
            return 0.0;
        }
        let maps = &self.lights[light as usize];
        maps.iter().find_map(|map| map.passed(point, normal)).unwrap_or(1.0)
    }
}
