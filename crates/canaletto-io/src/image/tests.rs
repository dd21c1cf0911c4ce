//! Tests of image formats with generated pictures and with damaged files.

use super::*;
use crate::assets::{AssetPath, Assets, MemoryAssets};
use crate::picture::{self, EncodeSettings, PictureFormat};
use canaletto::scene::Transfer;
use canaletto::texture::{ColorSpace, from_half};

fn read(bytes: Vec<u8>) -> Result<(Image, Vec<String>), ImageError> {
    let asset = MemoryAssets::new().with("a/picture", bytes).read("a/picture", &AssetPath::base()).expect("an asset");
    read_image(&asset)
}

fn png(image: &picture::Image, bits: u8, transfer: Transfer) -> Vec<u8> {
    let settings = EncodeSettings { bits: Some(bits), ..EncodeSettings::default() };
    PictureFormat::Png.encode_image(image, transfer, &settings, &[]).unwrap()
}

fn exr(image: &picture::Image) -> Vec<u8> {
    PictureFormat::Exr.encode_image(image, Transfer::None, &EncodeSettings::default(), &[]).unwrap()
}

/// Flips bits and cuts files; nothing may panic.
fn damage(whole: &[u8]) {
    for at in 0..whole.len().min(600) {
        for flip in [1, 0x80, 0xff] {
            let mut bytes = whole.to_vec();
            bytes[at] ^= flip;
            let _ = read(bytes);
        }
        let _ = read(whole[..at].to_vec());
    }
}

fn ramp(names: &[&str]) -> picture::Image {
    let channel = |c: usize| (0..12 * 5).map(|i| ((i * 7 + c * 29) % 61) as f32 / 60.0).collect();
    let channels = names.iter().enumerate();
    let channels = channels.map(|(c, name)| picture::Channel::new(*name, channel(c))).collect();
    picture::Image { width: 12, height: 5, channels }
}

#[test]
fn png_keeps_its_bits_and_says_what_its_numbers_mean() {
    for (names, channels) in [(&["Y"][..], 1), (&["Y", "A"], 2), (&["R", "G", "B"], 3), (&["R", "G", "B", "A"], 4)] {
        let picture = ramp(names);
        for bits in [8, 16] {
            let bytes = png(&picture, bits, Transfer::Srgb);
            let (image, notes) = read(bytes).unwrap();
            assert!(notes.is_empty() && image.name == "a/picture" && image.space == ColorSpace::Srgb);
            assert_eq!((image.width, image.height, image.channels), (12, 5, channels));
            image.check().unwrap();
            for i in 0..60 {
                for (c, channel) in picture.channels.iter().enumerate() {
                    let at = i * usize::from(channels) + c;
                    let (value, step) = match &image.samples {
                        Samples::U8(data) => (f32::from(data[at]) / 255.0, 0.5 / 255.0),
                        Samples::U16(data) => (f32::from(data[at]) / 65535.0, 0.5 / 65535.0),
                        _ => panic!("a PNG has integers"),
                    };
                    assert!((value - channel.data[i]).abs() <= step + 1e-6);
                }
            }
        }
    }
}

#[test]
fn a_gamma_of_its_own_is_made_linear() {
    let gray = picture::Image { width: 2, height: 1, channels: vec![picture::Channel::new("Y", vec![0.5, 1.0])] };
    let plain = png(&gray, 8, Transfer::None);
    let with = |gamma: u32| {
        let mut chunk = b"gAMA".to_vec();
        chunk.extend(gamma.to_be_bytes());
        let mut bytes = plain[..33].to_vec();
        bytes.extend(4u32.to_be_bytes());
        bytes.extend(&chunk);
        bytes.extend(crc(&chunk).to_be_bytes());
        bytes.extend(&plain[33..]);
        read(bytes).unwrap().0
    };
    assert_eq!((with(45455).space, with(100_000).space), (ColorSpace::Srgb, ColorSpace::Linear));
    let image = with(50_000);
    let expected = (128.0f64 / 255.0).powi(2) * 65535.0;
    let Samples::U16(data) = &image.samples else { panic!() };
    assert!(image.space == ColorSpace::Linear && (f64::from(data[0]) - expected).abs() < 1.0 && data[1] == 65535);
}

fn crc(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |c, _| if c & 1 == 1 { 0xedb8_8320 ^ (c >> 1) } else { c >> 1 })
    })
}

