//! A rasteriser with a z-buffer (Catmull 1974), for the comparison that the chapter makes with ray tracing.
//!
//! [`geometry`](crate::raster::geometry) projects all triangles into the tiles of the picture. Each tile then finds the
//! nearest triangle at each sample ([`coverage`]). Shading comes last, once for each visible triangle of a pixel, by
//! the code of the classic integrator. Curved shapes are tessellated within a tolerance in pixels
//! ([`facets`](crate::raster::facets)). Shadows come from [`shadow_map`].
//!
//! The z-buffer draws what lies between the camera's near and far planes. It has no reflected and refracted rays, no
//! lens and no motion: everything is drawn at the opening of the shutter.

mod cut_away;
mod description;
mod explain;
mod omissions;
mod samples;
mod shadow_map;

use super::prepared::{RayWatcher, TileBlock};
use super::shading::Fragment;
use super::visible_hit::background;
use super::whitted::Whitted;
use super::{Cancelled, Counts, FirstHit, IntegratorWorker, PreparedIntegrator, Probe};
use crate::camera::Camera;
use crate::film::{TileBuffer, WeightedSum};
use crate::job::{Aov, JobError, Observer, PlacedJob};
use crate::math::{DRay, RayDifferential, Rgb};
use crate::raster::coverage::{self, NOTHING, ScreenTriangle, Sites, VisibilityBuffer};
use crate::raster::depth_range::{DepthRange, view_bounds};
use crate::raster::facets::Tolerance;
use crate::raster::geometry::{BinnedTriangles, GeometryStage, Screen};
use crate::raster::projection::Projection;
use crate::raster::triangle_hits::TriangleHits;
use crate::raster::unshaded_view::refined_depth;
use crate::raster::visible_triangle::{FacetCache, VisibleTriangle};
use crate::sampler::{FrameSampler, Sample};
use crate::scene::{Shading, ShadowMethod, ZbufferSettings};
use crate::world::{Hit, World};
use explain::ExplainedTile;
pub use explain::{RasterNode, RasterRival, RasterTriangle, RivalFate};
use glam::DVec3;
use omissions::omissions;
pub(crate) use samples::sample_spacing;
use samples::{DrawnSamples, draws_sample_by_sample, grid_side, sites};
use shadow_map::ShadowMaps;
use std::ops::ControlFlow;
use std::sync::atomic::AtomicUsize;

/// The most bytes of all shadow maps.
const MOST_MAP_BYTES: u64 = 4 << 30;

/// The most triangles that are drawn between two questions whether the job is cancelled.
const DRAWN_TOGETHER: usize = 1 << 16;

/// The most fragments that are shaded together.
const BATCH: usize = 256;

/// The z-buffer, prepared for one picture: all triangles in their tiles.
pub(crate) struct Zbuffer<'w> {
    world: &'w World,
    job: PlacedJob<'w>,
    settings: ZbufferSettings,
    /// The camera at rest, without its lens.
    camera: Camera,
    projection: Projection,
    sites: Sites,
    /// Whether each site is shaded by itself, even if several see one triangle.
    shades_each_site: bool,
    screen: Screen,
    /// The depth of the far plane.
    far_depth: f32,
    tolerance: Tolerance,
    binned: BinnedTriangles,
    maps: Option<ShadowMaps<'w>>,
    sampler: FrameSampler,
}

