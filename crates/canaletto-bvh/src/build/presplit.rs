//! Presplitting: before the build, triangles that fill little of their boxes are replaced by several references with
//! smaller boxes. See Karras and Aila, "Fast parallel construction of high-quality bounding volume hierarchies", 2013,
//! section 4.3.
//!
//! A reference is the box around a triangle's part in a cell; the triangle itself stays whole. [`crate::triangle`]
//! proves what the boxes and the exact test must satisfy so that no hit is lost. Unlike the paper, only triangles that
//! waste much more area than the average box has are split, and only into few parts.

use canaletto_parallel::prelude::*;
use glam::{DVec3, Vec3};

use super::BuildError;
use super::prim_ref::{Corners, Extent, PrimRef, PrimRefs};
use crate::Aabb;
use crate::node::MAX_PRIMITIVES;

/// The limits of presplitting.
#[derive(Clone, Copy)]
pub(super) struct SplitBudget {
    /// The largest number of additional references, as a fraction of the number of triangles.
    max_extra: f64,
    /// The least waste for a split, in areas of an average box. Triangles that waste less stay whole.
    min_waste: f64,
    /// The waste for which a triangle is split once, in areas of an average box. Four times this waste gives two
    /// splits.
    waste_unit: f64,
}

impl SplitBudget {
    /// Tuned so that scans get no splits and a meadow gets almost none, as splits bring nothing there. An atrium gets
    /// 2.7 % more references and a third less SAH cost.
    pub(super) const DEFAULT: Self = Self { max_extra: 0.3, min_waste: 8.0, waste_unit: 3.0 };

    /// The largest number of additional references for `count` triangles.
    pub(super) fn room(&self, count: usize) -> usize {
        ((self.max_extra * count as f64) as usize).min(MAX_PRIMITIVES.saturating_sub(count))
    }
}

impl<'a> PrimRefs<'a> {
    /// The references of `count` triangles. Triangles that fill little of their boxes get several.
    pub(crate) fn of_triangles(count: usize, corners: &'a Corners<'a>) -> Result<Self, BuildError> {
        let budget = SplitBudget::DEFAULT;
        let mut refs = Self::of_triangles_with_room(count, budget.room(count), corners)?;
        split(&mut refs, corners, budget);
        Ok(refs)
    }
}

/// The largest number of additional references of one triangle. Trees over meshes on a ground of two triangles cost a
/// tenth less with this limit than with thousands of references.
const MAX_EXTRA_OF_ONE: f64 = 12.0;
/// The margin of a part's box on all sides, as a fraction of the triangle's largest extent: 2⁻²¹ for the cell that the
/// part is cut out with, and 2⁻²¹ for the part.
const MARGIN: f64 = 1.0 / (1u64 << 21) as f64;
/// The bits of a coordinate in the grid along whose planes triangles are split.
const GRID_BITS: u32 = 30;
/// The number of references in a thread's chunk. It is fixed, so that rounding doesn't depend on threads.
const CHUNK: usize = 1 << 12;

/// Replaces the references of wasteful triangles by several smaller references.
pub(super) fn split(all: &mut PrimRefs, corners: &Corners, budget: SplitBudget) {
    let refs = &mut all.list;
    let areas: Vec<f64> = refs.par_chunks(CHUNK).map(|refs| refs.iter().map(half_area).sum()).collect();
    let area = areas.iter().sum::<f64>();
    if area == 0.0 {
        return;
    }
    let mean = area / refs.len() as f64;
    let (min_waste, mut waste_unit) = (budget.min_waste * mean, budget.waste_unit * mean);
    let waste = |prim: &PrimRef| if half_area(prim) < min_waste { 0.0 } else { waste(prim, &corners(prim.id())) };
    let wasteful =
        |(index, prim): (usize, &PrimRef)| Some((index, waste(prim))).filter(|&(_, waste)| waste >= min_waste);
    let long: Vec<(usize, f64)> = refs.par_iter().enumerate().with_min_len(CHUNK).filter_map(wasteful).collect();
    if long.is_empty() {
        return;
    }
    // Find the least unit of waste that keeps the sum of splits within the budget.
    let max_extra = budget.room(refs.len());
    while long.par_iter().map(|&(_, waste)| splits(waste, waste_unit)).sum() > max_extra {
        waste_unit *= 1.25;
    }
    let root = Extent::of(refs).bounds.aabb();
    let grid = Grid::new(&root);
    let parts: Vec<Vec<PrimRef>> = long
        .par_iter()
        .map(|&(index, waste)| (refs[index].id(), splits(waste, waste_unit)))
        .map(|(id, splits)| references(id, &corners(id), splits, &grid))
        .collect();
    for ((index, _), parts) in long.into_iter().zip(parts) {
        if let [first, others @ ..] = parts.as_slice() {
            refs[index] = *first;
            refs.extend_from_slice(others);
        }
    }
    all.whole = Some(root);
}

