//! Tests of the decoders. Most streams are meshoptimizer's (version 1.2), of numbers that formulas here give again.

use super::*;

/// Attributes of version 0, in two blocks.
const BLOCKS_0: &str = "a040100441080000000080000000080000000080000000080001010101300000007ef00000007d7ef00000007d7ef0\
    0000007d7e545555550000000800000200008000800080080080200802008080202020808082020820820820820820882208822088222208\
    88882222222222222288888a22000000000001f00000007d7e152288a2288a2288a28a28a200000000000000000000000000000000000000\
    000000000000000000000000c80009";

/// The same numbers in version 1, with widths of 1, 2 and 4 bits, and a byte position without differences.
const BLOCKS_1: &str = "a180401004410400021000024000020001020004020101010102007e03007d7e03007d7e03007d7e54a9aaaa00400200\
    080210100202100402028020080200808020202080808202082082082082082088220882208822220888882222222222222288888a2292010\
    3007d7e152288a2288a2288a28a28a2000000000000000000000000000000000000000000c8000900";

/// Attributes of version 1, whose channels are bytes, halves and halves. All four controls occur.
const MIXED: &str = "a16d7bba052aaaaaaaaaaa0000001e72e51699f5fdb111e22a3949059281be523a76f915dd0526666666666600000099999\
    999999999999999999999999999999999999999990050f09030d07010b050f09030d07010b050f09030d070100a00012234455677899aabcc\
    de000000000040404040ff40404040ff40404040ff40404040ff40404000000000000000000000000500e80300000000803f000101";

/// The corners of the unit square as floats. Two channels are bits that are turned, and halves.
const SQUARE: &str = "a1eaeaaa007f007f00007f00000000000000000000000000000000000000000000120100";

/// Triangles of versions 1 and 0.
const TRIANGLES: [&str; 2] = [
    "e1fe1e100e100e100e100efe1e190e180e170e160eff1e160e160e160e160eff1e160e160e160e160efffe10ffff0f0c9f025f090c5f090cf\
    fae07e307e60700ff03d30701f4d0c50802007687566778a9866589689801690000",
    "e0fe1f100f100f100f100ffe1f190f180f170f160fff1f160f160f160f160fff1f160f160f160f160fffff1fffff0f0c02020202029f02020\
    20202025f090c02020202025f090c0202020202ffae07e307e607f2e9070204ffe007d30701f4d0c50802007687566778a986658968980169\
    0000",
];

const INDICES: &str =
    "d10081b5180c030c0b0c130c1b0c230c2b0c330c3b0c430c4b0c530c5b0c630c6b0c730c7b0c83010c8b010c930100000000";

fn bytes(hex: &str) -> Vec<u8> {
    (0..hex.len()).step_by(2).map(|i| u8::from_str_radix(&hex[i..i + 2], 16).unwrap()).collect()
}

fn view(mode: CompressionMode, byte_stride: usize, count: usize) -> CompressedView {
    let filter = CompressionFilter::None;
    CompressedView { buffer: 0, byte_offset: 0, byte_length: 0, byte_stride, count, mode, filter }
}

/// All streams, and how they are decoded.
fn streams() -> Vec<(CompressedView, Vec<u8>)> {
    let list = [
        (CompressionMode::Attributes, 4, 300, BLOCKS_0),
        (CompressionMode::Attributes, 4, 300, BLOCKS_1),
        (CompressionMode::Attributes, 12, 24, MIXED),
        (CompressionMode::Attributes, 12, 4, SQUARE),
        (CompressionMode::Triangles, 4, 135, TRIANGLES[0]),
        (CompressionMode::Triangles, 4, 135, TRIANGLES[1]),
        (CompressionMode::Indices, 4, 40, INDICES),
    ];
    list.into_iter().map(|(mode, stride, count, hex)| (view(mode, stride, count), bytes(hex))).collect()
}

/// The decoded bytes, or why there are none.
fn decoded(view: &CompressedView, stream: &[u8]) -> Result<Vec<u8>, String> {
    decode(view, stream).map_err(|fault| fault.error("m").message)
}