impl<'w> Zbuffer<'w> {
    /// Projects the world and draws the shadow maps. Breaks if cancelled.
    ///
    /// # Errors
    /// [`JobError::ShadowMaps`] if the shadow maps would take too much memory.
    pub(crate) fn prepare(
        job: &PlacedJob<'w>,
        settings: ZbufferSettings,
        observer: &dyn Observer,
    ) -> Result<ControlFlow<(), Zbuffer<'w>>, JobError> {
        Self::check(job.world(), &settings)?;
        Ok(Self::project(job, settings, observer))
    }

    /// Checks the memory of the shadow maps.
    ///
    /// # Errors
    /// [`JobError::ShadowMaps`] if they would take too much.
    pub(crate) fn check(world: &World, settings: &ZbufferSettings) -> Result<(), JobError> {
        if settings.shadows == ShadowMethod::Map {
            let bytes = ShadowMaps::bytes(world, settings.shadow_map_size);
            if bytes > MOST_MAP_BYTES {
                return Err(JobError::ShadowMaps { mebibytes: bytes >> 20, most: MOST_MAP_BYTES >> 20 });
            }
        }
        Ok(())
    }

    fn project(
        job: &PlacedJob<'w>,
        settings: ZbufferSettings,
        observer: &dyn Observer,
    ) -> ControlFlow<(), Zbuffer<'w>> {
        let world = job.world();
        let camera = job.camera.at(0.0);
        let size = camera.size().map(f64::from);
        let range = DepthRange::new(world, &camera);
        let projection = Projection::of_camera(&camera, range);
        let view = view_bounds(&camera, &range);
        let tolerance = Tolerance::new(settings.tolerance.into(), &projection, size, &camera, range.near, view);
        let [left, top, width, height] = job.window().map(|v| v as i32);
        let screen = Screen {
            corner: [left, camera.size()[1] as i32 - top - height],
            size: [width, height],
            side: job.tile.clamp(1, 1 << 20) as i32,
            from_top: true,
        };
        let (sites, shades_each_site) = sites(job, &settings);
        let cancelled = || observer.cancelled();
        let stage = GeometryStage {
            world,
            projection: &projection,
            tolerance: &tolerance,
            screen,
            sites: &sites,
            compares_curves: true,
            with_unbounded: true,
            traits: world
                .materials()
                .iter()
                .map(|material| [!material.model.is_index_matched_to_air(), material.has_holes()])
                .collect(),
            kept_bytes: AtomicUsize::new(0),
        };
        let binned = stage.run(&cancelled)?;
        let maps = match settings.shadows {
            ShadowMethod::Map => Some(ShadowMaps::draw(world, settings.shadow_map_size, &cancelled)?),
            ShadowMethod::None => None,
        };
        ControlFlow::Continue(Zbuffer {
            world,
            job: job.clone(),
            settings,
            far_depth: projection.far_depth as f32,
            camera,
            projection,
            sites,
            shades_each_site,
            screen,
            tolerance,
            binned,
            maps,
            sampler: FrameSampler::new(job.seed, job.frame, job.film.sampler),
        })
    }
}

impl PreparedIntegrator for Zbuffer<'_> {
    fn preparation_counts(&self) -> Counts {
        let others = vec![
            ("triangles on the screen", self.binned.len()),
            ("shapes coarser than the tolerance", self.binned.coarse()),
        ];
        Counts { others, ..Counts::default() }
    }

    fn worker<'a>(&'a self, cancelled: Cancelled<'a>) -> Box<dyn IntegratorWorker + 'a> {
        Box::new(ZbufferWorker {
            zbuffer: self,
            whitted: self.whitted(cancelled),
            cancelled,
            samples: DrawnSamples::of(self, self.job.first_sample),
            visibility: VisibilityBuffer::default(),
            lookup: TriangleLookup { zbuffer: self, cache: FacetCache::default() },
            hits: TriangleHits::default(),
            fragments: 0,
            explained: None,
        })
    }
}

impl Zbuffer<'_> {
    /// The classic integrator as it shades fragments.
    fn whitted<'a>(&'a self, cancelled: Cancelled<'a>) -> Whitted<'a> {
        let whitted = Whitted::new(self.world, self.job.description().nearest_whitted()).with_cancel(cancelled);
        match &self.maps {
            Some(maps) => whitted.with_shadows_by(maps),
            None => whitted,
        }
    }
}

/// The state of one thread.
struct ZbufferWorker<'a> {
    zbuffer: &'a Zbuffer<'a>,
    whitted: Whitted<'a>,
    cancelled: Cancelled<'a>,
    samples: DrawnSamples,
    visibility: VisibilityBuffer,
    lookup: TriangleLookup<'a>,
    /// The hits of the fragments that are shaded together.
    hits: TriangleHits,
    /// The number of fragments shaded.
    fragments: u64,
    /// The tile whose pixels are explained.
    explained: Option<ExplainedTile>,
}