/// Half of the surface area of a box.
fn half_area(prim: &PrimRef) -> f64 {
    prim.bounds().aabb().half_area()
}

/// The wasted area: half of the area that the box around a triangle has and ever smaller boxes around its parts would
/// not have. It is between half of the box's `half_area` and all of it.
fn waste(prim: &PrimRef, [a, b, c]: &[Vec3; 3]) -> f64 {
    let a = a.as_dvec3();
    let sides = (b.as_dvec3() - a).cross(c.as_dvec3() - a).abs();
    half_area(prim) - 0.5 * sides.element_sum()
}

/// The number of splits of a triangle.
fn splits(waste: f64, waste_unit: f64) -> usize {
    (waste / waste_unit).sqrt().min(MAX_EXTRA_OF_ONE) as usize
}

/// A grid of cubes around the scene. A reference is split along the coarsest grid plane that crosses it, so that
/// neighbours are split along common planes.
struct Grid {
    origin: DVec3,
    /// The size of the finest cells.
    cell: f64,
}

impl Grid {
    fn new(root: &Aabb) -> Self {
        let origin = root.min.as_dvec3();
        let size = (root.max.as_dvec3() - origin).max_element();
        Self { origin, cell: size / f64::from(1u32 << GRID_BITS) }
    }

    /// The axis and coordinate of the coarsest plane that crosses a box. Of equally coarse planes, the one along the
    /// box's largest extent is taken.
    fn plane(&self, low: DVec3, high: DVec3) -> Option<(usize, f64)> {
        let mut best: Option<(u32, f64, usize, f64)> = None;
        for axis in 0..3 {
            let index = |x: f64| ((x - self.origin[axis]) / self.cell) as u32;
            if low[axis] >= high[axis] {
                continue;
            }
            let (first, last) = (index(low[axis]), index(high[axis]));
            let differ = first ^ last;
            if differ == 0 {
                continue;
            }
            let level = differ.ilog2();
            let at = self.origin[axis] + f64::from(last >> level << level) * self.cell;
            let extent = high[axis] - low[axis];
            let better = best.is_none_or(|(l, e, ..)| level > l || level == l && extent > e);
            if better && low[axis] < at && at < high[axis] {
                best = Some((level, extent, axis, at));
            }
        }
        best.map(|(_, _, axis, at)| (axis, at))
    }
}

/// The largest number of corners of a triangle's part: three, and one more for each side of a cell. Only rounding can
/// give more.
const CORNERS: usize = 12;

/// A convex part of a triangle, relative to the triangle's first corner.
#[derive(Clone, Copy)]
struct Part {
    corners: [DVec3; CORNERS],
    len: usize,
}

impl Part {
    /// The part below a plane of an axis, or above it if `side` is −1. None if the corners don't fit.
    fn cut(&self, axis: usize, at: f64, side: f64) -> Option<Self> {
        let mut cut = Self { corners: [DVec3::ZERO; CORNERS], len: 0 };
        let mut push = |p: DVec3| {
            *cut.corners.get_mut(cut.len)? = p;
            cut.len += 1;
            Some(())
        };
        for i in 0..self.len {
            let (p, q) = (self.corners[i], self.corners[(i + 1) % self.len]);
            let (above, next) = ((p[axis] - at) * side, (q[axis] - at) * side);
            if above <= 0.0 {
                push(p)?;
            }
            if above < 0.0 && next > 0.0 || above > 0.0 && next < 0.0 {
                let mut on = p + (q - p) * (above / (above - next));
                on[axis] = at;
                push(on)?;
            }
        }
        (cut.len > 0).then_some(cut)
    }

