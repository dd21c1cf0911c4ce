//! The one way to the files that a scene names: the [`Assets`] trait.
//!
//! A scene file may come from a stranger, so what it names must lie below the scene's own folder unless the user says
//! otherwise. Paths are taken literally (nothing is percent-decoded) and judged after symbolic links are resolved.

use crate::content::Content;
use std::borrow::Cow;
use std::collections::{HashMap, HashSet};
use std::fmt;
use std::fs::{self, File, Metadata};
use std::io;
use std::path::{Component, Path, PathBuf};

/// Gives out the bytes of files that scenes name.
pub trait Assets: Send + Sync {
    /// Reads the file that `from` calls `path`. A relative path starts at the folder of `from`;
    /// [`AssetPath::base`] stands for the user, whose relative paths start at the root.
    ///
    /// # Errors
    /// [`AssetError`] says why there are no bytes.
    fn read(&self, path: &str, from: &AssetPath) -> Result<Asset, AssetError>;

    /// Opens the file that [`Assets::read`] would read, for those who read it in pieces. Its bytes are in memory, unless an
    /// implementation knows better.
    ///
    /// # Errors
    /// As [`Assets::read`].
    fn open(&self, path: &str, from: &AssetPath) -> Result<OpenAsset, AssetError> {
        self.read(path, from).map(|Asset { path, bytes }| OpenAsset { path, content: Content::Memory(bytes) })
    }
}

/// A file that is open, and where it came from.
#[derive(Debug)]
pub struct OpenAsset {
    /// Where it came from; the `from` of paths that this file names.
    pub path: AssetPath,
    /// What it holds.
    pub content: Content,
}

/// A file's content and where it came from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Asset {
    /// Where it came from; the `from` of paths that this file names.
    pub path: AssetPath,
    /// Its content.
    pub bytes: Vec<u8>,
}

/// Where an asset came from. Two paths of one [`Assets`] with the same identity are the same file.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub struct AssetPath {
    location: PathBuf,
    identity: PathBuf,
    shown: String,
}

impl AssetPath {
    /// The place that no file names: relative paths from here start at the root.
    pub fn base() -> AssetPath {
        AssetPath::default()
    }

    /// A path for implementations of [`Assets`]: `location` is the file as reached (its folder is where relative paths
    /// start), `identity` the same for every way to reach it, `shown` the name for people.
    pub fn new(location: impl Into<PathBuf>, identity: impl Into<PathBuf>, shown: impl Into<String>) -> AssetPath {
        AssetPath { location: location.into(), identity: identity.into(), shown: shown.into() }
    }

    /// The name to show in messages.
    pub fn name(&self) -> &str {
        &self.shown
    }

    /// The file as reached, relative to the root or absolute.
    pub fn location(&self) -> &Path {
        &self.location
    }

    /// What is the same for every way to reach this file.
    pub fn identity(&self) -> &Path {
        &self.identity
    }

    /// The file's name extension in lower case, or nothing.
    pub fn extension(&self) -> String {
        self.location.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default()
    }
}

/// Why a file can't be had. `path` is the path as the scene wrote it.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum AssetError {
    /// There is no such file.
    #[error("there is no file \"{path}\"")]
    Missing {
        /// As written.
        path: String,
        /// The most similar name that exists beside it.
        nearest: Option<String>,
    },
    /// It lies outside the folder that the scene may read.
    #[error("\"{path}\" lies outside the scene's folder")]
    Outside {
        /// As written.
        path: String,
    },
    /// It is a folder, a device, a pipe or a socket.
    #[error("\"{path}\" is {kind}, not a file")]
    NotAFile {
        /// As written.
        path: String,
        /// What it is, with its article.
        kind: &'static str,
    },
    /// The system refuses to read it.
    #[error("\"{path}\" can't be read: {reason}")]
    Unreadable {
        /// As written.
        path: String,
        /// What the system says.
        reason: String,
    },
    /// It is larger than allowed.
    #[error("\"{path}\" is too large: {size} bytes, and the limit is {limit}")]
    TooLarge {
        /// As written.
        path: String,
        /// Its size in bytes, as far as known.
        size: u64,
        /// The largest size allowed.
        limit: u64,
    },
    /// No file can have this name.
    #[error("{path:?} can't be a file's name: {reason}")]
    BadName {
        /// As written.
        path: String,
        /// What is wrong with it.
        reason: &'static str,
    },
}

impl AssetError {
    /// What the reader could do about it.
    pub fn help(&self) -> Option<String> {
        match self {
            AssetError::Missing { nearest: Some(name), .. } => Some(format!("did you mean \"{name}\"?")),
            AssetError::Missing { path, .. } if path.contains('\\') => {
                Some("write / between folders, on every system".into())
            }
            AssetError::Missing { .. } => Some("relative paths start at the folder of the file that names them".into()),
            AssetError::Outside { .. } => Some("allow it with --allow-outside, if you trust the scene".into()),
            _ => None,
        }
    }
}

