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

fn read_mesh(name: &str, bytes: &[u8]) -> Result<(Mesh, u64), Complaint> {
    super::read_mesh(name, bytes.into())
}

fn error(text: &str) -> String {
    read_mesh("a", text.as_bytes()).unwrap_err().message
}

#[test]
fn all_encodings_give_the_same_mesh() {
    let (mesh, thin) = read_mesh("a", &ascii()).unwrap();
    assert_eq!((mesh.positions.len(), thin, mesh.normals.len(), mesh.uvs.len()), (4, 0, 0, 0));
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
    let (mesh, thin) = read_mesh("a", text.as_bytes()).unwrap();
    assert_eq!((mesh.normals.as_slice(), thin), (&[Vec3::Y, Vec3::Z, Vec3::Y][..], 1));
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
    let spheres = read_spheres("a", text.as_bytes().into()).unwrap();
    assert_eq!((spheres.centers[1], spheres.radii.as_slice()), (Vec3::new(4., 5., 6.), &[0.5, 0.25][..]));
    let cylinders = read_cylinders("a", text.as_bytes().into()).unwrap();
    assert_eq!((cylinders.axes[0][1], cylinders.radii.as_slice()), (Vec3::new(4., 5., 6.), &[0.125][..]));
    assert!(error(text).contains("it has points but no faces"));
    assert_eq!(
        read_spheres("a", text.replace("0.25", "0").as_bytes().into()).unwrap_err().message,
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
        ("1 1 0 188", "1 inf 0 188", "vertex 2: its position 1 inf 0 is not finite"),
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

/// A file with normals and texture coordinates of other types than usual, as text and in both byte orders; faces as given.
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
    // All triangles; one that isn't; a thin one.
    for faces in [&[&[0, 1, 2][..], &[2, 1, 3], &[3, 0, 1]][..], &[&[0, 1, 2], &[0, 1, 3, 2]], &[&[0, 1, 2], &[0, 1]]] {
        let [text, little, big] = tables(faces).map(|bytes| read_mesh("m", &bytes).unwrap());
        assert_eq!(text.0.triangles.len(), faces.iter().map(|f| f.len() - 2).sum::<usize>());
        assert_eq!(text.0.uvs[2], Vec2::ZERO);
        assert_eq!(little, text);
        assert_eq!(big, text);
    }
    // Mistakes are told as ever.
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

/// All ways to read a file: at once and in small windows, from memory and from a disk, by one thread and by three.
fn every_way(bytes: &[u8]) -> Result<(Mesh, u64), Complaint> {
    let mut file = tempfile::tempfile().unwrap();
    std::io::Write::write_all(&mut file, bytes).unwrap();
    let expected = read_mesh("m", bytes);
    let told = |result: &Result<(Mesh, u64), Complaint>| match result {
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
    assert_eq!(all[0].1, 715);
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
