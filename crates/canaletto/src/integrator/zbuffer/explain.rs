//! The explanation of a pixel: the triangles that cover it, and the test of their depths.

use super::{DrawnSamples, PixelPart, Zbuffer, ZbufferWorker};
use super::{background, differential, draws_sample_by_sample, refine};
use crate::film::WeightedSum;
use crate::integrator::{Probe, RayKind};
use crate::math::Rgb;
use crate::raster::coverage::ScreenTriangle;
use crate::raster::visible_triangle::VisibleTriangle;
use serde::Serialize;
use std::ops::ControlFlow;

/// The most triangles that are listed as hidden.
const MOST_RIVALS: usize = 16;

/// What a part of a pixel shows, and what else covers the same place.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct RasterNode {
    /// The visible triangle; none where the background is visible.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub triangle: Option<RasterTriangle>,
    /// The number of the pixel's samples of this part, and of all its samples.
    pub samples: [usize; 2],
    /// What covers the same place and isn't seen, the nearest first.
    pub rivals: Vec<RasterRival>,
    /// The number of triangles that cover the same place and aren't listed.
    pub more_rivals: usize,
}

/// A visible triangle.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct RasterTriangle {
    /// The object.
    pub object: String,
    /// The number of the primitive in its object: of a mesh's triangle, a cloud's element, or 0.
    pub primitive: u32,
    /// The number of the triangle in the shape's tessellation; none for meshes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub facet: Option<u32>,
    /// The corners on the screen in pixels, with y upwards, snapped to 1/256 pixel, after clipping.
    pub corners: [[f64; 2]; 3],
    /// The perspective-correct barycentric coordinates of the shaded place, one weight for each corner before clipping.
    pub weights: [f32; 3],
    /// The depth 1/z, or −z of an orthographic camera; larger is nearer.
    pub depth: f32,
    /// z, the distance along the camera's axis.
    pub z: f64,
}

/// A triangle that covers a place and isn't seen there.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct RasterRival {
    /// The object.
    pub object: String,
    /// The depth 1/z, or −z of an orthographic camera.
    pub depth: f32,
    /// z, the distance along the camera's axis.
    pub z: f64,
    /// Why it isn't seen.
    pub fate: RivalFate,
}

/// Why a triangle isn't seen at a place that it covers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum RivalFate {
    /// It is farther away.
    Farther,
    /// It is equally far away, and comes later in the scene.
    Equal,
    /// It lies beyond the far plane.
    BeyondFar,
    /// Its surface lies in front of the near plane.
    BeforeNear,
    /// A texture leaves a hole there.
    Hole,
}

/// A tile that is drawn to explain its pixels: its area, its number and the parts of its pixels.
pub(super) struct ExplainedTile {
    area: [u32; 4],
    number: usize,
    parts: Vec<PixelPart>,
}

impl ZbufferWorker<'_> {
    /// Makes a pixel of the job's window for a probe, one sample for each shaded fragment.
    pub(super) fn explain(
        &mut self,
        pixel: [u32; 2],
        probe: &mut dyn Probe,
        add: &mut dyn FnMut(Rgb, f64),
    ) -> ControlFlow<()> {
        let job = &self.zbuffer.job;
        if !draws_sample_by_sample(job) {
            return self.explain_samples(pixel, probe, add);
        }
        for index in job.first_sample..job.first_sample + job.sample_count() {
            self.samples = DrawnSamples::of(self.zbuffer, index);
            self.explained = None;
            // A sample is one colour in the picture, whatever its fragments are.
            let mut sum = WeightedSum::default();
            self.explain_samples(pixel, probe, &mut |color, weight| sum.add(color, weight))?;
            add(sum.mean(), 1.0);
        }
        ControlFlow::Continue(())
    }

    /// Draws the tile of a pixel, unless it is drawn.
    fn draw_tile(&mut self, [x, y]: [u32; 2]) -> ControlFlow<(), ExplainedTile> {
        if let Some(tile) = self.explained.take().filter(|tile| tile.has([x, y])) {
            return ControlFlow::Continue(tile);
        }
        let Zbuffer { job, screen, .. } = self.zbuffer;
        let ([left, top, width, height], side) = (job.window(), screen.side as u32);
        let corner = [left + (x - left) / side * side, top + (y - top) / side * side];
        let area = [corner[0], corner[1], side.min(left + width - corner[0]), side.min(top + height - corner[1])];
        let number = self.draw(area)?;
        let parts = self.parts(area);
        self.lookup.prepare(number, &parts);
        ControlFlow::Continue(ExplainedTile { area, number, parts })
    }

    fn explain_samples(
        &mut self,
        pixel: [u32; 2],
        probe: &mut dyn Probe,
        add: &mut dyn FnMut(Rgb, f64),
    ) -> ControlFlow<()> {
        let tile = self.draw_tile(pixel)?;
        let zbuffer = self.zbuffer;
        for part in tile.parts_of(pixel) {
            let node = raster_node(self, tile.number, part, probe.lists_rivals());
            let Some(visible) = self.lookup.visible(tile.number, part) else {
                let line = zbuffer.camera.line(part.place[0], part.place[1]);
                probe.sample(part.place, part.share);
                probe.alpha(0.0);
                probe.drawn(None, None);
                probe.raster(&node);
                probe.ray(RayKind::Eye, &line.rounded(), 1, Rgb::WHITE);
                let differential = differential(zbuffer, part.place, self.samples.spacing);
                let color = match zbuffer.job.backdrop(zbuffer.world) {
                    Some(backdrop) => backdrop,
                    None => background(zbuffer.world, line.direction, differential.as_ref(), probe),
                };
                probe.miss(color);
                probe.end(color);
                add(color, part.share);
                continue;
            };
            let mut whitted = zbuffer.whitted(self.cancelled);
            let line = zbuffer.camera.line(part.place[0], part.place[1]);
            let seen = (line, visible.hit(&line));
            self.lookup.fragments_of(part, &visible, seen, (tile.area, &self.samples), |weight, fragment| {
                probe.sample(part.place, weight);
                probe.alpha(if self.hides(&visible, part) { 1.0 } else { 0.0 });
                probe.drawn(None, None);
                probe.raster(&node);
                add(whitted.shade_fragment(&fragment, probe), weight);
            });
        }
        self.explained = Some(tile);
        ControlFlow::Continue(())
    }
}