/// Files below a folder.
#[derive(Clone, Debug)]
pub struct FolderAssets {
    root: PathBuf,
    shown: String,
    granted: HashSet<PathBuf>,
    allow_outside: bool,
    limit: u64,
}

impl FolderAssets {
    /// The largest file that is read unless [`FolderAssets::with_limit`] says otherwise: 4 GiB.
    pub const DEFAULT_LIMIT: u64 = 4 << 30;

    /// The files below `root`.
    ///
    /// # Errors
    /// If there is no such folder.
    pub fn new(root: impl AsRef<Path>) -> io::Result<FolderAssets> {
        let given = root.as_ref();
        let root = fs::canonicalize(if given.as_os_str().is_empty() { Path::new(".") } else { given })?;
        if !root.is_dir() {
            return Err(io::Error::new(io::ErrorKind::NotADirectory, "not a folder"));
        }
        let shown = if given == Path::new(".") { String::new() } else { given.to_string_lossy().into_owned() };
        Ok(FolderAssets {
            root,
            shown,
            granted: HashSet::new(),
            allow_outside: false,
            limit: FolderAssets::DEFAULT_LIMIT,
        })
    }

    /// The files below the folder of `file`, and the name to read `file` by. The file itself may be a symbolic link
    /// to anywhere: it is the user who names it.
    ///
    /// # Errors
    /// If there is no such folder, or the file's name isn't Unicode.
    pub fn beside(file: impl AsRef<Path>) -> io::Result<(FolderAssets, String)> {
        let file = file.as_ref();
        let name = file
            .file_name()
            .and_then(|name| name.to_str())
            .ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, "the file's name must be Unicode"))?;
        let mut assets = FolderAssets::new(file.parent().unwrap_or(Path::new("")))?;
        if let Ok(target) = fs::canonicalize(file) {
            assets.granted.insert(target);
        }
        Ok((assets, name.to_owned()))
    }

    /// Whether files outside the folder may be read.
    pub fn allow_outside(mut self, allow: bool) -> FolderAssets {
        self.allow_outside = allow;
        self
    }

    /// The size in bytes above which files are refused.
    pub fn with_limit(mut self, limit: u64) -> FolderAssets {
        self.limit = limit;
        self
    }

    /// Finds the file and judges its place; nothing is opened.
    fn resolve(&self, path: &str, from: &AssetPath) -> Result<AssetPath, AssetError> {
        check_name(path)?;
        let outside = || AssetError::Outside { path: path.into() };
        if !self.allow_outside && is_foreign_absolute(path) {
            return Err(outside());
        }
        let folder = from.location.parent().unwrap_or(Path::new(""));
        let location = folder.join(path);
        let full = self.root.join(&location);
        // Judged by its letters first, so that nothing is learnt about what exists outside.
        if !self.allow_outside && !lexical(&full).is_some_and(|full| full.starts_with(&self.root)) {
            return Err(outside());
        }
        let inside = |real: &Path| self.allow_outside || real.starts_with(&self.root) || self.granted.contains(real);
        let real = match fs::canonicalize(&full) {
            Ok(real) => real,
            Err(error) => {
                let parent = full.parent().and_then(|parent| fs::canonicalize(parent).ok());
                return Err(match parent {
                    Some(parent) if !inside(&parent) => outside(),
                    Some(parent) if error.kind() == io::ErrorKind::NotFound => {
                        AssetError::Missing { path: path.into(), nearest: nearest_file(&parent, path) }
                    }
                    _ if matches!(error.kind(), io::ErrorKind::NotFound | io::ErrorKind::NotADirectory) => {
                        AssetError::Missing { path: path.into(), nearest: None }
                    }
                    _ => AssetError::Unreadable { path: path.into(), reason: reason(&error) },
                });
            }
        };
        if !inside(&real) {
            return Err(outside());
        }
        let shown = show(if from.shown.is_empty() { &self.shown } else { parent_of(&from.shown) }, path);
        Ok(AssetPath { location, identity: real, shown })
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
        let found = self.resolve(path, from)?;
        let unreadable = |e: io::Error| AssetError::Unreadable { path: path.into(), reason: reason(&e) };
        let check = |metadata: &Metadata| {
            if !metadata.is_file() {
                return Err(AssetError::NotAFile { path: path.into(), kind: kind_of(metadata) });
            }
            match usize::try_from(metadata.len()) {
                Ok(size) if metadata.len() <= self.limit => Ok(size),
                _ => Err(AssetError::TooLarge { path: path.into(), size: metadata.len(), limit: self.limit }),
            }
        };
        // Before opening, since opening a pipe waits for its writer; again after, in case it was swapped.
        check(&fs::metadata(&found.identity).map_err(unreadable)?)?;
        let file = File::open(&found.identity).map_err(unreadable)?;
        let size = check(&file.metadata().map_err(unreadable)?)?;
        Ok(OpenAsset { path: found, content: Content::File(file, size) })
    }
}

