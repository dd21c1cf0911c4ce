//! Models: glTF, OBJ files and their MTL files.

use crate::mutate::{Outcome, Random, bounded, run};
use canaletto_io::assets::MemoryAssets;
use canaletto_io::import::{Staging, load};
use std::fs;
use std::path::{Path, PathBuf};

/// The files with this extension in the seed folders.
fn seeds(extension: &str) -> Vec<Vec<u8>> {
    let repository = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut paths: Vec<PathBuf> = ["scenes/models", "tests/cases/models"]
        .iter()
        .flat_map(|folder| fs::read_dir(repository.join(folder)).expect("the repository's files"))
        .map(|entry| entry.expect("an entry").path())
        .filter(|path| path.extension().is_some_and(|e| e == extension))
        .collect();
    paths.sort();
    let read = |path: &PathBuf| fs::read(path).expect("a file");
    // Damage to a long file rarely hits its rare features.
    paths
        .iter()
        .map(read)
        .map(|mut bytes| {
            bytes.truncate(20_000);
            bytes
        })
        .collect()
}

const OBJ: &[u8] = b"mtllib a.mtl \"b c.mtl\"\no box\ng side\nv 0 0 0 1 0 0\nv 1 0 0 0 255 0\nv 1 1 0\nv 0 1 \\\n 0\nvt 0 0\nvt 1 0.5\n\
    vn 0 0 1\nvn nan 0 1\ns 1\nusemtl m\nf 1/1/1 2/2/2 3//1 4\ns off\nf -1 -2 -3\nf 1 2 2 3 4 4\nf 1 2 3 1 2 3 1 2 3\nl 1 2\np 1\n";
const MTL: &[u8] =
    b"newmtl m\nKd 0.5 0.5 0.5\nKs 128 0 0\nNs 0\nd 0.5\nTr 0.5\nNi 1.5\nillum 7\nmap_Kd -s 1 1 1 a.png\nTf 1 1 1\n\
    newmtl n\nd -halo 0.5\nKd spectral a.rfl 1\nKe 1 1 1\nillum 2\nTr 1\n";

/// Words that are difficult for text readers.
const ODD: [&str; 40] = [
    "v",
    "vt",
    "vn",
    "f",
    "s",
    "o",
    "g",
    "usemtl",
    "mtllib",
    "F",
    "#",
    "/",
    "//",
    "\\\n",
    "\\ \n",
    "\r",
    "\n",
    "\t",
    "0",
    "-0",
    "1",
    "-1",
    "-9223372036854775808",
    "4294967295",
    "4294967296",
    "1e39",
    "-1e-46",
    "nan",
    "-1.#IND",
    "1.#INF",
    "1d9",
    "1,5",
    "3.4028235e38",
    "1/1/1",
    "1//1",
    "-1/-1/-1",
    "\u{feff}",
    "newmtl",
    "Tr",
    "illum",
];

/// Replaces words, repeats lines and swaps numbers, as the bytes select.
fn reworded(bytes: &mut Vec<u8>) {
    let seed =
        bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash: u64, b| (hash ^ u64::from(*b)).wrapping_mul(0x0100_0000_01b3));
    let mut random = Random(seed);
    for _ in 0..random.below(6) {
        let at = random.below(bytes.len());
        let start = bytes[..at].iter().rposition(u8::is_ascii_whitespace).map_or(0, |i| i + 1);
        let end = bytes[at..].iter().position(u8::is_ascii_whitespace).map_or(bytes.len(), |i| at + i).max(start);
        let line_end = bytes[at..].iter().position(|b| *b == b'\n').map_or(bytes.len(), |i| at + i);
        let line = bytes[..at].iter().rposition(|b| *b == b'\n').map_or(0, |i| i + 1)..line_end;
        let odd = ODD[random.below(ODD.len())];
        match random.below(4) {
            0 => drop(bytes.splice(start..end, odd.bytes())),
            1 => drop(bytes.splice(end..end, format!(" {odd}").repeat(1 + random.below(50)).bytes())),
            2 => {
                let copied = bytes[line].to_vec();
                let lines = [copied.as_slice(), b"\n"].concat().repeat(1 + random.below(200));
                bytes.splice(line_end..line_end, [b"\n", lines.as_slice()].concat());
            }
            _ => drop(bytes.drain(line)),
        }
        if bytes.is_empty() {
            bytes.push(b' ');
        }
    }
}

