//! Sixteen rays that go nearly the same way, through the tree together: a node is visited if the interval of all of them
//! may meet it (Boulos, Wald and Shirley, "Geometric and arithmetic culling methods for entire ray packets", 2006), and
//! triangles are tested against all rays side by side.
//!
//! The answers are those of single rays, bit for bit. As there (`block`), triangles are tested in f32, and one that all but certainly is the nearest waits
//! for its exact test until the way has ended: then all rays are tested side by side with what waits for them, by the operations of the exact kernel in the same
//! order. Where a lane would leave the straight way (edges, products that nearly cancel, triangles without area), that ray
//! is served alone.
//!
//! The loops over lanes have no branches, so that the compiler makes vectors of them, for whatever instructions the function around them
//! is compiled for.

#![allow(clippy::needless_range_loop)] // Lanes of many lists side by side.

use crate::block::{BLUR, Block, Bound, Scene};
use crate::exact::CANCELLED;
use crate::node::{Link, Node};
use crate::slab::{self, DEFLATE, INFLATE, WIDTH, max, min};
use crate::traverse::STACK;
use crate::triangle::SURELY;
use crate::triangles::Nearest;
use crate::{Aabb, InstructionSet, Leaf, PreparedRay, Ray};
use glam::Vec3;
use std::mem::MaybeUninit;

/// Rays in a packet.
pub(crate) const LANES: usize = 16;

type Lanes<T> = [T; LANES];

/// What became of a packet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Outcome {
    /// All rays have their answers. So many triangles were tested on the way.
    Done(usize),
    /// The rays don't go together; nothing was done.
    Apart,
    /// These rays, a bit for each, have to be sent again, another way; what they know of hits is true.
    Again(u32),
}

/// Rays of one octant and one longest axis.
#[repr(C, align(64))]
struct Packet {
    /// x, y and z.
    origin: [Lanes<f32>; 3],
    reciprocal: [Lanes<f32>; 3],
    shear: [Lanes<f32>; 2],
    /// Up to where anything counts; −∞ for a ray that takes no part any more.
    t_max: Lanes<f32>,
    /// Up to where anything must be entered to be worth a visit.
    limits: Lanes<f32>,
    /// No hit of the triangle that waits is nearer; without one, the nearest hit.
    low: Lanes<f32>,
    /// The triangle that waits: four times its block plus its lane, or [`NOTHING`].
    waits: Lanes<u32>,
    /// The id of that triangle, or of the last one that waited or was the nearest: it may be met again in another leaf.
    known: Lanes<u32>,
    /// For each axis what all rays lie between: the origin that meets entry and exit planes first and last, and the
    /// reciprocals.
    interval: [Interval; 3],
    octant: usize,
    rows: [u8; 3],
    bound: Bound,
}

#[derive(Clone, Copy)]
struct Interval {
    enter: f32,
    leave: f32,
    reciprocal: [f32; 2],
}

const NOTHING: u32 = u32::MAX;