/// Files held in memory, for tests and for programs that make their scenes.
#[derive(Clone, Debug, Default)]
pub struct MemoryAssets {
    files: HashMap<String, Vec<u8>>,
}

impl MemoryAssets {
    /// No files at all.
    pub fn new() -> MemoryAssets {
        MemoryAssets::default()
    }

    /// The same files and one more; `path` has `/` between folders.
    pub fn with(mut self, path: &str, bytes: impl Into<Vec<u8>>) -> MemoryAssets {
        self.files.insert(path.to_owned(), bytes.into());
        self
    }
}

impl Assets for MemoryAssets {
    fn read(&self, path: &str, from: &AssetPath) -> Result<Asset, AssetError> {
        check_name(path)?;
        let outside = || AssetError::Outside { path: path.into() };
        if is_foreign_absolute(path) || path.starts_with('/') {
            return Err(outside());
        }
        let folder = from.location.parent().unwrap_or(Path::new(""));
        let location = lexical(&folder.join(path)).ok_or_else(outside)?;
        let name = location.components().map(|c| c.as_os_str().to_string_lossy()).collect::<Vec<_>>().join("/");
        let Some(bytes) = self.files.get(&name) else {
            let nearest = crate::text::nearest(path, self.files.keys().map(String::as_str)).map(str::to_owned);
            return Err(AssetError::Missing { path: path.into(), nearest });
        };
        let path = AssetPath { location: name.clone().into(), identity: name.clone().into(), shown: name };
        Ok(Asset { path, bytes: bytes.clone() })
    }
}

fn check_name(path: &str) -> Result<(), AssetError> {
    let reason = if path.is_empty() {
        "it is empty"
    } else if path.contains('\0') {
        "it holds a NUL character"
    } else if path.len() > 4096 {
        "it is longer than 4096 bytes"
    } else {
        return Ok(());
    };
    Err(AssetError::BadName { path: path.chars().take(80).collect(), reason })
}

/// Whether the path is absolute on some system, not only on this one: `C:\a`, `C:a`, `\\server\a`, `\a`.
fn is_foreign_absolute(path: &str) -> bool {
    let bytes = path.as_bytes();
    path.starts_with('\\') || (bytes.len() >= 2 && bytes[0].is_ascii_alphabetic() && bytes[1] == b':')
}

/// The path without `.` and `..`, by its letters alone; nothing if it climbs above its start.
fn lexical(path: &Path) -> Option<PathBuf> {
    let mut out = PathBuf::new();
    let mut depth = 0;
    for component in path.components() {
        match component {
            Component::CurDir => {}
            Component::ParentDir if depth == 0 => return None,
            Component::ParentDir => {
                out.pop();
                depth -= 1;
            }
            Component::Normal(_) => {
                out.push(component);
                depth += 1;
            }
            Component::Prefix(_) | Component::RootDir => out.push(component),
        }
    }
    Some(out)
}

fn parent_of(shown: &str) -> &str {
    shown.rfind('/').map_or("", |slash| &shown[..slash.max(1)])
}

/// The name for people: the path after its folder, with `/`, as short as its letters allow.
fn show(folder: &str, path: &str) -> String {
    let joined = Path::new(folder).join(path);
    let name = lexical(&joined).unwrap_or(joined).to_string_lossy().into_owned();
    if cfg!(windows) { name.replace('\\', "/") } else { name }
}

fn nearest_file(folder: &Path, path: &str) -> Option<String> {
    let (prefix, name) = path.rfind('/').map_or(("", path), |slash| path.split_at(slash + 1));
    let names: Vec<String> =
        fs::read_dir(folder).ok()?.take(1000).filter_map(|entry| entry.ok()?.file_name().into_string().ok()).collect();
    crate::text::nearest(name, names.iter().map(String::as_str)).map(|name| format!("{prefix}{name}"))
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

/// What the system says, without the number that Rust adds.
pub fn reason(error: &impl fmt::Display) -> String {
    let text = error.to_string();
    text.split(" (os error").next().unwrap_or_default().to_lowercase()
}

impl fmt::Display for AssetPath {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.shown)
    }
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

    #[test]
    fn memory_has_folders_too() {
        let assets = MemoryAssets::new().with("sub/b.kdl", "b").with("a.kdl", "a");
        let b = assets.read("sub/./b.kdl", &AssetPath::base()).unwrap();
        assert_eq!(assets.read("../a.kdl", &b.path).unwrap().path.name(), "a.kdl");
        assert!(matches!(assets.read("../../a.kdl", &b.path), Err(AssetError::Outside { .. })));
    }
}