fn read(obj: &[u8], mtl: &[u8]) -> Outcome {
    let assets = MemoryAssets::new().with("a.obj", obj).with("a.mtl", mtl).with("b c.mtl", mtl);
    match load("a.obj", &assets, &Staging::default()) {
        Ok((scene, warnings)) => {
            scene.meshes.iter().for_each(|mesh| mesh.check().expect("a mesh that can be used"));
            scene.materials.iter().for_each(|material| material.check().expect("a material that can be used"));
            assert!(warnings.len() < 500 && warnings.to_string().len() < 1 << 20, "{} warnings", warnings.len());
        }
        Err(errors) => assert!(!errors.to_string().is_empty()),
    }
    Outcome::Ordinary
}

#[test]
fn obj() {
    let mut all = seeds("obj");
    all.extend(std::iter::repeat_n(OBJ.to_vec(), all.len()));
    run("obj", &all, 400, reworded, |bytes| read(bytes, MTL));
}

#[test]
fn mtl() {
    let mut all = seeds("mtl");
    all.extend(std::iter::repeat_n(MTL.to_vec(), all.len()));
    run("mtl", &all, 400, reworded, |bytes| read(OBJ, bytes));
}

/// Small files with large results.
#[test]
fn models_that_repeat_are_read_in_time() {
    let square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";
    let comb: String = (0..2_000).map(|i| format!("v {i} {}.5 0\n", i % 2 * 9)).collect();
    for (name, text) in [
        ("corners", format!("{square}f{}\n", " 1 2 3 4".repeat(10_000))),
        ("one place", format!("{square}f{}\n", " 1".repeat(20_000))),
        (
            "comb",
            format!("{comb}v 2000 -9 0\nv -1 -9 0\nf{}\n", (1..=2_002).map(|i| format!(" {i}")).collect::<String>()),
        ),
        ("groups", format!("{square}{}", (0..2_000).map(|i| format!("g {i}\ns {i}\nf 1 2 3\n")).collect::<String>())),
        ("smoothing", format!("{square}{}", "s 1\nf 1 2 3\ns off\nf 1 3 4\n".repeat(10_000))),
        ("libraries", format!("mtllib {}\n{square}f 1 2 3\n", "x.mtl ".repeat(20_000))),
        ("libraries on lines", format!("{}{square}f 1 2 3\n", "mtllib a.mtl\n".repeat(10_000))),
        (
            "materials",
            format!(
                "mtllib a.mtl\n{square}{}",
                (0..10_000).map(|i| format!("usemtl {i}\nf 1 2 3\n")).collect::<String>()
            ),
        ),
        ("backslashes", format!("{square}f 1 2 {}3\n", "\\\n".repeat(10_000))),
        ("nowhere", format!("{}{square}f -1 -2 -3\n", "v nan 0 0\n".repeat(30_000))),
    ] {
        bounded(name, text.as_bytes(), |bytes| read(bytes, MTL));
    }
    for line in ["newmtl a\n", "map_Kd a.png\n", "Kd x\n", "Tr 1\n", "word\n", "newmtl a\nmap_Kd a.png\nKd 300 0 0\n"] {
        bounded(line.trim(), format!("newmtl m\n{}", line.repeat(10_000)).as_bytes(), |bytes| read(OBJ, bytes));
    }
}

/// Numbers that are difficult for readers of JSON.
const ODD_NUMBERS: [&str; 16] = [
    "0",
    "1",
    "2",
    "3",
    "4",
    "5123",
    "5125",
    "5126",
    "-1",
    "65535",
    "4294967295",
    "4294967296",
    "18446744073709551615",
    "1e308",
    "0.5",
    "null",
];