impl Packet {
    /// The packet of 1 to 16 rays, if they go together.
    #[inline(always)]
    fn gather(rays: &[Ray], t_max: impl Fn(usize) -> f32, bounds: &Aabb) -> Option<Packet> {
        let last = rays.len() - 1;
        let first = rays[0].prepare();
        let [_, _, longest] = first.axes();
        let mut origin = [[0.0f32; LANES]; 3];
        let mut direction = [[0.0f32; LANES]; 3];
        for i in 0..LANES {
            let Ray { origin: o, direction: d } = rays[min_of(i, last)];
            (origin[0][i], origin[1][i], origin[2][i]) = (o.x, o.y, o.z);
            (direction[0][i], direction[1][i], direction[2][i]) = (d.x, d.y, d.z);
        }
        let mut reciprocal = [[0.0f32; LANES]; 3];
        let mut apart = 0u32;
        for axis in 0..3 {
            let backwards = first.octant >> axis & 1 == 1;
            let long = &direction[longest];
            let is_longest = axis == longest;
            for i in 0..LANES {
                let d = direction[axis][i];
                let r = 1.0 / d;
                reciprocal[axis][i] = r;
                // Within the longest axis' length; of equal ones a single ray takes the first, which is then another way.
                let shorter = (d.abs() < long[i].abs()) | is_longest;
                let together = normal(r) & (origin[axis][i].abs() < f32::INFINITY) & ((d < 0.0) == backwards) & shorter;
                apart |= u32::from(!together);
            }
        }
        if apart != 0 {
            return None;
        }
        let mut shear = [[0.0f32; LANES]; 2];
        for k in 0..2 {
            let (along, long) = (&direction[first.axes()[k]], &direction[longest]);
            for i in 0..LANES {
                let s = along[i] / long[i];
                shear[k][i] = if (s == 0.0) | normal(s) { s } else { f32::NAN };
            }
        }
        let mut t = [f32::NEG_INFINITY; LANES];
        for i in 0..=last {
            t[i] = t_max(i);
        }
        let mut interval = [Interval { enter: 0.0, leave: 0.0, reciprocal: [0.0; 2] }; 3];
        let mut corners = [Vec3::ZERO; 2];
        for axis in 0..3 {
            let [low, high] = ends(&origin[axis]);
            (corners[0][axis], corners[1][axis]) = (low, high);
            let (enter, leave) = if first.octant >> axis & 1 == 1 { (low, high) } else { (high, low) };
            interval[axis] = Interval { enter, leave, reciprocal: ends(&reciprocal[axis]) };
        }
        Some(Packet {
            origin,
            reciprocal,
            shear,
            t_max: t,
            limits: [0.0; LANES],
            low: t,
            waits: [NOTHING; LANES],
            known: [Nearest::NONE; LANES],
            interval,
            octant: usize::from(first.octant),
            rows: first.rows,
            bound: Bound::within(corners[0], corners[1], bounds),
        })
    }

    /// Sets `limits` and returns the largest.
    #[inline(always)]
    fn limit(&mut self) -> f32 {
        for i in 0..LANES {
            self.limits[i] = slab::limit(self.t_max[i]);
        }
        largest(&self.limits)
    }

    /// Where the rays may enter and leave the boxes of a node: bounds for all of them, by monotone rounding.
    #[inline(always)]
    fn clip(&self, node: &Node, limit: f32) -> ([f32; WIDTH], [f32; WIDTH]) {
        let (mut near, mut far) = ([0.0f32; WIDTH], [f32::INFINITY; WIDTH]);
        for axis in 0..3 {
            let Interval { enter, leave, reciprocal: [r0, r1] } = self.interval[axis];
            let entry = self.octant >> axis & 1;
            let (first, second) = (&node.boxes[entry][axis], &node.boxes[entry ^ 1][axis]);
            for i in 0..WIDTH {
                let (x, y) = (first[i] - enter, second[i] - leave);
                near[i] = max(near[i], min(x * r0, x * r1));
                far[i] = min(far[i], max(y * r0, y * r1));
            }
        }
        for far in &mut far {
            *far = min(*far * INFLATE, limit);
        }
        (near, far)
    }

    /// Whether any ray meets the box in this lane of a node.
    #[inline(always)]
    fn enters(&self, node: &Node, lane: usize) -> bool {
        let planes = |axis: usize| {
            let entry = self.octant >> axis & 1;
            (node.boxes[entry][axis][lane & 7], node.boxes[entry ^ 1][axis][lane & 7])
        };
        let [(x0, x1), (y0, y1), (z0, z1)] = [planes(0), planes(1), planes(2)];
        let ([ox, oy, oz], [rx, ry, rz]) = (&self.origin, &self.reciprocal);
        let mut any = 0u32;
        for i in 0..LANES {
            let near = max(max((x0 - ox[i]) * rx[i], (y0 - oy[i]) * ry[i]), max((z0 - oz[i]) * rz[i], 0.0));
            let far = min(min((x1 - ox[i]) * rx[i], (y1 - oy[i]) * ry[i]), (z1 - oz[i]) * rz[i]) * INFLATE;
            any |= u32::from(near <= min(far, self.limits[i]));
        }
        any != 0
    }