/// The triangles of visible samples, in the world.
struct TriangleLookup<'a> {
    zbuffer: &'a Zbuffer<'a>,
    cache: FacetCache<'a>,
}

/// The samples of a pixel that see one triangle.
#[derive(Clone, Copy)]
struct PixelPart {
    /// The pixel in the tile, in rows from the upper left.
    pixel: usize,
    /// The triangle in the tile, or [`NOTHING`].
    number: u32,
    /// The mean place of the samples in pixels.
    place: [f64; 2],
    /// The share of the pixel's samples.
    share: f64,
    /// Whether the pixel's first sample is among them.
    is_first: bool,
}

impl IntegratorWorker for ZbufferWorker<'_> {
    fn tile(&mut self, buffer: &mut TileBuffer) -> ControlFlow<()> {
        let aovs = &self.zbuffer.job.aovs;
        self.each_part(buffer.area(), |worker, tile, parts, area| {
            worker.shade(tile, parts, area, &mut |pixel, color, weight| buffer.add(pixel, color, weight));
            worker.layers(tile, parts, aovs, buffer);
        })
    }

    fn first_hits(&mut self, aovs: &[Aov], buffer: &mut TileBuffer) -> ControlFlow<()> {
        self.samples = DrawnSamples::of(self.zbuffer, self.zbuffer.job.first_sample);
        self.each_part(buffer.area(), |worker, tile, parts, _| worker.layers(tile, parts, aovs, buffer))
    }

    fn block(&mut self, block: &TileBlock<'_>, add: &mut dyn FnMut(usize, &mut [Rgb])) -> ControlFlow<()> {
        let size = block.size as usize;
        let mut colors = vec![Rgb::BLACK; block.places.len() * size];
        let [_, _, width, height] = block.area;
        let mut numbers = vec![usize::MAX; (width * height) as usize];
        for (number, [x, y]) in block.places.iter().enumerate() {
            numbers[(y * width + x) as usize] = number;
        }
        for index in 0..block.size {
            self.samples = DrawnSamples::of(self.zbuffer, block.first + index);
            let mut sums = vec![WeightedSum::default(); block.places.len()];
            self.each_part(block.area, |worker, tile, parts, area| {
                worker.shade(tile, parts, area, &mut |pixel, color, weight| {
                    if let Some(sum) = sums.get_mut(numbers[pixel]) {
                        sum.add(color, weight);
                    }
                });
            })?;
            for (sum, colors) in sums.iter().zip(colors.chunks_exact_mut(size)) {
                colors[index as usize] = sum.mean();
            }
        }
        colors.chunks_exact_mut(size).enumerate().for_each(|(number, colors)| add(number, colors));
        ControlFlow::Continue(())
    }

    fn alphas(&mut self, block: &TileBlock<'_>, add: &mut dyn FnMut(usize, f64)) -> ControlFlow<()> {
        let [_, _, width, height] = block.area;
        for index in 0..block.size {
            self.samples = DrawnSamples::of(self.zbuffer, block.first + index);
            let mut alphas = vec![0.0; (width * height) as usize];
            self.each_part(block.area, |worker, tile, parts, _| {
                let hiding = parts.iter().filter(|part| {
                    worker.lookup.visible(tile, part).is_some_and(|visible| worker.hides(&visible, part))
                });
                hiding.for_each(|part| alphas[part.pixel] += part.share);
            })?;
            block.places.iter().enumerate().for_each(|(number, [x, y])| add(number, alphas[(y * width + x) as usize]));
        }
        ControlFlow::Continue(())
    }

    fn watch(&mut self, pixel: [u32; 2], probe: &mut dyn Probe, add: &mut dyn FnMut(Rgb, f64)) -> ControlFlow<()> {
        self.explain(pixel, probe, add)
    }

    fn rays(&mut self) -> Option<&mut dyn RayWatcher> {
        None
    }

    fn take_counts(&mut self) -> Counts {
        let others = vec![("fragments shaded", std::mem::take(&mut self.fragments))];
        Counts { others, ..std::mem::take(&mut self.whitted.counts).into() }
    }
}

