//! Clouds of spheres and cylinders from tables: text, XYZ, PLY, NumPy and raw binary.
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
//! **PLY**: see [`super::ply`]. **NumPy** (`npy`, `npz`): see [`npy`] and [`npz`].
//!
//! Rows with a coordinate or a radius that is missing, infinite or NaN are left out and counted.

mod columns;
mod elements;
mod npy;
mod npz;
mod text;
mod xyz;

use super::colormap::ColumnColors;
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
use canaletto::texture::ColorSpace;
use canaletto_parallel::prelude::*;
use glam::Vec3;
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
    /// An array of NumPy, alone or in an archive.
    Numpy,
}

/// What a scene says of a table besides its file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CloudSettings {
    /// The radius for files without radii, and for all atoms of an XYZ file.
    pub radius: Option<f32>,
    /// Whether its colours are on the sRGB curve or linear. Without this, their type and their size tell.
    pub colors: Option<ColorSpace>,
    /// Colours by the numbers of a column, in place of the table's own.
    pub colormap: Option<ColumnColors>,
    /// The names of its columns, in lower case, in place of those in the file. None keep those.
    pub columns: Vec<String>,
    /// The name of the array in an archive of several.
    pub array: Option<String>,
}

/// A table that has a radius for rows without one.
impl From<Option<f32>> for CloudSettings {
    fn from(radius: Option<f32>) -> CloudSettings {
        CloudSettings { radius, ..CloudSettings::default() }
    }
}

impl CloudFormat {
    /// The extensions that [`CloudFormat::of_extension`] accepts.
    pub const EXTENSIONS: [&str; 8] = ["csv", "tsv", "xyz", "txt", "ply", "npy", "npz", "bin"];

    /// The format of a file name extension, in lower case.
    pub fn of_extension(extension: &str) -> Option<CloudFormat> {
        match extension {
            "csv" | "tsv" | "xyz" | "txt" => Some(CloudFormat::Text),
            "ply" => Some(CloudFormat::Ply),
            "bin" => Some(CloudFormat::Binary),
            "npy" | "npz" => Some(CloudFormat::Numpy),
            _ => None,
        }
    }

    /// The precision of coordinates in a file of this format.
    fn precision(self, bytes: &[u8]) -> Precision {
        match self {
            CloudFormat::Text | CloudFormat::Numpy => Precision::Double,
            CloudFormat::Ply => ply::precision(bytes.into()),
            CloudFormat::Binary => Precision::Single,
        }
    }
}

/// Rows that are left out because a coordinate or the radius isn't finite.
#[derive(Default)]
struct LeftOutRows {
    count: u64,
    /// The offset of the first such row in a text, or its number.
    first: Option<usize>,
    /// The number of rows that are kept.
    kept: u64,
    /// The numbers of the rows that are left out, from 0 on.
    lost: Vec<u32>,
}

impl LeftOutRows {
    fn note(&mut self, row: &Token<'_>) {
        self.note_at(row.start);
    }

    fn note_at(&mut self, first: usize) {
        self.lost.push((self.count + self.kept) as u32);
        self.count += 1;
        self.first.get_or_insert(first);
    }

    /// The numbers of the rows that are kept, from 1 on; none if these are all rows.
    fn rows(&self) -> Vec<u32> {
        if self.count == 0 {
            return Vec::new();
        }
        let mut lost = self.lost.iter().peekable();
        let all = (0..(self.count + self.kept) as u32).filter(|row| lost.next_if_eq(&row).is_none());
        all.map(|row| row + 1).collect()
    }

    /// Adds the rows of a later part.
    fn append(&mut self, later: LeftOutRows) {
        let before = (self.count + self.kept) as u32;
        self.lost.extend(later.lost.iter().map(|row| before + row));
        self.count += later.count;
        self.kept += later.kept;
        self.first = self.first.or(later.first);
    }

    /// The warning about these rows of a text.
    fn complaint(&self, bytes: &[u8]) -> Option<ImportError> {
        let before = &bytes[..self.first?];
        let ends = memchr::memchr_iter(b'\n', before).count();
        // Old files end lines by \r alone.
        let line = 1 + if ends > 0 { ends } else { memchr::memchr_iter(b'\r', before).count() };
        Some(self.counted(&format!("line {line}")))
    }

    /// The warning about these rows, of which the first stands here.
    fn counted(&self, first: &str) -> ImportError {
        ImportError::file(format!(
            "{} of {} rows are left out, as a coordinate or the radius isn't a finite number; the first is {first}",
            self.count,
            self.count + self.kept
        ))
    }
}

/// A cloud with its warnings, or an error.
type Read<T> = Result<(T, Vec<ImportError>), ImportError>;