    /// Tests a triangle, its corners in the order of `rows`, and lets it wait for the rays that all but certainly meet it before all else; with
    /// `any`, ends those that certainly meet it. Returns the rays for which it has to be decided alone, as a nonzero number for each.
    #[inline(always)]
    fn test(
        &mut self,
        corners: &[[f32; 3]; 3],
        bound: f32,
        place: u32,
        id: u32,
        front_only: bool,
        any: bool,
    ) -> Option<Lanes<u32>> {
        let k = |k: usize| usize::from(self.rows[k] >> 4) % 3;
        let origin = [&self.origin[k(0)], &self.origin[k(1)], &self.origin[k(2)]];
        let (along, [sx, sy]) = (&self.reciprocal[k(2)], &self.shear);
        let look =
            |i: usize| Look::new(corners, [origin[0][i], origin[1][i], origin[2][i]], [sx[i], sy[i]], along[i], bound);
        let certainly = |i: usize, look: &Look, low: f32, high: f32| {
            if any {
                let area = max(look.least.abs(), look.most.abs());
                let large = (area > self.bound.area) & (area * low > self.bound.volume * along[i].abs());
                (low >= f32::MIN_POSITIVE) & large & (high <= min(self.t_max[i], f32::MAX))
            } else {
                (low > 0.0) & (high < self.low[i])
            }
        };
        // Into lists of their own first: the compiler can't tell that nothing that is read here is written.
        let (mut undecided, mut taken) = ([0u32; LANES], [0u32; LANES]);
        let (mut lows, mut highs) = ([0.0f32; LANES], [0.0f32; LANES]);
        for i in 0..LANES {
            let look = look(i);
            let missed = (look.most > bound) & (look.least < -bound);
            let beyond = (look.first > min(self.t_max[i], f32::MAX)) | (look.last <= 0.0);
            let met = !(missed | beyond) & !(front_only & (look.least > bound));
            let (low, high) = (look.first, look.last * INFLATE);
            let take = met & look.inside & certainly(i, &look, low, high);
            taken[i] = u32::from(take);
            undecided[i] = u32::from(met & !take);
            (lows[i], highs[i]) = (low, high);
        }
        if some(&undecided) {
            // A closer look.
            for i in 0..LANES {
                let look = look(i);
                let (low, high) = look.between();
                // A triangle may be met again in another leaf.
                undecided[i] &= u32::from(self.known[i] != id);
                let waiting = look.inside & (undecided[i] != 0);
                let take = waiting & certainly(i, &look, low, high);
                let gone = waiting & ((high <= 0.0) | (low > min(self.t_max[i], f32::MAX)));
                taken[i] |= u32::from(take);
                undecided[i] &= u32::from(!(take | gone));
                lows[i] = if take { low } else { lows[i] };
                highs[i] = if take { high } else { highs[i] };
            }
        }
        for i in 0..LANES {
            let take = taken[i] != 0;
            if any {
                self.t_max[i] = if take { f32::NEG_INFINITY } else { self.t_max[i] };
            } else {
                self.t_max[i] = if take { highs[i] } else { self.t_max[i] };
                self.low[i] = if take { lows[i] } else { self.low[i] };
                self.waits[i] = if take { place } else { self.waits[i] };
                self.known[i] = if take { id } else { self.known[i] };
            }
        }
        some(&undecided).then_some(undecided)
    }
}

/// What f32 tells of a ray and a triangle: `block::Tested` for one.
struct Look {
    first: f32,
    last: f32,
    least: f32,
    most: f32,
    /// The line certainly passes between the edges.
    inside: bool,
    bound: f32,
    sum: f32,
    weighed: f32,
}

