//! The rasteriser: triangles on the screen, and the samples of a tile that they cover.
//!
//! Corners are snapped to 1/256 of a pixel. Edge functions of snapped corners are exact in `i64` (Pineda, *A Parallel
//! Algorithm for Polygon Rasterization*, 1988). By the top-left rule a sample on a shared edge belongs to one triangle.
//! No crack opens between triangles that share corners. Depths come from the plane before snapping.

use canaletto_bvh::{InstructionSet, Kernel};
use glam::{DVec3, DVec4};

/// The parts of a pixel that corners are snapped to.
pub(crate) const SUBPIXELS: i64 = 256;
/// The largest distance of a corner from the picture's corner in pixels. Snapped corners are less than 2²⁹ steps away.
/// The difference of two is less than 2³⁰, so an edge function is less than 2⁶².
pub(crate) const GUARD_BAND: f64 = (1u32 << 21) as f64;

/// The origin of a triangle on the screen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Source {
    /// [`Hit::instance`](crate::world::Hit::instance).
    pub(crate) instance: u32,
    /// [`Hit::primitive`](crate::world::Hit::primitive).
    pub(crate) primitive: u32,
    /// The triangle of the primitive's tessellation; 0 for triangles of meshes.
    pub(crate) triangle: u32,
    /// Whether the primitive is a triangle of a mesh.
    pub(crate) is_of_mesh: bool,
}

/// A triangle on the screen.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ScreenTriangle {
    /// The corners in 1/256 pixels, counter-clockwise with y upwards.
    corners: [[i32; 2]; 3],
    /// The depth as a function α x + β y + γ of the place in pixels.
    plane: DVec3,
    /// The least and the largest depth of the corners. Planes that are seen nearly edge on have huge gradients.
    range: [f32; 2],
    pub(crate) source: Source,
    /// Whether parts of it may be cut out.
    pub(crate) has_holes: bool,
    /// Whether it stands for a curved surface, whose own depths are compared.
    pub(crate) is_curved: bool,
}

impl ScreenTriangle {
    /// A triangle without area.
    const NOTHING: ScreenTriangle = ScreenTriangle {
        corners: [[0; 2]; 3],
        plane: DVec3::ZERO,
        range: [0.0; 2],
        source: Source { instance: 0, primitive: 0, triangle: 0, is_of_mesh: false },
        has_holes: false,
        is_curved: false,
    };

    /// The triangle with these corners, whose W is positive, on the plane of a depth. None if it has no area after
    /// snapping.
    pub(crate) fn new(corners: &[DVec4; 3], plane: DVec3, source: Source) -> Option<ScreenTriangle> {
        let (snapped, range) = Self::snapped(corners);
        Self::of_snapped(snapped, plane, range, source)
    }

    /// The places of the corners in 1/256 pixels, and the least and the largest depth.
    #[inline(always)]
    pub(crate) fn snapped([a, b, c]: &[DVec4; 3]) -> ([[i32; 2]; 3], [f32; 2]) {
        let [ia, ib, ic] = [1.0 / a.z, 1.0 / b.z, 1.0 / c.z];
        let depths = [(a.w * ia) as f32, (b.w * ib) as f32, (c.w * ic) as f32];
        let least = |a: f32, b: f32| if b < a { b } else { a };
        let most = |a: f32, b: f32| if b > a { b } else { a };
        let range = [least(least(depths[0], depths[1]), depths[2]), most(most(depths[0], depths[1]), depths[2])];
        ([snap(a, ia), snap(b, ib), snap(c, ic)], range)
    }

    /// The triangle with these corners in 1/256 pixels. None if it has no area.
    #[inline(always)]
    pub(crate) fn of_snapped(
        snapped: [[i32; 2]; 3],
        plane: DVec3,
        range: [f32; 2],
        source: Source,
    ) -> Option<ScreenTriangle> {
        let mut triangle =
            ScreenTriangle { corners: snapped, plane, range, source, has_holes: false, is_curved: false };
        let area = triangle.doubled_area();
        if area < 0 {
            triangle.corners.swap(1, 2);
        }
        (area != 0).then_some(triangle)
    }

