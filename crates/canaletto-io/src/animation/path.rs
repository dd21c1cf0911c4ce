//! A path through points, parametrised by arc length.
//!
//! A path consists of straight lines, or is the Catmull-Rom spline with centripetal parameters. That one is the only
//! one of the family without loops and cusps between its points (C. Yuksel, S. Schaefer, J. Keyser, "Parameterization
//! and applications of Catmull-Rom curves", Computer-Aided Design 43, 2011). Its arc length has no closed form. Each
//! piece is split in [`PARTS`] parts, whose lengths are five-point Gauss integrals of the speed. Newton's method then
//! finds a place.

use canaletto::named;
use glam::DVec3;

/// The number of parts of a spline piece whose lengths are stored.
const PARTS: usize = 32;

/// The nodes and weights of five-point Gauss-Legendre quadrature on -1 to 1.
const GAUSS: [(f64, f64); 5] = [
    (-0.906_179_845_938_664, 0.236_926_885_056_189_08),
    (-0.538_469_310_105_683_1, 0.478_628_670_499_366_47),
    (0.0, 0.568_888_888_888_888_9),
    (0.538_469_310_105_683_1, 0.478_628_670_499_366_47),
    (0.906_179_845_938_664, 0.236_926_885_056_189_08),
];

/// The curve of a path through its points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum PathCurve {
    /// The centripetal Catmull-Rom spline.
    #[default]
    Spline,
    /// Straight lines.
    Line,
}

named!(PathCurve {
    Spline => "spline",
    Line => "line",
});

/// A path to follow.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Path {
    pieces: Vec<Piece>,
    /// The arc length up to the end of each part, over all pieces in order.
    lengths: Vec<f64>,
    /// The number of parts per piece: 1 if it is straight.
    parts: usize,
    closed: bool,
}

/// A cubic a + b u + c u² + d u³ for u from 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Piece([DVec3; 4]);

impl Piece {
    fn point(&self, u: f64) -> DVec3 {
        let [a, b, c, d] = self.0;
        a + (b + (c + d * u) * u) * u
    }

    fn velocity(&self, u: f64) -> DVec3 {
        let [_, b, c, d] = self.0;
        b + (c * 2.0 + d * (3.0 * u)) * u
    }

    /// The arc length from u0 to u1.
    fn length(&self, u0: f64, u1: f64) -> f64 {
        let (middle, half) = ((u0 + u1) / 2.0, (u1 - u0) / 2.0);
        GAUSS.iter().map(|(x, w)| w * self.velocity(middle + half * x).length()).sum::<f64>() * half
    }
}

impl Path {
    /// The path through these points, on this curve; a closed one returns to the first point.
    ///
    /// # Errors
    /// A sentence that says what is wrong with the points.
    pub(crate) fn new(points: &[DVec3], curve: PathCurve, closed: bool) -> Result<Path, String> {
        let least = if closed { 3 } else { 2 };
        if points.len() < least {
            return Err(format!("a {}path needs at least {least} points", if closed { "closed " } else { "" }));
        }
        let n = points.len();
        let count = if closed { n } else { n - 1 };
        let point = |i: usize| points[i % n];
        if let Some(i) = (0..count).find(|&i| point(i) == point(i + 1)) {
            let more = if closed && i + 1 == n { "; a closed path returns to the first point by itself" } else { "" };
            return Err(format!("points {} and {} of the path are the same{more}", i + 1, (i + 1) % n + 1));
        }
        let mut pieces = Vec::with_capacity(count);
        for i in 0..count {
            let (p, q) = (point(i), point(i + 1));
            if curve == PathCurve::Line {
                pieces.push(Piece([p, q - p, DVec3::ZERO, DVec3::ZERO]));
                continue;
            }
            let before = (closed || i > 0).then(|| point(i + n - 1));
            let after = (closed || i + 2 < n).then(|| point(i + 2));
            pieces.push(spline_piece(before, p, q, after));
        }
        let parts = match curve {
            PathCurve::Spline => PARTS,
            PathCurve::Line => 1,
        };
        let mut lengths = Vec::with_capacity(pieces.len() * parts);
        let mut length = 0.0;
        for piece in &pieces {
            for part in 0..parts {
                length += match curve {
                    PathCurve::Spline => piece.length(part as f64 / parts as f64, (part + 1) as f64 / parts as f64),
                    PathCurve::Line => piece.0[1].length(),
                };
                lengths.push(length);
            }
        }
        let path = Path { pieces, lengths, parts, closed };
        if path.length().is_finite() && path.length() > 0.0 {
            Ok(path)
        } else {
            Err("the path is too long or too short to be measured".into())
        }
    }

    /// The total arc length.
    pub(crate) fn length(&self) -> f64 {
        self.lengths.last().copied().unwrap_or(0.0)
    }