impl ZbufferWorker<'_> {
    /// Draws a tile, and calls `read` with its number, some parts of its pixels, and its area, until all are read.
    fn each_part(
        &mut self,
        area: [u32; 4],
        mut read: impl FnMut(&mut Self, usize, &[PixelPart], [u32; 4]),
    ) -> ControlFlow<()> {
        let tile = self.draw(area)?;
        let parts = self.parts(area);
        for parts in parts.chunks(BATCH) {
            if (self.cancelled)(self.whitted.counts.total()) {
                return ControlFlow::Break(());
            }
            self.lookup.cache.trim();
            self.lookup.prepare(tile, parts);
            read(self, tile, parts, area);
        }
        ControlFlow::Continue(())
    }

    /// Draws the triangles of a tile, and returns its number.
    fn draw(&mut self, [x, y, width, height]: [u32; 4]) -> ControlFlow<(), usize> {
        let Zbuffer { world, camera, screen, binned, tolerance, .. } = self.zbuffer;
        let [left, top, ..] = self.zbuffer.job.window();
        let side = screen.side as u32;
        let tile = ((y - top) / side * screen.tiles()[0] as u32 + (x - left) / side) as usize;
        let below = camera.size()[1] - y - height;
        let (corner, size) = ([x as i32, below as i32], [width as i32, height as i32]);
        let Self { visibility, lookup: TriangleLookup { cache, .. }, samples: DrawnSamples { sites, .. }, .. } = self;
        visibility.reset(corner, size, sites, self.zbuffer.far_depth);
        cache.clear();
        let mut triangles = binned.tile(tile).enumerate().map(|(number, triangle)| (number as u32, triangle));
        while triangles.len() > 0 {
            visibility.draw(triangles.by_ref().take(DRAWN_TOGETHER), sites, |visibility, number, triangle| {
                let visible = cache.triangle_to_refine(triangle, world, binned, tolerance);
                visibility.draw_refined(triangle, number, sites, |place, depth| match &visible {
                    Some(visible) => refine(self.zbuffer, triangle, visible, place, depth),
                    None => Some(depth),
                });
            });
            if triangles.len() > 0 && (self.cancelled)(0) {
                return ControlFlow::Break(());
            }
        }
        ControlFlow::Continue(tile)
    }

    /// The parts of all pixels of the tile.
    fn parts(&self, [x0, y0, width, height]: [u32; 4]) -> Vec<PixelPart> {
        let (Zbuffer { camera, shades_each_site, .. }, sites) = (self.zbuffer, &self.samples.sites);
        let samples = sites.len();
        let mut parts: Vec<PixelPart> = Vec::with_capacity((width * height) as usize);
        for pixel in 0..(width * height) as usize {
            let (column, row) = (pixel as u32 % width, pixel as u32 / width);
            let from_below = ((height - 1 - row) * width + column) as usize;
            let corner = [f64::from(x0 + column), f64::from(camera.size()[1] - 1 - y0 - row)];
            let begin = parts.len();
            if let [place] = sites.places[..] {
                let place = [
                    corner[0] + f64::from(place[0]) / coverage::SUBPIXELS as f64,
                    corner[1] + f64::from(place[1]) / coverage::SUBPIXELS as f64,
                ];
                let number = self.visibility.number(0, from_below);
                parts.push(PixelPart { pixel, number, place, share: 1.0, is_first: true });
                continue;
            }
            for (site, place) in sites.places.iter().enumerate() {
                let number = self.visibility.number(site, from_below);
                let place = [0, 1].map(|i: usize| corner[i] + f64::from(place[i]) / coverage::SUBPIXELS as f64);
                let known = parts[begin..].iter_mut().find(|part| !shades_each_site && part.number == number);
                match known {
                    Some(part) => {
                        // Sums until the pixel is complete.
                        (part.place[0], part.place[1]) = (part.place[0] + place[0], part.place[1] + place[1]);
                        part.share += 1.0;
                    }
                    None => parts.push(PixelPart { pixel, number, place, share: 1.0, is_first: site == 0 }),
                }
            }
            for part in &mut parts[begin..] {
                part.place = part.place.map(|sum| sum / part.share);
                part.share /= samples as f64;
            }
        }
        parts
    }

    /// Shades parts of pixels of a tile, and calls `add` with the pixel, colour and weight of each.
    fn shade(&mut self, tile: usize, parts: &[PixelPart], area: [u32; 4], add: &mut dyn FnMut(usize, Rgb, f64)) {
        let Zbuffer { camera, .. } = self.zbuffer;
        let Self { lookup, whitted, hits, fragments: count, samples, .. } = self;
        let seen: Vec<(&PixelPart, VisibleTriangle)> =
            parts.iter().filter_map(|part| Some((part, lookup.visible(tile, part)?))).collect();
        let places: Vec<[f64; 2]> = seen.iter().map(|(part, _)| part.place).collect();
        let mut lines = vec![DRay { origin: DVec3::ZERO, direction: DVec3::ZERO }; seen.len()];
        camera.lines(&places, &mut lines);
        hits.clear();
        seen.iter().zip(&lines).for_each(|((_, visible), line)| visible.push_line(line, hits));
        hits.find();
        let mut wave = whitted.fragments();
        let mut weights = Vec::with_capacity(seen.len());
        for (index, ((part, visible), line)) in seen.iter().zip(&lines).enumerate() {
            let hit = visible.hit_found(line, hits.get(index));
            lookup.fragments_of(part, visible, (*line, hit), (area, samples), |weight, fragment| {
                weights.push(weight);
                wave.push(&fragment);
            });
        }
        *count += weights.len() as u64;
        let mut colors = Vec::with_capacity(weights.len());
        wave.shade(|color| colors.push(color));
        let mut colors = colors.into_iter().zip(weights);
        let each = if self.zbuffer.settings.shading == Shading::Gouraud { 3 } else { 1 };
        for part in parts {
            if part.number != NOTHING {
                colors.by_ref().take(each).for_each(|(color, weight)| add(part.pixel, color, weight));
            } else {
                add(part.pixel, around(self.zbuffer, part.place, samples.spacing), part.share);
            }
        }
    }

    /// Adds parts of pixels of a tile to its layers.
    fn layers(&mut self, tile: usize, parts: &[PixelPart], aovs: &[Aov], buffer: &mut TileBuffer) {
        for part in parts.iter().take(if aovs.is_empty() { 0 } else { parts.len() }) {
            self.layers_of(part, self.lookup.visible(tile, part).as_ref(), aovs, buffer);
        }
    }

    /// Whether a visible triangle hides the background.
    fn hides(&self, visible: &VisibleTriangle<'_>, part: &PixelPart) -> bool {
        let Zbuffer { world, camera, .. } = self.zbuffer;
        !world.material(&visible.hit(&camera.line(part.place[0], part.place[1]))).shadow_catcher
    }

    /// Adds a part of a pixel to the layers.
    fn layers_of(&self, part: &PixelPart, visible: Option<&VisibleTriangle>, aovs: &[Aov], buffer: &mut TileBuffer) {
        let Zbuffer { world, camera, sampler, .. } = self.zbuffer;
        let first_hit = visible.map_or(FirstHit::MISS, |visible| {
            let line = camera.line(part.place[0], part.place[1]);
            let sample = sampler.pixel([0; 2]).sample(0, 1);
            let differential = differential(self.zbuffer, part.place, self.samples.spacing);
            let fragment = TriangleLookup::smooth(visible, (line, visible.hit(&line)), differential, sample);
            let surface = self.whitted.fragment_surface(&fragment);
            let outside = surface.normal.dot(line.direction) < 0.0;
            FirstHit::new(world, camera, &fragment.hit, &surface, outside)
        });
        for (layer, aov) in aovs.iter().enumerate() {
            let mut values = [0.0; 3];
            let values = &mut values[..aov.channels().len()];
            if *aov == Aov::Alpha {
                values[0] = if visible.is_some_and(|visible| self.hides(visible, part)) { part.share } else { 0.0 };
            } else if !part.is_first || !first_hit.write(*aov, values) {
                continue;
            }
            buffer.add_to_layer(layer, part.pixel, values);
        }
    }
}

