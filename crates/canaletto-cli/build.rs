//! Computes a hash of the program's sources. Two builds of one version with different sources differ in it. Equal
//! sources give an equal hash on every machine.

use std::path::{Path, PathBuf};
use std::{env, fs, io};

fn main() -> io::Result<()> {
    let own = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").unwrap_or_default());
    let mut files = Vec::new();
    // The other crates lie beside this one. In a registry they don't; there the versions distinguish builds.
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
    // Sorting makes the order independent of the file system. File names are left out, since they may hold either kind
    // of slash.
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
