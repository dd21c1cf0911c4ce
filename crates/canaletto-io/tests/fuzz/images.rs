//! Pictures: PNG, EXR, JPEG, Radiance HDR, WebP and KTX2 as textures; PNG and EXR also as pictures for comparison.

use crate::mutate::{Outcome, bounded, run};
use canaletto::scene::Transfer;
use canaletto_io::assets::{AssetPath, Assets, MemoryAssets};
use canaletto_io::image::{ImageError, read_image};
use canaletto_io::picture::{Channel, Compression, EncodeSettings, Image, PictureFormat, decode};
use exr::prelude as ex;
use exr::prelude::WritableImage;
use std::io::{Cursor, Write};

/// Reads the bytes as a texture and as a picture.
fn read(bytes: &[u8]) -> Outcome {
    let texture = texture(bytes);
    let _ = decode(bytes);
    match texture {
        Ok(notes) if notes.iter().any(|note| note.contains("reading them took")) => Outcome::Told,
        _ => Outcome::Ordinary,
    }
}

fn texture(bytes: &[u8]) -> Result<Vec<String>, ImageError> {
    let asset = MemoryAssets::new().with("x", bytes.to_vec()).read("x", &AssetPath::base()).expect("it is there");
    read_image(&asset).map(|(image, notes)| {
        image.check().expect("an image that can be used");
        notes
    })
}

fn ramp(names: &[&str], size: [u32; 2]) -> Image {
    let count = (size[0] * size[1]) as usize;
    let data = |c: usize| (0..count).map(|i| ((i * (7 + c)) % 61) as f32 / 60.0).collect();
    let channels = names.iter().enumerate();
    let channels = channels.map(|(c, name)| Channel::new(*name, data(c))).collect();
    Image { width: size[0], height: size[1], channels }
}

fn pngs() -> Vec<Vec<u8>> {
    let text = [("Comment".to_owned(), "à, 水".to_owned()), ("seed".to_owned(), "7".to_owned())];
    let mut seeds: Vec<Vec<u8>> = [
        &include_bytes!("seeds/palette.png")[..],
        include_bytes!("seeds/interlaced.png"),
        include_bytes!("seeds/colour.png"),
    ]
    .map(<[u8]>::to_vec)
    .to_vec();
    for (names, bits) in [(&["Y"][..], 8), (&["Y", "A"], 16), (&["R", "G", "B", "A"], 8)] {
        let settings = EncodeSettings { bits: Some(bits), compression: Compression::Fast, ..EncodeSettings::default() };
        let png = PictureFormat::Png.encode_image(&ramp(names, [12, 5]), Transfer::Srgb, &settings, &text);
        seeds.push(png.expect("a PNG"));
    }
    seeds
}

/// Corrects the checksums of a PNG's chunks.
fn with_checksums(bytes: &mut [u8]) {
    let mut at = 8;
    while let Some(head) = bytes.get(at..at + 4) {
        let length = u32::from_be_bytes([head[0], head[1], head[2], head[3]]) as usize;
        let Some(chunk) = bytes.get(at + 4..(at + 8).saturating_add(length)) else { return };
        let crc = !chunk.iter().fold(!0u32, |crc, byte| {
            (0..8).fold(crc ^ u32::from(*byte), |c, _| if c & 1 == 1 { 0xedb8_8320 ^ (c >> 1) } else { c >> 1 })
        });
        let place = at + 8 + length;
        at = place + 4;
        let Some(place) = bytes.get_mut(place..place + 4) else { return };
        place.copy_from_slice(&crc.to_be_bytes());
    }
}

#[test]
fn png() {
    run("png", &pngs(), 400, |bytes| with_checksums(bytes), read);
}

fn exr_bytes(image: &Image, texts: &[(String, String)]) -> Vec<u8> {
    PictureFormat::Exr.encode_image(image, Transfer::None, &EncodeSettings::default(), texts).expect("an EXR")
}