    fn bounds(&self) -> (DVec3, DVec3) {
        let corners = &self.corners[..self.len];
        corners.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(a, b), &p| (a.min(p), b.max(p)))
    }
}

/// The references of a triangle with at most so many splits. Empty if it cannot be split.
fn references(id: u32, corners: &[Vec3; 3], splits: usize, grid: &Grid) -> Vec<PrimRef> {
    let first = corners[0].as_dvec3();
    let mut part = Part { corners: [DVec3::ZERO; CORNERS], len: 3 };
    for (own, corner) in part.corners.iter_mut().zip(corners) {
        *own = corner.as_dvec3() - first;
    }
    let (low, high) = part.bounds();
    let margin = (high - low).max_element() * MARGIN;
    let mut parts = Vec::with_capacity(splits + 1);
    let mut todo = vec![(part, splits)];
    while let Some((part, splits)) = todo.pop() {
        let (low, high) = part.bounds();
        // Parts reach beyond the plane that made them. The shrunken box prevents a second split along that plane.
        let (inner_low, inner_high) = (first + low + 2.0 * margin, first + high - 2.0 * margin);
        let plane = if splits > 0 { grid.plane(inner_low, inner_high) } else { None };
        let halves = plane.and_then(|(axis, at)| {
            let at = at - first[axis];
            Some([part.cut(axis, at + margin, 1.0)?, part.cut(axis, at - margin, -1.0)?])
        });
        let Some([a, b]) = halves else {
            let bounds = Aabb { min: below(first + low - margin), max: above(first + high + margin) };
            if !bounds.is_finite() {
                return Vec::new();
            }
            parts.push(PrimRef::new(&bounds, id));
            continue;
        };
        let extent = |part: &Part| {
            let (low, high) = part.bounds();
            (high - low).max_element()
        };
        let share = extent(&a) / (extent(&a) + extent(&b));
        let to_a = ((splits - 1) as f64 * share + 0.5) as usize;
        todo.push((b, splits - 1 - to_a.min(splits - 1)));
        todo.push((a, to_a.min(splits - 1)));
    }
    // A single part would have a wider box than the triangle.
    if parts.len() > 1 { parts } else { Vec::new() }
}

/// The nearest f32 numbers that are certainly smaller.
fn below(p: DVec3) -> Vec3 {
    let p = p.as_vec3();
    Vec3::new(p.x.next_down(), p.y.next_down(), p.z.next_down())
}

