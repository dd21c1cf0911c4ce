//! Clouds of spheres and cylinders from tables: text, PLY and plain binary.
//!
//! **Text** (`csv`, `xyz`, `txt`): a row for each sphere, `x y z`, `x y z radius`, `x y z red green blue` or
//! `x y z radius red green blue`; for each cylinder the same with `x1 y1 z1 x2 y2 z2`. Semicolons, else commas, else
//! spaces stand between; the first row decides. A first row that is not of numbers names the columns, in any order;
//! unknown ones are passed over. Lines that start with `#` are comments. Colours are linear, 0 to 1, as in the scene text.
//!
//! **Binary** (`bin`): records of little-endian `f32` without a header: a sphere is `x y z radius`, a cylinder
//! `x1 y1 z1 x2 y2 z2 radius`.
//!
//! **PLY**: see [`super::ply`].

use super::lines::{Complaint, Word};
use super::ply;
use super::positions::Positions;
use crate::assets::Asset;
use crate::diagnostic::Diagnostics;
use canaletto::math::Rgb;
use canaletto::shape::{CylinderCloud, SphereCloud};
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// How a cloud's file is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CloudFormat {
    /// Rows of text.
    Text,
    /// PLY.
    Ply,
    /// Records of little-endian `f32`.
    Binary,
}

impl CloudFormat {
    /// The extensions that [`CloudFormat::of_extension`] knows.
    pub const EXTENSIONS: [&str; 5] = ["csv", "xyz", "txt", "ply", "bin"];

    /// The format that a file's extension (in lower case) stands for.
    pub fn of_extension(extension: &str) -> Option<CloudFormat> {
        match extension {
            "csv" | "xyz" | "txt" => Some(CloudFormat::Text),
            "ply" => Some(CloudFormat::Ply),
            "bin" => Some(CloudFormat::Binary),
            _ => None,
        }
    }
}

/// Reads spheres. `radius` is for files without radii; if there is none either, that is an error.
///
/// # Errors
/// The first mistake, with its row and column where the file has them.
pub fn read_spheres(asset: &Asset, format: CloudFormat, radius: Option<f32>) -> Result<SphereCloud, Diagnostics> {
    let name = asset.path.name();
    let cloud = match format {
        CloudFormat::Text => text(&asset.bytes, &["x", "y", "z"]).map(|Table { points, radii, colors }| {
            let (origin, centers) = points.settle();
            SphereCloud { name: name.to_owned(), origin, centers, radii, colors }
        }),
        CloudFormat::Ply => ply::read_spheres(name, asset.bytes.as_slice().into()),
        CloudFormat::Binary => records::<4>(&asset.bytes, "x y z radius").map(|(rows, radii)| SphereCloud {
            name: name.to_owned(),
            origin: DVec3::ZERO,
            centers: rows.par_iter().map(|row| Vec3::from_slice(row)).collect(),
            radii,
            colors: Vec::new(),
        }),
    };
    let cloud =
        cloud.and_then(|mut cloud| settle_radius(&mut cloud.radii, cloud.centers.len(), radius).map(|()| cloud));
    cloud.map_err(|complaint| failure(asset, format, complaint))
}

/// Reads cylinders; see [`read_spheres`]. They have caps.
///
/// # Errors
/// The first mistake, with its row and column where the file has them.
pub fn read_cylinders(asset: &Asset, format: CloudFormat, radius: Option<f32>) -> Result<CylinderCloud, Diagnostics> {
    let name = asset.path.name();
    let axis = |row: &[f32]| [Vec3::from_slice(row), Vec3::from_slice(&row[3..])];
    let cloud = match format {
        CloudFormat::Text => {
            text(&asset.bytes, &["x1", "y1", "z1", "x2", "y2", "z2"]).map(|Table { points, radii, colors }| {
                let (origin, ends) = points.settle();
                let axes = ends.as_chunks().0.to_vec();
                CylinderCloud { name: name.to_owned(), origin, axes, radii, colors, caps: true }
            })
        }
        CloudFormat::Ply => ply::read_cylinders(name, asset.bytes.as_slice().into()),
        CloudFormat::Binary => {
            records::<7>(&asset.bytes, "x1 y1 z1 x2 y2 z2 radius").map(|(rows, radii)| CylinderCloud {
                name: name.to_owned(),
                origin: DVec3::ZERO,
                axes: rows.par_iter().map(|row| axis(row)).collect(),
                radii,
                colors: Vec::new(),
                caps: true,
            })
        }
    };
    let cloud = cloud.and_then(|mut cloud| {
        if let Some(row) = cloud.axes.par_iter().position_first(|[a, b]| a == b) {
            return Err(Complaint::file(format!("cylinder {} has no length: its ends are the same point", row + 1)));
        }
        settle_radius(&mut cloud.radii, cloud.axes.len(), radius).map(|()| cloud)
    });
    cloud.map_err(|complaint| failure(asset, format, complaint))
}