fn exrs() -> Vec<Vec<u8>> {
    use ex::{Blocks, Compression as By, Encoding, LineOrder, Vec2};
    let mut seeds = vec![
        exr_bytes(&ramp(&["R", "G", "B", "A"], [12, 5]), &[("seed".into(), "7".into())]),
        exr_bytes(&ramp(&["Y"], [40, 40]), &[]),
    ];
    for (by, tiles) in [
        (By::Uncompressed, false),
        (By::RLE, false),
        (By::ZIP1, false),
        (By::ZIP16, true),
        (By::PIZ, false),
        (By::PIZ, true),
        (By::PXR24, false),
        (By::B44, false),
        (By::B44A, true),
    ] {
        let value = |at: Vec2<usize>, c: f32| ex::f16::from_f32(at.0 as f32 * 0.5 + at.1 as f32 + c);
        let channels = ex::SpecificChannels::rgb(|at| (value(at, 0.0), value(at, 9.0).to_f32(), value(at, 0.5)));
        let blocks = if tiles { Blocks::Tiles(Vec2(16, 8)) } else { Blocks::ScanLines };
        let encoding = Encoding { compression: by, blocks, line_order: LineOrder::Increasing };
        let layer = ex::Layer::new((24, 18), ex::LayerAttributes::named("a"), encoding, channels);
        let mut bytes = Cursor::new(Vec::new());
        ex::Image::from_layer(layer).write().non_parallel().to_buffered(&mut bytes).expect("an EXR");
        seeds.push(bytes.into_inner());
    }
    seeds
}

#[test]
fn exr() {
    run("exr", &exrs(), 400, |_| (), read);
}

#[test]
fn jpeg() {
    let seeds = [
        &include_bytes!("../../src/image/testdata/ramp.jpg")[..],
        include_bytes!("seeds/progressive.jpg"),
        include_bytes!("seeds/subsampled.jpg"),
        include_bytes!("seeds/grey.jpg"),
        include_bytes!("seeds/cmyk.jpg"),
    ];
    run("jpeg", &seeds.map(<[u8]>::to_vec), 400, |_| (), read);
}

#[test]
fn webp() {
    let seeds = [
        &include_bytes!("../../src/image/testdata/ramp.webp")[..],
        include_bytes!("seeds/lossy.webp"),
        include_bytes!("seeds/lossy-alpha.webp"),
        include_bytes!("seeds/lossless-alpha.webp"),
        include_bytes!("seeds/palette.webp"),
        include_bytes!("seeds/animated.webp"),
    ];
    run("webp", &seeds.map(<[u8]>::to_vec), 400, |_| (), read);
}

#[test]
fn ktx2() {
    let seeds = [
        &include_bytes!("seeds/etc1s.ktx2")[..],
        include_bytes!("seeds/etc1s-alpha.ktx2"),
        include_bytes!("seeds/uastc.ktx2"),
        include_bytes!("seeds/uastc-zstd-alpha.ktx2"),
    ];
    run("ktx2", &seeds.map(<[u8]>::to_vec), 400, |_| (), read);
}

#[test]
fn hdr() {
    let mut newer = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 3 +X 16\n".to_vec();
    for row in 0..3u8 {
        newer.extend([2, 2, 0, 16, 16]);
        newer.extend((0..16).map(|i| 10 * i + row));
        newer.extend([128 + 16, 64, 128 + 10, 32, 6, 1, 2, 3, 4, 5, 6, 128 + 16, 130]);
    }
    let mut older = b"#?RGBE\nEXPOSURE=2\n\n+X 2 -Y 6\n".to_vec();
    for _ in 0..2 {
        older.extend([10, 20, 30, 136, 1, 1, 1, 3, 40, 50, 60, 136, 70, 80, 90, 250]);
    }
    run("hdr", &[newer, older], 400, |_| (), read);
}

fn chunk(name: &[u8; 4], data: &[u8]) -> Vec<u8> {
    let mut bytes = (data.len() as u32).to_be_bytes().to_vec();
    bytes.extend(name);
    bytes.extend(data);
    bytes.extend([0; 4]);
    bytes
}

