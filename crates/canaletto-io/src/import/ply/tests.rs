use super::*;

const HEADER: &str = "ply\nformat FORMAT 1.0\ncomment made by hand\nelement vertex 4\nproperty float x\nproperty float y\n\
    property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nproperty short flags\n\
    element face 2\nproperty list uchar int vertex_indices\nproperty uchar quality\n\
    element edge 1\nproperty int vertex1\nproperty int vertex2\nend_header\n";

const TEXT: &str = "0 0 0 255 0 0 -1\n1 0 0 0 255 0 2\n1 1 0 188 0 0 3\n0 1 0 0 0 0 4\n4 0 1 2 3 9\n3 0 1 3 9\n0 1\n";

fn ascii() -> Vec<u8> {
    format!("{}{TEXT}", HEADER.replace("FORMAT", "ascii")).into_bytes()
}

fn binary(big: bool) -> Vec<u8> {
    let name = if big { "binary_big_endian" } else { "binary_little_endian" };
    let mut out = HEADER.replace("FORMAT", name).into_bytes();
    let mut put = |little: &[u8]| {
        let mut bytes = little.to_vec();
        if big {
            bytes.reverse();
        }
        out.extend(bytes);
    };
    for (p, color, flags) in [
        ([0f32, 0., 0.], [255u8, 0, 0], -1i16),
        ([1., 0., 0.], [0, 255, 0], 2),
        ([1., 1., 0.], [188, 0, 0], 3),
        ([0., 1., 0.], [0; 3], 4),
    ] {
        p.iter().for_each(|v| put(&v.to_le_bytes()));
        color.iter().for_each(|v| put(&[*v]));
        put(&flags.to_le_bytes());
    }
    for face in [&[0i32, 1, 2, 3][..], &[0, 1, 3]] {
        put(&[face.len() as u8]);
        face.iter().for_each(|v| put(&v.to_le_bytes()));
        put(&[9]);
    }
    [0i32, 1].iter().for_each(|v| put(&v.to_le_bytes()));
    out
}

type Read = (Mesh, Vec<ImportError>);

fn read_mesh(name: &str, bytes: &[u8]) -> Result<Read, ImportError> {
    match read_content(name, bytes.into())? {
        (PlyContent::Mesh(mesh, _), said) => Ok((mesh, said)),
        (PlyContent::Points(_), _) => panic!("there are no faces"),
    }
}

/// A model of files, of which the first is `a.ply`.
fn model(files: &[(&str, Vec<u8>)]) -> (Fragment, String) {
    use crate::assets::{AssetPath, MemoryAssets};
    let assets = files.iter().fold(MemoryAssets::new(), |assets, (name, bytes)| assets.with(name, bytes.clone()));
    let asset = assets.open("a.ply", &AssetPath::base()).unwrap();
    let options = ReadOptions { unsaid: DefaultShading::Creases, moment: None, variant: None };
    let (fragment, warnings) = read_model(&asset, &assets, &options).unwrap_or_else(|e| panic!("{e}"));
    (fragment, warnings.to_string())
}

/// The warnings about a file.
fn said(bytes: &[u8]) -> String {
    let said = read_mesh("a", bytes).unwrap().1;
    said.into_iter().map(|complaint| complaint.message).collect::<Vec<_>>().join("; ")
}

fn error(text: &str) -> String {
    read_mesh("a", text.as_bytes()).unwrap_err().message
}

#[test]
fn all_encodings_give_the_same_mesh() {
    let (mesh, _) = read_mesh("a", &ascii()).unwrap();
    assert_eq!((mesh.positions.len(), mesh.normals.len(), mesh.uvs.len()), (4, 0, 0));
    assert_eq!(
        said(&ascii()),
        "the property flags of element vertex is left out; the property quality of element face is left out; \
         element edge (1 rows) is left out"
    );
    assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3], [0, 1, 3]]);
    assert_eq!(mesh.colors[0], Rgb::new(1.0, 0.0, 0.0));
    assert!((mesh.colors[2].r - 0.502_886).abs() < 1e-5);
    assert_eq!(read_mesh("a", &binary(false)).unwrap().0, mesh);
    assert_eq!(read_mesh("a", &binary(true)).unwrap().0, mesh);
    let windows = String::from_utf8(ascii()).unwrap().replace('\n', "\r\n");
    assert_eq!(read_mesh("a", windows.as_bytes()).unwrap().0, mesh);
}

