//! Opening files beneath a folder by handles, so that the file that is checked is the file that is opened. Names and
//! links that change meanwhile can't lead elsewhere.
//!
//! Linux does it in one call (`openat2` with `RESOLVE_BENEATH`). On other systems, paths are walked component by
//! component, and the system follows no link. The walk also handles links that `openat2` refuses although they lead
//! back into the folder. Outside the folder a path is resolved lexically: the walk never tests whether anything exists
//! there.

use rustix::fs::{CWD, Dir, Mode, OFlags, openat, readlinkat};
use rustix::io::Errno;
use std::ffi::OsString;
use std::fs::File;
use std::io;
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::ffi::OsStringExt;
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

/// A folder beneath which files are opened.
#[derive(Clone, Debug)]
pub(super) struct Root {
    handle: Arc<OwnedFd>,
    /// The absolute paths of the folder.
    names: Vec<PathBuf>,
}

/// The reasons why a file isn't opened.
#[derive(Debug)]
pub(super) enum Refusal {
    /// The path ends outside the folder.
    Outside,
    /// The system's error for a path inside the folder.
    System(io::Error),
}

impl From<Errno> for Refusal {
    fn from(error: Errno) -> Refusal {
        Refusal::System(error.into())
    }
}

/// The largest number of links in a path, as in the Linux kernel.
const MAX_LINKS: usize = 40;

/// The flags of a folder that is only passed through.
#[cfg(any(target_os = "linux", target_os = "android"))]
const FOLDER: OFlags = OFlags::PATH.union(OFlags::DIRECTORY).union(OFlags::CLOEXEC);
#[cfg(not(any(target_os = "linux", target_os = "android")))]
const FOLDER: OFlags = OFlags::RDONLY.union(OFlags::DIRECTORY).union(OFlags::CLOEXEC);

/// The flags of a file to read. Opening a pipe doesn't wait for its writer.
const FILE: OFlags = OFlags::RDONLY.union(OFlags::NONBLOCK).union(OFlags::NOCTTY).union(OFlags::CLOEXEC);

impl Root {
    /// Opens `folder`, which may be reached through links; `names` are its absolute paths.
    pub(super) fn open(folder: &Path, names: Vec<PathBuf>) -> io::Result<Root> {
        Ok(Root { handle: Arc::new(openat(CWD, folder, FOLDER, Mode::empty())?), names })
    }

    /// Opens a file by a path that is absolute or relative to the folder.
    pub(super) fn file(&self, path: &Path) -> Result<File, Refusal> {
        #[cfg(any(target_os = "linux", target_os = "android"))]
        {
            use rustix::fs::{ResolveFlags, openat2};
            let beneath = ResolveFlags::BENEATH | ResolveFlags::NO_MAGICLINKS;
            // On any error the walk determines the reason.
            if let Ok(file) = openat2(&*self.handle, path, FILE, Mode::empty(), beneath) {
                return Ok(file.into());
            }
        }
        self.walk(path, FILE).map(File::from)
    }

    /// Some of the names in the folder of a path, if it is inside.
    pub(super) fn names_beside(&self, path: &Path) -> Vec<String> {
        const MOST: usize = 1000;
        let folder = path.parent().unwrap_or(Path::new(""));
        let Ok(folder) = self.walk(folder, OFlags::RDONLY | OFlags::DIRECTORY | OFlags::CLOEXEC) else {
            return Vec::new();
        };
        let Ok(entries) = Dir::new(folder) else { return Vec::new() };
        entries.take(MOST).filter_map(|entry| entry.ok()?.file_name().to_str().ok().map(str::to_owned)).collect()
    }

    fn walk(&self, path: &Path, flags: OFlags) -> Result<OwnedFd, Refusal> {
        let mut way = components(path);
        // The folders from the root's child on; or, outside the folder, the lexical path.
        let mut inside: Vec<OwnedFd> = Vec::new();
        let mut outside: Option<PathBuf> = None;
        let mut links = 0;
        while let Some(step) = way.pop() {
            if let Some(at) = &mut outside {
                match step {
                    Step::Root => *at = PathBuf::from("/"),
                    Step::Up => _ = at.pop(),
                    Step::Into(name) => at.push(name),
                }
                if self.names.contains(at) {
                    outside = None;
                }
                continue;
            }
            let name = match step {
                Step::Root => {
                    inside.clear();
                    outside = Some(PathBuf::from("/")).filter(|at| !self.names.contains(at));
                    continue;
                }
                Step::Up => {
                    if inside.pop().is_none() {
                        outside =
                            Some(self.names.first().and_then(|name| name.parent()).unwrap_or(Path::new("/")).into());
                    }
                    continue;
                }
                Step::Into(name) => name,
            };
            let folder = inside.last().map_or(self.handle.as_fd(), |folder| folder.as_fd());
            match readlinkat(folder, &name, Vec::new()) {
                Ok(target) => {
                    links += 1;
                    if links > MAX_LINKS {
                        return Err(Errno::LOOP.into());
                    }
                    way.extend(components(Path::new(&OsString::from_vec(target.into_bytes()))));
                    continue;
                }
                Err(Errno::INVAL) => {} // Not a link.
                Err(error) => return Err(error.into()),
            }
            // A component that became a link meanwhile is refused.
            if way.is_empty() {
                return Ok(openat(folder, &name, flags | OFlags::NOFOLLOW, Mode::empty())?);
            }
            inside.push(openat(folder, &name, FOLDER | OFlags::NOFOLLOW, Mode::empty())?);
        }
        if outside.is_some() {
            return Err(Refusal::Outside);
        }
        let folder = inside.last().map_or(self.handle.as_fd(), |folder| folder.as_fd());
        Ok(openat(folder, ".", flags, Mode::empty())?)
    }
}