fn indices(mode: CompressionMode, stride: usize, count: usize, hex: &str) -> Vec<u32> {
    let decoded = decoded(&view(mode, stride, count), &bytes(hex)).unwrap();
    let index = |b: &[u8]| b.iter().rev().fold(0, |sum, &byte| sum << 8 | u32::from(byte));
    decoded.chunks_exact(stride).map(index).collect()
}

/// The example of the specification (Appendix A, mode 0) as the first byte of each element.
#[test]
fn differences_are_the_specifications() {
    let deltas = [-1, -4, -3, 26, -91, 0, -6, 6, -4, -4, 5, -5, 1, -1, 0, 0];
    let hex = ["a0", "02175ff0bc77a9210034b5", "000000", &"00".repeat(28), "0a141e28"].concat();
    let decoded = decoded(&view(CompressionMode::Attributes, 4, 16), &bytes(&hex)).unwrap();
    let mut first = 10i32;
    for (element, delta) in decoded.chunks_exact(4).zip(deltas) {
        first += delta;
        assert_eq!(element, [first as u8, 20, 30, 40]);
    }
}

#[test]
fn attributes_of_both_versions() {
    let element = |i: u32| [i / 50, if i.is_multiple_of(64) { 200 } else { 7 }, i * i / 900, 9].map(|v| v as u8);
    let expected: Vec<u8> = (0..300).flat_map(element).collect();
    for hex in [BLOCKS_0, BLOCKS_1] {
        assert_eq!(decoded(&view(CompressionMode::Attributes, 4, 300), &bytes(hex)).unwrap(), expected);
    }
}

#[test]
fn channels_are_bytes_halves_and_bits() {
    let element = |i: u32| {
        let bytes = [i, i * i * i * 7 + (i << 3), 5, i & 1].map(|v| v as u8);
        let halves = [1000 - 77 * i as i32, (i * i * 40) as i32].map(|v| (v as u16).to_le_bytes());
        [bytes, [halves[0][0], halves[0][1], halves[1][0], halves[1][1]], ((i % 5) as f32 * 0.25 + 1.0).to_le_bytes()]
    };
    let expected: Vec<u8> = (0..24).flat_map(element).flatten().collect();
    assert_eq!(decoded(&view(CompressionMode::Attributes, 12, 24), &bytes(MIXED)).unwrap(), expected);
    let corners = [0f32, 0., 0., 1., 0., 0., 1., 1., 0., 0., 1., 0.];
    let expected: Vec<u8> = corners.into_iter().flat_map(f32::to_le_bytes).collect();
    assert_eq!(decoded(&view(CompressionMode::Attributes, 12, 4), &bytes(SQUARE)).unwrap(), expected);
}

/// A grid of 5 x 4 squares, and triangles far from it. A triangle may begin with another of its corners.
#[test]
fn triangles_turn_but_keep_their_order() {
    let corner = |square: u32| square / 5 * 6 + square % 5;
    let grid = (0..20).map(corner).flat_map(|p| [[p, p + 1, p + 6], [p + 6, p + 1, p + 7]]);
    let far = [[500, 2, 501], [0, 1, 2], [2, 1, 3], [499, 9, 8], [70000, 70001, 3]];
    let expected: Vec<[u32; 3]> = grid.chain(far).collect();
    let smallest_first = |t: [u32; 3]| {
        let k = (0..3).min_by_key(|&k| t[k]).unwrap();
        [t[k], t[(k + 1) % 3], t[(k + 2) % 3]]
    };
    for hex in TRIANGLES {
        for (stride, mask) in [(4, u32::MAX), (2, 0xFFFF)] {
            let decoded = indices(CompressionMode::Triangles, stride, 135, hex);
            let decoded = decoded.chunks_exact(3).map(|t| smallest_first([t[0], t[1], t[2]]));
            let expected = expected.iter().map(|t| smallest_first(t.map(|v| v & mask)));
            assert!(decoded.eq(expected), "{hex}, {stride}");
        }
    }
}