#[test]
fn exr_keeps_its_precision_and_its_order() {
    for names in [&["R", "G", "B"][..], &["R", "G", "B", "A"], &["Y"], &["Y", "A"]] {
        let picture = ramp(names);
        let (image, _) = read(exr(&picture)).unwrap();
        assert_eq!((image.width, image.height, usize::from(image.channels)), (12, 5, names.len()));
        assert!(image.space == ColorSpace::Linear && image.premultiplied == names.contains(&"A"));
        let Samples::F32(data) = &image.samples else { panic!() };
        for i in 0..60 {
            for (c, channel) in picture.channels.iter().enumerate() {
                assert_eq!(data[i * names.len() + c], channel.data[i]);
            }
        }
    }
    let other = exr(&ramp(&["depth.Z"]));
    assert!(read(other).unwrap_err().to_string().contains("the channels depth.Z instead of R G B or Y"));
}

/// What is no light doesn't take a picture: infinite texels count as the largest half float, those that are no numbers
/// as black, and negative ones stay for those who know what they mean.
#[test]
fn odd_texels_are_replaced_and_counted() {
    let odd = [f32::INFINITY, f32::NEG_INFINITY, 1e30, -3e38, 9e9, f32::NAN, -0.5];
    let mended = [65504.0, -65504.0, 65504.0, -65504.0, 9e9, 0.0, -0.5];
    let mut picture = ramp(&["R", "G", "B"]);
    for (at, number) in odd.into_iter().enumerate() {
        picture.channels[0].data[at] = number;
    }
    // A second number of a texel doesn't count again.
    picture.channels[2].data[0] = f32::INFINITY;
    let (image, notes) = read(exr(&picture)).unwrap();
    let Samples::F32(data) = &image.samples else { panic!() };
    assert!(mended.iter().enumerate().all(|(at, number)| data[3 * at] == *number), "{data:?}");
    assert!(image.check().is_ok() && image.samples.count_negative(3) == 3);
    let endless = "4 of its texels are infinite or beyond 1e10, which would outshine all others; such numbers are \
                   taken as 65504";
    assert_eq!(notes, [endless, "one of its texels is no number (NaN) and taken as 0"]);
}

#[test]
fn half_precision_exr_stays_half() {
    use ::exr::prelude as ex;
    use ::exr::prelude::WritableImage;
    let value = |at: ex::Vec2<usize>, c: f32| ex::f16::from_f32(at.0 as f32 + 10.0 * at.1 as f32 + c);
    let channels = ex::SpecificChannels::rgb(|at| (value(at, 0.0), value(at, 0.25), value(at, 0.5)));
    let mut bytes = std::io::Cursor::new(Vec::new());
    ex::Image::from_channels((7, 6), channels).write().to_buffered(&mut bytes).unwrap();
    let (image, _) = read(bytes.into_inner()).unwrap();
    let Samples::F16(data) = &image.samples else { panic!() };
    assert_eq!((from_half(data[(5 * 7 + 6) * 3]), from_half(data[7 * 3 + 2])), (56.0, 10.5));
}

/// A Radiance picture of 16 × 2: a run and single numbers in the newer packing.
fn hdr(size: &str) -> Vec<u8> {
    let mut bytes = format!("#?RADIANCE\n# a comment\nFORMAT=32-bit_rle_rgbe\nEXPOSURE=2\n\n{size}\n").into_bytes();
    for row in 0..2u8 {
        bytes.extend([2, 2, 0, 16]);
        bytes.push(16);
        bytes.extend((0..16).map(|i| 10 * i + row));
        bytes.extend([128 + 16, 64, 128 + 10, 32, 6, 1, 2, 3, 4, 5, 6]);
        bytes.extend([128 + 16, 130]);
    }
    bytes
}

#[test]
fn radiance_pictures_are_unpacked_and_turned() {
    let (image, _) = read(hdr("-Y 2 +X 16")).unwrap();
    assert_eq!((image.width, image.height, image.channels, image.space), (16, 2, 3, ColorSpace::Linear));
    let numbers = |image: &Image| -> Vec<f32> {
        let Samples::F16(data) = &image.samples else { panic!() };
        data.iter().map(|v| from_half(*v)).collect()
    };
    // m 2^(130 − 136)
    let data = numbers(&image);
    assert_eq!(data[..3], [0.0, 1.0, 0.5]);
    assert_eq!(data[(16 + 15) * 3..], [151.0 / 64.0, 1.0, 6.0 / 64.0]);
    let red = |size: &str| -> (u32, Vec<f32>) {
        let (image, _) = read(hdr(size)).unwrap();
        (image.width, numbers(&image).chunks(3).map(|t| (t[0] * 64.0).round()).collect())
    };
    let rows: Vec<f32> = (0..32).map(|i| f32::from(10 * (i % 16) as u8 + (i / 16) as u8)).collect();
    assert_eq!(red("-Y 2 +X 16"), (16, rows.clone()));
    let back = |i: usize| rows[i / 16 * 16 + 15 - i % 16];
    assert_eq!(red("-Y 2 -X 16"), (16, (0..32).map(back).collect()));
    assert_eq!(red("+Y 2 +X 16"), (16, (0..32).map(|i| rows[(i + 16) % 32]).collect()));
    // Scanlines are columns, from the top down.
    assert_eq!(red("+X 2 -Y 16"), (2, (0..32).map(|i| rows[i % 2 * 16 + i / 2]).collect()));
    // The older packing, and unpacked texels.
    let mut bytes = b"#?RGBE\n\n-Y 1 +X 6\n".to_vec();
    bytes.extend([10, 20, 30, 136, 1, 1, 1, 3, 40, 50, 60, 136, 70, 80, 90, 250]);
    let Samples::F32(data) = read(bytes).unwrap().0.samples else { panic!("e = 250 is beyond half precision") };
    assert_eq!(data[9..15], [10.0, 20.0, 30.0, 40.0, 50.0, 60.0]);
}

