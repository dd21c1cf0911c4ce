//! Triangulation of polygons. Halving is used where it is valid, as for all convex polygons. Other polygons are
//! triangulated by ear clipping (crate `earcut`), or by a sweep ([`monotone`]) if they have many corners.
//!
//! A triangulation is valid if no triangle is flipped: each point is then covered as often as the polygon winds around
//! it. This criterion is stronger than the turns at the corners. Those are zero at repeated corners and where an edge
//! reverses.

use super::monotone;
use earcut::Earcut;
use glam::{DVec2, DVec3, Vec3};

/// Triangulates polygons; reuses its memory between them.
#[derive(Default)]
pub(super) struct Triangulator {
    earcut: Earcut<f64>,
    /// The corners that differ from their predecessors.
    ring: Vec<u32>,
    flat: Vec<[f64; 2]>,
    ears: Vec<u32>,
}

/// A method of splitting a ring into triangles.
type Way = fn(&[u32], &mut dyn FnMut([u32; 3]));

impl Triangulator {
    /// The largest number of corners for ear clipping, which takes quadratic time at worst.
    const MAX_CLIPPED: usize = 10_000;
    /// The number of corners from which on a sweep is tried first.
    const MANY: usize = 256;
    /// The fraction of a polygon's area that rounding may flip.
    const ROUNDING: f64 = 1e-6;

    pub(super) fn new() -> Triangulator {
        Triangulator::default()
    }

    /// Passes triangles to `triangle` as indices into `corners` (at least 3), in the polygon's orientation.
    pub(super) fn cut(&mut self, corners: &[Vec3], mut triangle: impl FnMut([usize; 3])) -> Result<(), String> {
        let n = corners.len();
        if n == 3 {
            triangle([0, 1, 2]);
            return Ok(());
        }
        self.ring.clear();
        self.ring
            .extend((0..n).filter(|&i| corners[i] != corners[if i == 0 { n - 1 } else { i - 1 }]).map(|i| i as u32));
        let ring = &self.ring;
        if ring.len() < 3 {
            // The polygon is a point or a line.
            triangle([0, 1, 2]);
            return Ok(());
        }
        let at = |i: u32| corners[i as usize].as_dvec3();
        let normal = doubled_area(at(ring[0]), ring.iter().map(|i| at(*i)));
        let area = |t: [u32; 3]| {
            let [a, b, c] = t.map(at);
            (b - a).cross(c - a).dot(normal)
        };
        let allowed = Triangulator::ROUNDING * normal.length_squared();
        let turned_over = |way: Way| {
            let mut over = 0.0;
            way(ring, &mut |t| over -= area(t).min(0.0));
            over
        };
        // A fan is valid for a ring that winds around a convex polygon several times.
        let ways: [Way; 2] = [halves, fan];
        let good = ways.into_iter().find(|way| turned_over(*way) <= allowed);
        if good.is_none() {
            if ring.len() >= Triangulator::MANY {
                let swept = sweep(ring, corners, normal);
                let over: f64 = swept.iter().map(|t| -area(*t).min(0.0)).sum();
                if swept.len() + 2 == ring.len() && over <= allowed {
                    swept.into_iter().for_each(|t| triangle(t.map(|i| i as usize)));
                    return Ok(());
                }
            }
            if ring.len() > Triangulator::MAX_CLIPPED {
                return Err(format!(
                    "a polygon of {n} corners may not cross or touch itself; one that does may have {}",
                    Triangulator::MAX_CLIPPED
                ));
            }
            let least = turned_over(halves);
            self.clip(corners, normal);
            let area = |t: &[u32]| {
                let [a, b, c] = [t[0], t[1], t[2]].map(|i| corners[i as usize].as_dvec3());
                (b - a).cross(c - a).dot(normal)
            };
            let clipped: f64 = self.ears.chunks_exact(3).map(|t| -area(t).min(0.0)).sum();
            if !self.ears.is_empty() && clipped <= least {
                self.ears.chunks_exact(3).for_each(|t| triangle([t[0] as usize, t[1] as usize, t[2] as usize]));
                return Ok(());
            }
        }
        let mut none = true;
        good.unwrap_or(halves)(&self.ring, &mut |t| {
            let t = t.map(|i| i as usize);
            let [a, b, c] = t.map(|i| corners[i]);
            if a != b && b != c && c != a {
                none = false;
                triangle(t);
            }
        });
        if none {
            triangle([0, 1, 2]);
        }
        Ok(())
    }