#[test]
fn indices_follow_two_sequences() {
    let expected = |mask: u32| (0..20).flat_map(move |i| [i * 3, (100_000 - i * i) & mask]).collect::<Vec<u32>>();
    assert_eq!(indices(CompressionMode::Indices, 4, 40, INDICES), expected(u32::MAX));
    assert_eq!(indices(CompressionMode::Indices, 2, 40, INDICES), expected(0xFFFF));
}

fn filtered(filter: CompressionFilter, elements: &[u8], stride: usize) -> Vec<u8> {
    let mut elements = elements.to_vec();
    filters::apply(filter, stride, &mut elements);
    elements
}

fn filtered_halves(filter: CompressionFilter, element: [i16; 4]) -> [i16; 4] {
    let bytes = filtered(filter, &element.map(i16::to_le_bytes).concat(), 8);
    std::array::from_fn(|k| i16::from_le_bytes([bytes[2 * k], bytes[2 * k + 1]]))
}

#[test]
fn octahedra_are_unfolded() {
    let octahedral = |element: [i8; 4]| {
        let bytes = filtered(CompressionFilter::Octahedral, &element.map(|v| v as u8), 4);
        std::array::from_fn(|k| bytes[k] as i8)
    };
    assert_eq!(octahedral([0, 0, 127, -5]), [0, 0, 127, -5]);
    assert_eq!(octahedral([-7, 0, 7, 9]), [-127, 0, 0, 9]);
    assert_eq!(octahedral([7, 7, 7, 0]), [0, 0, -127, 0]);
    // (1, 1, 2) and (1, 1, -2) of length √6.
    assert_eq!(octahedral([1, 1, 4, 0]), [52, 52, 104, 0]);
    assert_eq!(octahedral([3, 3, 4, 0]), [52, 52, -104, 0]);
    // No 1: the result is anything.
    octahedral([3, 0, 0, 0]);
    let wide = filtered_halves(CompressionFilter::Octahedral, [255, -256, 1023, 7]);
    // x and y of 255 / 1023 and -256 / 1023 leave 512 / 1023 for z.
    assert_eq!(wide, [13333, -13386, 26772, 7]);
}

#[test]
fn quaternions_get_their_largest_component() {
    for largest in 0..4 {
        let mut expected = [0; 4];
        expected[largest] = 32767;
        // 1 is 7, without its lowest bits.
        let quaternion = |parts: [i16; 3]| {
            filtered_halves(CompressionFilter::Quaternion, [parts[0], parts[1], parts[2], 4 | largest as i16])
        };
        assert_eq!(quaternion([0, 0, 0]), expected);
        // The next component, round about, is the first: two equal ones of √½.
        expected[largest] = 23170;
        expected[(largest + 1) % 4] = 23170;
        assert_eq!(quaternion([7, 0, 0]), expected);
    }
}

#[test]
fn exponents_scale_exactly() {
    let number = |exponent: i8, mantissa: i32| {
        let bits = i32::from(exponent) << 24 | mantissa & 0xFF_FFFF;
        let bytes = filtered(CompressionFilter::Exponential, &bits.to_le_bytes(), 4);
        f32::from_le_bytes(bytes.try_into().unwrap())
    };
    for (exponent, mantissa, expected) in [
        (0, 0, 0.0),
        (0, 17, 17.0),
        (-1, -3, -1.5),
        (-20, 0x7F_FFFF, 8_388_607.0 / 1_048_576.0),
        (100, -0x80_0000, -1.063_382_4e37),
        (-100, 1, 7.888_609e-31),
        (127, 0x7F_FFFF, f32::INFINITY),
        (-128, 1, 2.938_736e-39),
    ] {
        assert_eq!(number(exponent, mantissa), expected, "2^{exponent} x {mantissa}");
    }
}

#[test]
fn colors_are_of_red_green_and_blue() {
    let color = |element: [u8; 4]| filtered(CompressionFilter::Color, &element, 4);
    // All 8 bits: white, red (255, 0, 0), and half of the opacity.
    assert_eq!(color([255, 0, 0, 255]), [255, 255, 255, 255]);
    assert_eq!(color([64, 127, 192, 128]), [255, 0, 1, 0]);
    assert_eq!(color([100, 0, 0, 128 | 63]), [100, 100, 100, 127]);
    // 4 bits, of which 1 is 15: y 8, orange 2, green 4 are red 6, green 12, blue 2.
    assert_eq!(color([8, 2, 4, 15]), [102, 204, 34, 255]);
    // No opacity: the result is anything.
    color([255, 128, 128, 0]);
    let wide = filtered_halves(CompressionFilter::Color, [8, 2, 4, 15]).map(|v| v as u16);
    assert_eq!(wide, [26214, 52428, 8738, 65535]);
}

