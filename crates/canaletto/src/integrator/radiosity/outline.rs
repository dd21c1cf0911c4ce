//! Outlines of patches: triangles and parallelograms, their sample points and their parts.

use glam::DVec3;

/// The number of cells of an outline. Each cell has the same area, and a sample point in its middle.
pub(super) const CELLS: usize = 16;

/// A longer edge of a parallelogram is halved alone if it exceeds the shorter one by this factor.
const LONG_QUAD: f64 = 1.5;

/// The longest edge of a triangle is halved alone if it exceeds the shortest one by this factor.
const LONG_TRIANGLE: f64 = 1.8;

/// A flat outline with corners in order, counter-clockwise when seen from its front.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Outline {
    corners: [DVec3; 4],
    is_quad: bool,
}

/// How an outline is split.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Split {
    /// Four similar parts.
    Quarters,
    /// Two parts at the middle of the edge from this corner to the next, and of the opposite edge or corner.
    Halves(usize),
}

fn middle(a: DVec3, b: DVec3) -> DVec3 {
    (a + b) * 0.5
}

impl Outline {
    pub(super) fn triangle([a, b, c]: [DVec3; 3]) -> Outline {
        Outline { corners: [a, b, c, c], is_quad: false }
    }

    /// A parallelogram: the corners satisfy a + c = b + d.
    pub(super) fn quad(corners: [DVec3; 4]) -> Outline {
        Outline { corners, is_quad: true }
    }

    pub(super) fn corners(&self) -> &[DVec3] {
        &self.corners[..if self.is_quad { 4 } else { 3 }]
    }

    /// The same place seen from behind.
    pub(super) fn reversed(&self) -> Outline {
        let [a, b, c, d] = self.corners;
        if self.is_quad { Outline::quad([a, d, c, b]) } else { Outline::triangle([a, c, b]) }
    }

    /// Twice the area of the triangle of the first three corners, along the front's normal.
    fn cross(&self) -> DVec3 {
        let [a, b, c, _] = self.corners;
        (b - a).cross(c - a)
    }

    /// The unit normal of the front; none for an outline without an area.
    pub(super) fn normal(&self) -> Option<DVec3> {
        self.cross().try_normalize()
    }

    pub(super) fn area(&self) -> f64 {
        self.cross().length() * if self.is_quad { 1.0 } else { 0.5 }
    }

    pub(super) fn center(&self) -> DVec3 {
        let [a, b, c, d] = self.corners;
        if self.is_quad { middle(middle(a, b), middle(c, d)) } else { (a + b + c) / 3.0 }
    }

    /// The largest distance of a corner from the centre.
    pub(super) fn radius(&self) -> f64 {
        let center = self.center();
        self.corners().iter().map(|p| p.distance(center)).fold(0.0, f64::max)
    }

    /// The smallest distance between a corner and the opposite edge.
    pub(super) fn width(&self) -> f64 {
        let corners = self.corners();
        let edge = |i: usize| corners[i].distance(corners[(i + 1) % corners.len()]);
        let longest = (0..corners.len()).map(edge).fold(0.0, f64::max);
        if longest > 0.0 { self.cross().length() / longest } else { 0.0 }
    }

    /// The point with coordinates in the unit square; for a triangle u + v ≤ 1.
    pub(super) fn point(&self, u: f64, v: f64) -> DVec3 {
        let [a, b, c, d] = self.corners;
        let along = if self.is_quad { d } else { c };
        a + (b - a) * u + (along - a) * v
    }

    /// The middle of a cell. The first four cells lie in different quarters, and so do the next ones.
    pub(super) fn cell(&self, index: usize) -> DVec3 {
        let (quarter, part) = (index % 4, index / 4);
        if self.is_quad {
            // Together the four parts of a round lie in different rows and columns of the grid.
            let part = [[3, 2, 1, 0], [0, 1, 2, 3], [2, 3, 0, 1], [1, 0, 3, 2]][part][quarter];
            let at = |bit: usize| {
                0.5 * f64::from((quarter >> bit & 1) as u8) + 0.25 * f64::from((part >> bit & 1) as u8) + 0.125
            };
            return self.point(at(0), at(1));
        }
        self.quarters()[quarter].quarters()[part].center()
    }

    /// The points and weights of a quadrature that is exact for cubic functions, or the finer one of two.
    pub(super) fn quadrature(&self, fine: bool) -> Vec<(DVec3, f64)> {
        /// Gauss and Legendre's rules on 0..1 with two and four points.
        const TWO: [(f64, f64); 2] = [(0.211_324_865_405_187_1, 0.5), (0.788_675_134_594_812_9, 0.5)];
        const FOUR: [(f64, f64); 4] = [
            (0.069_431_844_202_973_71, 0.173_927_422_568_726_93),
            (0.330_009_478_207_571_9, 0.326_072_577_431_273_07),
            (0.669_990_521_792_428_1, 0.326_072_577_431_273_07),
            (0.930_568_155_797_026_3, 0.173_927_422_568_726_93),
        ];
        let rule: &[(f64, f64)] = if fine { &FOUR } else { &TWO };
        let pairs = rule.iter().flat_map(|&(u, wu)| rule.iter().map(move |&(v, wv)| (u, v, wu * wv)));
        if self.is_quad {
            return pairs.map(|(u, v, weight)| (self.point(u, v), weight)).collect();
        }
        // The square collapses into the triangle (Duffy 1982); the weight is twice the Jacobian 1 − u.
        pairs.map(|(u, v, weight)| (self.point(u, v * (1.0 - u)), weight * 2.0 * (1.0 - u))).collect()
    }