impl ExplainedTile {
    fn has(&self, [x, y]: [u32; 2]) -> bool {
        let [left, top, width, height] = self.area;
        (left..left + width).contains(&x) && (top..top + height).contains(&y)
    }

    /// The parts of a pixel.
    fn parts_of(&self, [x, y]: [u32; 2]) -> &[PixelPart] {
        let [left, top, width, _] = self.area;
        let pixel = ((y - top) * width + x - left) as usize;
        let begin = self.parts.partition_point(|part| part.pixel < pixel);
        let end = self.parts.partition_point(|part| part.pixel <= pixel);
        &self.parts[begin..end]
    }
}

/// What a part shows, and its rivals if they are wanted.
fn raster_node(worker: &ZbufferWorker, tile: usize, part: &PixelPart, with_rivals: bool) -> RasterNode {
    let Zbuffer { world, binned, camera, projection, far_depth, .. } = worker.zbuffer;
    let sites = &worker.samples.sites;
    let name = |triangle: &ScreenTriangle| world.object(&triangle.source.hit(0.0, [0.0; 2], 0)).name.clone();
    let [x, y] = part.place;
    let depth_of = |triangle: &ScreenTriangle, visible: Option<&VisibleTriangle>| {
        let depth = triangle.depth(x, y);
        let refined = visible.map(|visible| refine(worker.zbuffer, triangle, visible, part.place, depth));
        (depth, refined.unwrap_or(Some(depth)))
    };
    let visible = worker.lookup.visible(tile, part);
    let triangle = visible.map(|visible| {
        let triangle = binned.get(tile, part.number);
        let [u, v] = visible.hit(&camera.line(x, y)).uv;
        let (own, refined) = depth_of(triangle, Some(&visible));
        let depth = refined.unwrap_or(own);
        RasterTriangle {
            object: name(triangle),
            primitive: triangle.source.primitive,
            facet: visible.is_tessellated().then_some(triangle.source.triangle),
            corners: triangle.corners_in_pixels(),
            weights: [1.0 - u - v, u, v],
            depth,
            z: projection.distance_of(depth.into()),
        }
    });
    let mut rivals = Vec::new();
    for (number, other) in (0..).zip(binned.tile(tile)).take_while(|_| with_rivals) {
        if number == part.number || !other.covers(part.place) {
            continue;
        }
        let its_visible = worker.lookup.cache.triangle(other.source, world, binned);
        let (own, refined) = depth_of(other, its_visible.as_ref());
        let its = refined.unwrap_or(own);
        let fate = match refined {
            _ if its <= *far_depth => RivalFate::BeyondFar,
            None if other.is_curved => RivalFate::BeforeNear,
            None => RivalFate::Hole,
            Some(_) if triangle.as_ref().is_some_and(|triangle| its >= triangle.depth) => RivalFate::Equal,
            Some(_) => RivalFate::Farther,
        };
        rivals.push(RasterRival { object: name(other), depth: its, z: projection.distance_of(its.into()), fate });
    }
    rivals.sort_by(|a, b| b.depth.total_cmp(&a.depth));
    let more_rivals = rivals.len().saturating_sub(MOST_RIVALS);
    rivals.truncate(MOST_RIVALS);
    let samples = [(part.share * sites.len() as f64).round() as usize, sites.len()];
    RasterNode { triangle, samples, rivals, more_rivals }
}