/// Reads spheres; returns them with warnings about what was left out or assumed. A file without radii needs one in the
/// settings, except for atoms, whose elements have radii.
///
/// # Errors
/// The first mistake, with its row and column where the file has them.
pub fn read_spheres(
    asset: &Asset,
    format: CloudFormat,
    settings: impl Into<CloudSettings>,
) -> Result<(SphereCloud, Diagnostics), Diagnostics> {
    let (asset, settings) = (&*readable(asset, format), &settings.into());
    let (name, radius) = (asset.path.name(), settings.radius);
    let mut precision = format.precision(&asset.bytes);
    let cloud = match format {
        CloudFormat::Text => spheres_of_text(&asset.bytes, settings),
        CloudFormat::Ply => ply::read_spheres(name, asset.bytes.as_slice().into(), settings),
        CloudFormat::Numpy => numpy(&asset.bytes, &SPHERE_POINTS, settings, &mut precision).map(spheres_of_columns),
        CloudFormat::Binary => records::<4>(&asset.bytes, "x y z radius", settings).map(
            |(Records { rows, radii, colors, numbers }, said)| {
                let centers = rows.par_iter().map(|row| Vec3::from_slice(row)).collect();
                (SphereCloud { centers, radii, colors, rows: numbers, ..SphereCloud::default() }, said)
            },
        ),
    };
    let cloud = cloud.and_then(|(mut cloud, mut said)| {
        name.clone_into(&mut cloud.name);
        settle_radius(&mut cloud.radii, cloud.centers.len(), radius, &said)?;
        said.extend(precision_warning::cloud(&cloud.centers, 1, &cloud.radii, cloud.origin, precision));
        Ok((cloud, said))
    });
    finish(asset, format, cloud)
}

/// The file; a text is converted to UTF-8.
fn readable(asset: &Asset, format: CloudFormat) -> Cow<'_, Asset> {
    let text = match format {
        CloudFormat::Text => encoding::text(&asset.bytes),
        CloudFormat::Ply => encoding::utf8(&asset.bytes),
        CloudFormat::Binary | CloudFormat::Numpy => return Cow::Borrowed(asset),
    };
    if text.len() == asset.bytes.len() {
        return Cow::Borrowed(asset);
    }
    Cow::Owned(Asset { path: asset.path.clone(), bytes: text.into_owned() })
}

/// The names of the coordinates of spheres.
const SPHERE_POINTS: [&str; 3] = ["x", "y", "z"];
/// The names of the coordinates of cylinders.
const CYLINDER_POINTS: [&str; 6] = ["x1", "y1", "z1", "x2", "y2", "z2"];

fn spheres_of_text(bytes: &[u8], settings: &CloudSettings) -> Read<SphereCloud> {
    let table = match xyz::read(bytes).transpose()? {
        Some(xyz::Counted::Atoms(atoms)) => return spheres_of_atoms(bytes, *atoms, settings),
        Some(xyz::Counted::Rows(from)) => text::read_from(bytes, from, &SPHERE_POINTS, settings)?,
        None => text::read(bytes, &SPHERE_POINTS, settings)?,
    };
    let lost = table.lost.complaint(bytes);
    Ok(spheres_of_columns(columns_of(table, lost, Written::Real, settings)))
}

fn spheres_of_columns((columns, said): (Columns, Vec<ImportError>)) -> (SphereCloud, Vec<ImportError>) {
    let Columns { points, radii, colors, rows } = columns;
    let (origin, centers) = points.rebase();
    (SphereCloud { origin, centers, radii, colors, rows, ..SphereCloud::default() }, said)
}

/// The columns of an array; `points` has the names of the coordinates.
fn numpy(bytes: &[u8], points: &[&str], settings: &CloudSettings, precision: &mut Precision) -> Read<Columns> {
    let bytes = if bytes.starts_with(npz::MAGIC) {
        npz::array(bytes, settings.array.as_deref())?
    } else if settings.array.is_some() {
        return Err(ImportError::file("it holds one array without a name, and array names one"));
    } else {
        Cow::Borrowed(bytes)
    };
    let npy::NumpyTable { table, written, is_single } = npy::read(&bytes, points, settings)?;
    *precision = if is_single { Precision::Single } else { Precision::Double };
    let lost = table.lost.first.map(|first| table.lost.counted(&format!("row {}", first + 1)));
    Ok(columns_of(table, lost, written, settings))
}

fn spheres_of_atoms(bytes: &[u8], mut atoms: xyz::Atoms, settings: &CloudSettings) -> Read<SphereCloud> {
    if settings.colormap.is_some() || !settings.columns.is_empty() {
        return Err(ImportError::file("an XYZ file of atoms has no columns for colormap and columns")
            .help("a table with a first row such as x,y,z,charge has"));
    }
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
        said.extend(table_color::normalise(&mut atoms.colors, Written::Real, settings.colors, "atoms"));
    }
    let radii = match settings.radius {
        Some(radius) if !atoms.has_radii => vec![radius],
        _ => atoms.radii,
    };
    let rows = atoms.lost.rows();
    let (origin, centers) = atoms.centers.rebase();
    Ok((SphereCloud { origin, centers, radii, colors: atoms.colors, rows, ..SphereCloud::default() }, said))
}

