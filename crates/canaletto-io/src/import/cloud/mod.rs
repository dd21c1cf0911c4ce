//! Clouds of spheres and cylinders from tables: text, XYZ, PLY and raw binary.
//!
//! **Text** (`csv`, `tsv`, `xyz`, `txt`): a row for each sphere, `x y z`, `x y z radius`, `x y z red green blue` or `x
//! y z radius red green blue`. Cylinders have `x1 y1 z1 x2 y2 z2` in place of `x y z`. The separator is semicolons,
//! else tabs, else commas, else spaces, as in the first row. A first row that isn't numeric names the columns, in any
//! order; unknown ones are skipped. Cells may be quoted. If the separator isn't the comma, numbers may have decimal
//! commas. Lines that start with `#`, `//` or `%` are comments. Colours are linear, 0 to 1, as in the scene text,
//! unless their numbers are those of a picture; see [`super::table_color`].
//!
//! **XYZ**: a text that starts with a count in a line of its own. It contains atoms, see [`xyz`], or plain rows.
//!
//! **Binary** (`bin`): records of little-endian `f32` without a header. A sphere is `x y z radius`, a cylinder `x1 y1
//! z1 x2 y2 z2 radius`.
//!
//! **PLY**: see [`super::ply`].
//!
//! Rows with a coordinate or a radius that is missing, infinite or NaN are left out and counted.

mod elements;
mod text;
mod xyz;

use super::encoding;
use super::lines::{ImportError, Token};
use super::ply;
use super::positions::Positions;
use super::precision_warning::{self, Precision};
use super::table_color::{self, Written};
use crate::assets::Asset;
use crate::diagnostic::Diagnostics;
use canaletto::math::Rgb;
use canaletto::shape::{CylinderCloud, SphereCloud};
use glam::Vec3;
use rayon::prelude::*;
use std::borrow::Cow;

/// The format of a cloud file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum CloudFormat {
    /// Rows of text.
    Text,
    /// A PLY file.
    Ply,
    /// Records of little-endian `f32`.
    Binary,
}

impl CloudFormat {
    /// The extensions that [`CloudFormat::of_extension`] accepts.
    pub const EXTENSIONS: [&str; 6] = ["csv", "tsv", "xyz", "txt", "ply", "bin"];

    /// The format of a file name extension, in lower case.
    pub fn of_extension(extension: &str) -> Option<CloudFormat> {
        match extension {
            "csv" | "tsv" | "xyz" | "txt" => Some(CloudFormat::Text),
            "ply" => Some(CloudFormat::Ply),
            "bin" => Some(CloudFormat::Binary),
            _ => None,
        }
    }

    /// The precision of coordinates in a file of this format.
    fn precision(self, bytes: &[u8]) -> Precision {
        match self {
            CloudFormat::Text => Precision::Double,
            CloudFormat::Ply => ply::precision(bytes.into()),
            CloudFormat::Binary => Precision::Single,
        }
    }
}

/// Rows that are left out because a coordinate or the radius isn't finite.
#[derive(Default)]
struct LeftOutRows {
    count: u64,
    /// The offset of the first such row.
    first: Option<usize>,
    /// The number of rows that are kept.
    kept: u64,
}

impl LeftOutRows {
    fn note(&mut self, row: &Token<'_>) {
        self.count += 1;
        self.first.get_or_insert(row.start);
    }

    /// Adds the rows of a later part.
    fn append(&mut self, later: LeftOutRows) {
        self.count += later.count;
        self.kept += later.kept;
        self.first = self.first.or(later.first);
    }

    /// The warning about these rows.
    fn complaint(&self, bytes: &[u8]) -> Option<ImportError> {
        let first = self.first?;
        let before = &bytes[..first];
        let ends = memchr::memchr_iter(b'\n', before).count();
        // Old files end lines by \r alone.
        let line = 1 + if ends > 0 { ends } else { memchr::memchr_iter(b'\r', before).count() };
        Some(ImportError::file(format!(
            "{} of {} rows are left out, as a coordinate or the radius isn't a finite number; the first is line {line}",
            self.count,
            self.count + self.kept
        )))
    }
}

/// A cloud with its warnings, or an error.
type Read<T> = Result<(T, Vec<ImportError>), ImportError>;

/// Reads spheres; returns them with warnings about what was left out or assumed. `radius` is for files without radii,
/// and for all atoms of an XYZ file. A file without radii needs `radius`, except for atoms, whose elements have radii.
///
/// # Errors
/// The first mistake, with its row and column where the file has them.
pub fn read_spheres(
    asset: &Asset,
    format: CloudFormat,
    radius: Option<f32>,
) -> Result<(SphereCloud, Diagnostics), Diagnostics> {
    let asset = &*readable(asset, format);
    let name = asset.path.name();
    let cloud = match format {
        CloudFormat::Text => spheres_of_text(&asset.bytes, radius),
        CloudFormat::Ply => ply::read_spheres(name, asset.bytes.as_slice().into()),
        CloudFormat::Binary => records::<4>(&asset.bytes, "x y z radius").map(|(Records { rows, radii }, said)| {
            let centers = rows.par_iter().map(|row| Vec3::from_slice(row)).collect();
            (SphereCloud { centers, radii, ..SphereCloud::default() }, said)
        }),
    };
    let cloud = cloud.and_then(|(mut cloud, mut said)| {
        name.clone_into(&mut cloud.name);
        settle_radius(&mut cloud.radii, cloud.centers.len(), radius, &said)?;
        said.extend(precision_warning::cloud(
            &cloud.centers,
            1,
            &cloud.radii,
            cloud.origin,
            format.precision(&asset.bytes),
        ));
        Ok((cloud, said))
    });
    finish(asset, format, cloud)
}