#[test]
fn jpeg_and_webp_come_close_to_what_was_packed() {
    // Other programs made both files from one 16 × 16 picture, red to the right and green downwards.
    for (bytes, bound) in [(&include_bytes!("testdata/ramp.jpg")[..], 12), (include_bytes!("testdata/ramp.webp"), 1)] {
        let (image, notes) = read(bytes.to_vec()).unwrap();
        assert_eq!((image.width, image.height, image.channels, image.space), (16, 16, 3, ColorSpace::Srgb));
        assert!(notes.is_empty() && image.check().is_ok());
        let Samples::U8(data) = &image.samples else { panic!() };
        for (i, texel) in data.chunks(3).enumerate() {
            let expected = [i % 16 * 16, i / 16 * 16, 128];
            for c in 0..3 {
                assert!((i32::from(texel[c]) - expected[c] as i32).abs() <= bound, "{i}: {texel:?} for {expected:?}");
            }
        }
        for at in [20, bytes.len() / 2, bytes.len() - 20] {
            assert!(read(bytes[..at].to_vec()).is_err(), "cut at {at}");
        }
    }
}

/// Inserts bytes before each segment of a JPEG's header except the first.
fn with_bytes_between(jpeg: &[u8], extra: &[u8]) -> Vec<u8> {
    let (mut bytes, mut at) = (jpeg[..2].to_vec(), 2);
    loop {
        let length = usize::from(u16::from_be_bytes([jpeg[at + 2], jpeg[at + 3]])) + 2;
        if jpeg[at + 1] == 0xda {
            bytes.extend(extra);
            bytes.extend(&jpeg[at..]);
            return bytes;
        }
        bytes.extend(extra);
        bytes.extend(&jpeg[at..at + length]);
        at += length;
    }
}

#[test]
fn bytes_between_the_segments_of_a_jpeg_change_nothing() {
    let progressive = &include_bytes!("../../tests/fuzz/seeds/progressive.jpg")[..];
    for jpeg in [&include_bytes!("testdata/ramp.jpg")[..], progressive] {
        let plain = read(jpeg.to_vec()).unwrap();
        let comment: &[u8] = b"\xff\xfe\0\x06text";
        let icc: &[u8] = b"\xff\xe2\0\x12ICC_PROFILE\0\x01\x01xx";
        for extra in
            [&b"\0\0\0\0"[..], b"some words", b"\xff\xff\xff\xff\xff\xff", b"\xff\0\xff\0\xff\0a", comment, icc]
        {
            assert_eq!(read(with_bytes_between(jpeg, extra)).unwrap(), plain, "{extra:?}");
        }
        let behind = [jpeg, b"and more"].concat();
        assert_eq!(read(behind).unwrap(), plain);
    }
}

#[test]
fn kinds_of_jpeg_that_are_not_read_are_named() {
    let jpeg = include_bytes!("testdata/ramp.jpg");
    let frame = jpeg.windows(2).position(|w| w == [0xff, 0xc0]).expect("a frame");
    let patched = |at: usize, byte: u8| {
        let mut bytes = jpeg.to_vec();
        bytes[frame + at] = byte;
        read(bytes).unwrap_err().to_string()
    };
    for (code, what) in [
        (0xc3, "lossless coding"),
        (0xc5, "hierarchical coding"),
        (0xc7, "hierarchical coding"),
        (0xc9, "arithmetic coding"),
        (0xca, "arithmetic coding"),
        (0xcb, "arithmetic coding"),
        (0xf7, "JPEG-LS coding"),
    ] {
        assert_eq!(patched(1, code), format!("the JPEG file has {what}, which isn't supported"));
    }
    assert_eq!(patched(4, 12), "the JPEG file has 12 bits for each number, which isn't supported");
    assert_eq!(patched(9, 2), "the JPEG file has 2 components, which isn't supported");
    let height = patched(5, 0x80);
    assert!(height.contains("16 × 32784 pixels, which its"), "{height}");
    let mut flat = jpeg.to_vec();
    flat[frame + 5..frame + 7].fill(0);
    assert!(read(flat).unwrap_err().to_string().contains("its height behind the picture (DNL)"));
}

