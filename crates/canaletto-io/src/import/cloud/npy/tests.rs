use super::super::{CloudFormat, CloudSettings, read_cylinders, read_spheres};
use crate::assets::{Asset, AssetPath};
use crate::import::{Colormap, ColumnColors};
use canaletto::math::Rgb;
use canaletto::shape::SphereCloud;
use canaletto::texture::ColorSpace;
use glam::Vec3;

/// A file with this type and shape as NumPy 2.4 writes it, and these bytes of numbers.
fn npy(descr: &str, fortran: bool, shape: &str, data: &[u8]) -> Vec<u8> {
    let order = if fortran { "True" } else { "False" };
    let mut header = format!("{{'descr': {descr}, 'fortran_order': {order}, 'shape': {shape}, }}");
    header.push_str(&" ".repeat(64 - (header.len() + 11) % 64));
    header.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(data);
    bytes
}

fn read(bytes: &[u8], settings: impl Into<CloudSettings>) -> Result<(SphereCloud, String), String> {
    let asset = Asset { path: AssetPath::new("a.npy", "a.npy", "a.npy"), bytes: bytes.to_vec() };
    let read = read_spheres(&asset, CloudFormat::Numpy, settings.into());
    read.map(|(cloud, said)| (cloud, said.to_string())).map_err(|e| e.to_string())
}

fn hex(text: &str) -> Vec<u8> {
    text.as_bytes().chunks(2).map(|pair| u8::from_str_radix(std::str::from_utf8(pair).unwrap(), 16).unwrap()).collect()
}

/// The numbers 1 to 8 as rows of four.
#[test]
fn every_type_of_both_orders_is_read() {
    fn check<const N: usize>(code: &str, little: fn(u8) -> [u8; N]) {
        for big in [false, true] {
            for fortran in [false, true] {
                let mut data = Vec::new();
                for i in 0..8u8 {
                    let number = if fortran { i % 2 * 4 + i / 2 } else { i } + 1;
                    let mut bytes = little(number);
                    if big {
                        bytes.reverse();
                    }
                    data.extend(bytes);
                }
                let descr = format!("'{}{code}'", if big { '>' } else { '<' });
                let (cloud, said) = read(&npy(&descr, fortran, "(2, 4)", &data), None).unwrap();
                assert_eq!(cloud.centers, [Vec3::new(1.0, 2.0, 3.0), Vec3::new(5.0, 6.0, 7.0)], "{descr} {fortran}");
                assert_eq!((cloud.radii, said.as_str()), (vec![4.0, 8.0], ""), "{descr} {fortran}");
            }
        }
    }
    check("f4", |v| f32::from(v).to_le_bytes());
    check("f8", |v| f64::from(v).to_le_bytes());
    check("i1", |v| (v as i8).to_le_bytes());
    check("i2", |v| i16::from(v).to_le_bytes());
    check("i4", |v| i32::from(v).to_le_bytes());
    check("i8", |v| i64::from(v).to_le_bytes());
    check("u1", |v| [v]);
    check("u2", |v| u16::from(v).to_le_bytes());
    check("u4", |v| u32::from(v).to_le_bytes());
    check("u8", |v| u64::from(v).to_le_bytes());
    let (cloud, _) = read(&npy("'|b1'", false, "(1, 3)", &[1, 0, 1]), Some(2.0)).unwrap();
    assert_eq!(cloud.centers, [Vec3::new(1.0, 0.0, 1.0)]);
    let (cloud, _) = read(&npy("'<i2'", false, "(1, 3)", &[255, 255, 0, 128, 5, 0]), Some(2.0)).unwrap();
    assert_eq!(cloud.centers, [Vec3::new(-1.0, -32768.0, 5.0)]);
}

#[test]
fn formats_2_and_3_and_headers_of_python_2_are_read() {
    let data: Vec<u8> = [1f32, 2.0, 3.0, 4.0].iter().flat_map(|v| v.to_le_bytes()).collect();
    for major in [2, 3] {
        let header = "{'descr': '<f4', 'fortran_order': False, 'shape': (1L, 4L), }\n";
        let mut bytes = vec![0x93, b'N', b'U', b'M', b'P', b'Y', major, 0];
        bytes.extend((header.len() as u32).to_le_bytes());
        bytes.extend(header.as_bytes());
        bytes.extend(&data);
        assert_eq!(read(&bytes, None).unwrap().0.radii, [4.0]);
    }
}

