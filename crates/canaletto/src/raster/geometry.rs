//! The geometry stage: all triangles of the world go through a projection into the tiles that they touch.

use super::clip::Polygon;
use super::coverage::{ScreenTriangle, Sites, Source};
use super::facets::{Facets, Tolerance, corners};
use super::projection::{Projection, depth_plane};
use super::triangle_setup::{Setup, SetupTarget, TOGETHER, TriangleSetup, is_in_guard_band};
use crate::shape::Mesh;
use crate::world::{Hit, Primitives, World};
use canaletto_bvh::Aabb;
use canaletto_parallel::prelude::*;
use glam::DVec4;
use std::collections::HashMap;
use std::ops::{ControlFlow, Range};
use std::sync::atomic::{AtomicUsize, Ordering};

/// The most primitives that are worked on together.
const BATCH: usize = 8192;

/// Tessellations with fewer triangles are made again where they are needed.
const MIN_KEPT: usize = 256;

/// About the most memory of tessellations that are kept.
const MOST_KEPT_BYTES: usize = 8 << 20;

/// A screen of tiles.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Screen {
    /// The lower left pixel, and the size in pixels.
    pub(crate) corner: [i32; 2],
    pub(crate) size: [i32; 2],
    /// The side of a tile in pixels.
    pub(crate) side: i32,
    /// Whether tiles count from the upper edge.
    pub(crate) from_top: bool,
}

impl Screen {
    /// The numbers of tile columns and tile rows.
    pub(crate) fn tiles(&self) -> [i32; 2] {
        self.size.map(|n| (n + self.side - 1) / self.side)
    }

    /// The number of the tile row that holds a row of pixels from below.
    fn tile_row(&self, y: i32) -> i32 {
        let from_below = y - self.corner[1];
        (if self.from_top { self.size[1] - 1 - from_below } else { from_below }) / self.side
    }

    fn last(&self) -> [i32; 2] {
        [self.corner[0] + self.size[0] - 1, self.corner[1] + self.size[1] - 1]
    }

    /// The first and the last pixel along an axis.
    #[inline(always)]
    pub(crate) fn span(&self, axis: usize) -> [i32; 2] {
        [self.corner[axis], self.corner[axis] + self.size[axis] - 1]
    }

    /// Whether all points lie beyond one border of the view.
    #[inline(always)]
    pub(crate) fn is_outside(&self, near: DVec4, points: &[DVec4]) -> bool {
        let [left, below] = self.corner.map(f64::from);
        let [right, above] = [left + f64::from(self.size[0]), below + f64::from(self.size[1])];
        let mut all = [true; 5];
        for p in points {
            all[0] &= near.dot(*p) < 0.0;
            all[1] &= p.x < left * p.z;
            all[2] &= p.x > right * p.z;
            all[3] &= p.y < below * p.z;
            all[4] &= p.y > above * p.z;
        }
        all[0] | all[1] | all[2] | all[3] | all[4]
    }
}

/// A geometry, or a range of its primitives.
struct Part {
    /// The number of the geometry in its place, or [`Hit::UNBOUNDED`].
    instance: u32,
    primitives: Range<u32>,
}

/// The triangles of a screen, by tile.
#[derive(Debug, Default)]
pub(crate) struct BinnedTriangles {
    /// The triangles of each batch.
    batches: Vec<Vec<ScreenTriangle>>,
    /// For each tile, the range of its entries.
    starts: Vec<usize>,
    /// Batch and number of each triangle of a tile, in the order of the world.
    entries: Vec<[u32; 2]>,
    /// Large tessellations, by instance and primitive. Which ones are kept changes no picture.
    kept: HashMap<[u32; 2], Facets>,
    /// The number of shapes whose tolerance would have needed too many triangles.
    coarse: u64,
}

/// The results of one batch.
#[derive(Default)]
struct Batch {
    triangles: Vec<ScreenTriangle>,
    /// The tile and the number of each triangle that touches it.
    touches: Vec<[u32; 2]>,
    kept: Vec<([u32; 2], Facets)>,
    /// The number of shapes whose tolerance would have needed too many triangles.
    coarse: u64,
}

/// A triangle of a geometry.
struct ProjectedTriangle {
    corners: [DVec4; 3],
    source: Source,
    /// Given if only the front is visible: whether the geometry's space is mirrored.
    sided: Option<bool>,
    is_curved: bool,
}