impl Look {
    #[inline(always)]
    fn new([a, b, c]: &[[f32; 3]; 3], [ox, oy, oz]: [f32; 3], [sx, sy]: [f32; 2], along: f32, bound: f32) -> Look {
        let (az, bz, cz) = (a[2] - oz, b[2] - oz, c[2] - oz);
        let (ta, tb, tc) = (az * along, bz * along, cz * along);
        let (ax, ay) = (a[0] - ox - sx * az, a[1] - oy - sy * az);
        let (bx, by) = (b[0] - ox - sx * bz, b[1] - oy - sy * bz);
        let (cx, cy) = (c[0] - ox - sx * cz, c[1] - oy - sy * cz);
        let (wa, wb, wc) = (bx * cy - by * cx, cx * ay - cy * ax, ax * by - ay * bx);
        let (least, most) = (min(min(wa, wb), wc), max(max(wa, wb), wc));
        Look {
            first: min(min(ta, tb), tc) * DEFLATE,
            last: max(max(ta, tb), tc),
            least,
            most,
            inside: (most < -bound) | (least > bound),
            bound,
            sum: wa + wb + wc,
            weighed: wa * ta + wb * tb + wc * tc,
        }
    }

    /// `Tested::between`.
    #[inline(always)]
    fn between(&self) -> (f32, f32) {
        let (first, high, sum) = (self.first, self.last * INFLATE, self.sum);
        let size = max(self.last.abs(), first.abs());
        let mean = self.weighed / sum;
        let off = (self.bound * 4.0 / sum.abs()) * (self.last - first) + size * BLUR;
        let told = self.inside & (mean >= first) & (mean <= high) & (sum.abs() * size >= f32::MIN_POSITIVE);
        (if told { max(first, mean - off) } else { first }, if told { min(high, mean + off) } else { high })
    }
}

/// Whether any is not 0.
#[inline(always)]
fn some(lanes: &Lanes<u32>) -> bool {
    let mut some = 0;
    for i in 0..LANES {
        some |= lanes[i];
    }
    some != 0
}

/// The way of a packet through the tree.
struct Walk {
    stack: [MaybeUninit<(f32, Link)>; STACK],
    len: usize,
    /// Triangles so far.
    triangles: usize,
}

impl Walk {
    #[inline(always)]
    fn new() -> Walk {
        let mut stack = [const { MaybeUninit::uninit() }; STACK];
        stack[0].write((f32::NEG_INFINITY, Link::node(0)));
        Walk { stack, len: 1, triangles: 0 }
    }

    /// The next leaf that a ray of the packet may meet. (It is a function that is asked, not one that calls another for each leaf, since that
    /// would not be compiled for the same instructions.)
    #[inline(always)]
    fn next<const ORDERED: bool>(&mut self, packet: &mut Packet, nodes: &[Node]) -> Option<Leaf> {
        let limit = packet.limit();
        while self.len > 0 {
            self.len -= 1;
            #[allow(unsafe_code)]
            // SAFETY: entries below `len` were written.
            let (near, link) = unsafe { self.stack[self.len].assume_init() };
            if near > limit {
                continue;
            }
            if link.is_leaf() {
                self.triangles += link.leaf().count() as usize;
                return Some(link.leaf());
            }
            let node = &nodes[link.index()];
            let (near, far) = packet.clip(node, limit);
            let mut met = [false; WIDTH];
            for lane in 0..WIDTH {
                met[lane] = near[lane] <= far[lane];
            }
            for (i, ordered) in node.order(packet.octant).enumerate() {
                let lane = if ORDERED { ordered } else { i };
                if met[lane] && packet.enters(node, lane) {
                    self.stack[self.len].write((near[lane], node.children[lane]));
                    self.len += 1;
                }
            }
        }
        None
    }
}

/// The largest of all lanes, by halves, which become vectors.
#[inline(always)]
fn largest(v: &Lanes<f32>) -> f32 {
    let (mut a, mut b, mut c) = ([0.0f32; 8], [0.0f32; 4], [0.0f32; 2]);
    for i in 0..8 {
        a[i] = max(v[i], v[i + 8]);
    }
    for i in 0..4 {
        b[i] = max(a[i], a[i + 4]);
    }
    for i in 0..2 {
        c[i] = max(b[i], b[i + 2]);
    }
    max(c[0], c[1])
}

