//! The cube of environment images (5.5, fig. 5.35): the face that a direction hits, the place on it, and the
//! continuation beyond the edge of a face.
//!
//! Each face is the picture of a camera in the middle of the cube with a right angle of view. The four side faces have
//! y upwards. The top face is seen after turning up from the front, the bottom face after turning down. The front is
//! −z, the default direction of a camera. Cube maps of graphics cards fit as px = right, nx = left, py = top, ny =
//! bottom, pz = front, nz = back.

use crate::named;
use glam::{DVec3, I64Vec3};
use serde::{Deserialize, Serialize};

/// A face of the cube.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Face {
    /// The face towards +x.
    Right,
    /// The face towards −x.
    Left,
    /// The face towards +y.
    Top,
    /// The face towards −y.
    Bottom,
    /// The face towards −z.
    Front,
    /// The face towards +z.
    Back,
}

named!(Face {
    Right => "right",
    Left => "left",
    Top => "top",
    Bottom => "bottom",
    Front => "front",
    Back => "back",
});

impl Face {
    /// The directions towards the face, to the right in its image, and upwards in it.
    fn axes(self) -> [I64Vec3; 3] {
        const X: I64Vec3 = I64Vec3::X;
        const Y: I64Vec3 = I64Vec3::Y;
        const Z: I64Vec3 = I64Vec3::Z;
        match self {
            Face::Right => [X, Z, Y],
            Face::Left => [-X, -Z, Y],
            Face::Top => [Y, X, Z],
            Face::Bottom => [-Y, X, -Z],
            Face::Front => [-Z, X, Y],
            Face::Back => [Z, -X, Y],
        }
    }

    /// The face that a direction hits: that of its largest coordinate. Of equal coordinates, x precedes y and y
    /// precedes z.
    pub fn of(direction: DVec3) -> Face {
        let size = direction.abs();
        let side = |value: f64, plus: Face, minus: Face| if value < 0.0 { minus } else { plus };
        if size.x >= size.y && size.x >= size.z {
            side(direction.x, Face::Right, Face::Left)
        } else if size.y >= size.z {
            side(direction.y, Face::Top, Face::Bottom)
        } else {
            side(direction.z, Face::Back, Face::Front)
        }
    }

    /// The intersection of the direction with the face: (u, v) from its image's upper left corner (0, 0) to its lower
    /// right one (1, 1). These are the other two coordinates over the largest, mapped from [−1, 1] to [0, 1] (fig.
    /// 5.35).
    pub fn uv(self, direction: DVec3) -> [f64; 2] {
        let [towards, right, up] = self.axes().map(|axis| axis.as_dvec3());
        let depth = direction.dot(towards);
        [0.5 + 0.5 * (direction.dot(right) / depth), 0.5 - 0.5 * (direction.dot(up) / depth)]
    }

    /// The direction to (u, v) of the face; not normalised.
    pub fn direction(self, [u, v]: [f64; 2]) -> DVec3 {
        let [towards, right, up] = self.axes().map(|axis| axis.as_dvec3());
        towards + right * (2.0 * u - 1.0) - up * (2.0 * v - 1.0)
    }