/// Bytes of NumPy 2.4: `np.save` of a structured array, whose colours are bytes.
#[test]
fn fields_with_names_are_columns() {
    let descr = "[('x', '<f8'), ('y', '<f8'), ('z', '<f8'), ('radius', '<f4'), ('red', '|u1'), ('green', '|u1'), \
                 ('blue', '|u1')]";
    let data = b"\x00\x00\x00\x00\x00\x00\xf0?\x00\x00\x00\x00\x00\x00\x00@\x00\x00\x00\x00\x00\x00\x08@\x00\x00\x00?\
        \xff\x80\x00\x00\x00\x00\x00\x00\x00\x10@\x00\x00\x00\x00\x00\x00\x14@\x00\x00\x00\x00\x00\x00\x18@\
        \x00\x00\x80>\x00\xff\xff";
    let bytes = npy(descr, false, "(2,)", data);
    let (cloud, said) = read(&bytes, None).unwrap();
    assert_eq!(cloud.centers, [Vec3::new(1.0, 2.0, 3.0), Vec3::new(4.0, 5.0, 6.0)]);
    assert_eq!((cloud.radii.as_slice(), said.as_str()), (&[0.5, 0.25][..], ""));
    // 128 of 255 on the curve of IEC 61966-2-1.
    let half = 0.215_860_5;
    assert!((cloud.colors[0].g - half).abs() < 1e-6 && cloud.colors[0].r == 1.0, "{:?}", cloud.colors);
    let linear = CloudSettings { colors: Some(ColorSpace::Linear), ..CloudSettings::default() };
    assert_eq!(read(&bytes, linear).unwrap().0.colors[0], Rgb::new(1.0, 128.0 / 255.0, 0.0));
}

/// Bytes of NumPy 2.4 with a field of three numbers, a text and a number for the colour map.
#[test]
fn a_vector_and_a_text_may_stand_in_a_row() {
    let descr = "[('pos', '>f4', (3,)), ('label', '<U4'), ('value', '<i2')]";
    let data =
        b"?\x80\x00\x00@\x00\x00\x00@@\x00\x00a\x00\x00\x00b\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x07\x00";
    let bytes = npy(descr, false, "(1,)", data);
    let map = |column: &str, range: [Option<f64>; 2]| CloudSettings {
        radius: Some(1.0),
        colormap: Some(ColumnColors { map: Colormap::Plasma, column: column.to_owned(), range }),
        ..CloudSettings::default()
    };
    let (cloud, said) = read(&bytes, map("Value", [Some(0.0), Some(14.0)])).unwrap();
    assert_eq!((cloud.centers[0], cloud.colors[0]), (Vec3::new(1.0, 2.0, 3.0), Colormap::Plasma.color(0.5)));
    assert!(said.contains("the column label is left out"), "{said}");
    let error = read(&bytes, map("label", [None; 2])).unwrap_err();
    assert!(error.contains("column \"label\" holds no numbers that are read"), "{error}");
    let error = read(&bytes, map("mass", [None; 2])).unwrap_err();
    assert!(error.contains("there is no column \"mass\"") && error.contains("x, y, z, label, value"), "{error}");
}

#[test]
fn columns_may_be_named_by_the_scene() {
    let data: Vec<u8> = [0.5f64, 1.0, 2.0, 3.0, f64::NAN, 4.0, 5.0, 6.0].iter().flat_map(|v| v.to_le_bytes()).collect();
    let bytes = npy("'<f8'", false, "(2, 4)", &data);
    let columns: Vec<String> = ["heat", "z", "y", "x"].map(str::to_owned).into();
    let colormap = Some(ColumnColors { map: Colormap::Turbo, column: "heat".into(), range: [None; 2] });
    let named = CloudSettings { radius: Some(1.0), columns: columns.clone(), ..CloudSettings::default() };
    let (cloud, said) = read(&bytes, named.clone()).unwrap();
    assert_eq!(cloud.centers, [Vec3::new(3.0, 2.0, 1.0), Vec3::new(6.0, 5.0, 4.0)]);
    assert!(said.contains("the column heat is left out"), "{said}");
    let error = read(&bytes, CloudSettings { colormap, ..named.clone() }).unwrap_err();
    assert!(error.contains("a.npy: error: row 2: heat isn't a finite number, which the colour map needs"), "{error}");
    let few = CloudSettings { columns: columns[1..].into(), ..named };
    assert!(read(&bytes, few).unwrap_err().contains("the array has 4 columns, but columns has 3 names"));
}

