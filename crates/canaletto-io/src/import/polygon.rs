//! Polygons into triangles: convex ones by a fan, the others by clipping ears (crate `earcut`).

use earcut::Earcut;
use glam::{DVec2, DVec3, Vec3};

/// Cuts polygons; keeps its memory between them.
#[derive(Default)]
pub(super) struct Triangulator {
    earcut: Earcut<f64>,
    flat: Vec<[f64; 2]>,
    ears: Vec<u32>,
}

impl Triangulator {
    /// The most corners of a polygon that isn't convex: clipping ears takes the square of their number at worst.
    const MAX_CONCAVE: usize = 10_000;

    pub(super) fn new() -> Triangulator {
        Triangulator { earcut: Earcut::new(), flat: Vec::new(), ears: Vec::new() }
    }

    /// Hands out triangles as positions in `corners` (at least 3), in the polygon's sense of rotation.
    pub(super) fn cut(&mut self, corners: &[Vec3], mut triangle: impl FnMut([usize; 3])) -> Result<(), String> {
        let n = corners.len();
        if n == 3 {
            triangle([0, 1, 2]);
            return Ok(());
        }
        let at = |i: usize| corners[i % n].as_dvec3();
        let normal = vector_area(corners);
        let turn = |i: usize| (at(i + 1) - at(i)).cross(at(i + 2) - at(i + 1)).dot(normal);
        if (0..n).any(|i| turn(i) < 0.0) {
            if n > Triangulator::MAX_CONCAVE {
                return Err(format!(
                    "a polygon of {n} corners must be convex; others may have {}",
                    Triangulator::MAX_CONCAVE
                ));
            }
            if self.clip(corners, normal) {
                self.ears.chunks_exact(3).for_each(|t| triangle([t[0] as usize, t[1] as usize, t[2] as usize]));
                return Ok(());
            }
        }
        (1..n - 1).for_each(|i| triangle([0, i, i + 1]));
        Ok(())
    }

    /// Clips ears in the plane that loses least; whether there were any.
    fn clip(&mut self, corners: &[Vec3], normal: DVec3) -> bool {
        let project: fn(DVec3) -> DVec2 = match normal.abs().max_position() {
            0 => |p| DVec2::new(p.y, p.z),
            1 => |p| DVec2::new(p.z, p.x),
            _ => |p| DVec2::new(p.x, p.y),
        };
        self.flat.clear();
        self.flat.extend(corners.iter().map(|p| project(p.as_dvec3()).to_array()));
        self.earcut.earcut_slice(&self.flat, &[] as &[u32], &mut self.ears);
        // The clipper's sense of rotation is its own; the polygon's is given by the normal.
        let area = |i: u32, j: u32, k: u32| {
            let [a, b, c] = [i, j, k].map(|v| DVec2::from_array(self.flat[v as usize]));
            (b - a).perp_dot(c - a)
        };
        let total: f64 = self.ears.chunks_exact(3).map(|t| area(t[0], t[1], t[2])).sum();
        if total * normal[normal.abs().max_position()] < 0.0 {
            self.ears.chunks_exact_mut(3).for_each(|t| t.swap(1, 2));
        }
        !self.ears.is_empty()
    }
}

/// The polygon's vector area, twice: along its normal.
pub(super) fn vector_area(corners: &[Vec3]) -> DVec3 {
    let first = corners[0].as_dvec3();
    let mut sum = DVec3::ZERO;
    for pair in corners.windows(2) {
        sum += (pair[0].as_dvec3() - first).cross(pair[1].as_dvec3() - first);
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
        assert!(out.iter().all(|t| vector_area(&t.map(|i| corners[i])).dot(whole) >= 0.0), "{out:?} turns over");
        out
    }

    #[test]
    fn convex_polygons_become_fans() {
        assert_eq!(cut(&[[0., 0., 0.], [1., 0., 0.], [1., 1., 0.], [0., 1., 0.]]), [[0, 1, 2], [0, 2, 3]]);
    }

    #[test]
    fn concave_polygons_keep_area_and_side() {
        // An arrow head in each plane, both ways round.
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
    fn degenerate_polygons_pass() {
        cut(&[[0., 0., 0.]; 5]);
        cut(&[[0., 0., 0.], [1., 0., 0.], [2., 0., 0.], [1., 0., 0.]]);
        cut(&[[3e38, 0., 0.], [-3e38, 1., 0.], [0., 3e38, 0.], [0., -3e38, 1.]]);
    }
}
