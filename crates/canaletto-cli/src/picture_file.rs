//! Reading of picture files that users name.

use crate::exit::Exit;
use crate::failure::{Failure, reason};
use crate::format::bytes;
use canaletto_io::picture::{Decoded, PictureError, PictureFormat, decode};
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// The size limit for a picture file, in bytes. The largest picture needs less.
const MAX_FILE: u64 = 8 << 30;
/// The number of first bytes that identify a format.
const START: u64 = 16;

/// The format of a file, by its first bytes; `None` for a file that is no picture or can't be read.
pub(crate) fn picture_format(path: &Path) -> Option<PictureFormat> {
    let mut start = Vec::new();
    File::open(path).ok().filter(|_| path.is_file())?.take(START).read_to_end(&mut start).ok()?;
    PictureFormat::of_bytes(&start)
}

/// Reads a picture.
pub(crate) fn read_picture(path: &Path) -> Result<Decoded, Failure> {
    let failed = |why: String| {
        // Lack of memory isn't a mistake in a file.
        let exit = if why.contains("there is no memory for") { Exit::Failed } else { Exit::Scene };
        Failure::new(exit, format!("can't read {}: {why}", path.display()))
    };
    let mut file = File::open(path).map_err(|e| failed(reason(&e)))?;
    // The first bytes identify the format before memory is allocated for the rest. The file may be a pipe or an endless
    // device.
    let mut content = Vec::new();
    file.by_ref().take(START).read_to_end(&mut content).map_err(|e| failed(reason(&e)))?;
    if let Err(e @ PictureError::Unknown) = decode(&content) {
        return Err(failed(e.to_string()));
    }
    file.take(MAX_FILE).read_to_end(&mut content).map_err(|e| failed(reason(&e)))?;
    if content.len() as u64 > MAX_FILE {
        return Err(failed(format!("it is larger than {}", bytes(MAX_FILE))));
    }
    decode(&content).map_err(|e| failed(e.to_string()))
}
