//! Triangle set-up: triangles in homogeneous coordinates become triangles on the screen, eight side by side.

use super::coverage::{GUARD_BAND, ScreenTriangle, Sites, Source};
use super::geometry::Screen;
use super::projection::depth_plane;
use canaletto_bvh::{InstructionSet, Kernel};
use glam::{DVec3, DVec4};

/// The number of triangles side by side.
const LANES: usize = 8;

/// The number of triangles that are set up by one call of a kernel.
pub(crate) const TOGETHER: usize = 8 * LANES;

/// What triangles are set up for.
#[derive(Clone, Copy)]
pub(crate) struct SetupTarget<'a> {
    pub(crate) screen: &'a Screen,
    pub(crate) sites: &'a Sites,
    /// Points with a negative product lie in front of the near plane.
    pub(crate) near: DVec4,
}

/// What becomes of a triangle.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Setup {
    /// All of it lies beyond one border of the view, it is seen edge on, or it covers no sample.
    Unseen,
    /// It has to be clipped.
    Clipped,
    /// A triangle on the screen, and the first and the last column and row of pixels, `[x, y]` each.
    Whole(ScreenTriangle, [[i32; 2]; 2]),
}

/// Triangles that are set up together.
pub(crate) struct TriangleSetup {
    groups: [TriangleSetup8; TOGETHER / LANES],
    len: usize,
}

/// Eight triangles, and the results.
#[derive(Clone, Copy)]
struct TriangleSetup8 {
    /// X, Y, W and D of each corner.
    corners: [[[f64; LANES]; 4]; 3],
    plane: [[f64; LANES]; 3],
    /// Whether the corners run counter-clockwise, seen from the eye.
    is_counter_clockwise: [bool; LANES],
    is_unseen: [bool; LANES],
    is_clipped: [bool; LANES],
    snapped: [[[i32; LANES]; 2]; 3],
    range: [[f32; LANES]; 2],
    first: [[i32; LANES]; 2],
    last: [[i32; LANES]; 2],
}

impl TriangleSetup8 {
    const NOTHING: TriangleSetup8 = TriangleSetup8 {
        corners: [[[0.0; LANES]; 4]; 3],
        plane: [[0.0; LANES]; 3],
        is_counter_clockwise: [false; LANES],
        is_unseen: [true; LANES],
        is_clipped: [false; LANES],
        snapped: [[[0; LANES]; 2]; 3],
        range: [[0.0; LANES]; 2],
        first: [[0; LANES]; 2],
        last: [[0; LANES]; 2],
    };

    #[inline(always)]
    fn corner(&self, corner: usize, lane: usize) -> DVec4 {
        let [x, y, w, d] = &self.corners[corner];
        DVec4::new(x[lane], y[lane], w[lane], d[lane])
    }

    #[inline(always)]
    fn set_up(&mut self, target: &SetupTarget) {
        for i in 0..LANES {
            let corners = [self.corner(0, i), self.corner(1, i), self.corner(2, i)];
            let is_outside = target.screen.is_outside(target.near, &corners);
            let (plane, determinant) = depth_plane(&corners);
            for axis in 0..3 {
                self.plane[axis][i] = plane.to_array()[axis];
            }
            self.is_counter_clockwise[i] = determinant > 0.0;
            let is_inside = |p: &DVec4| is_in_guard_band(target.near, p);
            self.is_clipped[i] = !(is_inside(&corners[0]) & is_inside(&corners[1]) & is_inside(&corners[2]));
            let (snapped, range) = ScreenTriangle::snapped(&corners);
            let [[ax, ay], [bx, by], [cx, cy]] = snapped;
            (self.range[0][i], self.range[1][i]) = (range[0], range[1]);
            for (axis, corners) in [[ax, bx, cx], [ay, by, cy]].into_iter().enumerate() {
                for (to, coordinate) in self.snapped.iter_mut().zip(corners) {
                    to[axis][i] = coordinate;
                }
                let [low, high] = target.screen.span(axis);
                (self.first[axis][i], self.last[axis][i]) = target.sites.pixels(axis, corners, low, high);
            }
            let is_missed = (self.first[0][i] > self.last[0][i]) | (self.first[1][i] > self.last[1][i]);
            // What is clipped has no meaningful place.
            self.is_unseen[i] = is_outside | !is_finite(plane) | (is_missed & !self.is_clipped[i]);
        }
    }
}

