//! Triangulation of simple polygons in O(n log n): a plane sweep splits them into monotone pieces, which are
//! triangulated by a stack (de Berg, Cheong, van Kreveld and Overmars, Computational Geometry, chapter 3).
//!
//! The result for polygons that cross or touch themselves may be wrong; the caller must validate it.

use std::cmp::Ordering;
use std::collections::BTreeMap;

/// A downward edge, or a point, whose two ends are equal. Edges that don't cross and overlap in height are ordered from
/// left to right.
#[derive(Clone, Copy, Debug)]
struct Edge {
    upper: [f64; 2],
    lower: [f64; 2],
}

/// Twice the signed area of a triangle, positive if it is counterclockwise.
fn turn([ax, ay]: [f64; 2], [bx, by]: [f64; 2], [cx, cy]: [f64; 2]) -> f64 {
    (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
}

/// The order of points in the sweep: from top to bottom, at equal height from left to right.
fn first(a: [f64; 2], b: [f64; 2]) -> Ordering {
    b[1].total_cmp(&a[1]).then(a[0].total_cmp(&b[0]))
}

impl Ord for Edge {
    fn cmp(&self, other: &Edge) -> Ordering {
        // The side of a downward edge on which a point lies: its left side has the larger x.
        let beside = |edge: &Edge, p| turn(edge.upper, edge.lower, p).total_cmp(&0.0);
        let same = |order: Ordering| (order != Ordering::Equal).then_some(order);
        let order = match first(self.upper, other.upper) {
            Ordering::Greater => same(beside(other, self.upper)).or_else(|| same(beside(other, self.lower))),
            _ => same(beside(self, other.upper)).or_else(|| same(beside(self, other.lower))).map(Ordering::reverse),
        };
        order.unwrap_or_else(|| first(self.upper, other.upper).then(first(self.lower, other.lower)))
    }
}

impl PartialOrd for Edge {
    fn partial_cmp(&self, other: &Edge) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Edge {
    fn eq(&self, other: &Edge) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Edge {}

/// The triangles of a simple counterclockwise polygon, as indices into `points`.
pub(super) fn triangles(points: &[[f64; 2]]) -> Vec<[u32; 3]> {
    let mut out = Vec::with_capacity(points.len().saturating_sub(2));
    let diagonals = diagonals(points);
    faces(points, &diagonals, |face| piece(points, face, &mut out));
    out
}

/// The diagonals that split a polygon into monotone pieces.
fn diagonals(points: &[[f64; 2]]) -> Vec<[u32; 2]> {
    let n = points.len();
    let after = |i: usize| if i + 1 == n { 0 } else { i + 1 };
    let before = |i: usize| if i == 0 { n - 1 } else { i - 1 };
    let edge = |i: usize| Edge { upper: points[i], lower: points[after(i)] };
    let is_later = |a: usize, b: usize| first(points[a], points[b]).then(a.cmp(&b)) == Ordering::Greater;
    let mut order: Vec<u32> = (0..n as u32).collect();
    order.sort_unstable_by(|a, b| first(points[*a as usize], points[*b as usize]).then(a.cmp(b)));
    let mut diagonals = Vec::new();
    // The downward edges at the sweep line. Each has its helper, the last point below it that sees it, and whether two
    // pieces merge there.
    let mut open: BTreeMap<Edge, (u32, bool)> = BTreeMap::new();
    for &v in &order {
        let i = v as usize;
        let (last, next) = (before(i), after(i));
        let (goes_down, comes_down) = (is_later(next, i), is_later(i, last));
        let convex = turn(points[last], points[i], points[next]) > 0.0;
        let mut merges = false;
        if comes_down {
            // The previous edge ends here.
            if let Some((helper, merged)) = open.remove(&edge(last))
                && merged
            {
                diagonals.push([v, helper]);
            }
        }
        let inner = match (comes_down, goes_down) {
            (true, true) => false,  // on a left chain
            (false, false) => true, // on a right chain
            (true, false) => {
                // the lower end of two edges
                merges = !convex;
                merges
            }
            (false, true) => !convex, // the upper end of two edges
        };
        if inner {
            let here = Edge { upper: points[i], lower: points[i] };
            if let Some((_, (helper, merged))) = open.range_mut(..here).next_back() {
                if *merged || goes_down && !comes_down {
                    diagonals.push([v, *helper]);
                }
                (*helper, *merged) = (v, merges);
            }
        }
        if goes_down {
            open.insert(edge(i), (v, false));
        }
    }
    diagonals
}

/// Calls `visit` with the corners of each piece into which the diagonals split a polygon.
fn faces(points: &[[f64; 2]], diagonals: &[[u32; 2]], mut visit: impl FnMut(&[u32])) {
    let n = points.len();
    // `starts` has the range of each point's diagonals in `ends`, the list of their other ends. Each range is then
    // sorted counterclockwise from the edge that leaves the point.
    let mut starts = vec![0u32; n + 1];
    for &[a, b] in diagonals {
        starts[a as usize + 1] += 1;
        starts[b as usize + 1] += 1;
    }
    for i in 0..n {
        starts[i + 1] += starts[i];
    }
    let mut ends = vec![0u32; 2 * diagonals.len()];
    let mut filled = starts.clone();
    for &[a, b] in diagonals {
        for [from, to] in [[a, b], [b, a]] {
            ends[filled[from as usize] as usize] = to;
            filled[from as usize] += 1;
        }
    }
    let next = |i: u32| if i as usize + 1 == n { 0 } else { i + 1 };
    // The angle from the edge ahead: first by half turns, then by orientation.
    let angles = |i: u32, a: u32, b: u32| {
        let [here, ahead, a, b] = [i, next(i), a, b].map(|i| points[i as usize]);
        let half = |p| turn(here, ahead, p) < 0.0;
        half(a).cmp(&half(b)).then_with(|| 0f64.total_cmp(&turn(here, a, b)))
    };
    for i in 0..n {
        let own = &mut ends[starts[i] as usize..starts[i + 1] as usize];
        own.sort_unstable_by(|a, b| angles(i as u32, *a, *b));
    }
    // Half edges: i is the polygon edge from point i, n + e is the diagonal of entry e in `ends`.
    let mut seen = vec![false; n + ends.len()];
    let mut face = Vec::new();
    for start in 0..n + ends.len() {
        let (mut half, mut from) = (
            start,
            if start < n { start as u32 } else { starts.partition_point(|s| *s as usize <= start - n) as u32 - 1 },
        );
        face.clear();
        while !seen[half] {
            seen[half] = true;
            face.push(from);
            let to = if half < n { next(from) } else { ends[half - n] };
            // The piece lies to the left. At the end of a half edge it continues along the first one clockwise from the
            // reversed half edge.
            let own = &ends[starts[to as usize] as usize..starts[to as usize + 1] as usize];
            let at = if half < n { own.len() } else { own.binary_search_by(|end| angles(to, *end, from)).unwrap_or(0) };
            half = if at == 0 { to as usize } else { n + starts[to as usize] as usize + at - 1 };
            from = to;
        }
        if face.len() >= 3 {
            visit(&face);
        }
    }
}

/// The triangles of a counterclockwise monotone piece.
fn piece(points: &[[f64; 2]], face: &[u32], out: &mut Vec<[u32; 3]>) {
    let n = face.len();
    let at = |i: usize| points[face[i] as usize];
    let sooner = |a: usize, b: usize| first(at(a), at(b)).then(face[a].cmp(&face[b]));
    let (Some(top), Some(bottom)) = ((0..n).min_by(|a, b| sooner(*a, *b)), (0..n).max_by(|a, b| sooner(*a, *b))) else {
        return;
    };
    // The merge of the left chain, which follows the top, and the right chain, in sweep order.
    let mut order = Vec::with_capacity(n);
    order.push((top, true));
    let (mut left, mut right) = ((top + 1) % n, (top + n - 1) % n);
    while left != bottom || right != bottom {
        if right == bottom || left != bottom && sooner(left, right) == Ordering::Less {
            order.push((left, true));
            left = (left + 1) % n;
        } else {
            order.push((right, false));
            right = (right + n - 1) % n;
        }
    }
    order.push((bottom, !order[order.len() - 1].1));
    let mut emit = |a: usize, b: usize, c: usize| out.push([face[a], face[b], face[c]]);
    let mut stack = vec![order[0], order[1]];
    for &(v, on_left) in &order[2..] {
        let Some(&(last, last_left)) = stack.last() else { return };
        if on_left != last_left {
            for two in stack.windows(2) {
                let ((a, _), (b, _)) = (two[0], two[1]);
                if last_left { emit(a, b, v) } else { emit(b, a, v) }
            }
            stack.clear();
            stack.push((last, last_left));
        } else {
            let mut middle = stack.pop().map_or(last, |(m, _)| m);
            while let Some(&(above, _)) = stack.last() {
                let turns = turn(at(above), at(middle), at(v));
                if if on_left { turns <= 0.0 } else { turns >= 0.0 } {
                    break;
                }
                if on_left {
                    emit(above, middle, v)
                } else {
                    emit(middle, above, v)
                }
                middle = above;
                stack.pop();
            }
            stack.push((middle, on_left));
        }
        stack.push((v, on_left));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    fn area(points: &[[f64; 2]]) -> f64 {
        let next = points.iter().cycle().skip(1);
        points.iter().zip(next).map(|(a, b)| 0.5 * (a[0] * b[1] - a[1] * b[0])).sum()
    }

    /// Simple counterclockwise polygons, concave nearly everywhere.
    fn shapes(n: usize) -> Vec<Vec<[f64; 2]>> {
        let round = |radius: &dyn Fn(usize) -> f64| -> Vec<[f64; 2]> {
            let at = |i: usize| (radius(i), TAU * i as f64 / n as f64);
            (0..n).map(at).map(|(r, t)| [r * libm::cos(t), r * libm::sin(t)]).collect()
        };
        let spikes = round(&|i| if i % 2 == 1 { 0.1 } else { 1.0 });
        let waves = round(&|i| 1.0 + 0.3 * libm::sin(7.0 * TAU * i as f64 / n as f64));
        let tooth = |i: usize| [i as f64, if i.is_multiple_of(2) { 1.0 } else { 100.0 }];
        let comb: Vec<[f64; 2]> = (0..n).rev().map(tooth).chain([[0.0, 0.0], [n as f64, 0.0]]).collect();
        let lying = comb.iter().map(|[x, y]| [-*y, *x]).collect();
        let turned = |i: usize| (n as f64 / 40.0).min(9.0) * TAU * i as f64 / n as f64;
        let arm = |i: usize, r: f64| [(r + turned(i)) * libm::cos(turned(i)), (r + turned(i)) * libm::sin(turned(i))];
        let spiral = (0..n).map(|i| arm(i, 4.0)).chain((0..n).rev().map(|i| arm(i, 1.0))).collect();
        let arc = |i: usize| TAU / 2.0 * i as f64 / (n - 1) as f64;
        let bowl = (0..n).rev().map(|i| [libm::cos(arc(i)), -libm::sin(arc(i))]).chain([[1.0, -2.0], [-1.0, -2.0]]);
        vec![spikes, waves, comb, lying, spiral, bowl.rev().collect()]
    }

    #[test]
    fn triangles_cover_each_polygon_once() {
        for n in [4, 5, 10, 37, 1000, 20_000] {
            for (kind, mut points) in shapes(n).into_iter().enumerate() {
                if area(&points) < 0.0 {
                    points.reverse();
                }
                let out = triangles(&points);
                let areas = out.iter().map(|t| area(&t.map(|i| points[i as usize])));
                assert!(areas.clone().all(|area| area >= -1e-9), "{kind} of {n}");
                assert!((areas.sum::<f64>() / area(&points) - 1.0).abs() < 1e-9, "{kind} of {n}");
                assert_eq!(out.len(), points.len() - 2, "{kind} of {n}");
            }
        }
    }

    #[test]
    fn polygons_that_cross_themselves_end() {
        let mut state = 1u64;
        for n in 3..300 {
            let points: Vec<[f64; 2]> = (0..n)
                .map(|_| {
                    state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                    [(state >> 60) as f64, (state >> 56 & 15) as f64]
                })
                .collect();
            triangles(&points);
        }
    }
}
