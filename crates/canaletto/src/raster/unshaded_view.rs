//! A view that is drawn without shading: the depths of shadow maps, the primitives that hemicubes see.

use super::coverage::{ScreenTriangle, Sites, Source, VisibilityBuffer};
use super::facets::Tolerance;
use super::geometry::{BinnedTriangles, GeometryStage, Screen};
use super::projection::Projection;
use super::visible_triangle::{FacetCache, VisibleTriangle};
use crate::material::PreparedMaterial;
use crate::math::DRay;
use crate::world::World;
use canaletto_parallel::prelude::*;
use std::ops::ControlFlow;
use std::sync::atomic::AtomicUsize;

/// The side of the tiles in which views are drawn.
const TILE: i32 = 64;

/// A view of a world with one sample at the centre of each pixel.
pub(crate) struct UnshadedView<'a> {
    pub(crate) world: &'a World,
    pub(crate) projection: &'a Projection,
    pub(crate) tolerance: &'a Tolerance,
    /// The lower left pixel, and the size in pixels.
    pub(crate) corner: [i32; 2],
    pub(crate) size: [i32; 2],
    /// See [`GeometryStage::compares_curves`].
    pub(crate) compares_curves: bool,
    /// See [`GeometryStage::with_unbounded`].
    pub(crate) with_unbounded: bool,
    /// Whether a material is drawn.
    pub(crate) is_drawn: fn(&PreparedMaterial) -> bool,
    /// Whether a triangle is drawn.
    pub(crate) is_seen: &'a (dyn Fn(&ScreenTriangle) -> bool + Sync),
    /// The least coverage that counts as there, at a place in pixels of a triangle.
    pub(crate) least_coverage: &'a (dyn Fn([f64; 2], Source) -> f32 + Sync),
}

/// A tile of a drawn view.
pub(crate) struct DrawnTile<'a, 'w> {
    /// The lower left pixel, and the size in pixels.
    pub(crate) corner: [i32; 2],
    pub(crate) size: [i32; 2],
    pub(crate) visibility: &'a VisibilityBuffer,
    view: &'a UnshadedView<'w>,
    binned: &'a BinnedTriangles,
    cache: &'a mut FacetCache<'w>,
    number: usize,
}

impl DrawnTile<'_, '_> {
    /// The number of triangles that touch the tile.
    pub(crate) fn triangles(&self) -> usize {
        self.binned.tile(self.number).len()
    }

    /// The triangle of this number.
    pub(crate) fn triangle(&mut self, number: u32) -> Option<VisibleTriangle<'_>> {
        let UnshadedView { world, tolerance, .. } = self.view;
        let source = self.binned.get(self.number, number).source;
        self.cache.prepare(source, world, self.binned, tolerance);
        self.cache.triangle(source, world, self.binned)
    }
}

impl<'w> UnshadedView<'w> {
    /// Draws the view. `read` gets each tile, and its results are in the order of the tiles. Breaks if cancelled.
    pub(crate) fn draw<T: Send>(
        &self,
        cancelled: &(dyn Fn() -> bool + Sync),
        read: impl Fn(&mut DrawnTile) -> T + Sync,
    ) -> ControlFlow<(), Vec<T>> {
        let Self { world, projection, tolerance, .. } = *self;
        let sites = Sites::new([[0.5; 2]]);
        let screen = Screen { corner: self.corner, size: self.size, side: TILE, from_top: false };
        let stage = GeometryStage {
            world,
            projection,
            tolerance,
            screen,
            sites: &sites,
            compares_curves: self.compares_curves,
            with_unbounded: self.with_unbounded,
            traits: world.materials().iter().map(|m| [(self.is_drawn)(m), m.has_holes()]).collect(),
            kept_bytes: AtomicUsize::new(0),
        };
        let binned = stage.run(cancelled)?;
        let [across, rows] = screen.tiles();
        let draw = |cache: &mut FacetCache<'w>, number: usize| {
            let tile = number as i32;
            let offset = [tile % across * TILE, tile / across * TILE];
            let corner = [self.corner[0] + offset[0], self.corner[1] + offset[1]];
            let size = [0, 1].map(|axis: usize| TILE.min(self.size[axis] - offset[axis]));
            let mut visibility = VisibilityBuffer::default();
            visibility.reset(corner, size, &sites, f32::NEG_INFINITY);
            cache.clear();
            let triangles = (0..).zip(binned.tile(number)).filter(|(_, triangle)| (self.is_seen)(triangle));
            visibility.draw(triangles, &sites, |visibility, number, triangle| {
                let visible = cache.triangle_to_refine(triangle, world, &binned, tolerance);
                visibility.draw_refined(triangle, number, &sites, |place, depth| {
                    let Some(visible) = &visible else { return Some(depth) };
                    let line = projection.line(place);
                    let least_coverage = (self.least_coverage)(place, triangle.source);
                    let depth = refined_depth(triangle, visible, &line, depth, projection, world, least_coverage)?;
                    // A viewer on a curved surface doesn't see it where they are.
                    let t = projection.parameter_at(&line, depth.into());
                    (!triangle.is_curved || t > visible.rounding(&line)).then_some(depth)
                });
            });
            read(&mut DrawnTile { corner, size, visibility: &visibility, view: self, binned: &binned, cache, number })
        };
        let tiles = (across * rows) as usize;
        ControlFlow::Continue((0..tiles).into_par_iter().map_init(FacetCache::default, draw).collect())
    }
}

/// The depth of a triangle's surface on a line from the viewer, where its triangle has `depth`. None where less than
/// `least_coverage` of the surface is there, or where the surface lies in front of the near plane.
pub(crate) fn refined_depth(
    triangle: &ScreenTriangle,
    visible: &VisibleTriangle,
    line: &DRay,
    depth: f32,
    projection: &Projection,
    world: &World,
    least_coverage: f32,
) -> Option<f32> {
    if triangle.has_holes && visible.coverage(world, *line, &visible.hit(line)) < least_coverage {
        return None;
    }
    if !triangle.is_curved {
        return Some(depth);
    }
    let t = visible.surface_near(line, projection.parameter_at(line, depth.into()));
    let depth = projection.depth_at(line, t) as f32;
    (f64::from(depth) <= projection.near_depth()).then_some(depth)
}