/// The file; a text is converted to UTF-8.
fn readable(asset: &Asset, format: CloudFormat) -> Cow<'_, Asset> {
    let text = match format {
        CloudFormat::Text => encoding::text(&asset.bytes),
        CloudFormat::Ply => encoding::utf8(&asset.bytes),
        CloudFormat::Binary => return Cow::Borrowed(asset),
    };
    if text.len() == asset.bytes.len() {
        return Cow::Borrowed(asset);
    }
    Cow::Owned(Asset { path: asset.path.clone(), bytes: text.into_owned() })
}

fn spheres_of_text(bytes: &[u8], radius: Option<f32>) -> Read<SphereCloud> {
    let names = ["x", "y", "z"];
    let table = match xyz::read(bytes).transpose()? {
        Some(xyz::Counted::Atoms(atoms)) => return Ok(spheres_of_atoms(bytes, atoms, radius)),
        Some(xyz::Counted::Rows(from)) => text::read_from(bytes, from, &names)?,
        None => text::read(bytes, &names)?,
    };
    let (Columns { points, radii, colors }, said) = columns(bytes, table);
    let (origin, centers) = points.rebase();
    Ok((SphereCloud { origin, centers, radii, colors, ..SphereCloud::default() }, said))
}

fn spheres_of_atoms(bytes: &[u8], mut atoms: xyz::Atoms, radius: Option<f32>) -> (SphereCloud, Vec<ImportError>) {
    let mut said: Vec<ImportError> = atoms.lost.complaint(bytes).into_iter().collect();
    if let Some((name, count)) = atoms.unknown {
        let message =
            format!("{count} atoms have a name that is no element, \"{name}\" first; they are grey, of radius 2");
        said.push(ImportError::file(message));
    }
    if atoms.more {
        said.push(ImportError::file("only the first of its frames is read"));
    }
    if !atoms.own_colors.is_empty() {
        atoms.colors = atoms.own_colors;
        said.extend(table_color::normalise(&mut atoms.colors, Written::Real, "atoms"));
    }
    let radii = match radius {
        Some(radius) if !atoms.has_radii => vec![radius],
        _ => atoms.radii,
    };
    let (origin, centers) = atoms.centers.rebase();
    (SphereCloud { origin, centers, radii, colors: atoms.colors, ..SphereCloud::default() }, said)
}

/// The columns of a table, with linear colours.
struct Columns {
    points: Positions,
    radii: Vec<f32>,
    colors: Vec<Rgb>,
}

/// The columns of a table, with its warnings.
fn columns(bytes: &[u8], table: text::Table) -> (Columns, Vec<ImportError>) {
    let text::Table { points, radii, mut colors, lost, commas, unknown } = table;
    let mut said: Vec<ImportError> = lost.complaint(bytes).into_iter().collect();
    if !unknown.is_empty() {
        /// The largest number of names in the message.
        const MOST: usize = 12;
        let more = if unknown.len() > MOST { format!(" and {} more", unknown.len() - MOST) } else { String::new() };
        let (noun, are) = if unknown.len() == 1 { ("column", "is") } else { ("columns", "are") };
        let listed: Vec<String> = unknown.iter().take(MOST).map(|name| name.chars().take(40).collect()).collect();
        said.push(ImportError::file(format!("the {noun} {}{more} {are} left out", listed.join(", "))));
    }
    if commas > 0 {
        said.push(ImportError::file(format!("{commas} numbers have a decimal comma; it is read as a point")));
    }
    said.extend(table_color::normalise(&mut colors, Written::Real, "rows"));
    (Columns { points, radii, colors }, said)
}