/// The last projected vertices of a mesh, by the last digits of their indices.
struct VertexCache {
    indices: [u32; VertexCache::SIZE],
    corners: [DVec4; VertexCache::SIZE],
}

impl Default for VertexCache {
    fn default() -> VertexCache {
        VertexCache { indices: [u32::MAX; VertexCache::SIZE], corners: [DVec4::ZERO; VertexCache::SIZE] }
    }
}

impl VertexCache {
    const SIZE: usize = 1024;

    #[inline(always)]
    fn get(&mut self, vertex: u32, project: impl FnOnce() -> DVec4) -> DVec4 {
        let slot = vertex as usize % VertexCache::SIZE;
        if self.indices[slot] != vertex {
            (self.indices[slot], self.corners[slot]) = (vertex, project());
        }
        self.corners[slot]
    }
}

/// The traits of a mesh's materials.
struct SlotTraits<'a> {
    stage: &'a GeometryStage<'a>,
    mesh: &'a Mesh,
    /// The slot of the last triangle, and its traits.
    last: Option<(u32, [bool; 2])>,
}

impl SlotTraits<'_> {
    /// [`GeometryStage::traits_of`].
    #[inline]
    fn of(&mut self, source: Source) -> [bool; 2] {
        let slot = self.mesh.slots.get(source.primitive as usize).copied().unwrap_or_default();
        match self.last {
            Some((last, traits)) if last == slot => traits,
            _ => {
                let traits = self.stage.traits_of(source);
                self.last = Some((slot, traits));
                traits
            }
        }
    }
}

/// The projection of a world onto a screen.
pub(crate) struct GeometryStage<'a> {
    pub(crate) world: &'a World,
    pub(crate) projection: &'a Projection,
    pub(crate) tolerance: &'a Tolerance,
    pub(crate) screen: Screen,
    pub(crate) sites: &'a Sites,
    /// Whether the depths of curved surfaces are compared in place of those of their triangles.
    pub(crate) compares_curves: bool,
    /// Whether shapes without bounds are drawn.
    pub(crate) with_unbounded: bool,
    /// For each material, whether it is drawn and whether it [has holes](Material::has_holes).
    pub(crate) traits: Vec<[bool; 2]>,
    /// The memory of the tessellations that are kept: 0 at first.
    pub(crate) kept_bytes: AtomicUsize,
}