/// The smallest and the largest.
#[inline(always)]
fn ends(v: &Lanes<f32>) -> [f32; 2] {
    let mut negated = [0.0f32; LANES];
    for i in 0..LANES {
        negated[i] = -v[i];
    }
    [-largest(&negated), largest(v)]
}

#[inline(always)]
fn closest_with(scene: Scene<'_>, rays: &[Ray], nearest: &mut [Nearest]) -> Outcome {
    if scene.nodes.is_empty() {
        return Outcome::Done(0);
    }
    let Some(mut packet) = Packet::gather(rays, |i| nearest[i].t, &scene.bounds) else { return Outcome::Apart };
    let mut again = 0;
    let (packet, mut walk) = (&mut packet, Walk::new());
    while let Some(leaf) = walk.next::<true>(packet, scene.nodes) {
        let block = &scene.blocks[leaf.first() as usize];
        let bound = packet.bound.of(block.size());
        for lane in 0..leaf.count() as usize {
            let corners = block.ordered(lane, packet.rows);
            let (place, id) = (leaf.first() << 2 | lane as u32, block.id(lane));
            if let Some(undecided) = packet.test(&corners, bound, place, id, scene.front_only, false) {
                for i in (0..rays.len()).filter(|&i| undecided[i] != 0) {
                    again |= decide(packet, scene, i, place, &rays[i], &mut nearest[i]);
                }
            }
        }
    }
    let alone = settle(packet, scene, rays, nearest);
    for i in (0..rays.len()).filter(|i| alone >> i & 1 == 1) {
        again |= decide(packet, scene, i, NOTHING, &rays[i], &mut nearest[i]);
    }
    if again == 0 { Outcome::Done(walk.triangles) } else { Outcome::Again(again) }
}

/// Tests what waits for a ray, then a triangle, exactly. Returns the ray's bit if what had waited was not met.
#[cold]
#[inline(never)]
fn decide(packet: &mut Packet, scene: Scene<'_>, i: usize, place: u32, ray: &Ray, nearest: &mut Nearest) -> u32 {
    let ray = PreparedRay::new(ray);
    let mut offer =
        |place: u32| scene.blocks[(place >> 2) as usize].offer(place as usize & 3, &ray, nearest, scene.front_only);
    let waits = std::mem::replace(&mut packet.waits[i], NOTHING);
    let failed = waits != NOTHING && !offer(waits);
    if place != NOTHING && offer(place) {
        packet.known[i] = scene.blocks[(place >> 2) as usize].id(place as usize & 3);
    }
    let failed = failed || waits != NOTHING && nearest.t > packet.t_max[i];
    (packet.t_max[i], packet.low[i]) = (nearest.t, nearest.t);
    u32::from(failed) << i
}

