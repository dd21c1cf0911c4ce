//! Clipping in homogeneous space (Blinn and Newell, *Clipping Using Homogeneous Coordinates*, 1978; Sutherland and
//! Hodgman, *Reentrant Polygon Clipping*, 1974).

use super::coverage::GUARD_BAND;
use glam::DVec4;

/// The most corners of a clipped triangle: each of the five planes adds at most one.
const MOST: usize = 8;

/// A convex polygon.
pub(crate) struct Polygon {
    corners: [DVec4; MOST],
    len: usize,
}

impl Polygon {
    /// The part of a triangle in front of the near plane and within the guard band. Neighbouring triangles are cut at
    /// points of equal bits: each cut is computed from the edge's end in front of the plane towards the end behind it.
    pub(crate) fn clipped(triangle: [DVec4; 3], near: DVec4) -> Polygon {
        let mut polygon = Polygon { corners: [DVec4::ZERO; MOST], len: 3 };
        polygon.corners[..3].copy_from_slice(&triangle);
        polygon.cut(near);
        for plane in [
            DVec4::new(1.0, 0.0, GUARD_BAND, 0.0),
            DVec4::new(-1.0, 0.0, GUARD_BAND, 0.0),
            DVec4::new(0.0, 1.0, GUARD_BAND, 0.0),
            DVec4::new(0.0, -1.0, GUARD_BAND, 0.0),
        ] {
            polygon.cut(plane);
        }
        polygon
    }

    /// The corners, counter-clockwise if the triangle's were.
    pub(crate) fn corners(&self) -> &[DVec4] {
        &self.corners[..self.len]
    }

    fn cut(&mut self, plane: DVec4) {
        let (from, count) = (self.corners, self.len);
        self.len = 0;
        for i in 0..count {
            let (a, b) = (from[(i + count - 1) % count], from[i]);
            let (da, db) = (plane.dot(a), plane.dot(b));
            if (da < 0.0) != (db < 0.0) {
                let (inner, outer, di, d_outer) = if da >= 0.0 { (a, b, da, db) } else { (b, a, db, da) };
                self.push(inner + (outer - inner) * (di / (di - d_outer)));
            }
            if db >= 0.0 {
                self.push(b);
            }
        }
    }

    fn push(&mut self, corner: DVec4) {
        // A convex polygon has room for one more corner after each cut; roundings can't add more.
        if self.len < MOST {
            self.corners[self.len] = corner;
            self.len += 1;
        }
    }
}
