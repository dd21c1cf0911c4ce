//! Streams of Google's own encoder, and a few by hand. What they hold is told by Google's own decoder.

use super::reader::Reader;
use super::{Attribute, Component, Mesh, decode};

/// A stream with its points, triangles and attributes, and a hash of them.
struct Stream {
    bytes: &'static [u8],
    counts: [usize; 3],
    hash: u64,
}

macro_rules! streams {
    ($($name:literal: $counts:expr, $hash:literal;)*) => {
        [$(Stream {
            bytes: include_bytes!(concat!("../../../tests/fuzz/seeds/draco/", $name, ".drc")),
            counts: $counts,
            hash: $hash,
        }),*]
    };
}

const STREAMS: [Stream; 16] = streams! {
    "bytes": [4, 2, 1], 0xa053_aae4_03a1_b532;
    "cube-edgebreaker": [24, 12, 2], 0x7771_e92a_ca54_ed6c;
    "cube-sequential": [24, 12, 2], 0xc630_a29e_9463_f20e;
    "differences": [4, 2, 1], 0x4a5b_a100_543e_1fd5;
    "doubled": [74, 70, 2], 0x7cc7_d218_5ba8_e2bf;
    "facets": [192, 144, 3], 0x8291_51a7_b05a_578e;
    "fan": [1002, 1000, 1], 0x73b4_8a42_5c01_674f;
    "grid": [961, 1800, 1], 0xa956_f7bd_6f99_6cfb;
    "holes": [77, 85, 1], 0x9b41_c3c9_f915_5a69;
    "metadata": [3, 1, 1], 0xe464_aba2_745e_0d63;
    "pair": [4, 2, 2], 0xbf8e_fcd7_edb3_9c57;
    "parallelogram": [4, 2, 1], 0xa358_fa7e_ed8e_6191;
    "patches": [60, 88, 3], 0x9a4a_4a99_70ee_65cd;
    "plain": [4, 2, 7], 0xeb8d_dd15_2ebd_5f05;
    "sphere": [220, 360, 2], 0x90e8_f804_42d1_f808;
    "tunnels": [64, 144, 2], 0x2ad6_6187_4ab9_0fe8;
};

fn stream(points: usize, triangles: usize) -> &'static [u8] {
    let found = STREAMS.iter().find(|stream| stream.counts[..2] == [points, triangles]);
    found.expect("a stream of these counts").bytes
}

/// FNV-1a of all that a mesh has.
fn hash(mesh: &Mesh) -> u64 {
    let words = |words: &[usize]| words.iter().flat_map(|word| (*word as u32).to_le_bytes()).collect::<Vec<u8>>();
    let mut bytes = words(&[mesh.points, mesh.triangles.len()]);
    bytes.extend(mesh.triangles.as_flattened().iter().flat_map(|point| point.to_le_bytes()));
    bytes.extend(words(&[mesh.attributes.len()]));
    for attribute in &mesh.attributes {
        bytes.extend(words(&[attribute.id as usize, attribute.bytes.len()]));
        bytes.extend(&attribute.bytes);
    }
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3))
}

#[test]
fn meshes_are_those_of_googles_decoder() {
    for Stream { bytes, counts, hash: expected } in STREAMS {
        let mesh = decode(bytes, usize::MAX).unwrap();
        assert_eq!([mesh.points, mesh.triangles.len(), mesh.attributes.len()], counts);
        assert_eq!(hash(&mesh), expected, "{counts:?}");
    }
}

#[test]
fn two_triangles() {
    let mesh = decode(include_bytes!("../../../tests/fuzz/seeds/draco/pair.drc"), usize::MAX).unwrap();
    assert_eq!(mesh.triangles, [[0, 1, 2], [1, 3, 2]]);
    let [positions, normals] = &mesh.attributes[..] else { panic!("two attributes") };
    let floats = |attribute: &Attribute| -> Vec<f32> {
        assert_eq!((attribute.component, attribute.width, attribute.is_normalized), (Component::F32, 3, false));
        attribute.bytes.as_chunks().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect()
    };
    assert_eq!(floats(positions), [1., 1., 0.507_936_54, 0., 1., 0., 1., 0., 0., 0., 0., 0.]);
    assert_eq!(
        floats(normals)[..6],
        [-0.485_071_4, -0.485_070_97, 0.727_606_9, -0.192_450_17, -0.192_45, 0.962_250_53]
    );
}

fn refused(bytes: &[u8]) -> String {
    decode(bytes, usize::MAX).unwrap_err().into_owned()
}

#[test]
fn parts_of_streams_are_refused() {
    for Stream { bytes, .. } in STREAMS {
        for length in 0..bytes.len() {
            refused(&bytes[..length]);
        }
    }
}