/// Tests for all rays what waits for them: `triangle::intersect_exactly` with rays for lanes. Returns the rays for which this has to be
/// done alone, a bit for each.
#[inline(always)]
fn settle(packet: &Packet, scene: Scene<'_>, rays: &[Ray], nearest: &mut [Nearest]) -> u32 {
    let mut corners = [[[0.0f32; LANES]; 3]; 3];
    for i in 0..rays.len() {
        if packet.waits[i] != NOTHING {
            let place = packet.waits[i];
            let triangle = scene.blocks[(place >> 2) as usize].ordered(place as usize & 3, packet.rows);
            for corner in 0..3 {
                for k in 0..3 {
                    corners[corner][k][i] = triangle[corner][k];
                }
            }
        }
    }
    let mut direction = [[0.0f32; LANES]; 3];
    for i in 0..LANES {
        let d = rays[min_of(i, rays.len() - 1)].direction;
        (direction[0][i], direction[1][i], direction[2][i]) = (d.x, d.y, d.z);
    }
    let k = [0, 1, 2].map(|k| usize::from(packet.rows[k] >> 4) % 3);
    let (ox, oy, oz) = (&packet.origin[k[0]], &packet.origin[k[1]], &packet.origin[k[2]]);
    let (dx, dy, dz) = (&direction[k[0]], &direction[k[1]], &direction[k[2]]);
    let [a, b, c] = &corners;
    let (mut t, mut u, mut v) = ([0.0f32; LANES], [0.0f32; LANES], [0.0f32; LANES]);
    let mut met = [0u32; LANES];
    for i in 0..LANES {
        let wide = |x: f32, o: f32| f64::from(x) - f64::from(o);
        let (ax, ay, az) = (wide(a[0][i], ox[i]), wide(a[1][i], oy[i]), wide(a[2][i], oz[i]));
        let (bx, by, bz) = (wide(b[0][i], ox[i]), wide(b[1][i], oy[i]), wide(b[2][i], oz[i]));
        let (cx, cy, cz) = (wide(c[0][i], ox[i]), wide(c[1][i], oy[i]), wide(c[2][i], oz[i]));
        let size = |x: f64, y: f64, z: f64| wide_max(wide_max(x.abs(), y.abs()), z.abs());
        let d = wide_max(wide_max(size(ax, ay, az), size(bx, by, bz)), size(cx, cy, cz));
        let along = f64::from(dz[i]);
        let (sx, sy) = (f64::from(dx[i]) / along, f64::from(dy[i]) / along);
        let (ax, ay) = (ax - sx * az, ay - sy * az);
        let (bx, by) = (bx - sx * bz, by - sy * bz);
        let (cx, cy) = (cx - sx * cz, cy - sy * cz);
        let ((wa, sa), (wb, sb), (wc, sc)) =
            (difference(bx, cy, by, cx), difference(cx, ay, cy, ax), difference(ax, by, ay, bx));
        let positive = (wa >= 0.0) & (wb >= 0.0) & (wc >= 0.0);
        let negative = (wa <= 0.0) & (wb <= 0.0) & (wc <= 0.0);
        let area = wa + wb + wc;
        let depth = wa * az + wb * bz + wc * cz;
        t[i] = (depth / area / along) as f32;
        u[i] = clamp((wb / area) as f32, 1.0);
        v[i] = clamp((wc / area) as f32, 1.0 - u[i]);
        let far = (area.abs() > d * d * SURELY) & (depth.abs() > d * d * d * SURELY);
        let counts = (area < 0.0) | !scene.front_only;
        met[i] = u32::from(sa & sb & sc & (positive | negative) & far & counts);
    }
    // `PreparedRay::confine_to_triangle`, the axes in another order: the longest comes last.
    for i in 0..LANES {
        let (mut near, mut far, mut last) = (0.0f32, f32::INFINITY, 0.0);
        for axis in 0..3 {
            let ends = [min(min(a[axis][i], b[axis][i]), c[axis][i]), max(max(a[axis][i], b[axis][i]), c[axis][i])];
            let (o, r) = (packet.origin[k[axis]][i], packet.reciprocal[k[axis]][i]);
            let (low, high) = ((ends[0] - o) * r, (ends[1] - o) * r);
            last = max(low, high);
            (near, far) = (max(near, min(low, high)), min(far, last));
        }
        let (far, last) = (far * INFLATE, last * INFLATE);
        let confined = if t[i] > last { last } else { t[i] };
        let confined = max(confined, near * DEFLATE);
        met[i] &= u32::from((near <= far) & (confined >= f32::MIN_POSITIVE) & (confined <= packet.t_max[i]));
        t[i] = confined;
    }
    let mut alone = 0;
    for i in 0..rays.len() {
        if packet.waits[i] == NOTHING {
            continue;
        }
        if met[i] == 0 {
            alone |= 1 << i;
            continue;
        }
        let id = scene.blocks[(packet.waits[i] >> 2) as usize].id(packet.waits[i] as usize & 3);
        nearest[i] = Nearest { t: t[i], u: u[i], v: v[i], id };
    }
    alone
}