/// Replaces numbers of a GLB's JSON, as the bytes select, and corrects the container's lengths.
fn renumbered(bytes: &mut Vec<u8>) {
    let word =
        |bytes: &[u8], at: usize| bytes.get(at..at + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize);
    let Some(length) = word(bytes, 12).filter(|length| 20 + length <= bytes.len()) else { return };
    let mut random = Random(bytes.iter().fold(7, |hash: u64, b| (hash ^ u64::from(*b)).wrapping_mul(0x0100_0000_01b3)));
    let mut json = bytes[20..20 + length].to_vec();
    for _ in 0..1 + random.below(4) {
        let at = random.below(json.len().max(1));
        let is_part = |b: &u8| b.is_ascii_digit() || matches!(b, b'-' | b'.');
        let Some(start) = json[at.min(json.len())..].iter().position(is_part).map(|i| at + i) else { continue };
        let end = json[start..].iter().position(|b| !is_part(b)).map_or(json.len(), |i| start + i);
        json.splice(start..end, ODD_NUMBERS[random.below(ODD_NUMBERS.len())].bytes());
    }
    json.resize(json.len().next_multiple_of(4), b' ');
    let rest = bytes[20 + length..].to_vec();
    bytes.truncate(12);
    bytes.extend((json.len() as u32).to_le_bytes());
    bytes.extend(b"JSON");
    bytes.extend(json);
    bytes.extend(rest);
    let length = (bytes.len() as u32).to_le_bytes();
    bytes[8..12].copy_from_slice(&length);
}

/// The files of a folder of seeds.
fn seeds_of(folder: &str) -> Vec<Vec<u8>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fuzz/seeds").join(folder);
    let mut paths: Vec<PathBuf> = fs::read_dir(folder).expect("seeds").map(|e| e.expect("an entry").path()).collect();
    paths.sort();
    paths.iter().map(|path| fs::read(path).expect("a file")).collect()
}

fn read_glb(bytes: &[u8]) -> Outcome {
    if let Ok((scene, warnings)) = load("a.glb", &MemoryAssets::new().with("a.glb", bytes), &Staging::default()) {
        scene.meshes.iter().for_each(|mesh| mesh.check().expect("a mesh that can be used"));
        scene.spheres.iter().for_each(|cloud| cloud.check().expect("spheres that can be used"));
        scene.cylinders.iter().for_each(|cloud| cloud.check().expect("cylinders that can be used"));
        scene.materials.iter().for_each(|material| material.check().expect("a material that can be used"));
        assert!(warnings.len() < 100, "{} warnings", warnings.len());
    }
    Outcome::Ordinary
}

#[test]
fn gltf() {
    run("gltf", &seeds_of("gltf"), 600, renumbered, read_glb);
}

/// A GLB whose only primitive is this stream.
fn glb_of_draco(stream: &[u8]) -> Vec<u8> {
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],
        "buffers":[{{"byteLength":{0}}}],"bufferViews":[{{"buffer":0,"byteLength":{0}}}],
        "accessors":[{{"componentType":5126,"count":9,"type":"VEC3"}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"extensions":{{"KHR_draco_mesh_compression":
        {{"bufferView":0,"attributes":{{"POSITION":0}}}}}}}}]}}]}}"#,
        stream.len()
    );
    let word = |length: usize| (length as u32).to_le_bytes();
    let (json, mut data) = (json.as_bytes(), stream.to_vec());
    let json = [json, &b"   "[..json.len().next_multiple_of(4) - json.len()]].concat();
    data.resize(data.len().next_multiple_of(4), 0);
    let length = word(28 + json.len() + data.len());
    let head = [*b"glTF", word(2), length, word(json.len()), *b"JSON"].concat();
    [head, json, word(data.len()).to_vec(), b"BIN\0".to_vec(), data].concat()
}

#[test]
fn draco() {
    run("draco", &seeds_of("draco"), 600, |_| (), |bytes| read_glb(&glb_of_draco(bytes)));
}