    /// The texel in column `x` and row `y` of a face of `n` × `n`, where one of the two may lie beyond the edge by up
    /// to n. The plane of the face is folded over the edge onto its neighbour. None where both lie beyond: three faces
    /// join there, and a fourth texel doesn't exist.
    pub fn fold(self, [x, y]: [i64; 2], n: i64) -> Option<(Face, [u32; 2])> {
        let inside = |i: i64| (0..n).contains(&i);
        if inside(x) && inside(y) {
            return Some((self, [x as u32, y as u32]));
        }
        if !inside(x) && !inside(y) {
            return None;
        }
        // Centres of texels are at odd places of a cube from −n to n.
        let [towards, right, up] = self.axes();
        let (a, b) = (2 * x + 1 - n, n - 1 - 2 * y);
        let edge = if inside(x) { up * b.signum() } else { right * a.signum() };
        let along = if inside(x) { right * a } else { up * b };
        let beyond = a.abs().max(b.abs()) - n;
        let place = edge * n + along + towards * (n - beyond);
        let face = Face::of(edge.as_dvec3());
        let [_, right, up] = face.axes();
        Some((face, [((place.dot(right) + n - 1) / 2) as u32, ((n - 1 - place.dot(up)) / 2) as u32]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Named;

    const FACES: [Face; 6] = [Face::Right, Face::Left, Face::Top, Face::Bottom, Face::Front, Face::Back];

    /// Checks fig. 5.35's example and its like: the middle, the right and the top of each face's image.
    #[test]
    fn directions_meet_the_faces_where_a_camera_there_would_see_them() {
        for (direction, face, uv) in [
            (DVec3::new(2.0, 0.0, 0.0), Face::Right, [0.5, 0.5]),
            (DVec3::new(2.0, 1.0, 1.0), Face::Right, [0.75, 0.25]),
            (DVec3::new(-2.0, 1.0, 1.0), Face::Left, [0.25, 0.25]),
            (DVec3::new(1.0, 2.0, 1.0), Face::Top, [0.75, 0.25]),
            (DVec3::new(1.0, -2.0, 1.0), Face::Bottom, [0.75, 0.75]),
            (DVec3::new(1.0, 1.0, -2.0), Face::Front, [0.75, 0.25]),
            (DVec3::new(1.0, 1.0, 2.0), Face::Back, [0.25, 0.25]),
        ] {
            assert_eq!((Face::of(direction), face.uv(direction)), (face, uv), "{direction}");
        }
        for face in FACES {
            let [towards, right, up] = face.axes();
            assert_eq!(right.cross(up), -towards, "{face:?} is seen from inside, not mirrored");
            assert_eq!(Face::ALL[face as usize], face);
        }
    }

    #[test]
    fn every_place_of_every_face_has_its_direction() {
        for face in FACES {
            for i in 0..=20 {
                for j in 0..=20 {
                    let uv = [f64::from(i) / 20.0, f64::from(j) / 20.0];
                    let back = face.uv(face.direction(uv) * 7.0);
                    assert!((back[0] - uv[0]).abs() < 1e-15 && (back[1] - uv[1]).abs() < 1e-15);
                    let border = [0, 20].contains(&i) || [0, 20].contains(&j);
                    let met = Face::of(face.direction(uv));
                    assert!(met == face || border, "{face:?} {uv:?}");
                    if border {
                        // The neighbouring face also has this place on its border, at an equal direction.
                        let other = met.uv(face.direction(uv));
                        assert!(other.iter().all(|c| (-1e-15..=1.0 + 1e-15).contains(c)));
                        assert!(other.iter().any(|c| c.abs() < 1e-15 || (c - 1.0).abs() < 1e-15), "{other:?}");
                        let [a, b] = [met.direction(other), face.direction(uv)].map(DVec3::normalize);
                        assert!((a - b).length() < 1e-15);
                    }
                }
            }
        }
        let corner = Face::of(DVec3::ONE);
        assert_eq!((corner, corner.uv(DVec3::ONE)), (Face::Right, [1.0, 0.0]));
    }

    /// The texel beyond an edge is the texel of the neighbour that touches the edge at this place.
    #[test]
    fn folding_leads_to_the_texel_next_door_and_back() {
        for n in [1, 2, 5, 8] {
            for face in FACES {
                for i in 0..n {
                    for (inner, outer) in
                        [([0, i], [-1, i]), ([n - 1, i], [n, i]), ([i, 0], [i, -1]), ([i, n - 1], [i, n])]
                    {
                        let (other, place) = face.fold(outer, n).unwrap();
                        assert_ne!(other, face);
                        let centre =
                            |f: Face, [x, y]: [f64; 2]| f.direction([(x + 0.5) / n as f64, (y + 0.5) / n as f64]);
                        let here = centre(face, inner.map(|i| i as f64));
                        let there = centre(other, place.map(f64::from));
                        // The centres of two texels that share an edge are half a texel from it.
                        let distance = (here - there).length() * n as f64;
                        assert!((distance - 2f64.sqrt()).abs() < 1e-12, "{face:?} {outer:?} to {other:?} {place:?}");
                        // A step from that texel over the shared edge returns to the first.
                        let [x, y] = place.map(i64::from);
                        let ways = [[x - 1, y], [x + 1, y], [x, y - 1], [x, y + 1]];
                        let home = Some((face, inner.map(|i| i as u32)));
                        assert!(ways.iter().any(|way| other.fold(*way, n) == home));
                    }
                }
                assert_eq!(face.fold([-1, n], n), None);
            }
        }
    }
}