#[test]
fn normals_and_texture_coordinates_are_taken() {
    let text = "ply\nformat ascii 1.0\nelement vertex 3\nproperty double x\nproperty double y\nproperty double z\n\
        property float nx\nproperty float ny\nproperty float nz\nproperty float s\nproperty float t\nproperty float red\n\
        property float green\nproperty float blue\nelement face 2\nproperty list int uint vertex_index\nend_header\n\
        0 0 0 0 1 0 0 1 .5 .5 .5\n1 0 0 0 0 0 0 1 .5 .5 .5\n0 1 0 0 1 0 0.5 1 .5 .5 .5\n3 0 1 2\n2 0 1\n";
    let (mesh, _) = read_mesh("a", text.as_bytes()).unwrap();
    assert_eq!(mesh.normals, [Vec3::Y, Vec3::Z, Vec3::Y]);
    assert_eq!(
        said(text.as_bytes()),
        "1 faces of fewer than 3 corners are left out; 1 normals have no direction; they are computed from the faces"
    );
    assert_eq!((mesh.uvs[2], mesh.colors[0]), (Vec2::new(0.5, 0.0), Rgb::gray(0.5)));
}

#[test]
fn strips_turn_every_second_triangle() {
    let text = "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n\
        element tristrips 1\nproperty list int int vertex_indices\nend_header\n0 0 0\n0 1 0\n1 0 0\n1 1 0\n2 0 0\n8 0 1 2 3 -1 2 3 4\n";
    assert_eq!(read_mesh("a", text.as_bytes()).unwrap().0.triangles, [[0, 1, 2], [2, 1, 3], [2, 3, 4]]);
}

#[test]
fn clouds_take_points_and_edges() {
    let text = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\n\
        property float radius\nelement edge 1\nproperty int vertex1\nproperty int vertex2\nproperty float radius\nend_header\n\
        1 2 3 0.5\n4 5 6 0.25\n0 1 0.125\n";
    let spheres = read_spheres("a", text.as_bytes().into(), &CloudSettings::default()).unwrap().0;
    assert_eq!((spheres.centers[1], spheres.radii.as_slice()), (Vec3::new(4., 5., 6.), &[0.5, 0.25][..]));
    let cylinders = read_cylinders("a", text.as_bytes().into(), &CloudSettings::default()).unwrap().0;
    assert_eq!((cylinders.axes[0][1], cylinders.radii.as_slice()), (Vec3::new(4., 5., 6.), &[0.125][..]));
    // As a model it is its points.
    let (model, _) = model(&[("a.ply", text.into())]);
    assert_eq!((model.spheres[0].radii.as_slice(), model.nodes.len()), (&[0.5, 0.25][..], 1));
    assert_eq!(
        read_spheres("a", text.replace("0.25", "0").as_bytes().into(), &CloudSettings::default()).unwrap_err().message,
        "vertex 1: radius is 0; it must be more than 0"
    );
}

#[test]
fn a_header_that_promises_too_much_fails_at_once() {
    for format in ["ascii", "binary_little_endian"] {
        for count in ["1000000000", "18446744073709551615"] {
            let text = format!(
                "ply\nformat {format} 1.0\nelement vertex {count}\nproperty float x\nproperty float y\nproperty float z\n\
                element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n"
            );
            let message = error(&text);
            assert!(
                message.contains("but only 6 bytes are left") || message.contains("more than 32 bits"),
                "{message}"
            );
        }
    }
    let text = "ply\nformat ascii 1.0\nelement vertex 0\nproperty int x\nproperty int y\nproperty int z\nelement nothing 18446744073709551615\n\
        element face 0\nproperty list int int vertex_indices\nend_header\n";
    assert_eq!(error(text), "there are no faces in it");
}