fn failure(asset: &Asset, format: CloudFormat, complaint: Complaint) -> Diagnostics {
    let mut errors = Diagnostics::from(complaint.error(asset.path.name()));
    if format == CloudFormat::Text || asset.bytes.get(4..16).is_some_and(|start| start.starts_with(b"format ascii")) {
        super::attach_source(&mut errors, asset.path.name(), asset.bytes.as_slice().into());
    }
    errors
}

fn settle_radius(radii: &mut Vec<f32>, count: usize, given: Option<f32>) -> Result<(), Complaint> {
    if count == 0 {
        return Err(Complaint::file("there are no rows in it"));
    }
    if radii.is_empty() {
        let radius = given.ok_or_else(|| {
            Complaint::file("the file has no radii").help("give one `radius` for all beside the file's name")
        })?;
        radii.push(radius);
    }
    Ok(())
}

/// The records' numbers, the last of which is the radius.
fn records<const N: usize>(bytes: &[u8], columns: &str) -> Result<(Vec<[f32; N]>, Vec<f32>), Complaint> {
    let size = 4 * N;
    if !bytes.len().is_multiple_of(size) {
        return Err(Complaint::file(format!(
            "its {} bytes are not a whole number of records of {size} bytes ({columns} as little-endian f32)",
            bytes.len()
        )));
    }
    let rows: Vec<[f32; N]> = bytes
        .par_chunks_exact(size)
        .map(|record| std::array::from_fn(|i| f32::from_le_bytes(std::array::from_fn(|b| record[4 * i + b]))))
        .collect();
    let finite = |row: &[f32; N]| row.iter().all(|v| v.is_finite());
    if let Some(index) = rows.par_iter().position_first(|row| !finite(row) || row[N - 1] <= 0.0) {
        let row = &rows[index];
        return Err(Complaint::file(if finite(row) {
            format!("record {index} (from 0): radius is {}; it must be more than 0", row[N - 1])
        } else {
            format!("record {index} (from 0) has a number that isn't finite")
        }));
    }
    let radii = rows.par_iter().map(|row| row[N - 1]).collect();
    Ok((rows, radii))
}

/// The columns of a text, and what stands between them.
struct Columns {
    separator: Option<u8>,
    count: usize,
    /// For each column its place among the points' coordinates, radius, red, green, blue; or nothing.
    roles: Vec<Option<usize>>,
    radius: bool,
    color: bool,
}

/// A part of the rows.
#[derive(Default)]
struct Table {
    points: Positions,
    radii: Vec<f32>,
    colors: Vec<Rgb>,
}

/// Rows of text with these columns for the points.
fn text(bytes: &[u8], points: &[&str]) -> Result<Table, Complaint> {
    let from = if bytes.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 };
    let Some(first) = rows(bytes, from..bytes.len()).next() else {
        return Ok(Table::default());
    };
    let (columns, start) = Columns::of(&first, points)?;
    // Pieces that start after a line's end; each is a pure function of its bytes, and they are joined in order.
    const PIECE: usize = 1 << 20;
    let line_after = |at: usize| bytes[at..].iter().position(|b| *b == b'\n').map_or(bytes.len(), |p| at + p + 1);
    let mut cuts = vec![start];
    while *cuts.last().unwrap_or(&0) < bytes.len() {
        let next = (cuts.last().unwrap_or(&0) + PIECE).min(bytes.len());
        cuts.push(line_after(next));
    }
    let tables: Vec<Result<Table, Complaint>> = cuts
        .par_windows(2)
        .map(|cut| {
            let mut table = Table::default();
            rows(bytes, cut[0]..cut[1]).try_for_each(|row| columns.read(&row, points, &mut table))?;
            table.points = table.points.part();
            Ok(table)
        })
        .collect();
    let mut all = Table::default();
    for table in tables {
        let table = table?;
        all.points.append(table.points);
        all.radii.extend(table.radii);
        all.colors.extend(table.colors);
    }
    Ok(all)
}

/// The rows of a part of the file, without blank lines and comments.
fn rows(bytes: &[u8], part: std::ops::Range<usize>) -> impl Iterator<Item = Word<'_>> {
    let mut at = part.start;
    let lines = bytes[part].split_inclusive(|b| *b == b'\n' || *b == b'\r').map(move |line| {
        let start = at;
        at += line.len();
        Word { start: start + line.len() - line.trim_ascii_start().len(), text: line.trim_ascii() }
    });
    lines.filter(|row| !row.text.is_empty() && !row.text.starts_with(b"#") && !row.text.starts_with(b"//"))
}

