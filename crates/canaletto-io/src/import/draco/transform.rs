//! How predictions and corrections make values.

use super::Decoded;
use super::reader::Reader;

/// Values from `least` to `most`. What goes beyond one end comes in at the other.
pub(super) struct Wrap {
    least: i32,
    most: i32,
    span: i32,
}

impl Wrap {
    pub(super) fn read(stream: &mut Reader) -> Decoded<Wrap> {
        let (least, most) = (stream.word()? as i32, stream.word()? as i32);
        let span = most.checked_sub(least).and_then(|difference| difference.checked_add(1));
        match span.filter(|span| *span > 0) {
            Some(span) => Ok(Wrap { least, most, span }),
            None => Err(format!("values from {least} to {most} aren't a range").into()),
        }
    }

    pub(super) fn corrected(&self, prediction: i32, correction: i32) -> i32 {
        let sum = prediction.clamp(self.least, self.most).wrapping_add(correction);
        if sum > self.most {
            sum.wrapping_sub(self.span)
        } else if sum < self.least {
            sum.wrapping_add(self.span)
        } else {
            sum
        }
    }
}

/// Unit vectors on an octahedron that is unfolded to a square (Cigolle and others, 2014). x is the axis through the
/// square's centre; half of the square, a diamond, has positive x.
#[derive(Clone, Copy)]
pub(super) struct Octahedron {
    /// The coordinates go from 0 to `2 * center`, so that there are `2 * center + 1` of them.
    center: i32,
}

impl Octahedron {
    /// The octahedron of coordinates of so many bits.
    pub(super) fn new(bits: u32) -> Decoded<Octahedron> {
        match bits {
            2..=30 => Ok(Octahedron { center: (1 << (bits - 1)) - 1 }),
            _ => Err(format!("normals have {bits} bits, not 2 to 30").into()),
        }
    }

    /// Reads what a prediction needs.
    pub(super) fn read(stream: &mut Reader) -> Decoded<Octahedron> {
        let most = stream.word()?;
        let _center = stream.word()?;
        match most % 2 {
            1 => Octahedron::new(32 - most.leading_zeros()),
            _ => Err("the largest coordinate of normals is even".into()),
        }
    }

    /// Corrects a prediction. Corrections are stored as if the prediction were in the lower left of the diamond.
    pub(super) fn corrected(&self, prediction: [i32; 2], correction: [i32; 2]) -> [i32; 2] {
        let centered = prediction.map(|v| v.wrapping_sub(self.center));
        let is_inside = centered[0].unsigned_abs().wrapping_add(centered[1].unsigned_abs()) <= self.center as u32;
        let inner = if is_inside { centered } else { self.inverted(centered) };
        let turns = turns(inner);
        let turned = turn(inner, turns);
        let sum: [i32; 2] = std::array::from_fn(|k| self.wrapped(turned[k].wrapping_add(correction[k])));
        let back = turn(sum, (4 - turns) % 4);
        let value = if is_inside { back } else { self.inverted(back) };
        value.map(|v| v.wrapping_add(self.center))
    }

    /// Brings a sum back to at most `center`. Corrections aren't negative.
    fn wrapped(&self, v: i32) -> i32 {
        if v > self.center { v.wrapping_sub(2 * self.center + 1) } else { v }
    }

    /// Swaps the diamond and the four corners around it. Each quarter is mirrored at the diamond's edge.
    fn inverted(&self, [s, t]: [i32; 2]) -> [i32; 2] {
        let signs = match (s >= 0 && t >= 0, s <= 0 && t <= 0) {
            (true, _) => [1, 1],
            (_, true) => [-1, -1],
            _ => [s, t].map(|v| if v > 0 { 1 } else { -1 }),
        };
        let corner = signs.map(|sign| sign * self.center);
        let doubled = |v: i32, corner: i32| v.wrapping_mul(2).wrapping_sub(corner);
        let (s, t) = (doubled(s, corner[0]), doubled(t, corner[1]));
        let [s, t] = if signs[0] == signs[1] { [t.wrapping_neg(), s.wrapping_neg()] } else { [t, s] };
        [s.wrapping_add(corner[0]) / 2, t.wrapping_add(corner[1]) / 2]
    }

    /// The coordinates of a direction, of any length.
    pub(super) fn coordinates(&self, direction: [i32; 3], is_flipped: bool) -> [i32; 2] {
        let mut v = self.projected(direction);
        if is_flipped {
            v = v.map(|v| -v);
        }
        let most = 2 * self.center;
        let [x, y, z] = v;
        let fold = |v: i32, other: i32| if other < 0 { v.abs() } else { most - v.abs() };
        if x >= 0 { [y + self.center, z + self.center] } else { [fold(z, y), fold(y, z)] }
    }

    /// The direction's point on the octahedron, of which the absolute values of the coordinates sum up to `center`.
    fn projected(&self, [x, y, z]: [i32; 3]) -> [i32; 3] {
        let [long_x, long_y, long_z] = [x, y, z].map(i64::from);
        let sum = long_x.abs() + long_y.abs() + long_z.abs();
        if sum == 0 {
            return [self.center, 0, 0];
        }
        let scaled = |v: i64| (v * i64::from(self.center) / sum) as i32;
        let (x, y) = (scaled(long_x), scaled(long_y));
        let rest = self.center - x.abs() - y.abs();
        [x, y, if z >= 0 { rest } else { -rest }]
    }

    /// The unit vector of coordinates.
    pub(super) fn unit_vector(&self, at: [i32; 2]) -> [f32; 3] {
        let scale = 2.0 / (2 * self.center) as f32;
        let [y, z] = at.map(|v| v as f32 * scale - 1.0);
        let x = 1.0 - y.abs() - z.abs();
        // Beyond the diamond x is negative, and the corner folds over.
        let over = if x > 0.0 { 0.0 } else { -x };
        let [y, z] = [y, z].map(|v| if v < 0.0 { v + over } else { v - over });
        let square = x * x + y * y + z * z;
        if f64::from(square) < 1e-6 {
            return [0.0; 3];
        }
        let scale = 1.0 / square.sqrt();
        [x * scale, y * scale, z * scale]
    }
}

/// The quarter turns that bring a point to the lower left.
fn turns([s, t]: [i32; 2]) -> u32 {
    match (s.signum(), t.signum()) {
        (0, 0) | (-1, 0 | -1) => 0,
        (0 | 1, -1) => 1,
        (1, _) => 2,
        _ => 3,
    }
}

/// Turns a point by quarters, clockwise.
fn turn([s, t]: [i32; 2], quarters: u32) -> [i32; 2] {
    match quarters {
        1 => [t, s.wrapping_neg()],
        2 => [s.wrapping_neg(), t.wrapping_neg()],
        3 => [t.wrapping_neg(), s],
        _ => [s, t],
    }
}