/// Bytes of NumPy 2.4: `np.savez(f, cloud=a)` and `np.savez_compressed(f, cloud=a, other=s)`.
#[test]
fn archives_are_read() {
    let stored = hex(concat!(
        "504b03042d000000000000002100176f88abffffffffffffffff09001400636c6f75642e6e707901001000a0000000000000",
        "00a000000000000000934e554d5059010076007b276465736372273a20273c6634272c2027666f727472616e5f6f72646572",
        "273a2046616c73652c20277368617065273a2028322c2034292c207d20202020202020202020202020202020202020202020",
        "2020202020202020202020202020202020202020202020202020202020202020202020200a0000803f000000400000404000",
        "0080400000a0400000c0400000e04000000041504b01022d032d000000000000002100176f88aba0000000a0000000090000",
        "000000000000000000800100000000636c6f75642e6e7079504b0506000000000100010037000000db0000000000",
    ));
    let packed = hex(concat!(
        "504b03042d000000080000002100176f88abffffffffffffffff09001400636c6f75642e6e707901001000a0000000000000",
        "005e000000000000009bec17ea1b10c9c850c650ad9e925a9c5ca46ea5a06e9366a2aea3a09e965f54529498179f5f94920a",
        "12774bcc294e058a17672416a402f91a463a0a269a3a0ab50a64032e0686067b060606072002e206205e00c40780f8011033",
        "380200504b03042d0000000800000021008dea7748ffffffffffffffff090014006f746865722e6e7079010010003e010000",
        "0000000094000000000000009bec17ea1b10c9c8f08da15a3d25b538b948dd4a215a43bd425d4741dd26cd425d53474143bd",
        "12855785c22b4a4cc92c2d8608994085525340fc9a5243083fbd2835350f452429a734152e100b64a4e517951425e6c5e717",
        "a5a4829ce09698539c0a142fce482c4805f2358c74801a6b15a80db818c0e0833d84667080501c20dafe7f035454002a2c02",
        "a5258074831dc3ffff00504b01022d032d000000080000002100176f88ab5e000000a0000000090000000000000000000000",
        "800100000000636c6f75642e6e7079504b01022d032d0000000800000021008dea7748940000003e01000009000000000000",
        "00000000008001990000006f746865722e6e7079504b050600000000020002006e000000680100000000",
    ));
    let named = |array: &str| CloudSettings { array: Some(array.to_owned()), ..CloudSettings::default() };
    let centers = [Vec3::new(1.0, 2.0, 3.0), Vec3::new(5.0, 6.0, 7.0)];
    assert_eq!(read(&stored, None).unwrap().0.centers, centers);
    assert_eq!(read(&packed, named("cloud")).unwrap().0.centers, centers);
    assert_eq!(read(&packed, named("other")).unwrap().0.colors.len(), 2);
    let error = read(&packed, None).unwrap_err();
    assert!(
        error.contains("it has 2 arrays") && error.contains("choose one with array=\"…\": cloud, other"),
        "{error}"
    );
    let error = read(&packed, named("mass")).unwrap_err();
    assert!(error.contains("there is no array \"mass\" in it") && error.contains("cloud, other"), "{error}");
    // Every cut and every changed byte gives a message or the array; never a panic.
    for archive in [&stored, &packed] {
        for at in 0..archive.len() {
            let _ = read(&archive[..at], named("cloud"));
            for bit in [1, 0x80, 0xff] {
                let mut wrong = archive.clone();
                wrong[at] ^= bit;
                if let Ok((cloud, _)) = read(&wrong, named("cloud")) {
                    assert!(cloud.check().is_ok());
                }
            }
        }
    }
    // A changed number in a packed array is noticed by its checksum.
    let mut wrong = stored.clone();
    let number = wrong.windows(4).position(|bytes| bytes == [0, 0, 0x80, 0x3f]).unwrap();
    wrong[number + 3] = 0x3e;
    assert!(read(&wrong, None).unwrap_err().contains("is damaged"), "a wrong number was read");
}