    /// The point at a fraction of the arc length, and the unit tangent there. An open path clamps the fraction to 0 to
    /// 1; a closed path repeats.
    pub(crate) fn at(&self, share: f64) -> (DVec3, DVec3) {
        let share = if self.closed { share - libm::floor(share) } else { share.clamp(0.0, 1.0) };
        let wanted = share * self.length();
        let part = self.lengths.partition_point(|end| *end <= wanted).min(self.lengths.len() - 1);
        let start = if part == 0 { 0.0 } else { self.lengths[part - 1] };
        let piece = &self.pieces[part / self.parts];
        let (low, high) =
            ((part % self.parts) as f64 / self.parts as f64, (part % self.parts + 1) as f64 / self.parts as f64);
        let length = self.lengths[part] - start;
        let mut u = low + (high - low) * if length > 0.0 { ((wanted - start) / length).clamp(0.0, 1.0) } else { 0.0 };
        for _ in 0..4 {
            let speed = piece.velocity(u).length();
            if self.parts == 1 || speed <= 0.0 {
                break;
            }
            u = (u - (piece.length(low, u) - (wanted - start)) / speed).clamp(low, high);
        }
        let direction = piece.velocity(u).try_normalize();
        // Where the spline's speed is zero, the direction is that a little further.
        let ahead = || (piece.point(high) - piece.point(low)).normalize_or(DVec3::X);
        (piece.point(u), direction.unwrap_or_else(ahead))
    }
}

/// The piece from p to q of the centripetal spline. Without a neighbour the slope is that of the parabola.
fn spline_piece(before: Option<DVec3>, p: DVec3, q: DVec3, after: Option<DVec3>) -> Piece {
    // The parameter increases by the square root of the distance.
    let step = |a: DVec3, b: DVec3| (b - a).length().sqrt();
    let h = step(p, q);
    let d = (q - p) / h;
    let e0 = before.map(|o| ((p - o) / step(o, p), step(o, p)));
    let e1 = after.map(|r| ((r - q) / step(q, r), step(q, r)));
    let slope = |near: Option<(DVec3, f64)>, far: Option<(DVec3, f64)>| match (near, far) {
        (Some((e, g)), _) => (d * g + e * h) / (h + g),
        (None, Some((e, g))) => d + (d - e) * (h / (h + g)),
        (None, None) => d,
    };
    let (m0, m1) = (slope(e0, e1) * h, slope(e1, e0) * h);
    Piece([p, m0, (q - p) * 3.0 - m0 * 2.0 - m1, (p - q) * 2.0 + m0 + m1])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(list: &[[f64; 2]]) -> Vec<DVec3> {
        list.iter().map(|[x, y]| DVec3::new(*x, *y, 0.0)).collect()
    }

    #[test]
    fn lines_by_their_length() {
        let path = Path::new(&points(&[[0.0, 0.0], [3.0, 0.0], [3.0, 1.0]]), PathCurve::Line, false).unwrap();
        assert_eq!(path.length(), 4.0);
        assert_eq!(path.at(0.375), (DVec3::new(1.5, 0.0, 0.0), DVec3::X));
        assert_eq!(path.at(0.875), (DVec3::new(3.0, 0.5, 0.0), DVec3::Y));
        assert_eq!((path.at(-1.0).0, path.at(7.0).0), (DVec3::ZERO, DVec3::new(3.0, 1.0, 0.0)));
        let square =
            Path::new(&points(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]), PathCurve::Line, true).unwrap();
        assert_eq!(square.at(0.875), (DVec3::new(0.0, 0.5, 0.0), DVec3::NEG_Y));
        assert_eq!(square.at(2.125).0, DVec3::new(0.5, 0.0, 0.0));
    }

    /// A spline through many points of a circle approximates it to the spline's order: its length is 2π and its speed
    /// uniform.
    #[test]
    fn a_circle_of_points_is_a_circle() {
        let n = 64;
        let around = |share: f64| {
            let (s, c) = libm::sincos(std::f64::consts::TAU * share);
            [c, s]
        };
        let list: Vec<[f64; 2]> = (0..n).map(|i| around(f64::from(i) / f64::from(n))).collect();
        let path = Path::new(&points(&list), PathCurve::Spline, true).unwrap();
        assert!((path.length() - std::f64::consts::TAU).abs() < 1e-5, "{}", path.length());
        for i in 0..500 {
            let share = f64::from(i) / 500.0;
            let (point, direction) = path.at(share);
            let [x, y] = around(share);
            assert!((point - DVec3::new(x, y, 0.0)).length() < 1e-5, "{share}");
            assert!((direction - DVec3::new(-y, x, 0.0)).length() < 1e-3, "{share}");
        }
    }

    /// Equal fractions are equal arc lengths even where points are dense, measured by chords.
    #[test]
    fn speed_is_even() {
        let list = [[0.0, 0.0], [0.1, 0.05], [0.2, 0.0], [5.0, 4.0], [5.1, 4.0], [9.0, -3.0]];
        let path = Path::new(&points(&list), PathCurve::Spline, false).unwrap();
        let steps = 20_000;
        let mut chords = 0.0;
        for i in 0..steps {
            let (a, b) = (path.at(f64::from(i) / f64::from(steps)).0, path.at(f64::from(i + 1) / f64::from(steps)).0);
            let chord = (b - a).length() / (path.length() / f64::from(steps));
            assert!((chord - 1.0).abs() < 1e-3, "{i}: {chord}");
            chords += (b - a).length();
        }
        assert!((chords / path.length() - 1.0).abs() < 1e-6);
    }

    #[test]
    fn what_makes_no_path() {
        let wrong = |list: &[[f64; 2]], closed| Path::new(&points(list), PathCurve::Spline, closed).unwrap_err();
        assert_eq!(wrong(&[[0.0, 0.0]], false), "a path needs at least 2 points");
        assert_eq!(wrong(&[[0.0, 0.0], [1.0, 0.0]], true), "a closed path needs at least 3 points");
        assert_eq!(wrong(&[[0.0, 0.0], [1.0, 0.0], [1.0, 0.0]], false), "points 2 and 3 of the path are the same");
        assert!(wrong(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 0.0]], true).contains("by itself"));
    }
}