    #[inline(always)]
    fn doubled_area(&self) -> i64 {
        let [[ax, ay], [bx, by], [cx, cy]] = self.corners;
        edge([ax.into(), ay.into()], [bx.into(), by.into()], [cx.into(), cy.into()])
    }

    /// The first and the last column and row of pixels, `[x, y]` each, that hold one of the triangle's samples. `sites`
    /// bounds the samples' places in a pixel. None if there are none within the rectangle from `low` to `high`.
    #[inline(always)]
    pub(crate) fn pixels(&self, sites: &Sites, low: [i32; 2], high: [i32; 2]) -> Option<[[i32; 2]; 2]> {
        let [a, b, c] = self.corners;
        let (mut first, mut last) = ([0; 2], [0; 2]);
        for axis in 0..2 {
            (first[axis], last[axis]) = sites.pixels(axis, [a[axis], b[axis], c[axis]], low[axis], high[axis]);
            if first[axis] > last[axis] {
                return None;
            }
        }
        Some([first, last])
    }

    /// Whether its surface decides where it is and how deep: it may have holes, or is curved.
    #[inline(always)]
    pub(crate) fn needs_refinement(&self) -> bool {
        self.has_holes || self.is_curved
    }

    /// The corners in pixels, counter-clockwise with y upwards.
    pub(crate) fn corners_in_pixels(&self) -> [[f64; 2]; 3] {
        self.corners.map(|corner| corner.map(|v| f64::from(v) / SUBPIXELS as f64))
    }

    /// Whether the triangle covers the place in 1/256 pixels that is nearest to a place in pixels.
    pub(crate) fn covers(&self, place: [f64; 2]) -> bool {
        let place = place.map(|v| (v * SUBPIXELS as f64).round_ties_even() as i64);
        let [a, b, c] = self.corners.map(|p| p.map(i64::from));
        [(a, b), (b, c), (c, a)].into_iter().all(|(from, to)| edge(from, to, place) >= least_inside(from, to))
    }

    /// The edge functions at a site's place in 1/256 pixels of a pixel.
    #[inline(always)]
    fn edges(&self, pixel: [i32; 2], site: [i32; 2]) -> [Edge; 3] {
        let [a, b, c] = self.corners;
        let place = [0, 1].map(|axis: usize| i64::from(pixel[axis]) * SUBPIXELS + i64::from(site[axis]));
        [Edge::new(a, b, place), Edge::new(b, c, place), Edge::new(c, a, place)]
    }

    /// The depth at a place in pixels.
    #[inline(always)]
    pub(crate) fn depth(&self, x: f64, y: f64) -> f32 {
        let depth = (self.plane.x * x + self.plane.y * y + self.plane.z) as f32;
        // Without the rules of `f32::max` for NaN, which cost instructions.
        let [farthest, nearest] = self.range;
        let depth = if depth > farthest { depth } else { farthest };
        if depth < nearest { depth } else { nearest }
    }
}

/// The place of a homogeneous corner in 1/256 pixels; `inverse` is 1/W.
#[inline(always)]
fn snap(corner: &DVec4, inverse: f64) -> [i32; 2] {
    let scale = SUBPIXELS as f64 * inverse;
    [nearest(corner.x * scale), nearest(corner.y * scale)]
}

/// The nearest whole number of one below 2³¹, of two the even one.
#[inline(always)]
fn nearest(v: f64) -> i32 {
    // In this range the spacing of `f64` is 1, so that the sum is rounded to a whole number.
    const SHIFT: f64 = (3u64 << 51) as f64;
    ((v + SHIFT) - SHIFT) as i32
}

/// Twice the signed area of three places: positive if they run counter-clockwise with y upwards.
#[inline(always)]
fn edge([ax, ay]: [i64; 2], [bx, by]: [i64; 2], [px, py]: [i64; 2]) -> i64 {
    (bx - ax) * (py - ay) - (by - ay) * (px - ax)
}

/// The least value of an edge function that counts as inside: 0 on top and left edges, else 1.
#[inline(always)]
fn least_inside([ax, ay]: [i64; 2], [bx, by]: [i64; 2]) -> i64 {
    let is_top = ay == by && bx < ax;
    let is_left = by < ay;
    i64::from(!(is_top || is_left))
}