/// The nearest f32 numbers that are certainly larger.
fn above(p: DVec3) -> Vec3 {
    -below(-p)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3Swizzles;

    use crate::primitive::triangle::{Triangle, intersect};
    use crate::slab::cull_limit;
    use crate::testing::{Random, TestPrimitive, awkward_ray, zoo};
    use crate::{InstructionSet, PreparedRay, PrimitiveHit, Quality, Ray, TriangleBvh};

    /// A budget that splits every triangle that can be split.
    const ALL: SplitBudget = SplitBudget { max_extra: 30.0, min_waste: 1e-6, waste_unit: 1e-6 };

    fn pick<T: Copy>(random: &mut Random, of: &[T]) -> T {
        of[random.below(of.len())]
    }

    /// A triangle from a sliver to a regular one, of any size and place, sometimes along axes.
    fn any_triangle(random: &mut Random) -> [Vec3; 3] {
        let place = random.vector() * pick(random, &[0.0, 1.0, 1e3, 1e6]);
        let thin = pick(random, &[1.0, 1e-3, 1e-6, 0.0]);
        let [p, q] = [random.vector(), random.vector()];
        let [p, q] = match random.below(4) {
            0 => [p.x * Vec3::AXES[random.below(3)], q * thin],
            1 => [p * Vec3::new(1.0, thin, 1.0), q * Vec3::new(1.0, thin, 1.0)],
            2 => [p, p * random.signed() + q * thin],
            _ => [p, q],
        };
        let scale = 10f32.powi(random.below(40) as i32 - 20);
        [place, place + p, place + q].map(|p| p * scale)
    }

    /// A ray at a triangle: through its splits, near its borders, or in its plane; from afar or nearby.
    fn any_ray([a, b, c]: [Vec3; 3], parts: &[Aabb], random: &mut Random) -> Ray {
        let (u, v) = (0.5 + 0.5 * random.signed(), 0.5 + 0.5 * random.signed());
        let inside = a + (b - a) * (u * (1.0 - v)) + (c - a) * (u * v);
        let mut target = match random.below(4) {
            0 => a + (b - a) * u,
            1 => pick(random, &[a, b, c]),
            _ => inside,
        };
        let part = pick(random, parts);
        let axis = random.below(3);
        if random.below(2) == 0 {
            // A target around the plane between two parts.
            target[axis] = pick(random, &[part.min[axis], part.max[axis], part.min[axis].next_up()]);
        }
        let size = (b - a).abs().max((c - a).abs()).max_element();
        let distance = size * 10f32.powi(random.below(16) as i32 - 5);
        let mut way = match random.below(4) {
            0 => (b - a) * random.signed() + (c - a) * random.signed(),
            1 => ((b - a) * random.signed() + (c - a) * random.signed()) / size + random.vector() * 1e-6,
            _ => random.vector(),
        };
        way = way / way.abs().max_element().max(f32::MIN_POSITIVE);
        way[axis] *= pick(random, &[1.0, 1.0, 0.0, 1e-4, 1e-8, 1e-12, 1e-20]);
        Ray::new(target - way * distance, way * pick(random, &[1.0, distance, 1e-3 / size]))
    }

    /// A triangle with an edge through a line along which parts meet, or along a border of the box. The ray runs next
    /// to that line.
    fn next_to_a_line(random: &mut Random) -> ([Vec3; 3], Ray) {
        let turn = random.below(3);
        let place = |x: f32, y: f32, z: f32| {
            let p = Vec3::new(x, y, z);
            [p, p.zxy(), p.yzx()][turn]
        };
        let tiny = |r: &mut Random| r.signed() * 10f32.powi(-(r.below(33) as i32) - 4) * pick(r, &[1.0, 1.0, 0.0]);
        let slope = pick(random, &[1.0, -1.0, 0.0, 0.5]);
        let depth = |r: &mut Random| 10.0 * r.signed().abs() * pick(r, &[1.0, 1.0, 0.0]);
        let [s, t] = [random.signed().abs(), random.signed().abs()];
        let corners = [
            place(-s, -s * slope, depth(random)),
            place(t, t * slope, depth(random)),
            place(random.signed(), random.signed(), depth(random)),
        ];
        let origin = place(tiny(random), tiny(random), -random.signed().abs() * pick(random, &[0.01, 1.0, 1e3]));
        (corners, Ray::new(origin, place(tiny(random), tiny(random), 1.0)))
    }

    /// A ray and a triangle that lie exactly in one plane.
    fn in_one_plane(random: &mut Random) -> ([Vec3; 3], Ray) {
        let [p, q] = [random.vector(), random.vector()].map(|v| (v * 3000.0).round());
        let mut point = || p * random.below(40) as f32 + q * random.below(40) as f32;
        let [a, b, c, origin, target] = [point(), point(), point(), point(), point()];
        ([a, b, c], Ray::new(origin, target - origin))
    }

    #[test]
    fn wherever_a_triangle_is_hit_a_part_of_it_is_met() {
        let random = &mut Random(61);
        let (mut hits, mut several, mut elsewhere) = ([0; 3], 0, 0);
        for i in 0..600_000 {
            let kind = i % 3;
            let (corners, aimed) = match kind {
                0 => (any_triangle(random), None),
                1 => {
                    let (corners, ray) = next_to_a_line(random);
                    (corners, Some(ray))
                }
                _ => {
                    let (corners, ray) = in_one_plane(random);
                    (corners, Some(ray))
                }
            };
            let whole = Aabb::from_points(corners);
            let root = match kind {
                1 => Aabb { min: Vec3::splat(-16.0), max: Vec3::splat(16.0) },
                // The root is off center, so that planes lie anywhere.
                _ => Aabb { min: whole.min - (whole.max - whole.min) * random.signed().abs(), max: whole.max },
            };
            let parts = references(7, &corners, 40, &Grid::new(&root));
            let mut parts: Vec<Aabb> = parts.iter().map(|prim| prim.bounds().aabb()).collect();
            if parts.is_empty() {
                parts.push(whole);
            }
            several += usize::from(parts.len() > 1);
            for _ in 0..if aimed.is_some() { 1 } else { 4 } {
                let ray = aimed.unwrap_or_else(|| any_ray(corners, &parts, random)).prepare();
                let Some(hit) = intersect(&ray, &Triangle::new(corners), f32::INFINITY) else { continue };
                hits[kind] += 1;
                let met = |part: &Aabb| {
                    let (near, far) = ray.clip_irregular(part, cull_limit(hit.t));
                    near <= far
                };
                assert!(parts.iter().any(met), "{kind} {corners:?} {ray:?} {hit:?} {hits:?}");
                elsewhere += usize::from(!parts.iter().all(met));
            }
        }
        let enough = hits.iter().zip([100_000, 10_000, 1000]).all(|(&hits, min_waste)| hits > min_waste);
        assert!(enough && several > 300_000 && elsewhere > 100_000, "{hits:?} {several} {elsewhere}");
    }

    /// Compares every kind of query with a loop over all triangles.
    fn compare(name: &str, corners: &[[Vec3; 3]], rays: &[Ray], trees: &[TriangleBvh]) {
        let whole = TriangleBvh::build(corners.len(), |id| corners[id as usize]).unwrap();
        let prepared: Vec<PreparedRay> = rays.iter().map(Ray::prepare).collect();
        let start = vec![PrimitiveHit::none(f32::INFINITY); rays.len()];
        let mut expected = start.clone();
        for (ray, nearest) in prepared.iter().zip(&mut expected) {
            whole.intersect_brute_force(ray, nearest, false);
        }
        let blocked: Vec<bool> = expected.iter().map(|nearest| nearest.t <= 2.0).collect();
        for (triangles, set) in
            trees.iter().flat_map(|tree| InstructionSet::available().iter().map(move |&s| (tree, s)))
        {
            set.limit();
            let mut single = start.clone();
            prepared.iter().zip(&mut single).for_each(|(ray, nearest)| triangles.intersect(ray, nearest, false));
            let (mut stream, mut packets) = (start.clone(), start.clone());
            triangles.intersect_stream(rays, &mut stream, false);
            triangles.intersect_coherent(rays, &mut packets, false);
            let any = |any: &dyn Fn(&mut [f32])| {
                let mut t_max = vec![2.0; rays.len()];
                any(&mut t_max);
                t_max.iter().map(|&t| t == f32::NEG_INFINITY).collect::<Vec<_>>()
            };
            let any_stream = any(&|t_max| triangles.occluded_stream(rays, t_max, false));
            let any_packets = any(&|t_max| triangles.occluded_coherent(rays, t_max, false));
            for i in 0..rays.len() {
                let found = [single[i], stream[i], packets[i]];
                assert_eq!(found, [expected[i]; 3], "{name} {set:?} {:?}", rays[i]);
                let single = triangles.occluded(&prepared[i], 2.0, false, &mut |_| true).is_some();
                assert_eq!([single, any_stream[i], any_packets[i]], [blocked[i]; 3], "{name} {set:?} {:?}", rays[i]);
            }
        }
    }

    fn trees(corners: &[[Vec3; 3]]) -> [TriangleBvh; 2] {
        let of = &|id: u32| corners[id as usize];
        let mut refs = PrimRefs::new(corners.len(), &|id| Aabb::of_triangle(corners[id])).unwrap();
        let before = refs.list.len();
        split(&mut refs, of, ALL);
        assert!(refs.list.len() <= 31 * before);
        let split = TriangleBvh::over(refs, Quality::High, corners.len(), of);
        [split, TriangleBvh::build_with(Quality::High, corners.len(), of).unwrap()]
    }

    #[test]
    fn split_triangles_are_found_as_whole_ones_are() {
        let random = &mut Random(62);
        let mut scenes: Vec<(&str, Vec<[Vec3; 3]>)> = Vec::new();
        for (name, scene) in zoo() {
            let corners = |p: &TestPrimitive| match p {
                TestPrimitive::Triangle(corners) => Some(*corners),
                TestPrimitive::Sphere(..) => None,
            };
            scenes.push((name, scene.iter().filter_map(corners).collect()));
        }
        let sliver = |r: &mut Random, thin: f32| {
            let [p, q] = [r.vector(), r.vector()];
            [p, p + q, p + q + thin * r.vector()]
        };
        scenes.push(("slivers", (0..300).map(|i| sliver(random, [1e-2, 1e-4, 1e-7][i % 3])).collect()));
        // All triangles intersect one line, so that hits lie close together.
        scenes.push(("fan", (0..200).map(|_| [-Vec3::X, Vec3::X, random.vector()]).collect()));
        let [lines, planes]: [Vec<_>; 2] =
            [next_to_a_line as fn(&mut Random) -> _, in_one_plane].map(|make| (0..150).map(|_| make(random)).collect());
        let mut aimed = Vec::new();
        for (name, cases) in [("next to a line", lines), ("in planes", planes)] {
            scenes.push((name, cases.iter().map(|case| case.0).collect()));
            aimed.extend(cases.iter().map(|case| case.1));
        }
        for (name, corners) in scenes.into_iter().filter(|scene| !scene.1.is_empty()) {
            let primitives: Vec<TestPrimitive> = corners.iter().map(|&c| TestPrimitive::Triangle(c)).collect();
            let trees = trees(&corners);
            let mut rays: Vec<Ray> = (0..200).map(|_| awkward_ray(&primitives, random)).collect();
            rays.extend((0..200).map(|_| {
                let corners = pick(random, &corners);
                any_ray(corners, &[Aabb::from_points(corners)], random)
            }));
            rays.extend(&aimed);
            // Some coherent rays, for packets.
            let first = awkward_ray(&primitives, random);
            let size = first.direction.abs().max_element() * 0.01;
            rays.extend((0..64).map(|_| Ray::new(first.origin, first.direction + random.vector() * size)));
            compare(name, &corners, &rays, &trees);
        }
    }

    #[test]
    fn long_triangles_are_split_and_those_of_a_scan_are_not() {
        let random = &mut Random(63);
        let scan: Vec<[Vec3; 3]> = crate::testing::closed_mesh(random);
        let mut both = scan.clone();
        both.push([Vec3::splat(-9.0), Vec3::splat(9.0), Vec3::new(9.0, 9.0, 8.9)]);
        let references = |corners: &[[Vec3; 3]]| {
            let of = &|id: u32| corners[id as usize];
            let refs = PrimRefs::of_triangles(corners.len(), &of).unwrap();
            assert!(refs.list.len() as f64 <= 1.3 * corners.len() as f64);
            refs.list.len() - corners.len()
        };
        assert!(references(&scan) < scan.len() / 50);
        assert!(references(&both) > 5);
        let of = &|id: u32| both[id as usize];
        let refs = PrimRefs::new(both.len(), &|id| Aabb::of_triangle(both[id])).unwrap();
        let whole = TriangleBvh::over(refs, Quality::Medium, both.len(), of);
        let split = TriangleBvh::build(both.len(), of).unwrap();
        assert!(split.statistics().sah_cost < 0.5 * whole.statistics().sah_cost);
        assert_eq!((split.bounds(), split.len()), (whole.bounds(), both.len()));
    }

    #[test]
    fn splits_do_not_depend_on_threads() {
        let random = &mut Random(64);
        let corners: Vec<[Vec3; 3]> = (0..9 * CHUNK + 9)
            .map(|i| {
                let p = random.vector();
                [p, p + random.vector() * 0.01, p + random.vector() * if i % 20 == 0 { 1.0 } else { 0.01 }]
            })
            .collect();
        let build = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let of = &|id: u32| corners[id as usize];
            let refs = pool.install(|| PrimRefs::of_triangles(corners.len(), &of));
            refs.unwrap().list.iter().map(|prim| (prim.id(), prim.bounds().0.map(f32::to_bits))).collect::<Vec<_>>()
        };
        let one = build(1);
        assert!(one.len() > corners.len() && build(2) == one && build(5) == one);
    }
}
