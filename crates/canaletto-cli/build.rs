//! A hash of the program's sources, by which pictures of another build are told apart though its version is the same. It is
//! the same wherever the same sources are compiled.

use std::path::{Path, PathBuf};
use std::{env, fs, io};

fn main() -> io::Result<()> {
    let own = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").unwrap_or_default());
    let mut files = Vec::new();
    // The other crates lie beside this one; where they don't, as in a registry, versions tell builds apart.
    for folder in ["src", "../canaletto/src", "../canaletto-bvh/src", "../canaletto-io/src"] {
        let folder = own.join(folder);
        if folder.is_dir() {
            println!("cargo::rerun-if-changed={}", folder.display());
            collect(&folder, &mut files)?;
        }
    }
    let lock = own.join("../../Cargo.lock");
    if lock.is_file() {
        println!("cargo::rerun-if-changed={}", lock.display());
        files.push(lock);
    }
    // In an order that no file system decides; names aside, since they may hold either kind of slash.
    let mut texts = files.iter().map(fs::read).collect::<io::Result<Vec<_>>>()?;
    texts.sort();
    let mut hash = 0xcbf2_9ce4_8422_2325_u64; // FNV-1a
    // Some systems check out lines that end in CR LF.
    for byte in texts.iter().flatten().filter(|byte| **byte != b'\r') {
        hash = (hash ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3);
    }
    println!("cargo::rustc-env=CANALETTO_SOURCES={hash:016x}");
    Ok(())
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            collect(&path, files)?;
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            files.push(path);
        }
    }
    Ok(())
}
