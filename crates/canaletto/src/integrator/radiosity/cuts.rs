//! Cuts along contacts: flat surfaces are cut where other flat surfaces touch or penetrate them, before anything else.
//! Light on one side of a wall thus never counts on the other, and what a body covers is a piece of its own.

use glam::DVec3;

/// The most contacts along which a surface is cut. Where there are more, only sample points tell what is covered.
const MOST_CUTS: usize = 64;

/// A convex polygon in space with its unit normal.
#[derive(Clone, Debug)]
pub(super) struct Polygon {
    pub(super) corners: Vec<DVec3>,
    pub(super) normal: DVec3,
    /// The distance within which points count as equal: the rounding of coordinates.
    pub(super) tolerance: f64,
}

impl Polygon {
    fn edges(&self) -> impl Iterator<Item = (DVec3, DVec3)> {
        let corners = &self.corners;
        (0..corners.len()).map(|i| (corners[i], corners[(i + 1) % corners.len()]))
    }

    /// The segments in this polygon's plane along which another polygon meets the plane: one, or all edges of a polygon
    /// in the plane.
    fn meeting(&self, other: &Polygon) -> Vec<[DVec3; 2]> {
        let near = self.tolerance.max(other.tolerance);
        let height = |p: DVec3| {
            let height = (p - self.corners[0]).dot(self.normal);
            if height.abs() <= near { 0.0 } else { height }
        };
        if other.corners.iter().all(|&p| height(p) == 0.0) {
            return other.edges().map(|(a, b)| [a, b]).collect();
        }
        let mut points: Vec<DVec3> = Vec::new();
        for (a, b) in other.edges() {
            let (d, e) = (height(a), height(b));
            if d == 0.0 {
                points.push(a);
            } else if (d < 0.0) != (e < 0.0) && e != 0.0 {
                points.push(a + (b - a) * (d / (d - e)));
            }
        }
        match points[..] {
            [a, b] => vec![[a, b]],
            _ => Vec::new(),
        }
    }

    /// The part of a segment in the polygon's interior, if there is any.
    fn inside(&self, [from, to]: [DVec3; 2]) -> Option<[DVec3; 2]> {
        let (mut low, mut high) = (0.0, 1.0);
        for (a, b) in self.edges() {
            let inwards = self.normal.cross(b - a).normalize_or_zero();
            let [d, e] = [from, to].map(|p| inwards.dot(p - a) - 2.0 * self.tolerance);
            if d <= 0.0 && e <= 0.0 {
                return None;
            }
            if d < 0.0 {
                low = f64::max(low, d / (d - e));
            } else if e < 0.0 {
                high = f64::min(high, d / (d - e));
            }
        }
        let at = |t: f64| from + (to - from) * t;
        let length = (high - low) * from.distance(to);
        (length > 4.0 * self.tolerance).then(|| [at(low), at(high)])
    }

    /// The two parts of the polygon on both sides of a line in its plane; one if the line passes outside.
    fn split(self, [from, to]: [DVec3; 2]) -> Vec<Polygon> {
        let across = self.normal.cross(to - from).normalize_or_zero();
        let side = |p: DVec3| {
            let side = across.dot(p - from);
            if side.abs() <= 2.0 * self.tolerance { 0.0 } else { side }
        };
        let (mut left, mut right) = (Vec::new(), Vec::new());
        for (a, b) in self.edges() {
            let (d, e) = (side(a), side(b));
            if d >= 0.0 {
                left.push(a);
            }
            if d <= 0.0 {
                right.push(a);
            }
            if d * e < 0.0 {
                let crossing = a + (b - a) * (d / (d - e));
                left.push(crossing);
                right.push(crossing);
            }
        }
        let has_inside = |corners: &[DVec3], sign: f64| corners.iter().any(|&p| side(p) * sign > 0.0);
        if !has_inside(&left, 1.0) || !has_inside(&right, -1.0) {
            return vec![self];
        }
        [left, right].into_iter().map(|corners| Polygon { corners, ..self }).collect()
    }