/// Reads cylinders, which have caps; see [`read_spheres`].
///
/// # Errors
/// The first mistake, with its row and column where the file has them.
pub fn read_cylinders(
    asset: &Asset,
    format: CloudFormat,
    radius: Option<f32>,
) -> Result<(CylinderCloud, Diagnostics), Diagnostics> {
    let asset = &*readable(asset, format);
    let axis = |row: &[f32]| [Vec3::from_slice(row), Vec3::from_slice(&row[3..])];
    let cloud = match format {
        CloudFormat::Text => cylinders_of_text(&asset.bytes),
        CloudFormat::Ply => ply::read_cylinders(asset.path.name(), asset.bytes.as_slice().into()),
        CloudFormat::Binary => {
            records::<7>(&asset.bytes, "x1 y1 z1 x2 y2 z2 radius").map(|(Records { rows, radii }, said)| {
                let axes = rows.par_iter().map(|row| axis(row)).collect();
                (CylinderCloud { axes, radii, ..CylinderCloud::default() }, said)
            })
        }
    };
    let cloud = cloud.and_then(|(mut cloud, mut said)| {
        if let Some(row) = cloud.axes.par_iter().position_first(|[a, b]| a == b) {
            return Err(ImportError::file(format!("cylinder {} has no length: its ends are the same point", row + 1)));
        }
        asset.path.name().clone_into(&mut cloud.name);
        cloud.caps = true;
        settle_radius(&mut cloud.radii, cloud.axes.len(), radius, &said)?;
        let ends = cloud.axes.as_flattened();
        said.extend(precision_warning::cloud(ends, 2, &cloud.radii, cloud.origin, format.precision(&asset.bytes)));
        Ok((cloud, said))
    });
    finish(asset, format, cloud)
}

fn cylinders_of_text(bytes: &[u8]) -> Read<CylinderCloud> {
    let names = ["x1", "y1", "z1", "x2", "y2", "z2"];
    let table = match xyz::read(bytes) {
        Some(Ok(xyz::Counted::Rows(from))) => text::read_from(bytes, from, &names)?,
        Some(Ok(xyz::Counted::Atoms(_))) => {
            let help = "spheres read the atoms; bonds need a table of their ends, x1 y1 z1 x2 y2 z2";
            return Err(ImportError::file("an XYZ file holds atoms, no cylinders").help(help));
        }
        Some(Err(_)) | None => text::read(bytes, &names)?,
    };
    let (Columns { points, radii, colors }, said) = columns(bytes, table);
    let (origin, ends) = points.rebase();
    let axes = ends.as_chunks().0.to_vec();
    Ok((CylinderCloud { origin, axes, radii, colors, ..CylinderCloud::default() }, said))
}

fn finish<T>(asset: &Asset, format: CloudFormat, read: Read<T>) -> Result<(T, Diagnostics), Diagnostics> {
    match read {
        Ok((cloud, said)) => {
            let mut warnings = Diagnostics::new();
            said.into_iter().for_each(|complaint| warnings.push(complaint.warning(asset.path.name())));
            Ok((cloud, warnings))
        }
        Err(complaint) => Err(failure(asset, format, complaint)),
    }
}

fn failure(asset: &Asset, format: CloudFormat, complaint: ImportError) -> Diagnostics {
    let mut errors = Diagnostics::from(complaint.error(asset.path.name()));
    if format == CloudFormat::Text || asset.bytes.get(4..16).is_some_and(|start| start.starts_with(b"format ascii")) {
        super::attach_source(&mut errors, asset.path.name(), asset.bytes.as_slice().into());
    }
    errors
}

/// Uses the radius `given` where the file has no radii. Fails if there is none, or if there are no rows; `said` may
/// have the reason for the latter.
fn settle_radius(
    radii: &mut Vec<f32>,
    count: usize,
    given: Option<f32>,
    said: &[ImportError],
) -> Result<(), ImportError> {
    if count == 0 {
        let lost = said.iter().find(|complaint| complaint.message.contains("left out, as a coordinate"));
        return Err(ImportError::file(lost.map_or("there are no rows in it", |complaint| complaint.message.as_str())));
    }
    if radii.is_empty() {
        let radius = given.ok_or_else(|| {
            ImportError::file("the file has no radii").help("give one `radius` for all beside the file's name")
        })?;
        radii.push(radius);
    }
    Ok(())
}

/// The records of a binary file.
struct Records<const N: usize> {
    rows: Vec<[f32; N]>,
    radii: Vec<f32>,
}

/// The numbers of the records, the last of which is the radius.
fn records<const N: usize>(bytes: &[u8], columns: &str) -> Read<Records<N>> {
    let size = 4 * N;
    if !bytes.len().is_multiple_of(size) {
        return Err(ImportError::file(format!(
            "its {} bytes are not a whole number of records of {size} bytes ({columns} as little-endian f32)",
            bytes.len()
        )));
    }
    let mut rows: Vec<[f32; N]> = bytes
        .par_chunks_exact(size)
        .map(|record| std::array::from_fn(|i| f32::from_le_bytes(std::array::from_fn(|b| record[4 * i + b]))))
        .collect();
    if let Some(index) = rows.par_iter().position_first(|row| row[N - 1] <= 0.0 && row[N - 1].is_finite()) {
        let radius = rows[index][N - 1];
        return Err(ImportError::file(format!("record {index} (from 0): radius is {radius}; it must be more than 0")));
    }
    let kept: Vec<bool> = rows.par_iter().map(|row| row.iter().all(|v| v.is_finite())).collect();
    let said = ply::left_out(&kept, "records").into_iter().collect();
    ply::keep(&mut rows, &kept);
    let radii = rows.par_iter().map(|row| row[N - 1]).collect();
    Ok((Records { rows, radii }, said))
}

#[cfg(test)]
mod tests;
