//! Assets in a folder.

#[cfg(unix)]
use super::beneath::{Refusal, Root};
use super::{Asset, AssetError, AssetPath, Assets, OpenAsset, check_name, is_foreign_absolute, lexical, reason};
use crate::content::Content;
use crate::diagnostic::closest_word;
use crate::file_id::FileId;
#[cfg(unix)]
use rustix::io::Errno;
use std::borrow::Cow;
use std::fs::{self, File, Metadata, OpenOptions};
use std::io;
use std::path::{Path, PathBuf};

/// Assets in a folder and its subfolders.
#[derive(Clone, Debug)]
pub struct FolderAssets {
    root: PathBuf,
    #[cfg(unix)]
    beneath: Root,
    shown: String,
    /// The file that the user named, which may be a link to anywhere.
    granted: Option<PathBuf>,
    allow_outside: bool,
    limit: u64,
}

impl FolderAssets {
    /// The default size limit of a file, 4 GiB; see [`FolderAssets::with_limit`].
    pub const DEFAULT_LIMIT: u64 = 4 << 30;

    /// The files below `root`.
    ///
    /// # Errors
    /// The system's error if there is no such folder.
    pub fn new(root: impl AsRef<Path>) -> io::Result<FolderAssets> {
        let given = root.as_ref();
        let root = fs::canonicalize(if given.as_os_str().is_empty() { Path::new(".") } else { given })?;
        if !root.is_dir() {
            return Err(io::Error::new(io::ErrorKind::NotADirectory, "not a folder"));
        }
        let shown = if given == Path::new(".") { String::new() } else { given.to_string_lossy().into_owned() };
        Ok(FolderAssets {
            #[cfg(unix)]
            beneath: Root::open(&root, names(&root, given))?,
            root,
            shown,
            granted: None,
            allow_outside: false,
            limit: FolderAssets::DEFAULT_LIMIT,
        })
    }

    /// The files below the folder of `file`, and the name by which to read `file`. The file itself may be a symbolic
    /// link to anywhere, because the user names it.
    ///
    /// # Errors
    /// An error if there is no such folder, or if the file's name isn't Unicode.
    pub fn beside(file: impl AsRef<Path>) -> io::Result<(FolderAssets, String)> {
        let file = file.as_ref();
        let name = file
            .file_name()
            .and_then(|name| name.to_str())
            .ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, "the file's name must be Unicode"))?;
        let mut assets = FolderAssets::new(file.parent().unwrap_or(Path::new("")))?;
        assets.granted = Some(name.into());
        Ok((assets, name.to_owned()))
    }

    /// Sets whether files outside the folder may be read.
    pub fn allow_outside(mut self, allow: bool) -> FolderAssets {
        self.allow_outside = allow;
        self
    }

    /// Sets the size in bytes above which files are refused.
    pub fn with_limit(mut self, limit: u64) -> FolderAssets {
        self.limit = limit;
        self
    }

    /// The path of the folder, without links.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// The system path of `path` as named in `from`. The file may not exist, may be no file or may be outside; only
    /// opening it checks that.
    pub fn system_path(&self, path: &str, from: &AssetPath) -> PathBuf {
        self.root.join(place(path, from))
    }

    /// Whether a location may lie outside.
    fn is_free(&self, location: &Path) -> bool {
        self.allow_outside || self.granted.as_deref() == Some(location)
    }

    /// Opens a file and checks its location.
    #[cfg(unix)]
    fn find(&self, path: &str, location: &Path) -> Result<File, AssetError> {
        if self.is_free(location) {
            return self.find_anywhere(path, location);
        }
        let system = |error: &io::Error| match error.raw_os_error().map(Errno::from_raw_os_error) {
            Some(Errno::NOENT | Errno::NOTDIR) => {
                let names = self.beneath.names_beside(location);
                AssetError::Missing { path: path.into(), nearest: nearest_of(&names, path) }
            }
            // A socket can't be opened.
            Some(Errno::NXIO) => AssetError::NotAFile { path: path.into(), kind: "a socket" },
            _ => AssetError::Unreadable { path: path.into(), reason: reason(error) },
        };
        self.beneath.file(location).map_err(|refusal| match refusal {
            Refusal::Outside => AssetError::Outside { path: path.into() },
            Refusal::System(error) => system(&error),
        })
    }

    /// Opens a file and checks its location atomically.
    #[cfg(not(unix))]
    fn find(&self, path: &str, location: &Path) -> Result<File, AssetError> {
        let outside = || AssetError::Outside { path: path.into() };
        let full = self.root.join(location);
        if !self.is_free(location) {
            // The lexical check comes first, so that nothing is revealed about what exists outside.
            if !lexical(&full).is_some_and(|full| full.starts_with(&self.root)) {
                return Err(outside());
            }
            let inside = |real: &Path| real.starts_with(&self.root);
            let parent = full.parent().and_then(|parent| fs::canonicalize(parent).ok());
            match fs::canonicalize(&full) {
                Ok(real) if !inside(&real) => return Err(outside()),
                Err(_) if full.is_symlink() || parent.is_some_and(|parent| !inside(&parent)) => return Err(outside()),
                _ => {}
            }
        }
        self.find_anywhere(path, location)
    }

    /// Opens a file at any location.
    fn find_anywhere(&self, path: &str, location: &Path) -> Result<File, AssetError> {
        let full = self.root.join(location);
        let unreadable = |e: io::Error| match e.kind() {
            io::ErrorKind::NotFound | io::ErrorKind::NotADirectory => {
                AssetError::Missing { path: path.into(), nearest: nearest_of(&names_in(full.parent()), path) }
            }
            _ => AssetError::Unreadable { path: path.into(), reason: reason(&e) },
        };
        // The check precedes opening, because opening a device may have effects.
        let metadata = fs::metadata(&full).map_err(unreadable)?;
        if !metadata.is_file() {
            return Err(AssetError::NotAFile { path: path.into(), kind: kind_of(&metadata) });
        }
        let mut options = OpenOptions::new();
        #[cfg(unix)]
        {
            use std::os::unix::fs::OpenOptionsExt;
            // If it became a pipe meanwhile, opening must not wait for its writer.
            options.custom_flags(rustix::fs::OFlags::NONBLOCK.bits() as i32);
        }
        options.read(true).open(&full).map_err(unreadable)
    }
}

