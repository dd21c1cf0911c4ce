//! The input files of a scene at any frame, which no output may replace.

use canaletto_io::file_id::FileId;
use canaletto_io::movie::MovieFormat;
use canaletto_io::picture::PictureFormat;
use std::collections::HashMap;
use std::ffi::OsString;
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

/// Finds outputs that are inputs, by file identity instead of by name.
pub(crate) struct InputGuard {
    outputs: HashMap<FileId, PathBuf>,
    /// Whether an output may be a material library, since it is no picture.
    has_text: bool,
}

impl InputGuard {
    /// A guard for outputs. Most of them need not exist yet.
    pub(crate) fn new(outputs: impl IntoIterator<Item = PathBuf>) -> InputGuard {
        let existing = outputs.into_iter().filter_map(|output| Some((FileId::of(&output).ok()?, output)));
        let outputs: HashMap<FileId, PathBuf> = existing.filter(|(_, output)| output.is_file()).collect();
        let has_text = outputs.values().any(|output| !is_picture(output));
        InputGuard { outputs, has_text }
    }

    /// Whether no output can replace a file.
    pub(crate) fn is_idle(&self) -> bool {
        self.outputs.is_empty()
    }

    /// The output that is this file.
    pub(crate) fn find(&self, input: &Path) -> Option<&Path> {
        self.outputs.get(&FileId::of(input).ok()?).map(PathBuf::as_path)
    }

    /// The output that a text of a scene may name. The text names a file, a file of a row whose number is `#`, or a
    /// model with its libraries.
    pub(crate) fn find_named(&self, named: &Path) -> Option<&Path> {
        let row = || self.outputs.values().find(|output| is_of_row(output, named)).map(PathBuf::as_path);
        let is_model = named.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("obj"));
        let libraries = if self.has_text && is_model { libraries(named) } else { Vec::new() };
        self.find(named).or_else(row).or_else(|| libraries.iter().find_map(|library| self.find(library)))
    }
}

/// A key that is equal for all names of a file, whether it exists or will be written.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) enum FileKey {
    Existing(FileId),
    /// Its folder and its name.
    New(FileId, OsString),
    /// A file in a folder that doesn't exist.
    Nowhere(PathBuf),
}

impl FileKey {
    pub(crate) fn of(path: &Path) -> FileKey {
        if let Ok(file) = FileId::of(path) {
            return FileKey::Existing(file);
        }
        let folder = path.parent().filter(|folder| *folder != Path::new("")).unwrap_or(Path::new("."));
        match (FileId::of(folder), path.file_name()) {
            // These systems take names as equal that differ in upper and lower case only.
            (Ok(folder), Some(name)) if cfg!(any(windows, target_os = "macos")) => {
                FileKey::New(folder, name.to_string_lossy().to_lowercase().into())
            }
            (Ok(folder), Some(name)) => FileKey::New(folder, name.to_owned()),
            _ => FileKey::Nowhere(path.to_owned()),
        }
    }
}

/// Whether the first bytes are those of a picture or film.
fn is_picture(file: &Path) -> bool {
    let mut start = [0; 12];
    let read = File::open(file).and_then(|mut file| file.read_exact(&mut start));
    let is_written = |format: PictureFormat| format.capabilities().is_some();
    read.is_ok() && (PictureFormat::of_bytes(&start).is_some_and(is_written) || MovieFormat::is_film(&start))
}

/// Whether a file lies in the row's folder and has the row's name with a number for `#`.
fn is_of_row(file: &Path, row: &Path) -> bool {
    let (Some(name), Some(pattern)) =
        (file.file_name().and_then(|n| n.to_str()), row.file_name().and_then(|n| n.to_str()))
    else {
        return false;
    };
    let Some((before, after)) = pattern.split_once('#') else { return false };
    let after = after.trim_start_matches('#');
    let number = name.strip_prefix(before).and_then(|rest| rest.strip_suffix(after));
    let folder =
        |path: &Path| path.parent().and_then(|p| FileId::of(if p == Path::new("") { Path::new(".") } else { p }).ok());
    number.is_some_and(|n| n.bytes().all(|b| b.is_ascii_digit())) && folder(file) == folder(row)
}

/// The material libraries that an OBJ may name: one name with spaces, or several names.
fn libraries(model: &Path) -> Vec<PathBuf> {
    let folder = model.parent().unwrap_or(Path::new(""));
    let Some(file) = File::open(model).ok().filter(|_| model.is_file()) else { return Vec::new() };
    let lines = BufReader::with_capacity(1 << 20, file).split(b'\n').map_while(Result::ok);
    let names = lines.filter_map(|line| {
        let names = line.trim_ascii().strip_prefix(b"mtllib")?;
        Some(String::from_utf8_lossy(names).trim().replace('\\', "/"))
    });
    let places = names.flat_map(|names| {
        let mut all: Vec<PathBuf> = names.split_whitespace().map(|name| folder.join(name.trim_matches('"'))).collect();
        all.push(folder.join(names.trim_matches('"')));
        all
    });
    places.collect()
}