impl GeometryStage<'_> {
    /// Projects all triangles. Breaks if cancelled.
    pub(crate) fn run(&self, cancelled: &(dyn Fn() -> bool + Sync)) -> ControlFlow<(), BinnedTriangles> {
        let batches = self.batches();
        let done = batches.par_iter().map(|parts| if cancelled() { None } else { Some(self.batch(parts)) }).collect();
        match done.into_iter().collect() {
            Some(done) => ControlFlow::Continue(self.bin(done)),
            None => ControlFlow::Break(()),
        }
    }

    /// The world's geometries as batches of about equal size.
    fn batches(&self) -> Vec<Vec<Part>> {
        let (mut batches, mut batch, mut room) = (Vec::new(), Vec::new(), BATCH);
        let mut add = |instance: u32, count: usize| {
            let mut next = 0;
            while next < count {
                let end = count.min(next + room);
                batch.push(Part { instance, primitives: next as u32..end as u32 });
                room -= end - next;
                next = end;
                if room == 0 {
                    batches.push(std::mem::take(&mut batch));
                    room = BATCH;
                }
            }
        };
        for instance in 0..self.world.placed_geometry_count() {
            if self.may_be_seen(&self.world.placed_bounds(instance)) {
                add(instance, self.world.placed_geometry(instance, 0.0).primitives.len());
            }
        }
        if self.with_unbounded {
            add(Hit::UNBOUNDED, self.world.unbounded_shapes().count());
        }
        batches.push(batch);
        batches
    }

    /// Whether a box may touch the screen.
    fn may_be_seen(&self, bounds: &Aabb) -> bool {
        let points: Vec<DVec4> = corners(bounds).map(|p| self.projection.point(p)).collect();
        !bounds.is_empty() && !self.screen.is_outside(self.projection.near(), &points)
    }

    fn batch(&self, parts: &[Part]) -> Batch {
        let mut batch = Batch::default();
        for part in parts {
            if part.instance == Hit::UNBOUNDED {
                for primitive in part.primitives.clone() {
                    let facets = Facets::new(self.world.unbounded_shape(primitive), None, None, self.tolerance);
                    self.facets(part.instance, primitive, facets, self.projection, false, &mut batch);
                }
                continue;
            }
            let placed = self.world.placed_geometry(part.instance, 0.0);
            let projection = self.projection.of_space(placed.to_world.as_ref());
            let mirrors = placed.to_world.is_some_and(|t| t.matrix().matrix3.determinant() < 0.0);
            if let Primitives::Mesh(mesh) = placed.primitives {
                let sided = if mesh.one_sided { Some(mirrors) } else { None };
                self.mesh(mesh, part, sided, &projection, &mut batch);
                continue;
            }
            for primitive in part.primitives.clone() {
                if let Some((shape, color)) = placed.primitives.shape(primitive) {
                    let facets = Facets::new(&shape, color, placed.to_world.as_ref(), self.tolerance);
                    self.facets(part.instance, primitive, facets, &projection, mirrors, &mut batch);
                }
            }
        }
        batch
    }

    /// Projects triangles of a mesh. Neighbouring triangles share most of their corners.
    fn mesh(&self, mesh: &Mesh, part: &Part, sided: Option<bool>, projection: &Projection, batch: &mut Batch) {
        let mut cache = VertexCache::default();
        let mut setup = TriangleSetup::new();
        let target = SetupTarget { screen: &self.screen, sites: self.sites, near: projection.near() };
        let mut traits = SlotTraits { stage: self, mesh, last: None };
        let mut begin = part.primitives.start;
        while begin < part.primitives.end {
            let end = part.primitives.end.min(begin + TOGETHER as u32);
            setup.clear();
            for &[a, b, c] in &mesh.triangles[begin as usize..end as usize] {
                let mut corner =
                    |vertex: u32| cache.get(vertex, || projection.point(mesh.positions[vertex as usize].as_dvec3()));
                setup.push([corner(a), corner(b), corner(c)]);
            }
            setup.run(target);
            for (index, primitive) in (begin..end).enumerate() {
                let source = Source { instance: part.instance, primitive, triangle: 0, is_of_mesh: true };
                match setup.get(index, source) {
                    Setup::Unseen => {}
                    Setup::Clipped => {
                        let corners = setup.corners(index);
                        let triangle = ProjectedTriangle { corners, source, sided, is_curved: false };
                        self.triangle(&triangle, projection, batch);
                    }
                    Setup::Whole(mut triangle, pixels) => {
                        let is_back = sided.is_some_and(|mirrors| setup.is_counter_clockwise(index) == mirrors);
                        let [is_drawn, has_holes] = traits.of(source);
                        if is_drawn && !is_back {
                            triangle.has_holes = has_holes;
                            self.add_to_tiles(triangle, pixels, batch);
                        }
                    }
                }
            }
            begin = end;
        }
    }

    fn facets(
        &self,
        instance: u32,
        primitive: u32,
        facets: Facets,
        projection: &Projection,
        mirrors: bool,
        batch: &mut Batch,
    ) {
        let sided = if facets.mesh.one_sided { Some(mirrors) } else { None };
        for triangle in 0..facets.mesh.len() as u32 {
            let source = Source { instance, primitive, triangle, is_of_mesh: false };
            let is_curved = !facets.is_exact && self.compares_curves;
            let corners = facets.corners(triangle).map(|p| projection.point(p));
            self.triangle(&ProjectedTriangle { corners, source, sided, is_curved }, projection, batch);
        }
        batch.coarse += u64::from(facets.is_coarse);
        if facets.mesh.len() >= MIN_KEPT && self.kept_bytes.load(Ordering::Relaxed) < MOST_KEPT_BYTES {
            self.kept_bytes.fetch_add(facets.bytes(), Ordering::Relaxed);
            batch.kept.push(([instance, primitive], facets));
        }
    }

    /// Clips a triangle and adds what is left.
    fn triangle(&self, triangle: &ProjectedTriangle, projection: &Projection, batch: &mut Batch) {
        let ProjectedTriangle { corners, source, sided, is_curved } = *triangle;
        if self.screen.is_outside(self.projection.near(), &corners) {
            return;
        }
        let (plane, determinant) = depth_plane(&corners);
        if !plane.is_finite() || sided.is_some_and(|mirrors| (determinant > 0.0) == mirrors) {
            return;
        }
        // A curved surface may lie behind the near plane where its triangles lie in front of it.
        let near = if is_curved { projection.nearer_plane() } else { projection.near() };
        if corners.iter().all(|p| is_in_guard_band(near, p)) {
            self.add(ScreenTriangle::new(&corners, plane, source), is_curved, batch);
            return;
        }
        let polygon = Polygon::clipped(corners, near);
        if let [first, rest @ ..] = polygon.corners() {
            for pair in rest.windows(2) {
                self.add(ScreenTriangle::new(&[*first, pair[0], pair[1]], plane, source), is_curved, batch);
            }
        }
    }

    /// Adds a triangle, unless it covers no sample.
    fn add(&self, triangle: Option<ScreenTriangle>, is_curved: bool, batch: &mut Batch) {
        let Some(mut triangle) = triangle else { return };
        let Some(pixels) = triangle.pixels(self.sites, self.screen.corner, self.screen.last()) else { return };
        let [is_drawn, has_holes] = self.traits_of(triangle.source);
        if is_drawn {
            (triangle.has_holes, triangle.is_curved) = (has_holes, is_curved);
            self.add_to_tiles(triangle, pixels, batch);
        }
    }

    /// Whether a primitive is drawn, and whether it has holes.
    fn traits_of(&self, source: Source) -> [bool; 2] {
        self.traits[self.world.material_index(&source.hit(0.0, [0.0; 2], 0)) as usize]
    }

    /// Adds a triangle to the tiles of its first to last pixels.
    #[inline]
    fn add_to_tiles(&self, triangle: ScreenTriangle, [first, last]: [[i32; 2]; 2], batch: &mut Batch) {
        let number = batch.triangles.len() as u32;
        batch.triangles.push(triangle);
        let screen = &self.screen;
        let columns = [first[0], last[0]].map(|x| (x - screen.corner[0]) / screen.side);
        let mut rows = [first[1], last[1]].map(|y| screen.tile_row(y));
        rows.sort_unstable();
        let across = screen.tiles()[0];
        for row in rows[0]..=rows[1] {
            for column in columns[0]..=columns[1] {
                batch.touches.push([(row * across + column) as u32, number]);
            }
        }
    }

    /// Sorts the triangles of all batches by tile.
    fn bin(&self, batches: Vec<Batch>) -> BinnedTriangles {
        let [columns, rows] = self.screen.tiles();
        let mut starts = vec![0; (columns * rows) as usize + 1];
        for [tile, _] in batches.iter().flat_map(|batch| &batch.touches) {
            starts[*tile as usize + 1] += 1;
        }
        for tile in 1..starts.len() {
            starts[tile] += starts[tile - 1];
        }
        let (mut next, mut entries) = (starts.clone(), vec![[0; 2]; starts[starts.len() - 1]]);
        let mut binned = BinnedTriangles::default();
        for (index, batch) in batches.into_iter().enumerate() {
            for [tile, number] in batch.touches {
                entries[next[tile as usize]] = [index as u32, number];
                next[tile as usize] += 1;
            }
            binned.batches.push(batch.triangles);
            binned.kept.extend(batch.kept);
            binned.coarse += batch.coarse;
        }
        (binned.starts, binned.entries) = (starts, entries);
        binned
    }
}