#[test]
fn errors_name_the_row() {
    let text = String::from_utf8(ascii()).unwrap();
    for (from, to, message) in [
        ("4 0 1 2 3 9", "4 0 1 2 7 9", "face 0: it refers to vertex 7, but only 4 exist (counted from 0)"),
        ("4 0 1 2 3 9", "4 0 1 2 -1 9", "face 0: it refers to vertex -1"),
        ("4 0 1 2 3 9", "9 0 1 2 3 9", "face 0: the line ends before vertex_indices"),
        ("4 0 1 2 3 9", "-4 0 1 2 3 9", "face 0: vertex_indices can't have -4 entries"),
        ("1 1 0 188", "1 z 0 188", "vertex 2: y: \"z\" is not a number"),
        ("255 0 0 -1", "255 0 0 -1 5", "vertex 0: \"5\" is more than the header announces for a line"),
        ("3 0 1 3 9\n0 1\n", "", "the file ends inside face 1 of 2"),
        ("float x", "float a", "its vertices need the properties x, y and z"),
        ("float y", "flaot y", "\"flaot\" is not a type of PLY"),
        ("element vertex 4", "element vertex four", "\"four\" is not a count"),
        ("ascii 1.0", "text 1.0", "the format must be ascii, binary_little_endian or binary_big_endian"),
        ("ascii 1.0", "ascii 2.0", "the format's version must be 1.0"),
        ("comment made", "commment made", "the header has an unknown word, \"commment\""),
        ("end_header", "comment", "the header has an unknown word, \"0\""),
        ("list uchar", "list float", "a list's length must be of a whole type"),
        ("ply\n", "plx\n", "it doesn't start with the line `ply`"),
    ] {
        let found = error(&text.replacen(from, to, 1));
        assert!(found.contains(message), "{message}: {found}");
    }
    let cut = binary(false);
    assert_eq!(read_mesh("a", &cut[..cut.len() - 20]).unwrap_err().message, "the file ends inside face 1 of 2");
}

#[test]
fn a_binary_list_longer_than_the_file_fails() {
    let mut bytes = b"ply\nformat binary_little_endian 1.0\nelement vertex 0\nproperty float x\nproperty float y\nproperty float z\n\
        element face 1\nproperty list uint int vertex_indices\nend_header\n".to_vec();
    bytes.extend(u32::MAX.to_le_bytes());
    assert_eq!(read_mesh("a", &bytes).unwrap_err().message, "the file ends inside face 0 of 1");
}

/// A file with normals and texture coordinates of unusual types, as text and in both byte orders, with the given faces.
fn tables(faces: &[&[i32]]) -> [Vec<u8>; 3] {
    let header = format!(
        "element vertex 4\nproperty double x\nproperty float y\nproperty short z\nproperty char nx\nproperty float ny\n\
         property uint nz\nproperty float u\nproperty double v\nelement face {}\n\
         property list uchar int vertex_indices\nend_header\n",
        faces.len()
    );
    ["ascii", "binary_little_endian", "binary_big_endian"].map(|encoding| {
        let mut out = format!("ply\nformat {encoding} 1.0\n{header}").into_bytes();
        let mut put = |text: String, little: &[u8]| match encoding {
            "ascii" => out.extend(format!("{text} ").into_bytes()),
            "binary_big_endian" => out.extend(little.iter().rev()),
            _ => out.extend(little),
        };
        for i in 0..4u8 {
            let (x, y, z) = (0.1 + f64::from(i), 0.3 * f32::from(i) * f32::from(i), -i16::from(i) * i16::from(i % 2));
            put(x.to_string(), &x.to_le_bytes());
            put(y.to_string(), &y.to_le_bytes());
            put(z.to_string(), &z.to_le_bytes());
            put((-(i as i8)).to_string(), &[i.wrapping_neg()]);
            put("0.25".into(), &0.25f32.to_le_bytes());
            put("16777217".into(), &16_777_217u32.to_le_bytes());
            put(y.to_string(), &y.to_le_bytes());
            let v = if i == 2 { f64::NAN } else { x };
            put(v.to_string(), &v.to_le_bytes());
            put("\n".into(), &[]);
        }
        for face in faces {
            put(face.len().to_string(), &[face.len() as u8]);
            face.iter().for_each(|v| put(v.to_string(), &v.to_le_bytes()));
            put("\n".into(), &[]);
        }
        out
    })
}

#[test]
fn tables_are_read_as_rows_are() {
    // All triangles; one polygon; one face with too few corners.
    for faces in [&[&[0, 1, 2][..], &[2, 1, 3], &[3, 0, 1]][..], &[&[0, 1, 2], &[0, 1, 3, 2]], &[&[0, 1, 2], &[0, 1]]] {
        let [text, little, big] = tables(faces).map(|bytes| read_mesh("m", &bytes).unwrap());
        assert_eq!(text.0.triangles.len(), faces.iter().map(|f| f.len() - 2).sum::<usize>());
        assert_eq!(text.0.uvs[2], Vec2::ZERO);
        assert_eq!(little, text);
        assert_eq!(big, text);
    }
    // The reader of single rows reports mistakes.
    for (wrong, message) in
        [(4, "face 1: it refers to vertex 4, but only 4 exist"), (-1, "face 1: it refers to vertex -1")]
    {
        let faces: &[&[i32]] = &[&[0, 1, 2], &[1, wrong, 2]];
        for bytes in &tables(faces)[1..] {
            let told = read_mesh("m", bytes).unwrap_err().error("m").message;
            assert!(told.contains(message), "{told}");
        }
    }
    for bytes in &tables(&[&[0, 1, 2], &[1, 3, 2]])[1..] {
        let told = read_mesh("m", &bytes[..bytes.len() - 1]).unwrap_err().error("m").message;
        assert!(told.contains("bytes are left") || told.contains("ends inside face 1 of 2"), "{told}");
    }
}