    fn split(&self) -> Split {
        let corners = self.corners();
        let edge = |i: usize| corners[i].distance(corners[(i + 1) % corners.len()]);
        if self.is_quad {
            return match (edge(0), edge(1)) {
                (u, v) if u > v * LONG_QUAD => Split::Halves(0),
                (u, v) if v > u * LONG_QUAD => Split::Halves(1),
                _ => Split::Quarters,
            };
        }
        let edges = [0, 1, 2].map(edge);
        let longest = (0..3).fold(0, |best, i| if edges[i] > edges[best] { i } else { best });
        let shortest = edges[0].min(edges[1]).min(edges[2]);
        if edges[longest] > shortest * LONG_TRIANGLE { Split::Halves(longest) } else { Split::Quarters }
    }

    /// Its parts, two or four. New corners are middles of edges, which have equal bits on both sides of an edge.
    pub(super) fn parts(&self) -> Vec<Outline> {
        match self.split() {
            Split::Quarters => self.quarters().to_vec(),
            Split::Halves(i) => self.halves(i).to_vec(),
        }
    }

    fn quarters(&self) -> [Outline; 4] {
        let [a, b, c, d] = self.corners;
        let [ab, bc] = [middle(a, b), middle(b, c)];
        if self.is_quad {
            let [cd, da, center] = [middle(c, d), middle(d, a), self.center()];
            return [[a, ab, center, da], [ab, b, bc, center], [da, center, cd, d], [center, bc, c, cd]]
                .map(Outline::quad);
        }
        let ca = middle(c, a);
        [[a, ab, ca], [ab, b, bc], [ca, bc, c], [bc, ca, ab]].map(Outline::triangle)
    }

    fn halves(&self, i: usize) -> [Outline; 2] {
        let n = self.corners().len();
        let at = |k: usize| self.corners[(i + k) % n];
        let near = middle(at(0), at(1));
        if self.is_quad {
            let far = middle(at(2), at(3));
            return [[at(0), near, far, at(3)], [near, at(1), at(2), far]].map(Outline::quad);
        }
        [[at(0), near, at(2)], [near, at(1), at(2)]].map(Outline::triangle)
    }

    /// The number of the part that is nearest to a point of the plane.
    pub(super) fn part_at(&self, p: DVec3) -> usize {
        let parts = self.parts();
        let depth = |part: &Outline| part.depth(p);
        (0..parts.len()).fold(0, |best, i| if depth(&parts[i]) > depth(&parts[best]) { i } else { best })
    }

    /// The distance of a point of the plane from the nearest edge's line; negative outside.
    pub(super) fn depth(&self, p: DVec3) -> f64 {
        let normal = self.cross();
        let corners = self.corners();
        (0..corners.len())
            .map(|i| {
                let (a, b) = (corners[i], corners[(i + 1) % corners.len()]);
                normal.cross(b - a).normalize_or_zero().dot(p - a)
            })
            .fold(f64::INFINITY, f64::min)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outlines() -> [Outline; 4] {
        let p = |x: f64, y: f64| DVec3::new(x, y, 0.5 * x - 0.25 * y);
        [
            Outline::quad([p(0.0, 0.0), p(1.0, 0.2), p(1.3, 1.2), p(0.3, 1.0)]),
            Outline::quad([p(0.0, 0.0), p(5.0, 0.0), p(5.0, 1.0), p(0.0, 1.0)]),
            Outline::triangle([p(0.0, 0.0), p(1.0, 0.0), p(0.4, 0.9)]),
            Outline::triangle([p(0.0, 0.0), p(4.0, 0.0), p(4.0, 0.5)]),
        ]
    }

    #[test]
    fn parts_fill_the_outline_and_face_its_side() {
        for outline in outlines() {
            let parts = outline.parts();
            let area: f64 = parts.iter().map(Outline::area).sum();
            assert!((area / outline.area() - 1.0).abs() < 1e-12);
            for (i, part) in parts.iter().enumerate() {
                assert!(part.normal().unwrap().dot(outline.normal().unwrap()) > 0.999_999);
                assert_eq!(outline.part_at(part.center()), i);
            }
        }
    }

    #[test]
    fn cells_and_quadratures_find_the_centroid() {
        for outline in outlines() {
            let mean: DVec3 = (0..CELLS).map(|i| outline.cell(i)).sum::<DVec3>() / CELLS as f64;
            assert!(mean.distance(outline.center()) < 1e-12);
            assert!((0..CELLS).all(|i| outline.depth(outline.cell(i)) > 0.0));
            let distinct = (0..CELLS).all(|i| (0..i).all(|j| outline.cell(i).distance(outline.cell(j)) > 1e-3));
            assert!(distinct);
            for fine in [false, true] {
                let points = outline.quadrature(fine);
                let total: f64 = points.iter().map(|(_, w)| w).sum();
                let mean: DVec3 = points.iter().map(|&(p, w)| p * w).sum();
                assert!((total - 1.0).abs() < 1e-12 && mean.distance(outline.center()) < 1e-12, "{fine} {total}");
            }
        }
    }
}