impl Source {
    /// The hit of a ray on this triangle's primitive.
    pub(crate) fn hit(&self, t: f32, uv: [f32; 2], part: u32) -> Hit {
        Hit { t, instance: self.instance, primitive: self.primitive, part, uv, time: 0.0 }
    }
}

impl BinnedTriangles {
    /// The triangles that touch a tile.
    pub(crate) fn tile(&self, tile: usize) -> impl ExactSizeIterator<Item = &ScreenTriangle> {
        self.entries[self.starts[tile]..self.starts[tile + 1]]
            .iter()
            .map(|[batch, number]| &self.batches[*batch as usize][*number as usize])
    }

    /// The triangle of this number in a tile.
    pub(crate) fn get(&self, tile: usize, number: u32) -> &ScreenTriangle {
        let [batch, number] = self.entries[self.starts[tile] + number as usize];
        &self.batches[batch as usize][number as usize]
    }

    /// A large tessellation.
    pub(crate) fn kept(&self, instance: u32, primitive: u32) -> Option<&Facets> {
        self.kept.get(&[instance, primitive])
    }

    /// The number of shapes whose tolerance would have needed too many triangles.
    pub(crate) fn coarse(&self) -> u64 {
        self.coarse
    }

    /// The number of triangles on the screen.
    pub(crate) fn len(&self) -> u64 {
        self.batches.iter().map(|batch| batch.len() as u64).sum()
    }
}
