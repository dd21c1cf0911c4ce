//! Intel's Open Image Denoise (OIDN), loaded at run time from a folder that the user names.
//!
//! Nothing of the library is needed to build this crate, and no other folder is searched. The functions and their types
//! are those of the C API of version 2, `OpenImageDenoise/oidn.h`. Files that load other code run as that code: name
//! only folders that you trust.
#![deny(unsafe_op_in_unsafe_fn)]

mod functions;
mod library;

use functions::Functions;
use library::Library;
use std::path::{Path, PathBuf};

/// A picture for the denoiser. All layers have width × height values, the top row first.
#[derive(Clone, Copy, Debug)]
pub struct OidnPicture<'a> {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// The colours in linear light, without an upper limit.
    pub color: &'a [[f32; 3]],
    /// The albedos, 0 to 1.
    pub albedo: Option<&'a [[f32; 3]]>,
    /// The normals; components from −1 to 1. The library takes them only together with albedos.
    pub normal: Option<&'a [[f32; 3]]>,
}

/// The reasons why the library can't be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum OidnError {
    /// No file of the library lies in the folder.
    #[error("{} has no {name}, nor has its folder lib or oidn/lib", folder.display())]
    NotFound {
        /// The folder.
        folder: PathBuf,
        /// The library's file.
        name: &'static str,
    },
    /// The system can't load the file.
    #[error("can't load {}: {reason}", file.display())]
    Load {
        /// The file.
        file: PathBuf,
        /// The system's message.
        reason: String,
    },
    /// The file lacks a function of version 2.
    #[error("{} has no function {function}; Open Image Denoise 2 is needed", file.display())]
    Function {
        /// The file.
        file: PathBuf,
        /// The function's name.
        function: &'static str,
    },
    /// A layer has another number of values than the picture has pixels, or the picture has none.
    #[error("the layer \"{layer}\" has {values} values for {width} x {height} pixels")]
    Size {
        /// The layer's name.
        layer: &'static str,
        /// The number of values.
        values: usize,
        /// Width in pixels.
        width: usize,
        /// Height in pixels.
        height: usize,
    },
    /// The library reports an error.
    #[error("Open Image Denoise: {0}")]
    Library(String),
}

/// The loaded library. It stays loaded until the program ends, since its threads may outlive any use of it.
#[derive(Debug)]
pub struct Oidn {
    functions: Functions,
    file: PathBuf,
}

impl Oidn {
    /// Loads the library from a folder: from itself, from `lib` in it, or from `oidn/lib`, as in the Python package
    /// `pyoidn`.
    ///
    /// # Errors
    /// [`OidnError`] if the folder has no library, or if it can't be loaded.
    pub fn load(folder: &Path) -> Result<Oidn, OidnError> {
        let file = find(folder)?;
        let library = Library::open(&file)?;
        let functions = Functions::of(&library)?;
        Ok(Oidn { functions, file })
    }

    /// The loaded file.
    pub fn file(&self) -> &Path {
        &self.file
    }

    /// Denoises a picture on this many threads; 0 is one for each processor.
    ///
    /// # Errors
    /// [`OidnError::Size`] if layers don't fit, [`OidnError::Library`] with the library's own message.
    pub fn denoise(&self, picture: &OidnPicture<'_>, threads: u32) -> Result<Vec<[f32; 3]>, OidnError> {
        let OidnPicture { width, height, color, albedo, normal } = *picture;
        let layers = [("color", Some(color)), ("albedo", albedo), ("normal", normal)];
        let pixels = width.checked_mul(height).filter(|pixels| *pixels > 0);
        for (layer, values) in layers.iter().filter_map(|(layer, values)| Some((*layer, (*values)?))) {
            if Some(values.len()) != pixels {
                return Err(OidnError::Size { layer, values: values.len(), width, height });
            }
        }
        let mut output = vec![[0.0; 3]; color.len()];
        self.functions.filter(
            [width, height],
            [color, albedo.unwrap_or(&[]), normal.unwrap_or(&[])],
            &mut output,
            threads,
        )?;
        Ok(output)
    }
}

/// The names of the library's file, the one of version 2 first.
#[cfg(target_os = "macos")]
const NAMES: [&str; 2] = ["libOpenImageDenoise.2.dylib", "libOpenImageDenoise.dylib"];
#[cfg(not(target_os = "macos"))]
const NAMES: [&str; 2] = ["libOpenImageDenoise.so.2", "libOpenImageDenoise.so"];

/// The library's file in a folder.
fn find(folder: &Path) -> Result<PathBuf, OidnError> {
    let folders = [folder.to_owned(), folder.join("lib"), folder.join("oidn/lib")];
    let mut files = folders.iter().flat_map(|folder| NAMES.map(|name| folder.join(name)));
    // The loader searches other folders for a path without a slash; an absolute path has one.
    let found = files.find(|file| file.is_file()).and_then(|file| file.canonicalize().ok());
    found.ok_or_else(|| OidnError::NotFound { folder: folder.to_owned(), name: NAMES[0] })
}