/// The columns of a table, with linear colours.
struct Columns {
    points: Positions,
    radii: Vec<f32>,
    colors: Vec<Rgb>,
    /// The numbers of the rows, if some are left out.
    rows: Vec<u32>,
}

/// The columns of a table, with its warnings. `lost` is that about rows which are left out.
fn columns_of(
    table: text::Table,
    lost: Option<ImportError>,
    written: Written,
    settings: &CloudSettings,
) -> (Columns, Vec<ImportError>) {
    let text::Table { points, radii, mut colors, values, lost: left_out, commas, unknown } = table;
    let mut said: Vec<ImportError> = lost.into_iter().collect();
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
    match &settings.colormap {
        Some(map) => colors = map.colors(&values),
        None => said.extend(table_color::normalise(&mut colors, written, settings.colors, "rows")),
    }
    (Columns { points, radii, colors, rows: left_out.rows() }, said)
}

/// Reads cylinders, which have caps; see [`read_spheres`].
///
/// # Errors
/// The first mistake, with its row and column where the file has them.
pub fn read_cylinders(
    asset: &Asset,
    format: CloudFormat,
    settings: impl Into<CloudSettings>,
) -> Result<(CylinderCloud, Diagnostics), Diagnostics> {
    let (asset, settings) = (&*readable(asset, format), &settings.into());
    let radius = settings.radius;
    let mut precision = format.precision(&asset.bytes);
    let axis = |row: &[f32]| [Vec3::from_slice(row), Vec3::from_slice(&row[3..])];
    let cloud = match format {
        CloudFormat::Text => cylinders_of_text(&asset.bytes, settings),
        CloudFormat::Ply => ply::read_cylinders(asset.path.name(), asset.bytes.as_slice().into(), settings),
        CloudFormat::Numpy => numpy(&asset.bytes, &CYLINDER_POINTS, settings, &mut precision).map(cylinders_of_columns),
        CloudFormat::Binary => {
            let records = records::<7>(&asset.bytes, "x1 y1 z1 x2 y2 z2 radius", settings);
            records.map(|(Records { rows, radii, colors, numbers }, said)| {
                let axes = rows.par_iter().map(|row| axis(row)).collect();
                (CylinderCloud { axes, radii, colors, rows: numbers, ..CylinderCloud::default() }, said)
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
        said.extend(precision_warning::cloud(ends, 2, &cloud.radii, cloud.origin, precision));
        Ok((cloud, said))
    });
    finish(asset, format, cloud)
}

fn cylinders_of_text(bytes: &[u8], settings: &CloudSettings) -> Read<CylinderCloud> {
    let table = match xyz::read(bytes) {
        Some(Ok(xyz::Counted::Rows(from))) => text::read_from(bytes, from, &CYLINDER_POINTS, settings)?,
        Some(Ok(xyz::Counted::Atoms(_))) => {
            let help = "spheres read the atoms; bonds need a table of their ends, x1 y1 z1 x2 y2 z2";
            return Err(ImportError::file("an XYZ file holds atoms, no cylinders").help(help));
        }
        Some(Err(_)) | None => text::read(bytes, &CYLINDER_POINTS, settings)?,
    };
    let lost = table.lost.complaint(bytes);
    Ok(cylinders_of_columns(columns_of(table, lost, Written::Real, settings)))
}

fn cylinders_of_columns((columns, said): (Columns, Vec<ImportError>)) -> (CylinderCloud, Vec<ImportError>) {
    let Columns { points, radii, colors, rows } = columns;
    let (origin, ends) = points.rebase();
    let axes = ends.as_chunks().0.to_vec();
    (CylinderCloud { origin, axes, radii, colors, rows, ..CylinderCloud::default() }, said)
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
    colors: Vec<Rgb>,
    /// The numbers of the records, if some are left out.
    numbers: Vec<u32>,
}

/// The numbers of the records, the last of which is the radius.
fn records<const N: usize>(bytes: &[u8], columns: &str, settings: &CloudSettings) -> Read<Records<N>> {
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
    let names: Vec<String> = columns.split(' ').map(str::to_owned).collect();
    let points: Vec<&str> = names[..N - 1].iter().map(String::as_str).collect();
    let value = columns::Roles::by_name(&names, &points, settings, "the file")?.value;
    let colors = match (&settings.colormap, value) {
        (Some(map), Some((at, _))) => map.colors(&rows.iter().map(|row| f64::from(row[at])).collect::<Vec<f64>>()),
        _ => Vec::new(),
    };
    Ok((Records { rows, radii, colors, numbers: ply::row_numbers(&kept) }, said))
}

#[cfg(test)]
mod tests;