    /// The pieces of this polygon after cuts along all `others` that meet its interior, and the segments of contact.
    pub(super) fn cut<'a>(&self, others: impl Iterator<Item = &'a Polygon>) -> (Vec<Polygon>, Vec<[DVec3; 2]>) {
        let mut segments = Vec::new();
        for other in others {
            segments.extend(self.meeting(other).into_iter().filter_map(|segment| self.inside(segment)));
            if segments.len() > MOST_CUTS {
                return (vec![self.clone()], Vec::new());
            }
        }
        let mut pieces = vec![self.clone()];
        for &segment in &segments {
            pieces = pieces
                .into_iter()
                .flat_map(|piece| if piece.inside(segment).is_some() { piece.split(segment) } else { vec![piece] })
                .collect();
        }
        (pieces, segments)
    }

    /// The triangles and parallelograms that fill the polygon: the polygon itself, if it is one, or else triangles.
    pub(super) fn outlines(&self) -> Vec<super::outline::Outline> {
        use super::outline::Outline;
        let corners = &self.corners;
        if let &[a, b, c, d] = &corners[..]
            && (a + c - b - d).length() <= self.tolerance
        {
            return vec![Outline::quad([a, b, c, d])];
        }
        // A fan from the corner that makes the least thin triangles.
        let fan = |first: usize| {
            let at = |i: usize| corners[(first + i) % corners.len()];
            (1..corners.len() - 1).map(|i| Outline::triangle([at(0), at(i), at(i + 1)])).collect::<Vec<Outline>>()
        };
        let thickness = |triangle: &Outline| triangle.area() / (triangle.radius() * triangle.radius());
        let worst = |fan: &[Outline]| fan.iter().map(thickness).fold(f64::INFINITY, f64::min);
        let mut best = fan(0);
        for first in 1..corners.len() {
            let other = fan(first);
            if worst(&other) > worst(&best) {
                best = other;
            }
        }
        best
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn polygon(corners: &[[f64; 3]]) -> Polygon {
        let corners: Vec<DVec3> = corners.iter().map(|&p| DVec3::from_array(p)).collect();
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize();
        Polygon { corners, normal, tolerance: 1e-6 }
    }

    fn areas(pieces: &[Polygon]) -> Vec<f64> {
        let of = |piece: &Polygon| piece.outlines().iter().map(|outline| outline.area()).sum::<f64>();
        pieces.iter().map(of).collect()
    }

    const FLOOR: [[f64; 3]; 4] = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [4.0, 4.0, 0.0], [0.0, 4.0, 0.0]];

    #[test]
    fn a_wall_cuts_the_floor_in_two() {
        // Half of the wall stands outside the floor, and the wall reaches below it.
        let wall = polygon(&[[1.0, -1.0, -1.0], [1.0, 2.0, -1.0], [1.0, 2.0, 3.0], [1.0, -1.0, 3.0]]);
        let pieces = polygon(&FLOOR).cut([wall].iter()).0;
        assert_eq!(areas(&pieces), [12.0, 4.0]);
    }

    #[test]
    fn a_wall_on_the_floors_edge_and_one_above_it_cut_nothing() {
        let at_edge = polygon(&[[0.0, 0.0, 0.0], [0.0, 4.0, 0.0], [0.0, 4.0, 3.0], [0.0, 0.0, 3.0]]);
        let above = polygon(&[[1.0, 0.0, 0.1], [1.0, 4.0, 0.1], [1.0, 4.0, 3.0], [1.0, 0.0, 3.0]]);
        assert_eq!(polygon(&FLOOR).cut([at_edge, above].iter()).0.len(), 1);
    }

    #[test]
    fn a_base_on_the_floor_is_a_piece() {
        let base = polygon(&[[1.0, 1.0, 0.0], [1.0, 2.0, 0.0], [2.0, 2.0, 0.0], [2.0, 1.0, 0.0]]);
        let pieces = polygon(&FLOOR).cut([base].iter()).0;
        let areas = areas(&pieces);
        assert!((areas.iter().sum::<f64>() - 16.0).abs() < 1e-12);
        let is_base = |piece: &Polygon| {
            piece.corners.iter().all(|p| p.cmpge(DVec3::new(0.99, 0.99, 0.0)).all() && p.x < 2.01 && p.y < 2.01)
        };
        assert_eq!(pieces.iter().filter(|piece| is_base(piece)).count(), 1, "{pieces:?}");
    }
}