#[test]
fn what_isnt_read_is_named() {
    let bytes = stream(74, 70);
    let changed = |at: usize, byte: u8| {
        let mut bytes = bytes.to_vec();
        bytes[at] = byte;
        refused(&bytes)
    };
    for (at, byte, words) in [
        (0, b'd', "they don't begin with DRACO"),
        (5, 1, "they have version 1.2, not 2.2"),
        (6, 3, "they have version 2.3, not 2.2"),
        (7, 0, "they are a cloud of points, not a mesh"),
        (8, 2, "their method 2 is unknown"),
        (11, 1, "Edgebreaker with prediction, which is obsolete"),
        (11, 3, "their Edgebreaker has an unknown kind"),
    ] {
        assert!(changed(at, byte).contains(words), "{at}: {}", changed(at, byte));
    }
    // The methods of the only attribute are behind its coding.
    let bytes = include_bytes!("../../../tests/fuzz/seeds/draco/parallelogram.drc");
    let at = bytes.windows(3).position(|w| w == [1, 1, 1]).unwrap() + 1;
    for (at, byte, words) in [
        (at, 2, "\"multi parallelogram\" is obsolete"),
        (at, 3, "first prediction of texture coordinates is obsolete"),
        (at, 7, "unknown prediction"),
        (at + 1, 2, "first prediction of normals is obsolete"),
        (at + 1, 3, "a prediction doesn't fit"),
        (at + 1, 0, "unknown kind of corrections"),
    ] {
        let mut bytes = bytes.to_vec();
        bytes[at] = byte;
        assert!(refused(&bytes).contains(words), "{at} {byte}: {}", refused(&bytes));
    }
}

/// Memory is reserved for what a stream may have only.
#[test]
fn counts_beyond_the_budget_are_refused() {
    let bytes = stream(961, 1800);
    let all = decode(bytes, usize::MAX).unwrap();
    let numbers = 3 * 3 * all.triangles.len() + 3 * all.points;
    assert!(decode(bytes, numbers).is_ok());
    assert!(decode(bytes, numbers - 1).unwrap_err().contains("more numbers than they may"));
    assert!(decode(bytes, 9 * 1800 - 1).unwrap_err().contains("more triangles than they may"));
    let most = [0xFF, 0xFF, 0xFF, 0xFF, 0x0F];
    // Vertices, triangles, no seams, symbols, no splits.
    let edgebreaker = [b"DRACO\x02\x02\x01\x01\0\0\x02\x03", &most[..], &[0], &most, &[0, 0, 0, 1, 0]].concat();
    assert!(refused(&edgebreaker).contains("more triangles than they may"));
    let sequential = [b"DRACO\x02\x02\x01\0\0\0", &most[..], &most, &[0, 1, 1]].concat();
    assert!(refused(&sequential).contains("more triangles than they may"));
    // A triangle of 4 billion points, whose numbers take no bytes.
    let points = [b"DRACO\x02\x02\x01\0\0\0\x01", &most[..], &[1], &[0; 12], &[1, 1, 0, 4, 255, 0, 0, 1]].concat();
    assert!(refused(&points).contains("more numbers than they may"));
}

#[test]
fn changed_streams_make_no_panic() {
    let mut random = 1u32;
    let mut next = || {
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        random as usize >> 8
    };
    for Stream { bytes, .. } in STREAMS {
        for _ in 0..2000 {
            let mut changed = bytes.to_vec();
            for _ in 0..1 + next() % 3 {
                // The header is left alone.
                let at = 11 + next() % (changed.len() - 11);
                changed[at] = next() as u8;
            }
            if let Ok(mesh) = decode(&changed, usize::MAX) {
                assert!(mesh.triangles.as_flattened().iter().all(|point| (*point as usize) < mesh.points));
                let size = |attribute: &Attribute| attribute.component.size() * attribute.width * mesh.points;
                assert!(mesh.attributes.iter().all(|attribute| attribute.bytes.len() == size(attribute)));
            }
        }
    }
}

/// Numbers have at most 32 bits.
#[test]
fn numbers_end() {
    let number = |bytes: &[u8]| Reader(bytes).number();
    assert_eq!(number(&[0xE5, 0x8E, 0x26]), Ok(624_485));
    assert_eq!(number(&[0xFF, 0xFF, 0xFF, 0xFF, 0x0F]), Ok(u32::MAX));
    assert!(number(&[0xFF, 0xFF, 0xFF, 0xFF, 0x1F]).is_err());
    assert!(number(&[0x80, 0x80, 0x80, 0x80, 0x80, 0]).is_err());
}
