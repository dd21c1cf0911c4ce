//! Predictions: values from those before them, and from positions. What is stored are the corrections.

use super::Decoded;
use super::entropy::BitDecoder;
use super::layout::Laid;
use super::reader::Reader;
use super::transform::{Octahedron, Wrap};

/// The positions of an attribute's values: a list of all positions, and the number of each value's own.
pub(super) struct Positions<'a> {
    pub(super) all: &'a [i32],
    pub(super) numbers: Vec<u32>,
}

impl Positions<'_> {
    fn get(&self, value: u32) -> [i64; 3] {
        let at = 3 * self.numbers[value as usize] as usize;
        std::array::from_fn(|k| self.all[at + k].into())
    }
}

fn minus(a: [i64; 3], b: [i64; 3]) -> [i64; 3] {
    std::array::from_fn(|k| a[k].wrapping_sub(b[k]))
}

fn dot(a: [i64; 3], b: [i64; 3]) -> i64 {
    a.into_iter().zip(b).fold(0, |sum: i64, (a, b)| sum.wrapping_add(a.wrapping_mul(b)))
}

fn cross(a: [i64; 3], b: [i64; 3]) -> [i64; 3] {
    let part = |j: usize, k: usize| a[j].wrapping_mul(b[k]).wrapping_sub(a[k].wrapping_mul(b[j]));
    [part(1, 2), part(2, 0), part(0, 1)]
}

/// Each value from the one before it. The first one is predicted as 0.
pub(super) fn from_last(values: &mut [i32], width: usize, wrap: &Wrap) {
    for at in 0..values.len() {
        let prediction = if at < width { 0 } else { values[at - width] };
        values[at] = wrap.corrected(prediction, values[at]);
    }
}

/// As [`from_last`], for coordinates on an octahedron.
pub(super) fn directions_from_last(values: &mut [[i32; 2]], octahedron: Octahedron) {
    let mut last = [0; 2];
    for value in values {
        *value = octahedron.corrected(last, *value);
        last = *value;
    }
}

/// The values of the triangle across the edge of a corner, if all of them are before this value.
fn across(laid: &Laid, corner: u32, value: u32) -> Option<[usize; 3]> {
    let known = laid.triangle_across(corner)?;
    known.iter().all(|v| *v < value).then(|| known.map(|v| v as usize))
}

/// The fourth corner of a parallelogram, of which the first is opposite.
fn fourth(values: &[i32], [a, b, c]: [usize; 3], width: usize, k: usize) -> i32 {
    let part = |value: usize| values[value * width + k];
    part(b).wrapping_add(part(c)).wrapping_sub(part(a))
}

/// Each value as the fourth corner of a parallelogram, whose other corners are the triangle across the edge.
pub(super) fn parallelogram(values: &mut [i32], width: usize, wrap: &Wrap, laid: &Laid) {
    for (value, corner) in laid.values() {
        let known = across(laid, corner, value);
        for k in 0..width {
            let at = value as usize * width + k;
            let prediction = match known {
                Some(known) => fourth(values, known, width, k),
                None if value > 0 => values[at - width],
                None => 0,
            };
            values[at] = wrap.corrected(prediction, values[at]);
        }
    }
}

/// The edges that parallelograms aren't made of, by the number of parallelograms of their vertex.
pub(super) struct Creases<'a>([Option<(u32, BitDecoder<'a>)>; 4]);