/// A mesh of many rows with colours, radii and polygons of all kinds, as text and in both byte orders.
fn large(count: usize, odd: impl Fn(usize, &mut Vec<i32>)) -> [Vec<u8>; 3] {
    let header = format!(
        "element vertex {count}\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\n\
         property uchar green\nproperty uchar blue\nelement face {count}\nproperty uchar quality\n\
         property list uchar int vertex_indices\nend_header\n"
    );
    ["ascii", "binary_little_endian", "binary_big_endian"].map(|encoding| {
        let mut out = format!("ply\nformat {encoding} 1.0\n{header}").into_bytes();
        let mut put = |text: String, little: &[u8]| match encoding {
            "ascii" => out.extend(format!("{text} ").into_bytes()),
            "binary_big_endian" => out.extend(little.iter().rev()),
            _ => out.extend(little),
        };
        for i in 0..count {
            for p in [i as f32, (i * i % 97) as f32 * 0.3, (i % 5) as f32] {
                put(p.to_string(), &p.to_le_bytes());
            }
            (0..3).for_each(|k| put(((i + k) % 256).to_string(), &[((i + k) % 256) as u8]));
            put("\n".into(), &[]);
        }
        for i in 0..count {
            let mut face: Vec<i32> = (0..3).map(|k| ((i * 7 + k * 3) % count) as i32).collect();
            odd(i, &mut face);
            put("7".into(), &[7]);
            put(face.len().to_string(), &[face.len() as u8]);
            face.iter().for_each(|v| put(v.to_string(), &v.to_le_bytes()));
            put(if i % 3 == 0 { "\n\n".into() } else { "\n".into() }, &[]);
        }
        out
    })
}

/// Reads a file in every manner: at once and in small windows, from memory and from a disk, by one thread and by three.
fn every_way(bytes: &[u8]) -> Result<Read, ImportError> {
    let mut file = tempfile::tempfile().unwrap();
    std::io::Write::write_all(&mut file, bytes).unwrap();
    let expected = read_mesh("m", bytes);
    let told = |result: &Result<Read, ImportError>| match result {
        Ok(mesh) => (Some(mesh.clone()), String::new()),
        Err(complaint) => (None, format!("{} {:?}", complaint.message, complaint.span)),
    };
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        for view in [View::Memory(bytes), View::File(&file, bytes.len())] {
            let header = read_header(view).unwrap();
            for window in [1, 1000, 100_000] {
                let payload = Payload::with_window(&header, view, window);
                let found = pool.install(|| read_payload("m", &header, payload));
                assert!(told(&found) == told(&expected), "{threads} threads, windows of {window}: {}", told(&found).1);
            }
        }
    }
    expected
}

#[test]
fn neither_windows_nor_threads_change_anything() {
    let triangles = |_: usize, _: &mut Vec<i32>| ();
    let polygons = |i: usize, face: &mut Vec<i32>| match i % 7 {
        1 => face.truncate(2),
        2 => face.push((i as i32 + 11) % 5000),
        3 => face.extend([1, 2, 3]),
        _ => {}
    };
    let mistakes = |i: usize, face: &mut Vec<i32>| match i {
        4100 => face[2] = -3,
        2200 | 2201 | 4900 => face[1] = 5000 + i as i32,
        _ => {}
    };
    let all = large(5000, triangles).map(|bytes| every_way(&bytes).unwrap());
    assert_eq!((all[0].0.triangles.len(), all[0].0.colors.len()), (5000, 5000));
    assert!(all[1] == all[0] && all[2] == all[0]);
    let all = large(5000, polygons).map(|bytes| every_way(&bytes).unwrap());
    let thin = "715 faces of fewer than 3 corners are left out";
    assert!(all[0].1.iter().any(|complaint| complaint.message == thin), "{:?}", all[0].1);
    assert!(all[1] == all[0] && all[2] == all[0]);
    for bytes in large(5000, mistakes) {
        let message = every_way(&bytes).unwrap_err().message;
        assert!(message.starts_with("face 2200: it refers to vertex 7200, but only 5000 exist"), "{message}");
    }
    for bytes in large(5000, polygons) {
        let message = every_way(&bytes[..bytes.len() - 2000]).unwrap_err().message;
        assert!(message.contains("face 4") || message.contains("bytes are left"), "{message}");
    }
}