/// A component of a path.
enum Step {
    Root,
    Up,
    Into(OsString),
}

/// The components of a path in reverse order.
fn components(path: &Path) -> Vec<Step> {
    let step = |component| match component {
        Component::Prefix(_) | Component::RootDir => Some(Step::Root),
        Component::CurDir => None,
        Component::ParentDir => Some(Step::Up),
        Component::Normal(name) => Some(Step::Into(name.to_owned())),
    };
    path.components().rev().filter_map(step).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use std::io::Read;
    use std::os::unix::fs::symlink;

    /// The text of a file, opened by the walk and by the system call, where there is one.
    fn read(root: &Root, path: &str) -> Result<String, &'static str> {
        let text = |file: OwnedFd| {
            let mut text = String::new();
            File::from(file).read_to_string(&mut text).map(|_| text).map_err(|_| "unreadable")
        };
        let kind = |refusal| match refusal {
            Refusal::Outside => "outside",
            Refusal::System(e) if e.kind() == io::ErrorKind::NotFound => "missing",
            Refusal::System(_) => "refused",
        };
        let walked = root.walk(Path::new(path), FILE).map_err(kind).and_then(text);
        let called = root.file(Path::new(path)).map_err(kind).and_then(|file| text(file.into()));
        assert_eq!(walked, called, "{path}");
        walked
    }

    #[test]
    fn a_way_counts_by_where_it_ends() {
        let folder = tempfile::tempdir().unwrap();
        let base = folder.path().canonicalize().unwrap();
        let root = base.join("root");
        fs::create_dir_all(root.join("sub/deep")).unwrap();
        fs::write(root.join("a"), "a").unwrap();
        fs::write(root.join("sub/b"), "b").unwrap();
        fs::write(base.join("secret"), "s").unwrap();
        let links = [
            ("in", "sub"),
            ("deep", "sub/deep"),
            ("absolute", root.join("sub").to_str().unwrap()),
            ("round", "../root/sub"),
            ("out", "../secret"),
            ("up", ".."),
            ("nowhere", "/no/such/thing"),
            ("gone", "../gone"),
            ("broken", "sub/none"),
            ("circle", "circle"),
        ]
        .map(|(link, target): (&str, &str)| symlink(target, root.join(link)));
        assert!(links.iter().all(Result::is_ok));
        let opened = Root::open(&root, vec![root.clone()]).unwrap();
        let absolute = root.join("sub/b").to_str().unwrap().to_owned();
        for path in ["sub/b", "in/b", "deep/../b", "absolute/b", "round/b", "sub/../in/b", "../root/sub/b", &absolute] {
            assert_eq!(read(&opened, path), Ok("b".into()), "{path}");
        }
        let secret = base.join("secret").to_str().unwrap().to_owned();
        for path in ["out", "up/secret", "up/none", "nowhere", "gone", "../secret", "../none", &secret, "up", "/"] {
            assert_eq!(read(&opened, path), Err("outside"), "{path}");
        }
        for (path, expected) in [("none", "missing"), ("broken", "missing"), ("a/b", "refused"), ("circle", "refused")]
        {
            assert_eq!(read(&opened, path), Err(expected), "{path}");
        }
        assert_eq!(opened.names_beside(Path::new("up/none")), Vec::<String>::new());
        assert!(opened.names_beside(Path::new("in/none")).contains(&"b".to_owned()));
    }

    /// A link that alternates between inside and outside while it is opened never yields the file outside.
    #[test]
    fn no_race_leads_outside() {
        use std::sync::atomic::{AtomicBool, Ordering};
        let folder = tempfile::tempdir().unwrap();
        let base = folder.path().canonicalize().unwrap();
        let root = base.join("root");
        fs::create_dir_all(root.join("sub")).unwrap();
        fs::write(root.join("sub/f"), "inside").unwrap();
        fs::write(base.join("f"), "secret").unwrap();
        for (link, target) in [("in", "sub"), ("out", "..")] {
            symlink(target, root.join(link)).unwrap();
        }
        let opened = Root::open(&root, vec![root.clone()]).unwrap();
        let done = AtomicBool::new(false);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                for turn in 0.. {
                    if done.load(Ordering::Relaxed) {
                        break;
                    }
                    let _ = fs::remove_file(root.join("new"));
                    symlink(if turn % 2 == 0 { "sub" } else { ".." }, root.join("new")).unwrap();
                    fs::rename(root.join("new"), root.join("way")).unwrap();
                }
            });
            for _ in 0..2000 {
                for file in [opened.walk(Path::new("way/f"), FILE).map(File::from), opened.file(Path::new("way/f"))] {
                    let mut text = String::new();
                    if let Ok(mut file) = file {
                        file.read_to_string(&mut text).unwrap();
                    }
                    assert_ne!(text, "secret");
                }
            }
            done.store(true, Ordering::Relaxed);
        });
    }
}