/// Whether all components are finite.
#[inline(always)]
fn is_finite(v: DVec3) -> bool {
    // What is no number or infinite doesn't become 0.
    v.x * 0.0 + v.y * 0.0 + v.z * 0.0 == 0.0
}

/// Whether a corner needs no clipping.
#[inline(always)]
pub(crate) fn is_in_guard_band(near: DVec4, p: &DVec4) -> bool {
    let most = GUARD_BAND * p.z;
    (near.dot(*p) >= 0.0) & (p.z > 0.0) & (p.x.abs() <= most) & (p.y.abs() <= most)
}

struct SetUp<'a>(&'a mut [TriangleSetup8], SetupTarget<'a>);

impl Kernel for SetUp<'_> {
    type Answer = ();

    #[inline(always)]
    fn run(self) {
        for group in self.0 {
            group.set_up(&self.1);
        }
    }
}

impl TriangleSetup {
    pub(crate) fn new() -> TriangleSetup {
        TriangleSetup { groups: [TriangleSetup8::NOTHING; TOGETHER / LANES], len: 0 }
    }

    pub(crate) fn clear(&mut self) {
        self.len = 0;
    }

    /// Adds a triangle, to at most [`TOGETHER`] in all.
    #[inline(always)]
    pub(crate) fn push(&mut self, corners: [DVec4; 3]) {
        let (group, lane) = (&mut self.groups[self.len / LANES], self.len % LANES);
        for (to, corner) in group.corners.iter_mut().zip(corners) {
            (to[0][lane], to[1][lane], to[2][lane], to[3][lane]) = (corner.x, corner.y, corner.z, corner.w);
        }
        self.len += 1;
    }

    /// Sets all triangles up.
    pub(crate) fn run(&mut self, target: SetupTarget) {
        InstructionSet::run(SetUp(&mut self.groups[..self.len.div_ceil(LANES)], target));
    }

    /// The corners of a triangle.
    pub(crate) fn corners(&self, index: usize) -> [DVec4; 3] {
        let (group, lane) = (&self.groups[index / LANES], index % LANES);
        [0, 1, 2].map(|corner| group.corner(corner, lane))
    }

    /// Whether the corners of a triangle run counter-clockwise, seen from the eye.
    #[inline(always)]
    pub(crate) fn is_counter_clockwise(&self, index: usize) -> bool {
        self.groups[index / LANES].is_counter_clockwise[index % LANES]
    }

    /// The result for a triangle of this source.
    #[inline(always)]
    pub(crate) fn get(&self, index: usize, source: Source) -> Setup {
        let (group, lane) = (&self.groups[index / LANES], index % LANES);
        if group.is_unseen[lane] {
            return Setup::Unseen;
        }
        if group.is_clipped[lane] {
            return Setup::Clipped;
        }
        let corner = |corner: &[[i32; LANES]; 2]| [corner[0][lane], corner[1][lane]];
        let [a, b, c] = &group.snapped;
        let plane = DVec3::new(group.plane[0][lane], group.plane[1][lane], group.plane[2][lane]);
        let range = [group.range[0][lane], group.range[1][lane]];
        match ScreenTriangle::of_snapped([corner(a), corner(b), corner(c)], plane, range, source) {
            Some(triangle) => Setup::Whole(triangle, [corner(&group.first), corner(&group.last)]),
            None => Setup::Unseen,
        }
    }
}