#[test]
fn headers_of_any_length_are_read() {
    let text = String::from_utf8(ascii()).unwrap();
    for length in [1 << 16, 1 << 18, 1 << 20] {
        for more in length - 500..length + 20 {
            let comment = format!("comment {}\nelement vertex", "c".repeat(more));
            let long = text.replacen("element vertex", &comment, 1);
            if more % 97 == 0 || long.find("end_header").unwrap().abs_diff(length) < 16 {
                assert_eq!(read_mesh("a", long.as_bytes()).unwrap().0.triangles.len(), 3);
            }
        }
    }
}

/// A cube of six coloured faces, as text and in both byte orders.
fn cube(faces: &str, row: impl Fn(usize) -> Vec<(String, Vec<u8>)>) -> [Vec<u8>; 3] {
    let corners = [[0i32, 1, 2, 3], [5, 4, 7, 6], [1, 5, 6, 2], [4, 0, 3, 7], [3, 2, 6, 7], [4, 5, 1, 0]];
    let points = [[-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1], [-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1]];
    ["ascii", "binary_little_endian", "binary_big_endian"].map(|encoding| {
        let mut out = format!(
            "ply\nformat {encoding} 1.0\ncomment TextureFile wall of brick.png\nelement vertex 8\nproperty char x\n\
             property char y\nproperty char z\nelement face 6\nproperty list uchar int vertex_indices\n{faces}end_header\n"
        )
        .into_bytes();
        let mut put = |text: String, little: &[u8]| match encoding {
            "ascii" => out.extend(format!("{text} ").into_bytes()),
            "binary_big_endian" => out.extend(little.iter().rev()),
            _ => out.extend(little),
        };
        for point in points {
            point.iter().for_each(|p| put(p.to_string(), &[*p as i8 as u8]));
            put("\n".into(), &[]);
        }
        for (i, face) in corners.iter().enumerate() {
            put("4".into(), &[4]);
            face.iter().for_each(|v| put(v.to_string(), &v.to_le_bytes()));
            row(i).into_iter().for_each(|(text, bytes)| put(text, &bytes));
            put("\n".into(), &[]);
        }
        out
    })
}

#[test]
fn faces_have_colours_of_their_own() {
    let colors = [[255u8, 0, 0], [0, 255, 0], [0, 0, 255], [255, 255, 0], [255, 0, 255], [0, 255, 255]];
    type Number = fn(u8) -> (String, Vec<u8>);
    let kinds: [(&str, Number); 3] = [
        ("uchar", |v| (v.to_string(), vec![v])),
        ("float", |v| ((v / 255).to_string(), f32::from(v / 255).to_le_bytes().to_vec())),
        ("int", |v| (v.to_string(), i32::from(v).to_le_bytes().to_vec())),
    ];
    for (kind, number) in kinds {
        let header = ["red", "green", "blue"].map(|name| format!("property {kind} {name}\n")).concat();
        for bytes in cube(&header, |i| colors[i].map(number).to_vec()) {
            let (mesh, said) = read_mesh("a", &bytes).unwrap();
            mesh.check().unwrap();
            assert_eq!((mesh.triangles.len(), mesh.positions.len()), (12, 24));
            for (t, triangle) in mesh.triangles.iter().enumerate() {
                let expected = Rgb::from(colors[t / 2].map(|v| f32::from(v / 255)));
                assert!(triangle.iter().all(|v| mesh.colors[*v as usize] == expected), "{kind}, triangle {t}");
            }
            let said: Vec<&str> = said.iter().map(|complaint| &*complaint.message).collect();
            assert_eq!(said.len(), usize::from(kind == "int"), "{said:?}");
        }
    }
}