fn packed(data: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(data).and_then(|()| encoder.finish()).expect("a stream")
}

/// A PNG of these chunks; `kind` is its bit depth and its colour type.
fn png_of(size: [u32; 2], kind: [u8; 2], chunks: &[Vec<u8>]) -> Vec<u8> {
    let mut header = size.map(u32::to_be_bytes).concat();
    header.extend([kind[0], kind[1], 0, 0, 0]);
    let mut bytes = b"\x89PNG\r\n\x1a\n".to_vec();
    bytes.extend(chunk(b"IHDR", &header));
    bytes.extend(chunks.concat());
    bytes.extend(chunk(b"IEND", &[]));
    with_checksums(&mut bytes);
    bytes
}

#[test]
fn palettes_of_all_lengths_are_read_or_refused() {
    for length in (0..32).chain(760..780) {
        for kind in [[1, 3], [2, 3], [4, 3], [8, 3]] {
            for alpha in [None, Some(0), Some(1), Some(4), Some(300)] {
                let mut chunks = vec![chunk(b"PLTE", &vec![7; length])];
                chunks.extend(alpha.map(|count| chunk(b"tRNS", &vec![9; count])));
                chunks.push(chunk(b"IDAT", &packed(&[0, 0b0101_0000])));
                let png = png_of([1, 1], kind, &chunks);
                let right = length % 3 == 0 && (3..=768).contains(&length);
                let (texture, picture) = (texture(&png), decode(&png));
                if !right {
                    let texture = texture.expect_err("a wrong palette").to_string();
                    assert!(texture.contains(&format!("its palette has {length} bytes")), "{texture}");
                    assert_eq!(picture.expect_err("a wrong palette").to_string(), texture);
                } else if alpha.is_none() {
                    assert!(texture.is_ok() && picture.is_ok(), "{length} {kind:?}");
                }
            }
        }
        // Without palette indices, a palette is only a suggestion.
        let chunks = [chunk(b"PLTE", &vec![7; length]), chunk(b"IDAT", &packed(&[0, 1, 2, 3]))];
        assert!(texture(&png_of([1, 1], [8, 2], &chunks)).is_ok());
    }
}

#[test]
fn what_unpacks_to_far_more_than_its_size_takes_no_more_memory_than_it_may() {
    let ends_early = |bytes: &[u8]| bytes[..bytes.len() - 40].to_vec();
    let large = packed(&vec![0; 10_000 * 10_001]);
    let whole = png_of([10_000, 10_000], [8, 0], &[chunk(b"IDAT", &large)]);
    assert!(texture(&whole).expect("it is whole")[0].contains("reading them took 100 MB"));
    bounded("png-cut-off", &ends_early(&whole), read);
    let pixel = chunk(b"IDAT", &packed(&[0, 1]));
    let profile = [b"p\0\0".to_vec(), large.clone()].concat();
    bounded("png-profile", &png_of([1, 1], [8, 0], &[chunk(b"iCCP", &profile), pixel.clone()]), |bytes| {
        assert!(texture(bytes).is_ok());
        read(bytes)
    });
    let texts = vec![chunk(b"zTXt", &profile); 50].concat();
    bounded("png-text", &png_of([1, 1], [8, 0], &[texts, pixel]), read);
    let webp = [
        b"RIFF\x22\0\0\0WEBPVP8L\x16\0\0\0\x2f\xfe\xbf\xff\x0f".to_vec(),
        vec![0x88, 0x88, 0x08, 0x88, 0x88, 0x88, 0x08],
        vec![0; 10],
    ];
    bounded("webp-one-colour", &webp.concat(), |bytes| {
        let error = texture(bytes).expect_err("too large");
        assert!(error.to_string().contains("16383 × 16383 pixels; unpacking it would take 2147 MB"), "{error}");
        read(bytes)
    });
    let mut runs = b"#?RGBE\n\n-Y 256 +X 1048576\n".to_vec();
    for _ in 0..256 {
        runs.extend([9, 9, 9, 130, 1, 1, 1, 0, 1, 1, 1, 0, 1, 1, 1, 15]);
        runs.extend([9, 9, 9, 130, 1, 1, 1, 255, 1, 1, 1, 255].repeat(15));
    }
    bounded("hdr-runs", &runs, read);
    // The size of a JPEG is five bytes after ff c0. Comments enlarge the file until it could hold the size.
    let mut jpeg = include_bytes!("../../src/image/testdata/ramp.jpg").to_vec();
    let at = jpeg.windows(2).position(|w| w == [0xff, 0xc0]).expect("a frame") + 5;
    jpeg[at..at + 4].copy_from_slice(&[0x2f, 0xff, 0x2f, 0xff]);
    let comment = [vec![0xff, 0xfe, 0xff, 0xff], vec![b'x'; 0xfffd]].concat();
    jpeg.splice(2..2, comment.repeat(16));
    bounded("jpeg-larger-than-it-is", &jpeg, read);
}