/// The places of a pixel's samples.
#[derive(Clone, Debug)]
pub(crate) struct Sites {
    /// The places in 1/256 pixels, to the right and upwards from the pixel's lower left corner.
    pub(crate) places: Vec<[i32; 2]>,
    /// The least and the largest coordinates.
    first: [i32; 2],
    last: [i32; 2],
}

impl Sites {
    /// The sites at these places, in pixels.
    pub(crate) fn new(places: impl IntoIterator<Item = [f64; 2]>) -> Sites {
        let snap = |v: f64| (v * SUBPIXELS as f64).round_ties_even() as i32;
        let places: Vec<[i32; 2]> = places.into_iter().map(|place| place.map(snap)).collect();
        let (mut first, mut last) = ([i32::MAX; 2], [i32::MIN; 2]);
        for place in &places {
            for axis in 0..2 {
                first[axis] = first[axis].min(place[axis]);
                last[axis] = last[axis].max(place[axis]);
            }
        }
        Sites { places, first, last }
    }

    /// The standard pattern of 1, 2, 4 or 8 samples around this place: rows and columns are all different.
    pub(crate) fn pattern(samples: u32, [x, y]: [f64; 2]) -> Sites {
        // In sixteenths of a pixel.
        let pattern: &[[i32; 2]] = match samples {
            2 => &[[4, 4], [-4, -4]],
            4 => &[[-2, -6], [6, -2], [-6, 2], [2, 6]],
            8 => &[[1, -3], [-1, 3], [5, 1], [-3, -5], [-5, 5], [-7, -1], [3, 7], [7, -7]],
            _ => &[[0, 0]],
        };
        Sites::new(pattern.iter().map(|[dx, dy]| [x + f64::from(*dx) / 16.0, y + f64::from(*dy) / 16.0]))
    }

    /// The first and the last pixel from `low` to `high` along an axis that may hold samples of a triangle with these
    /// coordinates in 1/256 pixels.
    #[inline(always)]
    pub(crate) fn pixels(&self, axis: usize, [a, b, c]: [i32; 3], low: i32, high: i32) -> (i32, i32) {
        let (least, most) = (a.min(b).min(c), a.max(b).max(c));
        // The first pixel with a site at or after the least coordinate, the last with one before the largest.
        let first =
            (least.wrapping_sub(self.last[axis]).wrapping_add(SUBPIXELS as i32 - 1)) >> SUBPIXELS.trailing_zeros();
        let last = most.wrapping_sub(self.first[axis]) >> SUBPIXELS.trailing_zeros();
        (first.max(low), last.min(high))
    }

    /// The number of sites in a pixel.
    pub(crate) fn len(&self) -> usize {
        self.places.len()
    }
}

/// The number of pixels of a row that are drawn side by side.
const LANES: usize = 8;

/// No triangle.
pub(crate) const NOTHING: u32 = u32::MAX;

/// The nearest triangle at each sample of a rectangle of pixels: a visibility buffer (Burns and Hunt 2013).
#[derive(Default)]
pub(crate) struct VisibilityBuffer {
    /// The lower left pixel, and the size in pixels.
    corner: [i32; 2],
    size: [i32; 2],
    /// The depth and the number of the triangle at each sample: one plane of pixels for each site, in rows from below.
    /// [`LANES`] further elements let each pixel be the first of that many.
    depths: Vec<f32>,
    numbers: Vec<u32>,
}

impl VisibilityBuffer {
    /// Removes everything. The buffer then holds this rectangle, and what is farther than `far_depth` isn't drawn.
    pub(crate) fn reset(&mut self, corner: [i32; 2], size: [i32; 2], sites: &Sites, far_depth: f32) {
        (self.corner, self.size) = (corner, size);
        let samples = size[0] as usize * size[1] as usize * sites.len() + LANES;
        self.depths.clear();
        self.depths.resize(samples, far_depth);
        self.numbers.clear();
        self.numbers.resize(samples, NOTHING);
    }

    /// The number of the triangle at a pixel's sample; the pixel counts from the lower left corner in rows.
    #[inline]
    pub(crate) fn number(&self, site: usize, pixel: usize) -> u32 {
        self.numbers[site * self.size[0] as usize * self.size[1] as usize + pixel]
    }

