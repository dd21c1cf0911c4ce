//! Partial pictures and films, which an interrupted run leaves beside their files.

use canaletto_io::picture::SOFTWARE;
use std::fs::{self, File};
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// The key of the text in files that hold a partial picture.
pub(crate) const UNFINISHED: &str = "unfinished";

/// The path of the partial file: `name.partial.png` beside `name.png`. The latter may be an older, complete picture.
pub(crate) fn partial(file: &Path) -> PathBuf {
    numbered(file, 1)
}

/// The n-th path for the partial file, for cases where earlier ones are taken.
fn numbered(file: &Path, n: u32) -> PathBuf {
    let mut name = file.file_stem().unwrap_or_default().to_owned();
    name.push(".partial");
    if n > 1 {
        name.push(format!("-{n}"));
    }
    if let Some(extension) = file.extension() {
        name.push(".");
        name.push(extension);
    }
    file.with_file_name(name)
}

/// The first path that is free or holds the partial file of an earlier run.
pub(crate) fn free_partial_path(file: &Path) -> PathBuf {
    let is_free = |place: &PathBuf| place.symlink_metadata().is_err() || is_part(place);
    (1..).map(|n| numbered(file, n)).find(is_free).unwrap_or_else(|| partial(file))
}

/// The name under which a part keeps the samples of a picture whose own format can't.
pub(crate) fn with_samples(file: &Path) -> PathBuf {
    let mut name = file.as_os_str().to_owned();
    name.push(".exr");
    name.into()
}

/// Removes the partial files that an earlier run left beside a complete one.
pub(crate) fn remove_part(whole: &Path) {
    for part in [partial(whole), partial(&with_samples(whole))] {
        if is_part(&part) {
            let _ = fs::remove_file(part);
        }
    }
}

/// Whether a file is marked as partial. The mark is at its start, or, in films, at its end.
fn is_part(file: &Path) -> bool {
    if !file.symlink_metadata().is_ok_and(|file| file.is_file()) {
        return false;
    }
    let ends = || -> io::Result<Vec<u8>> {
        const MOST: u64 = 1 << 16;
        let (mut file, mut bytes) = (File::open(file)?, Vec::new());
        file.by_ref().take(MOST).read_to_end(&mut bytes)?;
        let size = file.metadata()?.len();
        file.seek(SeekFrom::Start(size.saturating_sub(MOST)))?;
        file.take(MOST).read_to_end(&mut bytes)?;
        Ok(bytes)
    };
    let has = |bytes: &[u8], text: &str| bytes.windows(text.len()).any(|part| part == text.as_bytes());
    ends().is_ok_and(|bytes| has(&bytes, UNFINISHED) && (bytes.starts_with(b"GIF8") || has(&bytes, NAME)))
}

/// The program's name without its version.
const NAME: &str = SOFTWARE.split_at(9).0;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_have_names_of_their_own() {
        assert_eq!(NAME, "Canaletto");
        assert_eq!(partial(Path::new("a/b.0001.png")), Path::new("a/b.0001.partial.png"));
        assert_eq!(partial(Path::new("b")), Path::new("b.partial"));
        let folder = tempfile::tempdir().unwrap();
        let whole = folder.path().join("a.png");
        fs::write(partial(&whole), "somebody's own").unwrap();
        assert_eq!(free_partial_path(&whole), folder.path().join("a.partial-2.png"));
        remove_part(&whole);
        fs::write(partial(&whole), format!("{SOFTWARE} {UNFINISHED}")).unwrap();
        assert_eq!(free_partial_path(&whole), partial(&whole));
        remove_part(&whole);
        assert!(!partial(&whole).exists());
    }
}