#[test]
fn parts_of_streams_are_refused() {
    for (view, stream) in streams() {
        assert!(decode(&view, &stream).is_ok());
        for length in 0..stream.len() {
            assert!(decode(&view, &stream[..length]).is_err(), "{view:?}, {length} bytes");
        }
        let longer = [&stream[..stream.len() / 2], &[0], &stream[stream.len() / 2..]].concat();
        assert!(decode(&view, &longer).is_err(), "{view:?}, a byte more");
        let told = decoded(&view, &[&[0x55], &stream[1..]].concat()).unwrap_err();
        assert!(told.contains("begin with the byte"), "{told}");
    }
}

/// Bytes are reserved only for what a stream can hold.
#[test]
fn counts_beyond_the_stream_are_refused() {
    for (mut view, stream) in streams() {
        let count = view.count;
        for more in [count + 300, 3 << 20, 3 << 40, usize::MAX - 3, usize::MAX] {
            view.count = more / 3 * 3;
            assert!(decode(&view, &stream).is_err(), "{view:?}");
        }
    }
}

#[test]
fn changed_streams_make_no_panic() {
    let mut random = 1u32;
    let mut next = || {
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        random >> 8
    };
    for (mut view, stream) in streams() {
        for _ in 0..2000 {
            let mut changed = stream.clone();
            for _ in 0..1 + next() % 4 {
                let at = next() as usize % changed.len();
                changed[at] = next() as u8;
            }
            view.count = if next() % 4 == 0 { 3 * (1 + next() as usize % 200) } else { view.count };
            if let Ok(decoded) = decode(&view, &changed) {
                assert_eq!(decoded.len(), view.count * view.byte_stride);
            }
        }
    }
}

/// A first triangle has no edge or vertex before it.
#[test]
fn triangles_refer_to_earlier_ones() {
    for code in ["00", "f1"] {
        // The pair 1 of the table names the latest vertex.
        let hex = ["e1", code, "0010", &"00".repeat(14)].concat();
        let told = decoded(&view(CompressionMode::Triangles, 2, 3), &bytes(&hex)).unwrap_err();
        assert!(told.contains("one before the first"), "{code}: {told}");
    }
}

#[test]
fn numbers_fit_the_mode() {
    use CompressionFilter as Filter;
    use CompressionMode as Mode;
    for (mode, filter, stride, count, words) in [
        (Mode::Attributes, Filter::None, 6, 1, "/byteStride: is 6"),
        (Mode::Attributes, Filter::None, 0, 1, "/byteStride"),
        (Mode::Attributes, Filter::None, 260, 1, "/byteStride"),
        (Mode::Attributes, Filter::Octahedral, 12, 1, "/byteStride: is 12; with its mode and filter it must be 4 or 8"),
        (Mode::Attributes, Filter::Quaternion, 4, 1, "/byteStride"),
        (Mode::Attributes, Filter::Exponential, 5, 1, "/byteStride"),
        (Mode::Attributes, Filter::Color, 16, 1, "/byteStride"),
        (Mode::Attributes, Filter::None, 4, 0, "/count: is 0"),
        (Mode::Triangles, Filter::None, 2, 4, "/count: is 4"),
        (Mode::Triangles, Filter::None, 1, 3, "/byteStride"),
        (Mode::Triangles, Filter::Color, 4, 3, "/filter"),
        (Mode::Indices, Filter::None, 8, 3, "/byteStride"),
    ] {
        let view = CompressedView { filter, ..view(mode, stride, count) };
        let told = decoded(&view, &[0; 64]).unwrap_err();
        assert!(told.contains(words), "{view:?}: {told}");
    }
}