    /// All depths of the first site, in rows from below.
    pub(crate) fn depths(&self) -> &[f32] {
        &self.depths[..self.size[0] as usize * self.size[1] as usize]
    }

    /// Draws triangles with their numbers. Nearer depths win; of equal depths, the triangle that was drawn first.
    /// Triangles that [need refinement](ScreenTriangle::needs_refinement) are given to `refined`, which draws them.
    pub(crate) fn draw<'t>(
        &mut self,
        triangles: impl Iterator<Item = (u32, &'t ScreenTriangle)>,
        sites: &Sites,
        refined: impl FnMut(&mut VisibilityBuffer, u32, &ScreenTriangle),
    ) {
        InstructionSet::run(Draw { buffer: self, triangles, sites, refined });
    }

    /// Draws a triangle that needs no refinement, eight pixels of a row side by side.
    #[inline(always)]
    fn draw_plain(&mut self, triangle: &ScreenTriangle, number: u32, sites: &Sites) {
        let [x0, y0] = self.corner;
        let [width, height] = self.size;
        let Some([first, last]) = triangle.pixels(sites, self.corner, [x0 + width - 1, y0 + height - 1]) else {
            return;
        };
        let plane_size = width as usize * height as usize;
        for (site, &place) in sites.places.iter().enumerate() {
            let [e0, e1, e2] = triangle.edges(first, place);
            let sub = place.map(|v| f64::from(v) / SUBPIXELS as f64);
            let mut row = [e0.value, e1.value, e2.value];
            for y in first[1]..=last[1] {
                let [mut v0, mut v1, mut v2] = row;
                let start = site * plane_size + (y - y0) as usize * width as usize;
                let y_place = f64::from(y) + sub[1];
                let mut x = first[0];
                while x <= last[0] {
                    let index = start + (x - x0) as usize;
                    let depths = &mut self.depths[index..][..LANES];
                    let numbers = &mut self.numbers[index..][..LANES];
                    for i in 0..LANES {
                        let step = i as i64;
                        let edges = (v0 + e0.right * step) | (v1 + e1.right * step) | (v2 + e2.right * step);
                        let column = x + i as i32;
                        let depth = triangle.depth(f64::from(column) + sub[0], y_place);
                        let is_seen = (edges >= 0) & (column <= last[0]) & (depth > depths[i]);
                        depths[i] = if is_seen { depth } else { depths[i] };
                        numbers[i] = if is_seen { number } else { numbers[i] };
                    }
                    x += LANES as i32;
                    let steps = LANES as i64;
                    (v0, v1, v2) = (v0 + e0.right * steps, v1 + e1.right * steps, v2 + e2.right * steps);
                }
                row = [row[0] + e0.up, row[1] + e1.up, row[2] + e2.up];
            }
        }
    }

    /// Draws triangle number `number` of a surface with holes or of a curved one. `refine` gets the place in pixels and
    /// the triangle's depth there, and returns the surface's own depth, or none where nothing is there.
    pub(crate) fn draw_refined(
        &mut self,
        triangle: &ScreenTriangle,
        number: u32,
        sites: &Sites,
        mut refine: impl FnMut([f64; 2], f32) -> Option<f32>,
    ) {
        let [x0, y0] = self.corner;
        let [width, height] = self.size;
        let Some([first, last]) = triangle.pixels(sites, self.corner, [x0 + width - 1, y0 + height - 1]) else {
            return;
        };
        let plane_size = width as usize * height as usize;
        for (site, &place) in sites.places.iter().enumerate() {
            let [e0, e1, e2] = triangle.edges(first, place);
            let sub = place.map(|v| f64::from(v) / SUBPIXELS as f64);
            let mut row = [e0.value, e1.value, e2.value];
            for y in first[1]..=last[1] {
                let [mut v0, mut v1, mut v2] = row;
                let start = site * plane_size + (y - y0) as usize * width as usize;
                let y_place = f64::from(y) + sub[1];
                for x in first[0]..=last[0] {
                    if v0 | v1 | v2 >= 0 {
                        let index = start + (x - x0) as usize;
                        let x_place = f64::from(x) + sub[0];
                        let mut depth = triangle.depth(x_place, y_place);
                        if triangle.is_curved || depth > self.depths[index] {
                            depth = refine([x_place, y_place], depth).unwrap_or(f32::NEG_INFINITY);
                        }
                        if depth > self.depths[index] {
                            (self.depths[index], self.numbers[index]) = (depth, number);
                        }
                    }
                    (v0, v1, v2) = (v0 + e0.right, v1 + e1.right, v2 + e2.right);
                }
                row = [row[0] + e0.up, row[1] + e1.up, row[2] + e2.up];
            }
        }
    }
}

