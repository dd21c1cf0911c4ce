//! Clouds as arrays of NumPy with named columns.

use canaletto::math::Rgb;
use glam::DVec3;

/// A table of elements with these points each. Points are relative to zero; near it they are `f32`. Radii and colours
/// have columns if each element has its own.
pub(super) fn table<const N: usize>(rows: Vec<[DVec3; N]>, origin: DVec3, radii: &[f32], colors: &[Rgb]) -> Vec<u8> {
    let is_far = origin != DVec3::ZERO;
    let names: &[&str] = if N == 1 { &["x", "y", "z"] } else { &["x1", "y1", "z1", "x2", "y2", "z2"] };
    let place = if is_far { "<f8" } else { "<f4" };
    let mut columns: Vec<String> = names.iter().map(|name| format!("('{name}', '{place}')")).collect();
    let has_radii = radii.len() > 1 || radii.len() == rows.len() && rows.len() > 1;
    if has_radii {
        columns.push("('radius', '<f4')".into());
    }
    if !colors.is_empty() {
        columns.extend(["red", "green", "blue"].map(|name| format!("('{name}', '<f4')")));
    }
    let header = format!("{{'descr': [{}], 'fortran_order': False, 'shape': ({},), }}", columns.join(", "), rows.len());
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    let size = (bytes.len() + 2 + header.len() + 1).next_multiple_of(64) - bytes.len() - 2;
    bytes.extend((size as u16).to_le_bytes());
    bytes.extend(header.bytes());
    bytes.resize(10 + size - 1, b' ');
    bytes.push(b'\n');
    let of = |list: &[Rgb], i: usize| if list.len() == 1 { list[0] } else { list[i] };
    for (i, points) in rows.iter().enumerate() {
        for coordinate in points.iter().flat_map(|p| p.to_array()) {
            match is_far {
                true => bytes.extend(coordinate.to_le_bytes()),
                false => bytes.extend((coordinate as f32).to_le_bytes()),
            }
        }
        if has_radii {
            bytes.extend(radii[i].to_le_bytes());
        }
        if !colors.is_empty() {
            bytes.extend(of(colors, i).to_array().iter().flat_map(|v| v.to_le_bytes()));
        }
    }
    bytes
}
