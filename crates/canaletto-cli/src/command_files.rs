//! The files that a command reads and writes, as one table. No output may replace an input or another output.

use crate::exit::Exit;
use crate::failure::{Failure, reason};
use crate::inputs::FileKey;
use crate::source::Reader;
use clap::Args;
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

/// The flag about folders of outputs.
#[derive(Args, Clone, Copy, Debug, Default)]
pub(crate) struct FolderFlag {
    /// Makes the folders of the files that are written, where they aren't there
    #[arg(long, help_heading = "Output")]
    pub mkdir: bool,
}

impl FolderFlag {
    /// Makes the folders of all outputs, if the flag is given.
    ///
    /// # Errors
    /// A folder that can't be made.
    pub(crate) fn make_folders(self, files: &CommandFiles) -> Result<(), Failure> {
        for output in files.outputs.iter().filter(|_| self.mkdir) {
            let folder = folder_of(&output.path);
            std::fs::create_dir_all(folder).map_err(|e| {
                let message = format!("{}: can't make the folder {}: {}", output.flag, folder.display(), reason(&e));
                Failure::new(Exit::Failed, message)
            })?;
        }
        Ok(())
    }
}

/// A file with the flag or argument that names it.
#[derive(Clone, Debug)]
struct NamedFile {
    flag: &'static str,
    path: PathBuf,
}

/// The files of a command.
#[derive(Clone, Debug, Default)]
pub(crate) struct CommandFiles {
    inputs: Vec<NamedFile>,
    outputs: Vec<NamedFile>,
}

impl CommandFiles {
    /// Adds files that are read. `-` is no file.
    #[must_use]
    pub(crate) fn reads<'p>(mut self, flag: &'static str, files: impl IntoIterator<Item = &'p PathBuf>) -> Self {
        self.inputs.extend(named(flag, files.into_iter().cloned()));
        self
    }

    /// Adds files that are written. `-` is no file.
    #[must_use]
    pub(crate) fn writes(mut self, flag: &'static str, files: impl IntoIterator<Item = PathBuf>) -> Self {
        self.outputs.extend(named(flag, files));
        self
    }

    /// These files and others.
    #[must_use]
    pub(crate) fn and(mut self, other: CommandFiles) -> Self {
        self.inputs.extend(other.inputs);
        self.outputs.extend(other.outputs);
        self
    }

    /// The files that are read, each with the flag or argument that names it.
    pub(crate) fn inputs(&self) -> impl Iterator<Item = (&'static str, &Path)> {
        self.inputs.iter().map(|input| (input.flag, input.path.as_path()))
    }

    /// Whether an output exists already, so that it may be an input.
    pub(crate) fn exist(&self) -> bool {
        self.outputs.iter().any(|output| output.path.exists())
    }

    /// A file that would be written twice.
    pub(crate) fn written_twice(&self) -> Option<&Path> {
        let mut known = HashSet::new();
        let again = self.outputs.iter().find(|output| !known.insert(FileKey::of(&output.path)));
        again.map(|output| output.path.as_path())
    }

    /// Checks before any work that no output is an input or another output, under whatever names.
    ///
    /// # Errors
    /// A failure that names the flag and the file.
    pub(crate) fn check(&self) -> Result<(), Failure> {
        let mut known: HashMap<FileKey, (&NamedFile, bool)> = HashMap::new();
        for input in &self.inputs {
            known.insert(FileKey::of(&input.path), (input, true));
        }
        for output in &self.outputs {
            match known.insert(FileKey::of(&output.path), (output, false)) {
                Some((_, true)) => return Err(replaced(output.flag, &output.path)),
                Some((other, false)) => return Err(both(other, output)),
                None => {}
            }
        }
        Ok(())
    }

    /// As [`CommandFiles::check`], for the files that a scene names at any frame.
    ///
    /// # Errors
    /// As [`CommandFiles::check`].
    pub(crate) fn check_scene(&self, reader: &Reader) -> Result<(), Failure> {
        let Some(file) = reader.replaced_by(self.outputs.iter().map(|output| output.path.clone())) else {
            return Ok(());
        };
        let flag = self.outputs.iter().find(|output| output.path == file).map_or("--output", |output| output.flag);
        Err(replaced(flag, &file))
    }
}

fn named(flag: &'static str, files: impl IntoIterator<Item = PathBuf>) -> impl Iterator<Item = NamedFile> {
    let files = files.into_iter().filter(|path| path != Path::new("-"));
    files.map(move |path| NamedFile { flag, path })
}

/// The folder of a file.
pub(crate) fn folder_of(file: &Path) -> &Path {
    match file.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    }
}

/// The error that an output would replace one of its inputs.
fn replaced(flag: &str, file: &Path) -> Failure {
    let file = file.display();
    Failure::usage(format!("{flag} {file} would replace a file that is read for it")).help("choose another name")
}

/// The failure of two outputs of one name.
fn both(a: &NamedFile, b: &NamedFile) -> Failure {
    let file = b.path.display();
    let message = match a.flag == b.flag {
        true => format!("two files of {} would be {file}", a.flag),
        false => format!("{} and {} are both {file}", a.flag, b.flag),
    };
    Failure::usage(message).help("choose another name for one of them")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every pair of an input and an output, and of two outputs, by names that differ.
    #[test]
    fn pairs_are_refused_under_any_name() {
        let folder = tempfile::tempdir().unwrap();
        let place = |name: &str| folder.path().join(name);
        std::fs::write(place("old"), "x").unwrap();
        std::fs::create_dir(place("sub")).unwrap();
        std::fs::hard_link(place("old"), place("linked")).unwrap();
        let pairs = [("old", "old"), ("old", "./old"), ("old", "sub/../old"), ("old", "linked"), ("new", "sub/../new")];
        for (a, b) in pairs {
            let table = CommandFiles::default().writes("--b", [place(b)]);
            let told = |table: CommandFiles| match table.check() {
                Err(Failure::Message { message, .. }) => message,
                other => panic!("{a} {b}: {other:?}"),
            };
            assert!(told(table.clone().reads("--a", &[place(a)])).starts_with("--b "), "{a} {b}");
            assert!(told(table.clone().writes("--a", [place(a)])).starts_with("--b and --a are both "));
            assert!(told(table.writes("--b", [place(a)])).starts_with("two files of --b would be "));
        }
        let apart = CommandFiles::default().reads("--a", &[place("old"), place("old")]);
        apart.writes("--b", [place("new"), place("sub/old"), "-".into()]).writes("--c", ["-".into()]).check().unwrap();
    }
}
