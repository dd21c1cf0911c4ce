//! An estimate of a displaced surface's final number of triangles before they are made. Some of its triangles are
//! refined one by one, and the results are discarded.

use super::{BaseMesh, Vertex};
use canaletto_parallel::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// A vertex and its height.
pub(super) type Raised = (Vertex, f64);

/// The number of triangles in the sample.
const SAMPLE: usize = 256;

/// The limit divided by the largest contribution of one triangle, so that no single triangle decides.
const SHARE: usize = 32;

/// Calls `each` with the parts of a triangle after splitting these edges at their `middles`. `longer` compares two
/// edges: it returns whether the first one is longer.
pub(super) fn parts<V: Copy>(
    [a, b, c]: [V; 3],
    middles: [Option<V>; 3],
    longer: impl Fn([V; 2], [V; 2]) -> bool,
    mut each: impl FnMut([V; 3]),
) {
    // With p between a and b and q between b and c, the first cut is from the middle of the longer edge.
    let mut around = |[a, b, c]: [V; 3], p: V, q: V| {
        let rest = if longer([a, b], [b, c]) { [[p, q, c], [a, p, c]] } else { [[a, p, q], [a, q, c]] };
        [[p, b, q], rest[0], rest[1]].into_iter().for_each(&mut each);
    };
    match middles {
        [None, None, None] => each([a, b, c]),
        [Some(m), None, None] => [[a, m, c], [m, b, c]].into_iter().for_each(each),
        [None, Some(m), None] => [[a, b, m], [a, m, c]].into_iter().for_each(each),
        [None, None, Some(m)] => [[a, b, m], [m, b, c]].into_iter().for_each(each),
        [Some(p), Some(q), None] => around([a, b, c], p, q),
        [None, Some(p), Some(q)] => around([b, c, a], p, q),
        [Some(q), None, Some(p)] => around([c, a, b], p, q),
        [Some(p), Some(q), Some(r)] => {
            [[a, p, r], [p, b, q], [r, q, c], [p, q, r]].into_iter().for_each(each);
        }
    }
}

impl BaseMesh {
    /// Whether the final number of triangles certainly exceeds `most`. Splits by neighbours are left out; they would
    /// only add.
    pub(super) fn exceeds(
        &self,
        most: usize,
        triangles: &[[u32; 3]],
        heights: &[f64],
        wanted: &(impl Fn(&Raised, &Raised) -> bool + Sync),
        height: &(dyn Fn(&Vertex) -> f64 + Sync),
    ) -> bool {
        let step = triangles.len().div_ceil(SAMPLE).max(1);
        let sample: Vec<[u32; 3]> = triangles.iter().copied().step_by(step).collect();
        let each = (most / step).div_ceil(SHARE).max(1);
        let sum = AtomicUsize::new(0);
        let exceeds = || sum.load(Ordering::Relaxed).saturating_mul(step) > most;
        sample.par_iter().for_each(|corners| {
            // Sums only grow, so that the result doesn't depend on the triangles left out.
            if !exceeds() {
                let corners = corners.map(|v| (self.vertices[v as usize], heights[v as usize]));
                sum.fetch_add(self.refined(corners, each, wanted, height), Ordering::Relaxed);
            }
        });
        exceeds()
    }

    /// The number of triangles that one triangle becomes, up to `most`.
    fn refined(
        &self,
        triangle: [Raised; 3],
        most: usize,
        wanted: &impl Fn(&Raised, &Raised) -> bool,
        height: &(dyn Fn(&Vertex) -> f64 + Sync),
    ) -> usize {
        let length = |[a, b]: [Raised; 2]| a.0.point.distance_squared(b.0.point);
        let mut whole = 0;
        let mut left = vec![triangle];
        while let Some([a, b, c]) = left.pop() {
            if whole + left.len() >= most {
                return most;
            }
            let edges = [[a, b], [b, c], [c, a]];
            let mut split = edges.map(|[a, b]| wanted(&a, &b));
            if split.contains(&true) {
                // Rivara's rule, as for the base mesh.
                let longest = (0..3).reduce(|x, y| if length(edges[y]) > length(edges[x]) { y } else { x });
                split[longest.unwrap_or(0)] = true;
            }
            if split == [false; 3] {
                whole += 1;
                continue;
            }
            let middle = |i: usize| {
                let vertex = self.between(&edges[i][0].0, &edges[i][1].0, 0.5);
                split[i].then(|| (vertex, height(&vertex)))
            };
            parts([a, b, c], [0, 1, 2].map(middle), |x, y| length(x) >= length(y), |part| left.push(part));
        }
        whole
    }
}
