use super::*;
use crate::assets::AssetPath;
use crate::import::{Colormap, ColumnColors};
use canaletto::math::Rgb;

fn asset(bytes: impl Into<Vec<u8>>) -> Asset {
    Asset { path: AssetPath::new("a.csv", "a.csv", "a.csv"), bytes: bytes.into() }
}

fn spheres(text: &str) -> SphereCloud {
    read_spheres(&asset(text), CloudFormat::Text, Some(2.0)).unwrap().0
}

/// The warnings about spheres.
fn said(text: impl Into<Vec<u8>>) -> String {
    read_spheres(&asset(text), CloudFormat::Text, Some(2.0)).unwrap().1.to_string()
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
    let cloud = read_cylinders(&asset("0 0 0 1 1 1 0.5\n"), CloudFormat::Text, None).unwrap().0;
    assert_eq!((cloud.axes.as_slice(), cloud.radii[0], cloud.caps), (&[[Vec3::ZERO, Vec3::ONE]][..], 0.5, true));
    let error = read_cylinders(&asset("0 0 0 0 0 0 1\n"), CloudFormat::Text, None).unwrap_err().to_string();
    assert!(error.contains("cylinder 1 has no length"), "{error}");
}

#[test]
fn binary_records_are_little_endian() {
    let bytes: Vec<u8> = [1f32, 2., 3., 0.5, 4., 5., 6., 0.25].iter().flat_map(|v| v.to_le_bytes()).collect();
    let cloud = read_spheres(&asset(bytes.clone()), CloudFormat::Binary, None).unwrap().0;
    assert_eq!((cloud.centers[1], cloud.radii.as_slice()), (Vec3::new(4., 5., 6.), &[0.5, 0.25][..]));
    let error = |bytes: &[u8]| read_spheres(&asset(bytes), CloudFormat::Binary, None).unwrap_err().to_string();
    assert!(error(&bytes[1..]).contains("its 31 bytes are not a whole number of records of 16 bytes (x y z radius"));
    assert!(error(&[0; 32]).contains("record 0 (from 0): radius is 0; it must be more than 0"));
    assert!(
        error(&[0xff; 16]).contains("1 of 1 records are left out, as a coordinate or the radius isn't a finite number")
    );
    let odd = [&bytes[..], &[0xff; 16]].concat();
    let (cloud, said) = read_spheres(&asset(odd), CloudFormat::Binary, None).unwrap();
    assert_eq!(cloud.centers.len(), 2);
    assert!(said.to_string().contains("1 of 3 records are left out") && said.to_string().contains("number 3 of them"));
    let cylinder: Vec<u8> = [0f32, 0., 0., 1., 1., 1., 0.5].iter().flat_map(|v| v.to_le_bytes()).collect();
    assert_eq!(read_cylinders(&asset(cylinder), CloudFormat::Binary, None).unwrap().0.axes.len(), 1);
}