#[test]
fn other_formats_are_named() {
    let why = |bytes: &[u8]| read(bytes.to_vec()).unwrap_err().to_string();
    assert_eq!(why(b"II*\0\x08\0\0\0"), "its format is TIFF, which isn't read");
    assert_eq!(why(b"\0\0\0\x20ftypheic"), "its format is HEIF, which isn't read");
    assert_eq!(why(b"GIF89a"), "its format is GIF, which isn't read");
    assert_eq!(why(b"nothing"), "it is no image that can be read");
    let xyze = b"#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 1 +X 1\n\0\0\0\0";
    let named = "the Radiance HDR file has the pixel format 32-bit_rle_xyze, which isn't supported";
    assert_eq!(why(xyze), named);
}

#[test]
fn cmyk_of_adobe_is_turned_into_colour() {
    let cmyk = include_bytes!("../../tests/fuzz/seeds/cmyk.jpg");
    let (image, _) = read(cmyk.to_vec()).unwrap();
    let Samples::U8(data) = &image.samples else { panic!() };
    // The values that Pillow 12 decodes.
    let pillow = [(0, 0, [1u8, 0, 0]), (5, 5, [50, 75, 24]), (20, 10, [200, 151, 200]), (23, 16, [230, 241, 111])];
    for (x, y, expected) in pillow {
        let texel = &data[3 * (y * 24 + x)..][..3];
        assert!((0..3).all(|c| texel[c].abs_diff(expected[c]) <= 2), "{x} {y}: {texel:?} for {expected:?}");
    }
    let mut plain = cmyk.to_vec();
    let adobe = plain.windows(5).position(|w| w == b"Adobe").expect("a marker");
    plain[adobe] = b'a';
    assert!(read(plain).unwrap_err().to_string().contains("CMYK without Adobe's marker"));
}

#[test]
fn damage_never_panics() {
    damage(&png(&ramp(&["R", "G", "B", "A"]), 16, Transfer::Srgb));
    damage(&exr(&ramp(&["R", "G", "B"])));
    damage(&hdr("-Y 2 +X 16"));
    damage(include_bytes!("testdata/ramp.jpg"));
    damage(include_bytes!("testdata/ramp.webp"));
}

#[test]
fn what_announces_too_much_is_refused_before_memory_is_taken() {
    let (empty, huge) = (read(hdr("-Y 0 +X 16")).unwrap_err(), read(hdr("-Y 2 +X 1048577")).unwrap_err());
    assert_eq!(empty.to_string(), "the Radiance HDR file announces an image of 16 × 0 pixels; it needs at least one");
    assert!(huge.to_string().contains("1048577 × 2 pixels; the most are 268435456 in all and 1048576 in a row"));
    // The size of a JPEG is five bytes after ff c0.
    let mut jpeg = include_bytes!("testdata/ramp.jpg").to_vec();
    let at = jpeg.windows(2).position(|w| w == [0xff, 0xc0]).expect("a frame") + 5;
    jpeg[at..at + 4].copy_from_slice(&[0x3f, 0xff, 0x3f, 0xff]);
    assert!(matches!(read(jpeg).unwrap_err(), ImageError::ExceedsFile { width: 16383, height: 16383, .. }));
    // A WebP of one colour may have any size, so the message reports its memory.
    let mut webp = include_bytes!("testdata/ramp.webp").to_vec();
    let at = webp.windows(4).position(|w| w == b"VP8L" || w == b"VP8 ").expect("a picture");
    match webp[at + 3] {
        b'L' => webp[at + 9..at + 13].copy_from_slice(&[0xfe, 0xbf, 0xff, 0x0f]),
        _ => webp[at + 14..at + 18].copy_from_slice(&[0xff, 0x3f, 0xff, 0x3f]),
    }
    let error = read(webp).unwrap_err();
    assert!(
        matches!(error, ImageError::TooDense { width: 16383, height: 16383, memory: 2_147_221_512, .. }),
        "{error}"
    );
    assert!(error.to_string().contains("2147 MB") && error.help().is_some_and(|help| help.contains("PNG")));
}
