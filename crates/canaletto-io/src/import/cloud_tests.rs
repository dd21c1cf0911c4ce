use super::*;
use crate::assets::AssetPath;

fn asset(bytes: impl Into<Vec<u8>>) -> Asset {
    Asset { path: AssetPath::new("a.csv", "a.csv", "a.csv"), bytes: bytes.into() }
}

fn spheres(text: &str) -> SphereCloud {
    read_spheres(&asset(text), CloudFormat::Text, Some(2.0)).unwrap()
}

fn error(text: &str) -> String {
    read_spheres(&asset(text), CloudFormat::Text, Some(2.0)).unwrap_err().to_string()
}

#[test]
fn rows_may_be_separated_in_every_usual_way() {
    for text in [
        "1 2 3 4\n5 6 7 8\n",
        "1,2,3,4\r\n5, 6 ,7,8",
        "# x\n\n1;2;3;4\n // y\n5;6;7;8\n",
        "\u{feff}1\t2\t3\t4\n5\t6\t7\t8\n",
    ] {
        let cloud = spheres(text);
        assert_eq!(
            (cloud.centers.len(), cloud.centers[1], cloud.radii.as_slice()),
            (2, Vec3::new(5., 6., 7.), &[4.0, 8.0][..]),
            "{text}"
        );
    }
}

#[test]
fn the_number_of_columns_says_what_they_are() {
    let cloud = spheres("1 2 3\n");
    assert_eq!((cloud.radii.as_slice(), cloud.colors.len()), (&[2.0][..], 0));
    let cloud = spheres("1 2 3 0.1 0.2 0.3\n");
    assert_eq!((cloud.radii.as_slice(), cloud.colors.as_slice()), (&[2.0][..], &[Rgb::new(0.1, 0.2, 0.3)][..]));
    let cloud = spheres("1 2 3 9 0.1 0.2 0.3\n");
    assert_eq!((cloud.radii.as_slice(), cloud.colors.as_slice()), (&[9.0][..], &[Rgb::new(0.1, 0.2, 0.3)][..]));
}

#[test]
fn a_first_row_may_name_the_columns() {
    let cloud = spheres("id,\"Radius\",z,y,x\n7,0.5,3,2,1\n");
    assert_eq!((cloud.centers[0], cloud.radii[0]), (Vec3::new(1., 2., 3.), 0.5));
    let cloud = spheres("x y z r g b\n1 2 3 0.1 0.2 0.3\n");
    assert_eq!((cloud.colors[0], cloud.radii[0]), (Rgb::new(0.1, 0.2, 0.3), 2.0));
    assert_eq!(spheres("x y z r\n1 2 3 4\n").radii, [4.0]);
}

#[test]
fn cylinders_have_two_ends() {
    let cloud = read_cylinders(&asset("0 0 0 1 1 1 0.5\n"), CloudFormat::Text, None).unwrap();
    assert_eq!((cloud.axes.as_slice(), cloud.radii[0], cloud.caps), (&[[Vec3::ZERO, Vec3::ONE]][..], 0.5, true));
    let error = read_cylinders(&asset("0 0 0 0 0 0 1\n"), CloudFormat::Text, None).unwrap_err().to_string();
    assert!(error.contains("cylinder 1 has no length"), "{error}");
}

#[test]
fn binary_records_are_little_endian() {
    let bytes: Vec<u8> = [1f32, 2., 3., 0.5, 4., 5., 6., 0.25].iter().flat_map(|v| v.to_le_bytes()).collect();
    let cloud = read_spheres(&asset(bytes.clone()), CloudFormat::Binary, None).unwrap();
    assert_eq!((cloud.centers[1], cloud.radii.as_slice()), (Vec3::new(4., 5., 6.), &[0.5, 0.25][..]));
    let error = |bytes: &[u8]| read_spheres(&asset(bytes), CloudFormat::Binary, None).unwrap_err().to_string();
    assert!(error(&bytes[1..]).contains("its 31 bytes are not a whole number of records of 16 bytes (x y z radius"));
    assert!(error(&[0; 32]).contains("record 0 (from 0): radius is 0; it must be more than 0"));
    assert!(error(&[0xff; 16]).contains("record 0 (from 0) has a number that isn't finite"));
    let cylinder: Vec<u8> = [0f32, 0., 0., 1., 1., 1., 0.5].iter().flat_map(|v| v.to_le_bytes()).collect();
    assert_eq!(read_cylinders(&asset(cylinder), CloudFormat::Binary, None).unwrap().axes.len(), 1);
}

#[test]
fn errors_name_row_and_column() {
    for (text, message) in [
        ("1 2 3\n1 2 q\n", "a.csv:2:5: error: column 3 (z): \"q\" is not a number"),
        ("1,2,3\n1,,3\n", "a.csv:2:3: error: column 2 (y): \"\" is not a number"),
        ("1 2 3 4\n1 2 3\n", "a.csv:2:1: error: this row has 3 columns, and the first one 4"),
        ("1 2 3 4\n1 2 3 0\n", "a.csv:2:7: error: column 4: radius is 0; it must be more than 0"),
        ("1 2\n", "a row has 2 columns, but it should have 3, 4, 6 or 7"),
        ("a b c\n1 2 3\n", "the first row names no column `x`"),
        ("1 2 3 255 0 0\n", "column 4: red is 255; it must be between 0 and 1"),
        ("1;2,5;3\n", "\"2,5\" is not a number"),
        ("", "a.csv: error: there are no rows in it"),
    ] {
        let found = error(text);
        assert!(found.contains(message), "{text}: {found}");
    }
    let found = read_spheres(&asset("1 2 3\n"), CloudFormat::Text, None).unwrap_err().to_string();
    assert!(found.contains("the file has no radii") && found.contains("help: give one `radius`"), "{found}");
}

#[test]
fn pieces_join_in_order() {
    let text: String = (0..300_000).map(|i| format!("{i} 0 {}.5 1\n", -i)).collect();
    let cloud = spheres(&text);
    assert_eq!(cloud.centers.len(), 300_000);
    assert!(cloud.centers.iter().enumerate().all(|(i, c)| c.x == i as f32));
    let wrong = text.replace("299999 0", "299999 x");
    assert!(error(&wrong).starts_with("a.csv:300000:8: error: column 2 (y)"));
}