#[inline(always)]
fn any_with(scene: Scene<'_>, rays: &[Ray], t_max: &mut [f32]) -> Outcome {
    if scene.nodes.is_empty() {
        return Outcome::Done(0);
    }
    let Some(mut packet) = Packet::gather(rays, |i| t_max[i], &scene.bounds) else { return Outcome::Apart };
    let (packet, mut walk) = (&mut packet, Walk::new());
    while let Some(leaf) = walk.next::<false>(packet, scene.nodes) {
        let block = &scene.blocks[leaf.first() as usize];
        let bound = packet.bound.of(block.size());
        for lane in 0..leaf.count() as usize {
            let corners = block.ordered(lane, packet.rows);
            if let Some(undecided) = packet.test(&corners, bound, NOTHING, NOTHING - 1, scene.front_only, true) {
                for i in (0..rays.len()).filter(|&i| undecided[i] != 0) {
                    end(packet, scene, i, block, lane, &rays[i]);
                }
            }
        }
    }
    t_max.copy_from_slice(&packet.t_max[..rays.len()]);
    Outcome::Done(walk.triangles)
}

/// Ends a ray if a triangle is met, by the exact test.
#[cold]
#[inline(never)]
fn end(packet: &mut Packet, scene: Scene<'_>, i: usize, block: &Block, lane: usize, ray: &Ray) {
    let mut nearest = Nearest::before(packet.t_max[i]);
    if block.offer(lane, &ray.prepare(), &mut nearest, scene.front_only) {
        packet.t_max[i] = f32::NEG_INFINITY;
    }
}

macro_rules! for_instructions {
    ($(#[$doc:meta])* $name:ident, $with:ident, $avx2:ident, $avx512:ident, $answers:ty) => {
        $(#[$doc])*
        pub(crate) fn $name(scene: Scene<'_>, rays: &[Ray], answers: &mut [$answers]) -> Outcome {
            #[allow(unsafe_code)]
            #[cfg(target_arch = "x86_64")]
            match InstructionSet::current() {
                // SAFETY: `current` never tells more than the machine has.
                InstructionSet::Avx512 => return unsafe { $avx512(scene, rays, answers) },
                // SAFETY: as said.
                InstructionSet::Avx2 => return unsafe { $avx2(scene, rays, answers) },
                InstructionSet::Baseline => {}
            }
            $with(scene, rays, answers)
        }

        #[cfg(target_arch = "x86_64")]
        #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
        fn $avx2(scene: Scene<'_>, rays: &[Ray], answers: &mut [$answers]) -> Outcome {
            $with(scene, rays, answers)
        }

        #[cfg(target_arch = "x86_64")]
        #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt,avx512f,avx512vl,avx512bw,avx512dq")]
        fn $avx512(scene: Scene<'_>, rays: &[Ray], answers: &mut [$answers]) -> Outcome {
            $with(scene, rays, answers)
        }
    };
}

for_instructions!(
    /// Finds the nearest triangles that 1 to 16 rays meet, nearer than what is in `nearest`.
    closest, closest_with, closest_avx2, closest_avx512, Nearest
);
for_instructions!(
    /// Tells which of 1 to 16 rays meet a triangle at or before `t_max`, by −∞.
    any, any_with, any_avx2, any_avx512, f32
);

/// `exact::difference_of_products`, where that is not careful; tells whether that is so.
#[inline(always)]
fn difference(a: f64, b: f64, c: f64, d: f64) -> (f64, bool) {
    let (p, q) = (a * b, c * d);
    let e = p - q;
    (e, e.abs() > (p.abs() + q.abs()) * CANCELLED)
}

#[inline(always)]
fn normal(a: f32) -> bool {
    (a.abs() >= f32::MIN_POSITIVE) & (a.abs() < f32::INFINITY)
}

/// `f32::clamp` from 0; like that one, it leaves −0 alone.
#[inline(always)]
fn clamp(a: f32, end: f32) -> f32 {
    let a = if a < 0.0 { 0.0 } else { a };
    if a > end { end } else { a }
}

#[inline(always)]
fn wide_max(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

#[inline(always)]
fn min_of(a: usize, b: usize) -> usize {
    if a < b { a } else { b }
}