#[test]
fn corners_have_texture_coordinates_of_their_own() {
    let header = "property list uchar float texcoord\nproperty int texnumber\n";
    let uv = [[0.0f32, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    for short in [false, true] {
        let row = |i: usize| {
            let count = if short && i == 3 { 6u8 } else { 8 };
            let mut row = vec![(count.to_string(), vec![count])];
            let flat = uv.iter().flatten().take(count.into());
            row.extend(flat.map(|v| (v.to_string(), v.to_le_bytes().to_vec())));
            row.push(("0".into(), vec![0; 4]));
            row
        };
        for bytes in cube(header, row) {
            let (mesh, complaints) = read_mesh("a", &bytes).unwrap();
            mesh.check().unwrap();
            for (t, triangle) in mesh.triangles.iter().enumerate() {
                let corners = [[0, 1, 2], [0, 2, 3]][t % 2];
                for (corner, vertex) in corners.into_iter().zip(triangle) {
                    let [u, v] = uv[corner];
                    // v counts from an image's top row.
                    let expected = if short && t / 2 == 3 { [0.0, 0.0] } else { [u, 1.0 - v] };
                    assert_eq!(mesh.uvs[*vertex as usize].to_array(), expected, "triangle {t}");
                }
            }
            let said: Vec<&str> = complaints.iter().map(|complaint| &*complaint.message).collect();
            let without = "1 faces have other than two texture coordinates for each corner; theirs are taken as 0";
            assert_eq!(said.contains(&without), short, "{said:?}");
        }
    }
}

#[test]
fn vertices_without_a_place_are_left_out_with_their_faces() {
    let text = String::from_utf8(ascii()).unwrap();
    for wrong in ["nan", "inf", "-inf", "1e39"] {
        // Vertex 2 belongs to the polygon, not to the triangle.
        let bytes = text.replacen("1 1 0 188", &format!("1 {wrong} 0 188"), 1).into_bytes();
        let (mesh, _) = read_mesh("a", &bytes).unwrap();
        mesh.check().unwrap();
        assert_eq!(mesh.triangles, [[0, 1, 3]]);
        let message =
            "1 vertices have a coordinate that isn't a finite number; they are left out, and 1 faces with them";
        assert!(said(&bytes).contains(message), "{}", said(&bytes));
    }
    let non_finite = ["0 0 0 255", "1 0 0 0", "1 1 0 188", "0 1 0 0"]
        .iter()
        .fold(text, |text, row| text.replacen(row, &format!("nan{}", &row[1..]), 1));
    assert_eq!(error(&non_finite), "none of its faces has three corners with finite coordinates");
    // The equivalent in tables.
    for odd in large(300, |_, _| ()) {
        let text = String::from_utf8_lossy(&odd[..60]).into_owned();
        if text.contains("ascii") {
            continue;
        }
        let mut bytes = odd;
        let start = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
        // x of vertex 7: all bits set is a NaN in both byte orders.
        bytes[start + 7 * 15..][..4].fill(0xff);
        let (mesh, complaints) = read_mesh("m", &bytes).unwrap();
        mesh.check().unwrap();
        assert_eq!(mesh.triangles.len(), 297);
        assert!(complaints.iter().any(|c| c.message.contains("and 3 faces with them")), "{complaints:?}");
    }
}

#[test]
fn points_without_a_place_or_size_are_left_out() {
    let text = |rows: &str| {
        format!(
            "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
             property float radius\nproperty float red\nproperty float green\nproperty float blue\nelement edge 2\n\
             property int vertex1\nproperty int vertex2\nend_header\n{rows}0 3\n1 3\n"
        )
    };
    let rows = text("0 0 0 1 1 0 0\nnan 0 0 1 1 1 1\n0 1 0 nan 1 1 1\n0 2 0 2 0 nan 1\n");
    let (cloud, said) = read_spheres("a", rows.as_bytes().into(), &CloudSettings::default()).unwrap();
    assert_eq!((cloud.centers.as_slice(), cloud.radii.as_slice()), (&[Vec3::ZERO, Vec3::Y * 2.0][..], &[1.0, 2.0][..]));
    assert_eq!(cloud.colors, [Rgb::new(1.0, 0.0, 0.0), Rgb::WHITE]);
    assert!(said[0].message.contains("1 colours of its vertices have a number that isn't finite"), "{said:?}");
    assert!(
        said[1].message.starts_with("2 of 4 points are left out") && said[1].message.contains("the first is number 2")
    );
    let (cloud, said) = read_cylinders("a", rows.as_bytes().into(), &CloudSettings::default()).unwrap();
    assert_eq!(cloud.axes, [[Vec3::ZERO, Vec3::Y * 2.0]]);
    assert!(said[0].message.starts_with("1 of 2 edges are left out"), "{said:?}");
}

#[test]
fn colours_of_every_type_are_bytes_or_say_what_they_are() {
    for (kind, white, assumed) in [
        ("uchar", "255", ""),
        ("char", "-1", ""),
        ("ushort", "65535", ""),
        ("ushort", "255", "16-bit numbers up to 255 only"),
        ("short", "255", "whole numbers up to 255 only"),
        ("int", "255", "whole numbers up to 255 only"),
        ("uint", "255", "whole numbers up to 255 only"),
        ("uint", "4294967295", ""),
        ("int", "65535", "whole numbers up to 65535 only"),
        ("float", "1", ""),
        ("float", "255", "they are taken as sRGB from 0 to 255"),
        ("double", "255", "they are taken as sRGB from 0 to 255"),
    ] {
        let text = String::from_utf8(ascii()).unwrap();
        let text = ["red", "green", "blue"]
            .iter()
            .fold(text, |text, name| text.replacen(&format!("uchar {name}"), &format!("{kind} {name}"), 1));
        let text = text.replacen("255 0 0 -1", &format!("{white} 0 0 -1"), 1).replacen("0 255 0 2", "0 0 0 2", 1);
        let text = text.replacen("188 0 0 3", "0 0 0 3", 1);
        let (mesh, _) = read_mesh("a", text.as_bytes()).unwrap();
        assert_eq!(mesh.colors[0], Rgb::new(1.0, 0.0, 0.0), "{kind} {white}");
        let said = said(text.as_bytes());
        assert_eq!(said.contains("the colours of its vertices"), !assumed.is_empty(), "{kind} {white}: {said}");
        assert!(said.contains(assumed), "{kind} {white}: {said}");
    }
}

#[test]
fn headers_of_every_habit_are_read() {
    let expected = read_mesh("a", &ascii()).unwrap().0;
    let text = String::from_utf8(ascii()).unwrap();
    let (header, body) = text.split_at(text.find("end_header").unwrap());
    let spaced = format!("{}end_header \t\n{}", header.replace('\n', "  \n").replace(' ', "  "), &body[11..]);
    let capitals = format!("{}{body}", header.to_uppercase());
    for odd in [
        format!("\u{feff}{text}"),
        spaced,
        capitals,
        text.replace('\n', "\r\n"),
        text.replace('\n', "\r"),
        text.replacen("comment made by hand", "obj_info made by hand\n\ncomment\nobj_info", 1),
        text.replacen("format ascii 1.0", "format ascii 1", 1),
        format!("{text}\n\n  \n"),
    ] {
        let (mesh, _) = read_mesh("a", odd.as_bytes()).unwrap_or_else(|e| panic!("{}: {odd}", e.message));
        assert_eq!(mesh, expected, "{odd}");
    }
    assert!(said(format!("{text}more\n").as_bytes()).contains("5 bytes behind its last element are left out"));
    // The first number's first byte is that of a line's end: 10 is the low byte of 0x0000_000a.
    for big in [false, true] {
        let mut bytes = binary(big);
        let end = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
        bytes[end] = b'\n';
        let expected = read_mesh("a", &bytes).unwrap().0;
        for ending in [&b"\r"[..], b"\r\n", b" \n"] {
            let mut odd: Vec<u8> =
                bytes[..end].iter().flat_map(|b| if *b == b'\n' { ending.to_vec() } else { vec![*b] }).collect();
            odd.extend(&bytes[end..]);
            assert_eq!(read_mesh("a", &odd).unwrap().0, expected, "{ending:?}");
        }
    }
}

#[test]
fn normals_without_any_direction_are_no_normals() {
    let cube = String::from_utf8(cube("", |_| Vec::new())[0].clone()).unwrap();
    let header =
        cube.replacen("property char z", "property char z\nproperty float nx\nproperty float ny\nproperty float nz", 1);
    let (header, body) = header.split_at(header.find("end_header").unwrap());
    for normal in ["0 0 0", "nan nan nan", "inf 0 0", "-0 0 0"] {
        let mut rows: Vec<String> = body.lines().map(str::to_owned).collect();
        rows[1..9].iter_mut().for_each(|row| row.push_str(normal));
        let (mesh, _) = read_mesh("a", format!("{header}{}\n", rows.join("\n")).as_bytes()).unwrap();
        assert!(mesh.normals.is_empty(), "{normal}");
    }
}

#[test]
fn repeated_corners_fill_no_notch() {
    // An arrow head of area 4, with corners twice: its area is that of its triangles.
    let header = "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n\
        element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n2 4 0\n0 2 0\n-2 4 0\n0 2 0\n";
    for face in
        ["4 0 1 2 3", "5 0 1 2 2 3", "5 0 1 2 4 3", "6 0 1 2 4 2 3", "5 0 0 1 2 3", "5 0 1 2 3 0", "6 0 1 1 2 3 3"]
    {
        let (mesh, _) = read_mesh("a", format!("{header}{face}\n").as_bytes()).unwrap();
        let area: f32 = (0..mesh.len())
            .map(|i| {
                let [a, b, c] = mesh.corners(i);
                (b - a).cross(c - a).length() / 2.0
            })
            .sum();
        assert!((area - 4.0).abs() < 1e-5, "{face}: {area}");
    }
}

#[test]
fn texture_coordinates_that_are_no_numbers_are_zero() {
    let text = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nproperty float s\n\
        property float t\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\
        0 0 0 nan 0\n1 0 0 0 inf\n0 1 0 0.5 0.25\n3 0 1 2\n";
    let (mesh, said) = read_mesh("a", text.as_bytes()).unwrap();
    assert_eq!(mesh.uvs, [Vec2::ZERO, Vec2::ZERO, Vec2::new(0.5, 0.75)]);
    assert_eq!(said[0].message, "2 texture coordinates aren't finite; they are taken as 0 0");
}

/// Points without radii are large enough to hide what is behind a surface of them.
#[test]
fn points_without_faces_are_spheres() {
    let rows: String = (0..100).map(|i| format!("{} {} 0 255 0 0\n", i % 10, i / 10)).collect();
    let text = format!(
        "ply\nformat ascii 1.0\nelement vertex 100\nproperty float x\nproperty float y\nproperty float z\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n{rows}"
    );
    let (model, warnings) = model(&[("a.ply", text.clone().into())]);
    let cloud = &model.spheres[0];
    assert_eq!((cloud.centers.len(), cloud.colors[0], warnings.as_str()), (100, Rgb::new(1.0, 0.0, 0.0), ""));
    assert!(cloud.radii.len() == 1 && (0.2..0.6).contains(&cloud.radii[0]), "{:?}", cloud.radii);
    let none = text.replace("vertex 100", "vertex 0");
    let end = none.find("end_header\n").unwrap() + 11;
    assert_eq!(error(&none[..end]), "it has neither faces nor points");
}

/// Each picture of the header has a material, and faces say by `texnumber` which is theirs.
#[test]
fn pictures_of_the_header_are_materials() {
    use crate::picture::{EncodeSettings, Image, PictureFormat};
    let image = Image::from_rgb(1, 1, std::iter::once([1.0, 0.5, 0.0]));
    let srgb = canaletto::scene::Transfer::Srgb;
    let png = PictureFormat::Png.encode_image(&image, srgb, &EncodeSettings::default(), &[]).unwrap();
    let text = |second: &str| {
        let text = format!(
            "ply\nformat ascii 1.0\ncomment TextureFile wall of brick.png\n{second}element vertex 4\nproperty float x\n\
             property float y\nproperty float z\nelement face 3\nproperty list uchar int vertex_indices\n\
             property int texnumber\nend_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2 1\n3 0 2 3 0\n3 0 1 3 7\n"
        );
        text.into_bytes()
    };
    let brick = ("wall of brick.png", png);
    let (one, warnings) = model(&[("a.ply", text("")), brick.clone()]);
    assert_eq!((one.meshes[0].slots.len(), one.materials.len(), warnings.as_str()), (0, 1, ""));
    assert_eq!((one.meshes[0].materials.as_slice(), one.materials[0].textures.len()), (&[0][..], 1));
    let (two, warnings) = model(&[("a.ply", text("comment TextureFile ../b.png\n")), brick]);
    assert_eq!((two.meshes[0].slots.as_slice(), two.materials.len()), (&[1, 0, 0][..], 2));
    assert!(warnings.contains("1 faces have the number of no picture"), "{warnings}");
    assert!(warnings.contains("a picture that its header names is left out: \"../b.png\" lies outside"), "{warnings}");
    two.meshes[0].check().unwrap();
    assert!(model(&[("a.ply", text(""))]).0.materials.is_empty());
}