    /// Clips ears in the axis-aligned projection with the largest area.
    fn clip(&mut self, corners: &[Vec3], normal: DVec3) {
        let project = projection(normal);
        self.flat.clear();
        self.flat.extend(self.ring.iter().map(|i| project(corners[*i as usize].as_dvec3()).to_array()));
        self.earcut.earcut_slice(&self.flat, &[] as &[u32], &mut self.ears);
        // The clipper has its own orientation; the normal gives that of the polygon.
        let area = |i: u32, j: u32, k: u32| {
            let [a, b, c] = [i, j, k].map(|v| DVec2::from_array(self.flat[v as usize]));
            (b - a).perp_dot(c - a)
        };
        let total: f64 = self.ears.chunks_exact(3).map(|t| area(t[0], t[1], t[2])).sum();
        if total * normal[normal.abs().max_position()] < 0.0 {
            self.ears.chunks_exact_mut(3).for_each(|t| t.swap(1, 2));
        }
        self.ears.iter_mut().for_each(|ear| *ear = self.ring[*ear as usize]);
    }
}

/// The axis-aligned projection in which a polygon of this normal has the largest area.
fn projection(normal: DVec3) -> fn(DVec3) -> DVec2 {
    match normal.abs().max_position() {
        0 => |p| DVec2::new(p.y, p.z),
        1 => |p| DVec2::new(p.z, p.x),
        _ => |p| DVec2::new(p.x, p.y),
    }
}

/// The triangles of a ring without crossings, in its orientation.
fn sweep(ring: &[u32], corners: &[Vec3], normal: DVec3) -> Vec<[u32; 3]> {
    let project = projection(normal);
    let mut ring: Vec<u32> = ring.to_vec();
    let mirrored = normal[normal.abs().max_position()] < 0.0;
    if mirrored {
        ring.reverse();
    }
    let flat: Vec<[f64; 2]> = ring.iter().map(|i| project(corners[*i as usize].as_dvec3()).to_array()).collect();
    let mut triangles = monotone::triangles(&flat);
    for t in &mut triangles {
        *t = t.map(|i| ring[i as usize]);
        if mirrored {
            t.swap(1, 2);
        }
    }
    triangles
}

/// Triangles over the midpoints of a ring's halves, of their halves, and so on. Their shapes are better than those of a
/// fan. The number of triangles at a corner is at most twice the depth of halving. The first corners come first.
fn halves(ring: &[u32], triangle: &mut dyn FnMut([u32; 3])) {
    // Parts whose first half is done, as (first, middle, last).
    let mut open: Vec<[usize; 3]> = Vec::new();
    let (mut first, mut last) = (0, ring.len() - 1);
    loop {
        while last - first >= 2 {
            let middle = (first + last).div_ceil(2);
            open.push([first, middle, last]);
            last = middle;
        }
        let Some(part) = open.pop() else { return };
        triangle(part.map(|i| ring[i]));
        [_, first, last] = part;
    }
}

/// The triangles of a ring's first corner with all others.
fn fan(ring: &[u32], triangle: &mut dyn FnMut([u32; 3])) {
    ring[1..].windows(2).for_each(|pair| triangle([ring[0], pair[0], pair[1]]));
}

/// Twice the polygon's vector area, which points along its normal.
pub(super) fn vector_area(corners: &[Vec3]) -> DVec3 {
    doubled_area(corners[0].as_dvec3(), corners.iter().map(|p| p.as_dvec3()))
}