#[test]
fn errors_name_row_and_column() {
    for (text, message) in [
        ("1 2 3\n1 2 q\n", "a.csv:2:5: error: column 3 (z): \"q\" is not a number"),
        ("1 2 3 4\n1 2 3\n", "a.csv:2:1: error: this row has 3 columns, and the first one 4"),
        ("1 2 3 4\n1 2 3 0\n", "a.csv:2:7: error: column 4: radius is 0; it must be more than 0"),
        ("1 2\n", "a row has 2 columns, but it should have 3, 4, 6 or 7"),
        ("a b c\n1 2 3\n", "the first row names no column `x`"),
        ("1;2,5,5;3\n", "\"2,5,5\" is not a number"),
        ("1,5 2,5 3,5\n", "\"5 2\" is not a number\n1 | 1,5 2,5 3,5\n  |   ^^^\n  help: are these decimal commas?"),
        ("nan nan nan\n", "a.csv: error: 1 of 1 rows are left out"),
        ("\"x\",\"y\"\n1,2\n", "names no column `z`"),
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

#[test]
fn cells_may_stand_in_quotes() {
    let rows = "\"X\",\"Y\",\"Z\",\"Radius\"\n\"0\",\"0\",\"0\",\"0.5\"\n\"1\",\"0\",\"0\",\"0.5\"\n";
    for text in [
        rows.to_owned(),
        rows.replace(',', ";"),
        rows.replace(',', "\t"),
        rows.replace(',', " , "),
        rows.replace("\",", "\" ,"),
        rows.replace(',', " "),
        rows.replace('"', "'"),
        rows.replace('\n', "\r\n"),
        rows.replace('\n', "\r"),
        format!("\u{feff}{rows}"),
        // Quoted remarks with separators, a unit, and unused columns.
        rows.replace("\"X\"", "\"X [m, wide]\"")
            .replacen("\"Radius\"", "\"Radius\",\"a;b\"", 1)
            .replace("\"0.5\"", "\"0.5\",\"x, \"\"y\"\"\""),
        rows.replace("\"0\"", "\" 0 \""),
        rows.replace("\"\n", "\",\n"),
        rows.replace("\"\n", "\" # remark, with a comma\n"),
        rows.replacen("\"0\"", "% remark\n#\n// remark\n\n\"0\"", 1),
        "x;y;z;radius\n0;0;0;0,5\n1;0;0;0,5\n".to_owned(),
        "0,0\t0,0\t0,0\t0,5\n1,0\t0\t0\t0,5\n".to_owned(),
    ] {
        let cloud = spheres(&text);
        assert_eq!(
            (cloud.centers.as_slice(), cloud.radii.as_slice()),
            (&[Vec3::ZERO, Vec3::X][..], &[0.5, 0.5][..]),
            "{text}"
        );
    }
    assert!(said("1;2,5;3\n").contains("1 numbers have a decimal comma; it is read as a point"));
    assert!(said("x,y,z,mass,\"a b\"\n1,2,3,4,5\n").contains("the columns mass, a b are left out"));
    let paraview = "\"scalar\",\"Points:0\",\"Points:1\",\"Points:2\"\n7,1,2,3\n";
    assert_eq!(spheres(paraview).centers, [Vec3::new(1.0, 2.0, 3.0)]);
}

#[test]
fn rows_without_a_place_or_size_are_left_out() {
    for missing in ["nan", "NaN", "-nan", "inf", "-Infinity", "1e39", "", "NA", "n/a", "NULL", "-"] {
        let text = format!("x,y,z,radius\n0,0,0,0.5\n{missing},0,0,0.5\n0,1,0,0.5\n0,2,0,{missing}\n");
        let cloud = spheres(&text);
        assert_eq!((cloud.centers.as_slice(), cloud.radii.len()), (&[Vec3::ZERO, Vec3::Y][..], 2), "{missing}");
        let said = said(text);
        assert!(said.contains("2 of 4 rows are left out") && said.contains("the first is line 3"), "{missing}: {said}");
    }
    // Also in the first row, which determines the columns.
    assert_eq!(spheres("nan nan nan\n1 2 3\n").centers, [Vec3::new(1.0, 2.0, 3.0)]);
    let said = said("1 2 3 1 0 nan\n1 2 4 1 0 0\n");
    assert!(said.contains("1 colours of its rows have a number that isn't finite; they are taken as white"), "{said}");
    let (cloud, said) = read_cylinders(&asset("0 0 0 0 0 1\n0 0 0 0 nan 1\n"), CloudFormat::Text, Some(1.0)).unwrap();
    assert_eq!(cloud.axes.len(), 1);
    assert!(said.to_string().contains("1 of 2 rows are left out"), "{said}");
}

#[test]
fn colours_of_pictures_are_known_by_their_numbers() {
    let cloud = spheres("0 0 0 255 0 0\n1 0 0 0 128 0\n");
    assert_eq!(cloud.colors[0], Rgb::new(1.0, 0.0, 0.0));
    assert!((cloud.colors[1].g - 0.215_86).abs() < 1e-4, "{:?}", cloud.colors[1]);
    assert!(said("0 0 0 255 0 0\n").contains("go up to 255; they are taken as sRGB from 0 to 255"));
    assert!(said("0 0 0 1 0 -0.5\n").contains("1 colours of its rows have a negative number"));
    assert_eq!(said("0 0 0 1 0 0.5\n"), "");
}

const METHANE: &str =
    "5\nmethane\nC 0.0 0.0 0.0\nH 0.63 0.63 0.63\nH -0.63 -0.63 0.63\nH -0.63 0.63 -0.63\nH 0.63 -0.63 -0.63\n";

#[test]
fn atoms_have_their_elements_radii_and_colours() {
    let read = |text: &str, radius| read_spheres(&asset(text), CloudFormat::Text, radius).unwrap();
    let (cloud, said) = read(METHANE, None);
    assert!(said.is_empty(), "{said}");
    assert_eq!((cloud.centers.len(), cloud.centers[1]), (5, Vec3::splat(0.63)));
    // Alvarez 2013: carbon 1.77, hydrogen 1.20.
    assert_eq!(cloud.radii, [1.77, 1.2, 1.2, 1.2, 1.2]);
    assert_eq!(cloud.colors[1], Rgb::WHITE);
    assert_eq!(cloud.colors[0].r, cloud.colors[0].b);
    assert_eq!(read(METHANE, Some(0.4)).0.radii, [0.4]);
    for text in [
        METHANE.replace('\n', "\r\n"),
        format!("\u{feff}{METHANE}"),
        METHANE.replace("5\n", "  5 \n"),
        METHANE.replace("methane", ""),
        METHANE.replace("methane", "0.0 0.0 0.0"),
        METHANE.replace('C', "6").replace('H', "1"),
        METHANE.replace('C', "C1").replace('H', "h"),
        METHANE.replace('\n', " 0.1 0.2\n").replace("5 0.1 0.2", "5"),
        METHANE.replace("methane", "Lattice=\"1 0 0 0 1 0 0 0 1\" Properties=species:S:1:pos:R:3 pbc=\"F F F\""),
        METHANE.trim_end().to_owned(),
    ] {
        assert_eq!(read(&text, None).0, cloud, "{text}");
    }
    let frames = METHANE.repeat(3);
    let (first, said) = read(&frames, None);
    assert_eq!(first, cloud);
    assert!(said.to_string().contains("only the first of its frames is read"));
    let (_, said) = read(&METHANE.replace("C ", "Xx "), None);
    assert!(said.to_string().contains("1 atoms have a name that is no element, \"Xx\" first"), "{said}");
    let (cloud, said) = read(&METHANE.replacen("H 0.63", "H nan", 1), None);
    assert_eq!(cloud.centers.len(), 4);
    assert!(said.to_string().contains("1 of 5 rows are left out") && said.to_string().contains("line 4"), "{said}");
}

#[test]
fn extended_xyz_says_what_its_columns_are() {
    let text = "2\nProperties=id:I:1:species:S:1:pos:R:3:color:R:3:forces:R:3:radius:R:1\n\
        1 C 0 0 0 1 0 0 9 9 9 0.5\n2 O 1 2 3 0 0.5 0 9 9 9 0.25\n";
    let cloud = spheres(text);
    assert_eq!((cloud.centers[1], cloud.radii.as_slice()), (Vec3::new(1.0, 2.0, 3.0), &[0.5, 0.25][..]));
    assert_eq!(cloud.colors, [Rgb::new(1.0, 0.0, 0.0), Rgb::new(0.0, 0.5, 0.0)]);
    for (from, to, message) in [
        ("pos:R:3", "pos:R:x", "is not a list of name:type:columns"),
        ("pos:R:3", "place:R:3", "its Properties have no positions"),
        ("2 O 1 2 3", "2 O 1 2 z", "a.csv:4:9: error: z: \"z\" is not a number"),
        ("0.25", "", "this line has 11 columns; 12 are expected"),
        ("0.25", "-1", "radius is -1"),
        ("2\n", "3\n", "it announces 3 atoms, but only 2 follow"),
        ("2\n", "99999999999999\n", "it announces 99999999999999 atoms, but only 2 follow"),
    ] {
        let found = error(&text.replacen(from, to, 1));
        assert!(found.contains(message), "{message}: {found}");
    }
}

#[test]
fn points_may_have_their_count_in_front() {
    let cloud = spheres("2\n0 0 0 0.5\n1 0 0 0.25\n");
    assert_eq!((cloud.centers[1], cloud.radii.as_slice()), (Vec3::X, &[0.5, 0.25][..]));
    let (cloud, _) = read_cylinders(&asset("1\n0 0 0 1 0 0 0.25\n"), CloudFormat::Text, None).unwrap();
    assert_eq!(cloud.axes.len(), 1);
    let error = read_cylinders(&asset(METHANE), CloudFormat::Text, Some(1.0)).unwrap_err().to_string();
    assert!(error.contains("an XYZ file holds atoms, no cylinders"), "{error}");
}

fn mapped(map: Colormap, column: &str, range: [Option<f64>; 2]) -> CloudSettings {
    let colormap = Some(ColumnColors { map, column: column.to_owned(), range });
    CloudSettings { radius: Some(1.0), colormap, ..CloudSettings::default() }
}

#[test]
fn a_column_gives_colours() {
    let read = |text: &str, settings: CloudSettings| {
        let read = read_spheres(&asset(text), CloudFormat::Text, settings);
        read.map(|(cloud, said)| (cloud, said.to_string())).map_err(|e| e.to_string())
    };
    let at = |share: f64| Colormap::Magma.color(share);
    let table = "x;y;z;Heat [K];red;green;blue\n0;0;0;2,5;1;1;1\nnan;0;0;900;1;1;1\n1;0;0;5;1;1;1\n2;0;0;10;1;1;1\n";
    let (cloud, said) = read(table, mapped(Colormap::Magma, "heat", [None; 2])).unwrap();
    assert_eq!(cloud.colors, [at(0.0), at(1.0 / 3.0), at(1.0)]);
    assert_eq!(cloud.rows, [1, 3, 4], "rows that are left out keep their numbers");
    assert!(!said.contains("the column"), "{said}");
    let (cloud, _) = read(table, mapped(Colormap::Magma, "4", [Some(0.0), Some(5.0)])).unwrap();
    assert_eq!(cloud.colors, [at(0.5), at(1.0), at(1.0)]);
    let (cloud, _) = read("0 0 1 3\n0 0 2 3\n", mapped(Colormap::Magma, "z", [None; 2])).unwrap();
    assert_eq!((cloud.colors.as_slice(), cloud.radii.as_slice()), (&[at(0.0), at(1.0)][..], &[3.0, 3.0][..]));
    assert!(cloud.rows.is_empty());
    let named = CloudSettings {
        columns: ["x", "y", "z", "_", "v"].map(str::to_owned).into(),
        ..mapped(Colormap::Magma, "v", [None; 2])
    };
    let (cloud, _) = read("0 0 1 a 7\n0 0 2 b 8\n", named.clone()).unwrap();
    assert_eq!((cloud.colors.len(), cloud.radii.as_slice()), (2, &[1.0][..]));
    assert!(read("0 0 1 7\n", named).unwrap_err().contains("a row has 4 columns, but columns has 5 names"));
    for (row, place) in [("3,0,0,", "a.csv:3:1"), ("3,0,0,nan", "a.csv:3:7"), ("3,0,0,inf", "a.csv:3:7")] {
        let text = format!("x,y,z,v\n0,0,0,1\n{row}\n");
        let error = read(&text, mapped(Colormap::Viridis, "v", [None; 2])).unwrap_err();
        assert!(error.starts_with(&format!("{place}: error: column 4 (v) has no finite number here")), "{error}");
    }
    let error = read("x,y,z\n0,0,0\n", mapped(Colormap::Viridis, "v", [None; 2])).unwrap_err();
    assert!(error.contains("there is no column \"v\" for the colour map"), "{error}");
    assert!(read("1\n\nC 0 0 0\n", mapped(Colormap::Viridis, "x", [None; 2])).unwrap_err().contains("no columns for"));
}

#[test]
fn a_column_of_every_format_gives_colours() {
    let at = |share: f64| Colormap::Turbo.color(share);
    let bytes: Vec<u8> = [1f32, 2., 3., 0.5, 4., 5., 6., 0.25].iter().flat_map(|v| v.to_le_bytes()).collect();
    let (cloud, _) =
        read_spheres(&asset(bytes), CloudFormat::Binary, mapped(Colormap::Turbo, "radius", [None; 2])).unwrap();
    assert_eq!(cloud.colors, [at(1.0), at(0.0)]);
    let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
        property double Quality\nelement edge 2\nproperty int vertex1\nproperty int vertex2\nproperty float load\n\
        end_header\n0 0 0 4\nnan 0 0 99\n1 0 0 6\n0 2 -1\n2 0 1\n";
    let (cloud, _) =
        read_spheres(&asset(ply), CloudFormat::Ply, mapped(Colormap::Turbo, "quality", [None; 2])).unwrap();
    assert_eq!((cloud.colors.as_slice(), cloud.rows.as_slice()), (&[at(0.0), at(1.0)][..], &[1, 3][..]));
    let load = mapped(Colormap::Turbo, "load", [None, Some(3.0)]);
    let (cloud, _) = read_cylinders(&asset(ply), CloudFormat::Ply, load.clone()).unwrap();
    assert_eq!(cloud.colors, [at(0.0), at(0.5)]);
    let error = read_cylinders(&asset(ply.replace("0 2 -1", "0 2 nan")), CloudFormat::Ply, load).unwrap_err();
    assert!(error.to_string().contains("row 0 (from 0): load isn't a finite number"), "{error}");
    let error = read_spheres(&asset(ply), CloudFormat::Ply, mapped(Colormap::Turbo, "mass", [None; 2])).unwrap_err();
    assert!(error.to_string().contains("there is no property \"mass\""), "{error}");
}