/// [`VisibilityBuffer::draw`].
struct Draw<'a, T, R> {
    buffer: &'a mut VisibilityBuffer,
    triangles: T,
    sites: &'a Sites,
    refined: R,
}

impl<'t, T, R> Kernel for Draw<'_, T, R>
where
    T: Iterator<Item = (u32, &'t ScreenTriangle)>,
    R: FnMut(&mut VisibilityBuffer, u32, &ScreenTriangle),
{
    type Answer = ();

    #[inline(always)]
    fn run(mut self) {
        // Triangles lie scattered in memory. Copies of several are read at once, and the reads overlap.
        let mut copies = [(0, ScreenTriangle::NOTHING); LANES];
        loop {
            let mut len = 0;
            for (copy, (number, triangle)) in copies.iter_mut().zip(self.triangles.by_ref()) {
                *copy = (number, *triangle);
                len += 1;
            }
            for (number, triangle) in &copies[..len] {
                if triangle.needs_refinement() {
                    (self.refined)(self.buffer, *number, triangle);
                } else {
                    self.buffer.draw_plain(triangle, *number, self.sites);
                }
            }
            if len < LANES {
                return;
            }
        }
    }
}

/// An edge function at a place, and its changes to the next pixel on the right and above. It is negative outside.
struct Edge {
    value: i64,
    right: i64,
    up: i64,
}

impl Edge {
    #[inline(always)]
    fn new([ax, ay]: [i32; 2], [bx, by]: [i32; 2], place: [i64; 2]) -> Edge {
        let (a, b) = ([i64::from(ax), i64::from(ay)], [i64::from(bx), i64::from(by)]);
        let value = edge(a, b, place) - least_inside(a, b);
        Edge { value, right: (a[1] - b[1]) * SUBPIXELS, up: (b[0] - a[0]) * SUBPIXELS }
    }
}

#[cfg(test)]
mod tests {
    use super::super::projection::depth_plane;
    use super::*;
    use crate::shape::testing::Random;

    const SOURCE: Source = Source { instance: 0, primitive: 0, triangle: 0, is_of_mesh: true };

    fn triangle(corners: [[f64; 3]; 3]) -> Option<ScreenTriangle> {
        // Places in pixels at a depth of z.
        let corners = corners.map(|[x, y, z]| DVec4::new(x * z, y * z, z, 1.0));
        ScreenTriangle::new(&corners, depth_plane(&corners).0, SOURCE)
    }

    /// A fan around a point covers each sample of a square exactly once, whatever the order of the corners.
    #[test]
    fn neighbours_share_no_sample_and_leave_none_out() {
        const SIDE: usize = 32;
        let random = &mut Random(81);
        for round in 0..200 {
            // Many corners lie on samples, and many edges run through them.
            let coarse = round % 2 == 0;
            let mut place = || {
                let v = f64::from(random.unit()) * SIDE as f64;
                if coarse { v.round() + 0.5 } else { v }
            };
            let middle = [place(), place(), 2.0];
            let far = 4.0 * SIDE as f64;
            let ring = [[-far, -far], [far, -far], [far, far], [place(), far], [-far, far], [-far, place()]];
            let sites = Sites::pattern([1, 2, 4, 8][round % 4], [0.5; 2]);
            let mut covered = vec![0; SIDE * SIDE * sites.len()];
            for i in 0..ring.len() {
                let [a, b] = [ring[i], ring[(i + 1) % ring.len()]].map(|[x, y]| [x, y, 2.0]);
                let corners = if i % 2 == 0 { [middle, a, b] } else { [b, a, middle] };
                let Some(triangle) = triangle(corners) else { continue };
                let mut buffer = VisibilityBuffer::default();
                buffer.reset([0; 2], [SIDE as i32; 2], &sites, 0.0);
                buffer.draw([(0, &triangle)].into_iter(), &sites, |_, _, _| unreachable!());
                covered.iter_mut().zip(&buffer.numbers).for_each(|(n, number)| *n += u32::from(*number == 0));
            }
            assert!(covered.iter().all(|n| *n == 1), "round {round}");
        }
    }

    /// Eight pixels side by side are those one by one.
    #[test]
    fn pixels_side_by_side_are_those_one_by_one() {
        let random = &mut Random(83);
        for set in InstructionSet::available() {
            set.limit();
            for round in 0..50 {
                let size = [2.0, 20.0, 500.0][round % 3];
                let sites = Sites::pattern([1, 2, 4, 8][round % 4], [0.5; 2]);
                let rectangle = ([-7, 3], [37, 21]);
                let [mut together, mut alone] = [(); 2].map(|()| {
                    let mut buffer = VisibilityBuffer::default();
                    buffer.reset(rectangle.0, rectangle.1, &sites, 0.1);
                    buffer
                });
                let triangles: Vec<ScreenTriangle> = (0..200)
                    .filter_map(|_| {
                        let middle = [random.within(-10.0, 40.0), random.within(0.0, 30.0)].map(f64::from);
                        let mut at = |m: f64| m + f64::from(random.within(-size, size));
                        let corners = [(); 3].map(|()| [at(middle[0]), at(middle[1])]);
                        triangle(corners.map(|[x, y]| [x, y, f64::from(random.within(0.5, 12.0))]))
                    })
                    .collect();
                together.draw((0..).zip(&triangles), &sites, |_, _, _| unreachable!());
                for (number, triangle) in (0..).zip(&triangles) {
                    alone.draw_refined(triangle, number, &sites, |_, depth| Some(depth));
                }
                assert!(alone.numbers.iter().any(|number| *number != NOTHING));
                assert!(together.numbers == alone.numbers && together.depths == alone.depths, "round {round}");
            }
        }
    }

    #[test]
    fn depth_is_that_of_the_plane_at_each_sample() {
        // The plane z = 1 + x / 8 of the places (x z, y z): 1/z isn't affine in x z, but on the screen it is.
        let z = |x: f64| 1.0 / (0.5 + x / 64.0);
        let corners = [[0.0, 0.0], [16.0, 0.0], [0.0, 16.0]].map(|[x, y]: [f64; 2]| [x, y, z(x)]);
        let triangle = triangle(corners).unwrap();
        for x in 0..16 {
            let x = f64::from(x) + 0.5;
            assert!((f64::from(triangle.depth(x, 0.25)) - 1.0 / z(x)).abs() < 1e-6, "{x}");
        }
    }

    #[test]
    fn the_nearer_triangle_is_seen_in_any_order() {
        let corners = |z: f64| [[0.0, 0.0, z], [8.0, 0.0, z], [0.0, 8.0, z]];
        let [near, far] = [1.0, 2.0].map(|z| triangle(corners(z)).unwrap());
        let sites = Sites::pattern(1, [0.5; 2]);
        for order in [[0, 1], [1, 0]] {
            let mut buffer = VisibilityBuffer::default();
            buffer.reset([0; 2], [8; 2], &sites, 0.25);
            let triangles = order.map(|number| (number, [&near, &far][number as usize]));
            buffer.draw(triangles.into_iter(), &sites, |_, _, _| unreachable!());
            assert_eq!((buffer.number(0, 0), buffer.number(0, 63)), (0, NOTHING));
        }
        // What lies beyond the far plane at z = 4 isn't drawn.
        let beyond = triangle(corners(5.0)).unwrap();
        let mut buffer = VisibilityBuffer::default();
        buffer.reset([0; 2], [8; 2], &sites, 0.25);
        buffer.draw([(0, &beyond)].into_iter(), &sites, |_, _, _| unreachable!());
        assert_eq!(buffer.number(0, 0), NOTHING);
    }
}