fn doubled_area(first: DVec3, corners: impl Iterator<Item = DVec3>) -> DVec3 {
    let (mut sum, mut last) = (DVec3::ZERO, DVec3::ZERO);
    for corner in corners.map(|corner| corner - first) {
        sum += last.cross(corner);
        last = corner;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cut(corners: &[[f32; 3]]) -> Vec<[usize; 3]> {
        let corners: Vec<Vec3> = corners.iter().map(|c| Vec3::from(*c)).collect();
        let mut out = Vec::new();
        Triangulator::new().cut(&corners, |t| out.push(t)).unwrap();
        let areas: DVec3 = out.iter().map(|t| vector_area(&t.map(|i| corners[i]))).sum();
        let whole = vector_area(&corners);
        assert!((areas - whole).length() <= 1e-9 * whole.length(), "{out:?}");
        let least = -1e-6 * whole.length_squared();
        assert!(out.iter().all(|t| vector_area(&t.map(|i| corners[i])).dot(whole) >= least), "{out:?} turns over");
        out
    }

    #[test]
    fn convex_polygons_become_halves() {
        assert_eq!(cut(&[[0., 0., 0.], [1., 0., 0.], [1., 1., 0.], [0., 1., 0.]]), [[0, 1, 2], [0, 2, 3]]);
        let round = |n: usize| -> Vec<[f32; 3]> {
            let angle = |i: usize| i as f64 / n as f64 * std::f64::consts::TAU;
            (0..n).map(|i| [libm::cos(angle(i)) as f32, 0.5, -libm::sin(angle(i)) as f32]).collect()
        };
        assert_eq!(cut(&round(6)), [[0, 1, 2], [0, 2, 3], [0, 3, 5], [3, 4, 5]]);
        // The polygon has so many corners that rounding makes many of them concave.
        let many = cut(&round(100_000));
        let mut uses = vec![0; 100_000];
        many.iter().flatten().for_each(|i| uses[*i] += 1);
        assert!(many.len() == 99_998 && uses.iter().all(|n| (1..=2 * 17).contains(n)), "{:?}", uses.iter().max());
    }

    /// Twice the area that the triangles cover, each counted as positive.
    fn covered(corners: &[[f32; 3]]) -> f64 {
        cut(corners).iter().map(|t| vector_area(&t.map(|i| Vec3::from(corners[i]))).length()).sum()
    }

    /// A polygon in the plane z = 0.
    fn flat(points: &[[f32; 2]]) -> Vec<[f32; 3]> {
        points.iter().map(|[x, y]| [*x, *y, 0.0]).collect()
    }

    #[test]
    fn corners_that_come_twice_change_nothing() {
        let dart = [[4., 0.], [1., 1.], [0., 4.], [0., 0.]];
        assert_eq!(covered(&flat(&dart)), 8.0);
        // Every corner occurs one to three times, from each start, in both orientations.
        for counts in 0..81 {
            let mut points: Vec<[f32; 2]> = Vec::new();
            for (i, point) in dart.iter().enumerate() {
                points.extend(std::iter::repeat_n(*point, 1 + counts / 3usize.pow(i as u32) % 3));
            }
            for turn in 0..points.len() {
                let mut turned = flat(&points);
                turned.rotate_left(turn);
                assert_eq!(covered(&turned), 8.0, "{turned:?}");
                turned.reverse();
                assert_eq!(covered(&turned), 8.0, "{turned:?}");
            }
        }
    }

    #[test]
    fn edges_that_go_back_cover_nothing() {
        for (points, area) in [
            // A spike outwards and inwards, at a corner and on an edge; up to its start and beyond.
            (vec![[4., 0.], [6., 0.], [4., 0.], [1., 1.], [0., 4.], [0., 0.]], 8.0),
            (vec![[4., 0.], [1., 1.], [2., 2.], [1., 1.], [0., 4.], [0., 0.]], 8.0),
            (vec![[4., 0.], [1., 1.], [0.5, 0.5], [1., 1.], [0., 4.], [0., 0.]], 8.0),
            (vec![[4., 0.], [1., 1.], [0., 4.], [0., 6.], [0., 4.], [0., 0.]], 8.0),
            (vec![[4., 0.], [1., 1.], [0., 4.], [0., 6.], [0., 0.]], 8.0),
            (vec![[4., 0.], [1., 1.], [0., 4.], [0., 0.], [2., 0.], [0., 0.]], 8.0),
            // Corners on straight edges.
            (vec![[0., 0.], [1., 0.], [2., 0.], [4., 0.], [4., 4.], [2., 4.], [0., 4.]], 32.0),
            (vec![[0., 0.], [2., 0.], [4., 0.], [2.5, 0.5], [1., 1.], [0.5, 2.5], [0., 4.]], 8.0),
        ] {
            for turn in 0..points.len() {
                let mut points = flat(&points);
                points.rotate_left(turn);
                assert!((covered(&points) - area).abs() < 1e-9, "{points:?} covers {}", covered(&points));
            }
        }
    }

    #[test]
    fn holes_behind_a_bridge_stay_open() {
        let square = |c: f32, r: f32| [[c - r, c - r], [c + r, c - r], [c + r, c + r], [c - r, c + r]];
        let (outer, mut inner) = (square(4., 4.), square(4., 1.));
        inner.reverse();
        // A bridge leads from the outer square's first corner to each corner of the hole, and back.
        for start in 0..4 {
            let mut points = outer.to_vec();
            points.push(outer[0]);
            points.extend((0..=4).map(|i| inner[(start + i) % 4]));
            for turn in 0..points.len() {
                let mut points = flat(&points);
                points.rotate_left(turn);
                // The bridge to the far corner crosses the hole.
                if start != 1 {
                    assert!((covered(&points) - 120.0).abs() < 1e-9, "{points:?} covers {}", covered(&points));
                }
            }
        }
    }

    #[test]
    fn bent_polygons_keep_their_side() {
        let mut points = flat(&[[4., 0.], [4., 0.], [1., 1.], [0., 4.], [0., 0.]]);
        points[2][2] = 0.25;
        points[3][2] = -0.25;
        for _ in 0..5 {
            points.rotate_left(1);
            cut(&points);
        }
    }

    #[test]
    fn concave_polygons_keep_area_and_side() {
        // An arrow head in each plane, in both orientations.
        let arrow = [[0., 0.], [2., 2.], [0., 1.], [-2., 2.]];
        for axis in 0..3 {
            let mut corners: Vec<[f32; 3]> = arrow
                .iter()
                .map(|[u, v]| {
                    let mut p = [5.0; 3];
                    (p[axis], p[(axis + 1) % 3]) = (*u, *v);
                    p
                })
                .collect();
            assert_eq!(cut(&corners).len(), 2);
            corners.reverse();
            assert_eq!(cut(&corners).len(), 2);
        }
    }

    #[test]
    fn large_polygons_may_be_concave() {
        let n = 60_000;
        for axis in 0..3 {
            for turned in [false, true] {
                let corner = |i: usize| {
                    let (t, r) = (i as f64 / n as f64 * std::f64::consts::TAU, if i % 2 == 1 { 0.5 } else { 1.0 });
                    let mut p = [0.25; 3];
                    (p[axis], p[(axis + 1) % 3]) = ((r * libm::cos(t)) as f32, (r * libm::sin(t)) as f32);
                    p
                };
                let mut corners: Vec<[f32; 3]> = (0..n).map(corner).collect();
                if turned {
                    corners.reverse();
                }
                assert_eq!(cut(&corners).len(), n - 2);
            }
        }
        // A polygon that crosses itself is reported as too large.
        let crossed: Vec<Vec3> =
            (0..20_001).map(|i| Vec3::new((i * i % 997) as f32, (i * 7 % 1009) as f32, 0.0)).collect();
        assert!(Triangulator::new().cut(&crossed, |_| {}).is_err_and(|e| e.contains("cross")));
    }

    #[test]
    fn polygons_that_go_round_twice_are_covered_twice() {
        let square = [[0., 0.], [2., 0.], [2., 2.], [0., 2.]];
        assert_eq!(covered(&flat(&square.repeat(2))), 16.0);
        let many = flat(&square[..3].repeat(100_000));
        assert_eq!((cut(&many).len(), covered(&many)), (100_000, 400_000.0));
    }

    #[test]
    fn degenerate_polygons_pass() {
        cut(&[[0., 0., 0.]; 5]);
        cut(&[[0., 0., 0.], [1., 0., 0.], [2., 0., 0.], [1., 0., 0.]]);
        cut(&[[3e38, 0., 0.], [-3e38, 1., 0.], [0., 3e38, 0.], [0., -3e38, 1.]]);
    }
}
