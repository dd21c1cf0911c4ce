//! Loading of a shared library by the system.

#![allow(unsafe_code)] // The system's loader.

use crate::OidnError;
use std::ffi::{CStr, CString, c_void};
use std::path::{Path, PathBuf};
use std::ptr::NonNull;

/// A loaded library, which is never unloaded.
pub(crate) struct Library {
    handle: NonNull<c_void>,
    file: PathBuf,
}

impl Library {
    /// Loads a library with all that it needs. Its names stay its own.
    #[cfg(unix)]
    pub(crate) fn open(file: &Path) -> Result<Library, OidnError> {
        use std::os::unix::ffi::OsStrExt;
        let failed = |reason: String| OidnError::Load { file: file.to_owned(), reason };
        let path = CString::new(file.as_os_str().as_bytes()).map_err(|e| failed(e.to_string()))?;
        // SAFETY: `path` ends in NUL. Loading runs the library's initialisers, which the user trusts by naming its
        // folder.
        let handle = unsafe { libc::dlopen(path.as_ptr(), libc::RTLD_NOW | libc::RTLD_LOCAL) };
        match NonNull::new(handle) {
            Some(handle) => Ok(Library { handle, file: file.to_owned() }),
            None => Err(failed(last_error())),
        }
    }

    #[cfg(not(unix))]
    pub(crate) fn open(file: &Path) -> Result<Library, OidnError> {
        let reason = "libraries are loaded on Unix systems only".to_owned();
        Err(OidnError::Load { file: file.to_owned(), reason })
    }

    /// The address of a function.
    pub(crate) fn function(&self, name: &'static CStr) -> Result<NonNull<c_void>, OidnError> {
        #[cfg(unix)]
        // SAFETY: the handle is of `dlopen` and never closed; `name` ends in NUL.
        let address = unsafe { libc::dlsym(self.handle.as_ptr(), name.as_ptr()) };
        #[cfg(not(unix))]
        let address = std::ptr::null_mut();
        let function = name.to_str().unwrap_or_default();
        NonNull::new(address).ok_or_else(|| OidnError::Function { file: self.file.clone(), function })
    }
}

/// The loader's message about its last failure.
#[cfg(unix)]
fn last_error() -> String {
    // SAFETY: `dlerror` returns null or a text that ends in NUL and stays until the next call in this thread.
    let message = unsafe { libc::dlerror() };
    if message.is_null() {
        return "the system gives no reason".to_owned();
    }
    // SAFETY: as above.
    unsafe { CStr::from_ptr(message) }.to_string_lossy().into_owned()
}