impl TriangleLookup<'_> {
    /// Makes sure that the tessellations of visible shapes are at hand.
    fn prepare(&mut self, tile: usize, parts: &[PixelPart]) {
        let Zbuffer { world, binned, tolerance, .. } = self.zbuffer;
        for part in parts.iter().filter(|part| part.number != NOTHING) {
            self.cache.prepare(binned.get(tile, part.number).source, world, binned, tolerance);
        }
    }

    /// The triangle of a part.
    fn visible(&self, tile: usize, part: &PixelPart) -> Option<VisibleTriangle<'_>> {
        let Zbuffer { world, binned, .. } = self.zbuffer;
        (part.number != NOTHING)
            .then(|| binned.get(tile, part.number))
            .and_then(|triangle| self.cache.triangle(triangle.source, world, binned))
    }

    /// The fragment at a hit of a line on a triangle, with the normal of the surface that the triangle stands for.
    #[inline]
    fn smooth<'t>(
        visible: &'t VisibleTriangle<'t>,
        (line, hit): (DRay, Hit),
        differential: Option<RayDifferential>,
        sample: Sample,
    ) -> Fragment<'t> {
        match visible.surface_hit(&line, &hit) {
            Some(hit) => Fragment { line, hit, facet: None, is_flat: false, differential, sample },
            None => Fragment { line, hit, facet: visible.facet(), is_flat: false, differential, sample },
        }
    }

    /// Calls `add` with the fragments that are shaded for a part of a pixel, and their weights in the pixel. `seen` is
    /// the line to the part, with its hit.
    #[inline]
    fn fragments_of<'t>(
        &self,
        part: &PixelPart,
        visible: &'t VisibleTriangle<'t>,
        seen: (DRay, Hit),
        ([x, y, width, _], samples): ([u32; 4], &DrawnSamples),
        mut add: impl FnMut(f64, Fragment<'t>),
    ) {
        let Zbuffer { camera, settings, sampler, .. } = self.zbuffer;
        let pixel = [x + part.pixel as u32 % width, y + part.pixel as u32 / width];
        let sample = sampler.pixel(pixel).sample(samples.index, samples.count);
        let differential = differential(self.zbuffer, part.place, samples.spacing);
        let fragment =
            |(line, hit), is_flat| Fragment { line, hit, facet: visible.facet(), is_flat, differential, sample };
        match settings.shading {
            Shading::Phong => add(part.share, Self::smooth(visible, seen, differential, sample)),
            Shading::Flat => add(part.share, fragment(visible.seen_by(camera, [1.0 / 3.0; 2]), true)),
            Shading::Gouraud => {
                let [u, v] = seen.1.uv.map(f64::from);
                for (weight, uv) in [(1.0 - u - v, [0.0, 0.0]), (u, [1.0, 0.0]), (v, [0.0, 1.0])] {
                    add(part.share * weight.max(0.0), fragment(visible.seen_by(camera, uv), false));
                }
            }
        }
    }
}