impl Assets for FolderAssets {
    fn read(&self, path: &str, from: &AssetPath) -> Result<Asset, AssetError> {
        let OpenAsset { path: found, content } = self.open(path, from)?;
        match content {
            Content::Memory(bytes) => Ok(bytes),
            Content::File(..) => content.view().whole().map(Cow::into_owned),
        }
        .map(|bytes| Asset { path: found, bytes })
        .map_err(|e| AssetError::Unreadable { path: path.into(), reason: reason(&e) })
    }

    fn open(&self, path: &str, from: &AssetPath) -> Result<OpenAsset, AssetError> {
        check_name(path)?;
        if !self.allow_outside && is_foreign_absolute(path) {
            return Err(AssetError::Outside { path: path.into() });
        }
        let location = place(path, from);
        let unreadable = |e: io::Error| AssetError::Unreadable { path: path.into(), reason: reason(&e) };
        let file = self.find(path, &location)?;
        let metadata = file.metadata().map_err(unreadable)?;
        if !metadata.is_file() {
            return Err(AssetError::NotAFile { path: path.into(), kind: kind_of(&metadata) });
        }
        let size = usize::try_from(metadata.len()).ok().filter(|_| metadata.len() <= self.limit);
        let Some(size) = size else {
            return Err(AssetError::TooLarge { path: path.into(), size: metadata.len(), limit: self.limit });
        };
        let identity = FileId::with(&self.root.join(&location), &metadata).map_err(unreadable)?;
        let shown = show(if from.shown.is_empty() { &self.shown } else { parent_of(&from.shown) }, path);
        let found = AssetPath { location, identity: identity.into_path(), shown };
        Ok(OpenAsset { path: found, content: Content::File(file, size) })
    }
}

/// The location of a path that `from` names, relative to the root or absolute.
fn place(path: &str, from: &AssetPath) -> PathBuf {
    from.location.parent().unwrap_or(Path::new("")).join(path)
}

/// The absolute paths of a folder: without links, and as given.
#[cfg(unix)]
fn names(root: &Path, given: &Path) -> Vec<PathBuf> {
    let given = std::path::absolute(given).ok().and_then(|given| lexical(&given));
    [Some(root.to_owned()), given].into_iter().flatten().collect()
}

fn parent_of(shown: &str) -> &str {
    shown.rfind('/').map_or("", |slash| &shown[..slash.max(1)])
}

/// The display name: the path after its folder, with `/` and lexically normalised.
fn show(folder: &str, path: &str) -> String {
    let joined = Path::new(folder).join(path);
    let name = lexical(&joined).unwrap_or(joined).to_string_lossy().into_owned();
    if cfg!(windows) { name.replace('\\', "/") } else { name }
}

/// Some of the names in a folder.
fn names_in(folder: Option<&Path>) -> Vec<String> {
    const MOST: usize = 1000;
    let Some(Ok(entries)) = folder.map(fs::read_dir) else { return Vec::new() };
    entries.take(MOST).filter_map(|entry| entry.ok()?.file_name().into_string().ok()).collect()
}