impl Columns {
    /// The columns by the first row, and where the rows of numbers start.
    fn of(first: &Word<'_>, points: &[&str]) -> Result<(Columns, usize), Complaint> {
        let separator = [b';', b','].into_iter().find(|s| first.text.contains(s));
        let n = points.len();
        let mut columns = Columns { separator, count: 0, roles: Vec::new(), radius: false, color: false };
        let cells: Vec<Word<'_>> = columns.cells(first).collect();
        columns.count = cells.len();
        if cells.iter().any(|cell| cell.number().is_ok()) {
            (columns.radius, columns.color) = match cells.len().wrapping_sub(n) {
                0 => (false, false),
                1 => (true, false),
                3 => (false, true),
                4 => (true, true),
                _ => {
                    let message = format!(
                        "a row has {} columns, but it should have {n}, {}, {} or {}",
                        cells.len(),
                        n + 1,
                        n + 3,
                        n + 4
                    );
                    let names = points.join(" ");
                    return Err(first.wrong(message).help(format!(
                        "the columns are {names} [radius] [red green blue]; others need names in the first row"
                    )));
                }
            };
            let radius = usize::from(columns.radius);
            columns.roles = (0..cells.len()).map(|i| Some(if i < n + radius { i } else { i + 1 - radius })).collect();
            return Ok((columns, first.start));
        }
        let names: Vec<String> = cells.iter().map(|c| c.string().trim_matches('"').to_lowercase()).collect();
        let find = |wanted: &[&str]| names.iter().position(|name| wanted.contains(&name.as_str()));
        columns.roles = vec![None; names.len()];
        for (role, name) in points.iter().enumerate() {
            let at = find(&[name]).ok_or_else(|| first.wrong(format!("the first row names no column `{name}`")))?;
            columns.roles[at] = Some(role);
        }
        let short = find(&["g"]).is_some() && find(&["b"]).is_some();
        let rgb = if short {
            [find(&["r"]), find(&["g"]), find(&["b"])]
        } else {
            [find(&["red"]), find(&["green"]), find(&["blue"])]
        };
        if let [Some(r), Some(g), Some(b)] = rgb {
            columns.color = true;
            [r, g, b].iter().enumerate().for_each(|(i, at)| columns.roles[*at] = Some(n + 1 + i));
        }
        let radius = find(&["radius"]).or(if short { None } else { find(&["r"]) });
        if let Some(at) = radius {
            columns.radius = true;
            columns.roles[at] = Some(n);
        }
        Ok((columns, first.start + first.text.len()))
    }

    fn cells<'a>(&self, row: &Word<'a>) -> impl Iterator<Item = Word<'a>> + use<'a> {
        let (separator, mut at, row) = (self.separator, row.start, *row);
        let by_space = separator.is_none().then(|| row.words()).into_iter().flatten();
        let by_separator = separator.map(|separator| {
            row.text.split(move |b| *b == separator).map(move |cell| {
                let lead = cell.len() - cell.trim_ascii_start().len();
                let word = Word { start: at + lead, text: cell.trim_ascii() };
                at += cell.len() + 1;
                word
            })
        });
        by_separator.into_iter().flatten().chain(by_space)
    }

    fn read(&self, row: &Word<'_>, points: &[&str], table: &mut Table) -> Result<(), Complaint> {
        let n = points.len();
        let mut values = [0.0f32; 10];
        let mut exact = [0.0f64; 6];
        let mut count = 0;
        for cell in self.cells(row) {
            if let Some(Some(role)) = self.roles.get(count) {
                let (value, all) = cell.exact_number().map_err(|complaint| {
                    let others = ["radius", "red", "green", "blue"];
                    let name = points.get(*role).copied().unwrap_or_else(|| others[*role - n]);
                    complaint.within(&format!("column {} ({name})", count + 1))
                })?;
                if *role == n && value <= 0.0 {
                    return Err(cell.wrong(format!("column {}: radius is {value}; it must be more than 0", count + 1)));
                }
                if *role > n && !(0.0..=1.0).contains(&value) {
                    let name = ["red", "green", "blue"][*role - n - 1];
                    return Err(cell
                        .wrong(format!("column {}: {name} is {value}; it must be between 0 and 1", count + 1))
                        .help("colours are linear, 0 to 1; a PLY file may have bytes (sRGB)"));
                }
                values[*role] = value;
                if *role < n {
                    exact[*role] = all;
                }
            }
            count += 1;
        }
        if count != self.count {
            return Err(row.wrong(format!("this row has {count} columns, and the first one {}", self.count)));
        }
        for (rounded, exact) in values[..n].chunks_exact(3).zip(exact.chunks_exact(3)) {
            table.points.push(Vec3::from_slice(rounded), DVec3::from_slice(exact));
        }
        if self.radius {
            table.radii.push(values[n]);
        }
        if self.color {
            table.colors.push(Rgb::new(values[n + 1], values[n + 2], values[n + 3]));
        }
        Ok(())
    }
}

#[cfg(test)]
#[path = "cloud_tests.rs"]
mod tests;