#[test]
fn what_is_no_table_gets_a_message() {
    let eight = [0u8; 8];
    for (bytes, message) in [
        (npy("'|O'", false, "(2, 4)", &eight), "it holds Python objects, which are pickled"),
        (npy("[('x', '<f8'), ('o', '|O')]", false, "(2,)", &eight), "it holds Python objects, which are pickled"),
        (npy("'<c8'", false, "(1, 4)", &[0; 32]), "its type \"<c8\" isn't read"),
        (npy("'<f2'", false, "(1, 4)", &eight), "its type \"<f2\" isn't read"),
        (npy("'<f8'", false, "(4,)", &[0; 32]), "its shape is (4); a table has rows and columns"),
        (npy("'<f8'", false, "()", &eight), "its shape is (); a table has rows and columns"),
        (npy("'<f8'", false, "(1, 2, 2)", &[0; 32]), "its shape is (1, 2, 2)"),
        (npy("'<f8'", false, "(3, 100000)", &[0; 64]), "it has 100000 columns, and at most 4096 are read"),
        (npy("'<f4'", false, "(1, 5)", &[0; 20]), "a row has 5 columns, but it should have 3, 4, 6 or 7"),
        (npy("'<f8'", false, "(2, 4)", &[0; 63]), "2 rows of 4 × 8 bytes are 64 bytes, but only 63 follow the header"),
        (
            npy("'<f8'", false, "(18446744073709551615, 4)", &eight),
            "rows of 4 × 8 bytes are more bytes than can be counted, but only 8 follow",
        ),
        (npy("'<f8'", false, "(99999999999999999999, 4)", &eight), "its header can't be understood"),
        (npy("[('x', '<f8', (4000, 4000))]", false, "(1,)", &eight), "field \"x\" has too many numbers"),
        (npy("[('a', '<f8'), ('b', '<f8')]", false, "(0,)", &[]), "the array names no column `x`"),
        (npy("'<f8'", false, "(0, 3)", &[]), "there are no rows in it"),
        (npy("'<V99999999999999999999'", false, "(1,)", &eight), "isn't known"),
        (npy(&"[".repeat(4000), false, "(1,)", &eight), "its header can't be understood"),
        (b"\x93NUMPY\x04\x00\x00\x00".to_vec(), "its format is 4.0, and 1.0 to 3.0 are read"),
        (b"\x93NUMPY\x02\x00\xff\xff\xff\xff".to_vec(), "its header would have 4294967295 bytes"),
        (b"\x93NUMPY\x01\x00\xff\x00{".to_vec(), "its header is cut off"),
        (b"1 2 3 4".to_vec(), "it is no NPY file"),
        (b"PK\x03\x04".to_vec(), "the archive is damaged or cut off"),
        (npy("'<f4'", false, "(1, 4)", &[0; 16]), "row 1: radius is 0; it must be more than 0"),
    ] {
        let error = read(&bytes, None).unwrap_err();
        assert!(error.contains(message), "{error}, not {message}");
    }
    let nan = [f32::NAN, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 2.0].map(f32::to_le_bytes).concat();
    let (cloud, said) = read(&npy("'<f4'", false, "(2, 4)", &nan), None).unwrap();
    assert!(cloud.radii == [2.0] && said.contains("1 of 2 rows are left out") && said.contains("the first is row 1"));
}

#[test]
fn cylinders_are_read() {
    let data = [0f32, 0.0, 0.0, 0.0, 2.0, 0.0, 0.5].map(f32::to_le_bytes).concat();
    let asset = Asset { path: AssetPath::new("a.npy", "a.npy", "a.npy"), bytes: npy("'<f4'", false, "(1, 7)", &data) };
    let (cloud, _) = read_cylinders(&asset, CloudFormat::Numpy, None).unwrap();
    assert_eq!((cloud.axes[0], cloud.radii[0]), ([Vec3::ZERO, Vec3::Y * 2.0], 0.5));
}