/// The path with the most similar of these names.
fn nearest_of(names: &[String], path: &str) -> Option<String> {
    let (prefix, name) = path.rfind('/').map_or(("", path), |slash| path.split_at(slash + 1));
    // A dangling link is listed, but is no suggestion.
    let others = names.iter().map(String::as_str).filter(|other| *other != name);
    closest_word(name, others).map(|name| format!("{prefix}{name}"))
}

fn kind_of(metadata: &Metadata) -> &'static str {
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt;
        let kind = metadata.file_type();
        if kind.is_fifo() {
            return "a pipe";
        } else if kind.is_socket() {
            return "a socket";
        } else if kind.is_char_device() || kind.is_block_device() {
            return "a device";
        }
    }
    if metadata.is_dir() { "a folder" } else { "something else" }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder() -> tempfile::TempDir {
        let dir = tempfile::tempdir().expect("a temporary folder");
        fs::create_dir_all(dir.path().join("root/sub")).unwrap();
        fs::write(dir.path().join("root/a.kdl"), "a").unwrap();
        fs::write(dir.path().join("root/sub/b.kdl"), "b").unwrap();
        fs::write(dir.path().join("secret"), "s").unwrap();
        dir
    }

    #[test]
    fn relative_paths_start_at_the_file_that_names_them() {
        let dir = folder();
        let assets = FolderAssets::new(dir.path().join("root")).unwrap();
        let b = assets.read("sub/b.kdl", &AssetPath::base()).unwrap();
        assert_eq!(b.bytes, b"b");
        let a = assets.read("../a.kdl", &b.path).unwrap();
        assert_eq!((a.bytes.as_slice(), a.path.name().ends_with("root/a.kdl")), (b"a".as_slice(), true));
        assert_eq!(a.path.identity(), assets.read("./a.kdl", &AssetPath::base()).unwrap().path.identity());
    }

    #[test]
    fn nothing_outside_is_read() {
        let dir = folder();
        let assets = FolderAssets::new(dir.path().join("root")).unwrap();
        let absolute = dir.path().join("secret").to_string_lossy().into_owned();
        for path in ["../secret", "../missing", "sub/../../secret", "C:\\secret", "\\\\host\\x", &absolute] {
            let error = assets.read(path, &AssetPath::base()).unwrap_err();
            assert!(matches!(error, AssetError::Outside { .. }), "{path}: {error}");
        }
        for path in ["%2e%2e/secret", "..%2fsecret", "..\\secret"] {
            let error = assets.read(path, &AssetPath::base()).unwrap_err();
            assert!(matches!(error, AssetError::Missing { .. }), "{path}: {error}");
        }
        assert!(assets.allow_outside(true).read("../secret", &AssetPath::base()).is_ok());
    }

    #[cfg(unix)]
    #[test]
    fn links_are_judged_by_where_they_lead() {
        let dir = folder();
        std::os::unix::fs::symlink("../secret", dir.path().join("root/link")).unwrap();
        std::os::unix::fs::symlink("..", dir.path().join("root/up")).unwrap();
        let assets = FolderAssets::new(dir.path().join("root")).unwrap();
        for path in ["link", "up/secret", "up/missing"] {
            let error = assets.read(path, &AssetPath::base()).unwrap_err();
            assert!(matches!(error, AssetError::Outside { .. }), "{path}: {error}");
        }
        let (assets, name) = FolderAssets::beside(dir.path().join("root/link")).unwrap();
        assert_eq!(assets.read(&name, &AssetPath::base()).unwrap().bytes, b"s");
    }

    #[cfg(unix)]
    #[test]
    fn only_regular_files_are_opened() {
        let dir = folder();
        let _socket = std::os::unix::net::UnixListener::bind(dir.path().join("root/socket")).unwrap();
        let assets = FolderAssets::new(dir.path().join("root")).unwrap().allow_outside(true);
        for (path, kind) in [("sub", "a folder"), ("socket", "a socket"), ("/dev/zero", "a device")] {
            let error = assets.read(path, &AssetPath::base()).unwrap_err();
            assert_eq!(error, AssetError::NotAFile { path: path.into(), kind });
        }
        assert!(matches!(assets.read("a\0", &AssetPath::base()), Err(AssetError::BadName { .. })));
        assert!(matches!(assets.read("", &AssetPath::base()), Err(AssetError::BadName { .. })));
    }

    #[test]
    fn large_and_missing_files_say_so() {
        let dir = folder();
        let assets = FolderAssets::new(dir.path().join("root")).unwrap().with_limit(0);
        let error = assets.read("a.kdl", &AssetPath::base()).unwrap_err();
        assert_eq!(error, AssetError::TooLarge { path: "a.kdl".into(), size: 1, limit: 0 });
        let error = assets.read("sub/bb.kdl", &AssetPath::base()).unwrap_err();
        assert_eq!(error.help().as_deref(), Some("did you mean \"sub/b.kdl\"?"));
    }
}