/// The offset of the block table in an EXR of one part.
fn table(bytes: &[u8]) -> usize {
    let mut at = 8;
    while bytes[at] != 0 {
        for _ in 0..2 {
            at += 1 + bytes[at..].iter().position(|b| *b == 0).expect("a name");
        }
        at += 4 + u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]) as usize;
    }
    at + 1
}

#[test]
fn blocks_of_an_exr_are_all_there_once_and_as_large_as_they_can_be() {
    let whole = exr_bytes(&ramp(&["Y"], [40, 40]), &[]);
    let at = table(&whole);
    let why = |bytes: &[u8]| {
        let error = texture(bytes).expect_err("a damaged file").to_string();
        assert_eq!(decode(bytes).expect_err("a damaged file").to_string(), error);
        error
    };
    let mut missing = whole.clone();
    missing[at..at + 8].fill(0);
    assert!(why(&missing).contains("it wasn't written to its end"));
    let mut twice = whole.clone();
    twice.copy_within(at..at + 8, at + 8);
    assert!(why(&twice).contains("blocks are missing"));
    // Windows of a gigapixel in equally few bytes.
    for (width, height) in [(1 << 20, 64), (64, 1 << 20), (16_383, 16_383)] {
        let mut large = whole.clone();
        let window = large.windows(10).position(|w| w == b"dataWindow").expect("a window") + 11 + 6 + 4;
        large[window + 8..window + 16].copy_from_slice(&[width - 1i32, height - 1].map(i32::to_le_bytes).concat());
        bounded("exr-window", &large, |bytes| {
            assert!(texture(bytes).is_err());
            read(bytes)
        });
    }
}

#[test]
fn an_exr_without_channels_is_refused() {
    let mut bytes = exr_bytes(&ramp(&["Y"], [4, 4]), &[]);
    let at = bytes.windows(6).position(|w| w == b"chlist").expect("channels") + 7;
    let size = u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]) as usize;
    bytes.splice(at..at + 4 + size, [1, 0, 0, 0, 0]);
    assert!(texture(&bytes).is_err() && decode(&bytes).is_err());
}

#[test]
fn deep_data_and_dwa_are_named() {
    let mut deep = exr_bytes(&ramp(&["Y"], [4, 4]), &[]);
    deep[5] |= 0x08;
    let error = texture(&deep).expect_err("deep data").to_string();
    assert_eq!(error, "the OpenEXR file has deep data, which isn't supported");
    for number in [8, 9] {
        let mut dwa = exr_bytes(&ramp(&["Y"], [4, 4]), &[]);
        let at = dwa.windows(11).position(|w| w == b"compression").expect("an attribute") + 12 + 12 + 4;
        dwa[at] = number;
        let error = texture(&dwa).expect_err("DWA");
        assert_eq!(error.to_string(), "the OpenEXR file has DWA compression, which isn't supported");
        assert!(error.help().is_some_and(|help| help.contains("save it with ZIP or PIZ")));
        assert_eq!(decode(&dwa).expect_err("DWA").help(), error.help());
    }
}