impl<'a> Creases<'a> {
    pub(super) fn read(stream: &mut Reader<'a>) -> Decoded<Creases<'a>> {
        let mut creases = Creases([const { None }; 4]);
        for list in &mut creases.0 {
            let count = stream.number()?;
            *list = if count > 0 { Some((count, BitDecoder::new(stream)?)) } else { None };
        }
        Ok(creases)
    }

    fn next(&mut self, parallelograms: usize) -> Decoded<bool> {
        let list = self.0[parallelograms - 1].as_mut();
        let (left, bits) = list.filter(|(left, _)| *left > 0).ok_or("there are too few edges without creases")?;
        *left -= 1;
        bits.next()
    }
}

/// Each value as the mean of up to four parallelograms, without those across creases.
pub(super) fn parallelograms(
    values: &mut [i32],
    width: usize,
    wrap: &Wrap,
    laid: &Laid,
    mut creases: Creases,
) -> Decoded<()> {
    for (value, corner) in laid.values() {
        let mut known = [[0; 3]; 4];
        let mut found = 0;
        if value > 0 {
            let all = laid.fan(corner).filter_map(|corner| across(laid, corner, value));
            for (slot, own) in known.iter_mut().zip(all) {
                *slot = own;
                found += 1;
            }
        }
        let mut used = 0;
        for i in 0..found {
            if !creases.next(found)? {
                known[used] = known[i];
                used += 1;
            }
        }
        for k in 0..width {
            let at = value as usize * width + k;
            let sum = known[..used].iter().fold(0i32, |sum, own| sum.wrapping_add(fourth(values, *own, width, k)));
            let prediction = match used {
                0 if value == 0 => 0,
                0 => values[at - width],
                _ => sum / used as i32,
            };
            values[at] = wrap.corrected(prediction, values[at]);
        }
    }
    Ok(())
}

/// The sides on which texture coordinates are, in the order from the last to the first.
pub(super) fn read_sides(stream: &mut Reader, values: usize) -> Decoded<Vec<bool>> {
    let count = stream.word()? as usize;
    if count > values {
        return Err(format!("{values} texture coordinates can't be on {count} sides").into());
    }
    let mut bits = BitDecoder::new(stream)?;
    let mut side = true;
    let next = |_| {
        side ^= !bits.next()?;
        Ok(side)
    };
    (0..count).map(next).collect()
}

/// Texture coordinates: the triangle of each is similar to that of its positions.
pub(super) fn texture_coordinates(
    values: &mut [[i32; 2]],
    wrap: &Wrap,
    laid: &Laid,
    positions: &Positions,
    mut sides: Vec<bool>,
) -> Decoded<()> {
    for (value, corner) in laid.values() {
        let [_, n, p] = laid.triangle(corner);
        let at = |v: u32| values[v as usize];
        let similar = match n < value && p < value {
            true if at(n) == at(p) => Some(at(p)),
            true => similar([at(n), at(p)], [n, p, value].map(|v| positions.get(v)), &mut sides)?,
            false => None,
        };
        let prediction = match similar {
            Some(prediction) => prediction,
            None if n < value => at(n),
            None if value > 0 => at(value - 1),
            None => [0; 2],
        };
        let correction = values[value as usize];
        values[value as usize] = std::array::from_fn(|k| wrap.corrected(prediction[k], correction[k]));
    }
    Ok(())
}

/// The third corner of a triangle in the texture, which is similar to that of the positions n, p and tip. None if n and
/// p are one place. All is in whole numbers, times the square of the distance from n to p.
fn similar(uvs: [[i32; 2]; 2], [n, p, tip]: [[i64; 3]; 3], sides: &mut Vec<bool>) -> Decoded<Option<[i32; 2]>> {
    const TOO_LARGE: &str = "a texture coordinate is too large to predict";
    let [uv_n, uv_p] = uvs.map(|uv| uv.map(i64::from));
    let along = minus(p, n);
    let square = dot(along, along);
    if square == 0 {
        return Ok(None);
    }
    let share = dot(along, minus(tip, n));
    let uv_along: [i64; 2] = std::array::from_fn(|k| uv_p[k] - uv_n[k]);
    let largest = |v: &[i64]| v.iter().map(|v| v.unsigned_abs()).max().unwrap_or(0);
    let fits = |v: &[i64], factor: u64| largest(v).checked_mul(factor).is_some_and(|v| v <= i64::MAX as u64);
    let is_small =
        fits(&uv_n, square as u64) && fits(&uv_along, share.unsigned_abs()) && fits(&along, share.unsigned_abs());
    if !is_small {
        return Err(TOO_LARGE.into());
    }
    let foot: [i64; 3] = std::array::from_fn(|k| n[k].wrapping_add((share * along[k]).wrapping_div(square)));
    let height = minus(tip, foot);
    let across = (dot(height, height) as u64).wrapping_mul(square as u64).isqrt() as i64;
    let side = sides.pop().ok_or("there are too few sides of texture coordinates")?;
    let across = if side { across } else { across.wrapping_neg() };
    let turned = [uv_along[1], -uv_along[0]];
    Ok(Some(std::array::from_fn(|k| {
        let foot = uv_n[k].wrapping_mul(square).wrapping_add(share.wrapping_mul(uv_along[k]));
        foot.wrapping_add(turned[k].wrapping_mul(across)).wrapping_div(square) as i32
    })))
}

/// Normals: the mean of the triangles around, weighted by their areas. A bit for each tells whether it is flipped.
pub(super) fn normals(
    values: &mut [[i32; 2]],
    octahedron: Octahedron,
    laid: &Laid,
    positions: &Positions,
    mut flips: BitDecoder,
) -> Decoded<()> {
    for (value, (_, corner)) in values.iter_mut().zip(laid.values()) {
        let direction = normal(laid, positions, corner);
        let prediction = octahedron.coordinates(direction, flips.next()?);
        *value = octahedron.corrected(prediction, *value);
    }
    Ok(())
}

/// The normal of the triangles around a corner, of which the absolute values of the components have a sum of at most
/// about 2^29.
fn normal(laid: &Laid, positions: &Positions, corner: u32) -> [i32; 3] {
    const MOST: i64 = 1 << 29;
    let at = |value: u32| positions.get(value);
    let center = at(laid.triangle(corner)[0]);
    let mut sum = [0i64; 3];
    for corner in laid.fan(corner) {
        let [_, n, p] = laid.triangle(corner);
        let area = cross(minus(at(n), center), minus(at(p), center));
        sum = std::array::from_fn(|k| sum[k].wrapping_add(area[k]));
    }
    let size = sum.iter().fold(0i64, |size, v| size.saturating_add(v.saturating_abs()));
    let divisor = if size > MOST { size / MOST } else { 1 };
    sum.map(|v| (v / divisor) as i32)
}
