//! Tests of KTX2 with textures that Binomial's `basisu` 1.15 made and unpacked.

use super::*;

const ETC1S: &[u8] = include_bytes!("../../../tests/fuzz/seeds/etc1s.ktx2");
const ETC1S_ALPHA: &[u8] = include_bytes!("../../../tests/fuzz/seeds/etc1s-alpha.ktx2");
const UASTC: &[u8] = include_bytes!("../../../tests/fuzz/seeds/uastc.ktx2");
const UASTC_ZSTD: &[u8] = include_bytes!("../../../tests/fuzz/seeds/uastc-zstd-alpha.ktx2");

const ALL: [&[u8]; 4] = [ETC1S, ETC1S_ALPHA, UASTC, UASTC_ZSTD];

fn patched(bytes: &[u8], at: usize, with: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    bytes[at..at + with.len()].copy_from_slice(with);
    bytes
}

fn why(bytes: &[u8]) -> String {
    read(bytes).unwrap_err().to_string()
}

#[test]
fn sums_and_texels_are_those_of_basisu() {
    use ColorSpace::{Linear, Srgb};
    // The sums of the channels, and the texel at (11, 7).
    let expected: [(_, _, &[u64], &[u8]); 4] = [
        ([24, 20], Srgb, &[55078, 54643, 61492], &[116, 83, 149]),
        ([24, 20], Srgb, &[55078, 54643, 61492, 57601], &[116, 83, 149, 255]),
        ([24, 20], Srgb, &[55100, 54600, 61920], &[110, 84, 129]),
        ([64, 36], Linear, &[289516, 281704, 275472, 257689], &[43, 48, 124, 59]),
    ];
    for (bytes, (size, space, sums, texel)) in ALL.into_iter().zip(expected) {
        let (image, _) = read(bytes).unwrap();
        image.check().unwrap();
        assert_eq!(([image.width, image.height], image.space, image.premultiplied), (size, space, false));
        let channels = usize::from(image.channels);
        let Samples::U8(data) = image.samples else { panic!() };
        let sum = |c: usize| data[c..].iter().step_by(channels).map(|v| u64::from(*v)).sum::<u64>();
        assert_eq!((0..channels).map(sum).collect::<Vec<_>>(), sums);
        assert_eq!(data[channels * (7 * size[0] as usize + 11)..][..channels], *texel);
    }
}

/// Two numbers are red and green, as in a picture of two channels.
#[test]
fn the_second_of_two_numbers_is_green() {
    let kind = HEADER + 24 + 31;
    let (image, _) = read(&patched(&patched(ETC1S_ALPHA, kind, &[3]), kind + 16, &[4])).unwrap();
    let Samples::U8(data) = image.samples else { panic!() };
    assert_eq!((image.channels, &data[3 * (7 * 24 + 11)..][..3]), (3, &[116, 255, 0][..]));
}

#[test]
fn a_file_that_is_cut_anywhere_is_refused() {
    for bytes in ALL {
        for length in 12..bytes.len() {
            assert!(read(&bytes[..length]).is_err(), "{length} of {}", bytes.len());
        }
    }
}

#[test]
fn what_is_not_read_is_named() {
    let isnt = |what: &str| format!("the KTX2 file has {what}, which isn't supported");
    for (at, with, what) in [
        (12, 37, "texels of Vulkan's format 37"),
        (24, 0, "one dimension"),
        (28, 5, "three dimensions"),
        (32, 3, "an array of 3 pictures"),
        (36, 6, "the six sides of a cube"),
        (44, 3, "a supercompression by zlib"),
        (44, 1, "the supercompression 1 of the colour model 166"),
    ] {
        assert_eq!(why(&patched(UASTC, at, &u32::to_le_bytes(with))), isnt(what));
    }
    // The colour model is in the descriptor, which follows an index of one level.
    assert_eq!(why(&patched(UASTC, HEADER + 24 + 12, &[128])), isnt("the colour model 128"));
    let basis = "ASTC, or a form of Basis Universal that glTF doesn't have";
    assert_eq!(why(&patched(UASTC, HEADER + 24 + 12, &[167])), isnt(basis));
    assert_eq!(why(&patched(UASTC, 36, &[7])), "the KTX2 file is damaged: it has 7 faces");
    // The pair "KTXwriter" becomes an orientation of the same length.
    let at = UASTC.windows(9).position(|w| w == b"KTXwriter").unwrap();
    assert_eq!(why(&patched(UASTC, at, b"KTXorientation\0ru")), isnt("rows from the bottom upwards"));
    assert!(read(&patched(UASTC, at, b"KTXorientation\0rd")).is_ok());
}

#[test]
fn transfer_and_premultiplied_alpha_come_from_the_descriptor() {
    let at = HEADER + 24 + 12;
    let (image, _) = read(&patched(UASTC, at + 2, &[1, 1])).unwrap();
    assert_eq!((image.space, image.premultiplied), (ColorSpace::Linear, true));
}

#[test]
fn sizes_beyond_the_bytes_are_refused() {
    let sized = |bytes: &[u8], size: [u32; 2]| patched(bytes, 20, &size.map(u32::to_le_bytes).concat());
    let error = |bytes: &[u8], size| read(&sized(bytes, size)).unwrap_err();
    assert!(matches!(error(UASTC, [28, 20]), ImageError::ExceedsFile { width: 28, height: 20, .. }));
    assert!(matches!(error(UASTC, [u32::MAX, u32::MAX]), ImageError::TooLarge { .. }));
    assert!(matches!(error(UASTC, [0, 20]), ImageError::Empty { .. }));
    for bytes in [ETC1S, ETC1S_ALPHA, UASTC_ZSTD] {
        assert!(matches!(error(bytes, [16383, 16383]), ImageError::TooDense { memory: 1_342_013_445, .. }));
        assert!(matches!(error(bytes, [1 << 21, 1]), ImageError::TooLarge { .. }));
    }
    let told = why(&sized(UASTC_ZSTD, [68, 36]));
    assert_eq!(told, "the KTX2 file is damaged: its level isn't a frame of Zstandard of 2448 bytes");
}

/// A block whose matches would make 33 MB of 500 bytes stops at the size of its level.
#[test]
fn a_block_of_zstandard_is_no_larger_than_its_level() {
    // Equal literals, and 255 sequences with tables of one symbol each: a literal, offset 1 and the longest match.
    let (literals, tables) = ([0xf5, 0x0f, b'x'], [1, 0, 52]);
    let block = [&literals[..], &[128, 255, 0b0101_0100], &tables, &[0xff; 510], &[1]].concat();
    let head = (block.len() << 3 | 2 << 1 | 1).to_le_bytes();
    let frame = [&[0x28, 0xb5, 0x2f, 0xfd, 0, 0x58], &head[..3], &block].concat();
    let mut out = Vec::new();
    assert_eq!(zstd::inflate(&frame, 1 << 20, &mut out), None);
    assert!((1 << 19..=1 << 20).contains(&out.len()), "{}", out.len());
}