/// The depth of a triangle's surface at a place where its triangle has `depth`. None where a hole is, or where the
/// surface lies in front of the near plane.
fn refine(
    zbuffer: &Zbuffer,
    triangle: &ScreenTriangle,
    visible: &VisibleTriangle,
    [x, y]: [f64; 2],
    depth: f32,
) -> Option<f32> {
    let Zbuffer { world, camera, projection, .. } = zbuffer;
    refined_depth(triangle, visible, &camera.line(x, y), depth, projection, world, 0.5)
}

/// The colour at a place of the picture where nothing is.
fn around(zbuffer: &Zbuffer, place: [f64; 2], spacing: f64) -> Rgb {
    let Zbuffer { world, camera, job, .. } = zbuffer;
    if let Some(backdrop) = job.backdrop(world).or(world.backdrop) {
        return backdrop;
    }
    if world.environment.is_none() {
        return world.background;
    }
    let line = camera.line(place[0], place[1]);
    background(world, line.direction, differential(zbuffer, place, spacing).as_ref(), &mut ())
}

/// The ray differential at a place of the picture, if the world needs it.
fn differential(zbuffer: &Zbuffer, [x, y]: [f64; 2], spacing: f64) -> Option<RayDifferential> {
    let spaced = || zbuffer.camera.differential(x, y, spacing);
    zbuffer.world.needs_differentials().then(spaced)
}
