//! Model files: OBJ, MTL and their materials, normals, textures and coordinates.

use canaletto::camera::Camera;
use canaletto::math::Rgb;
use canaletto::render::{Job, render};
use canaletto::scene::{Content, Fragment, Scene};
use canaletto::shape::Mesh;
use canaletto::world::World;
use canaletto_io::assets::{AssetPath, FolderAssets, MemoryAssets};
use canaletto_io::import;
use canaletto_io::picture::{EncodeSettings, Image, PictureFormat};
use canaletto_io::text::read_scene;
use canaletto_tests::root;
use glam::Vec3;
use std::fs;

fn folder() -> FolderAssets {
    FolderAssets::new(root().join("tests/cases/models")).unwrap()
}

/// The result of `mesh file=…` for a file of this folder, with its warnings.
fn model(file: &str) -> (Fragment, String) {
    match import::load_objects(file, &folder(), &AssetPath::base()) {
        Ok((model, warnings)) => {
            model.meshes.iter().for_each(|mesh| mesh.check().unwrap());
            (model, warnings.to_string())
        }
        Err(errors) => panic!("{errors}"),
    }
}

/// The picture of `canaletto render FILE`, at a small size.
fn picture(file: &str) -> Vec<Rgb> {
    let (mut scene, _) =
        import::load(file, &folder(), &import::Staging::classic()).unwrap_or_else(|errors| panic!("{errors}"));
    (scene.views[0].intrinsics.width, scene.views[0].intrinsics.height) = (96, 72);
    pixels(scene)
}

fn pixels(scene: Scene) -> Vec<Rgb> {
    let job = Job::new(Camera::of(&scene.views[0]).unwrap(), scene.film, scene.integrator);
    render(&World::build(scene).unwrap(), &job, &()).unwrap().picture.pixels
}

/// The picture of a scene text with these files.
fn drawn(text: &str, files: MemoryAssets) -> Vec<Rgb> {
    match read_scene("case.kdl", &files.with("case.kdl", text)) {
        Ok((scene, _)) => pixels(scene),
        Err(errors) => panic!("{errors}\n{text}"),
    }
}

/// The largest difference of two pictures.
fn apart(a: &[Rgb], b: &[Rgb]) -> f32 {
    assert_eq!(a.len(), b.len());
    let of =
        |a: Rgb, b: Rgb| a.to_array().into_iter().zip(b.to_array()).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    a.iter().zip(b).map(|(a, b)| of(*a, *b)).fold(0.0, f32::max)
}

#[track_caller]
fn alike(file: &str, other: &str, by: f32) {
    let difference = apart(&picture(file), &picture(other));
    assert!(difference <= by, "{file} and {other} differ by {difference}");
}

mod transparency {
    use super::*;

    #[test]
    fn d_decides_before_tr_and_tr_1_is_opaque() {
        for (file, warning) in [
            ("dissolve-c.obj", "dissolve-c.mtl:7:1: warning: `Tr` disagrees with `d`, and `d` decides"),
            ("dissolve-d.obj", "dissolve-d.mtl:7:1: warning: `Tr` of 1 is read as opaque"),
        ] {
            alike(file, "dissolve-a.obj", 0.0);
            let (_, warnings) = model(file);
            assert!(warnings.contains(warning), "{warnings}");
        }
        assert_eq!(model("dissolve-a.obj").1, "");
    }

    /// A dissolved surface is in front of a matte one, both lit by 0.5: d · kd/2 + (1 − d) · 0.4.
    #[test]
    fn a_dissolved_surface_adds_its_share() {
        let scene = |file: &str, mtl: &str| {
            let text = format!(
                "background 0\nambient 0\nintegrator \"whitted\" {{ shadows #false }}\nfilm {{ transfer \"none\" }}\n\
                 camera {{ eye 0 0 6; center 0 0 0; fovy 40; size 3 3 }}\nmesh file=\"{file}\"\n\
                 triangle {{ a -9 -9 -3; b 9 -9 -3; c 0 18 -3 }}\nlight \"directional\" {{ direction 0 0 -1; intensity 0.5 }}"
            );
            let read = |name: &str| fs::read(root().join("tests/cases/models").join(name)).unwrap();
            drawn(&text, MemoryAssets::new().with(file, read(file)).with(mtl, read(mtl)))[4]
        };
        let behind = Rgb::gray(0.4);
        assert!(apart(&[scene("dissolve-i.obj", "dissolve-i.mtl")], &[behind]) < 1e-6);
        // The ray crosses two sides of the box, both lit, since nothing casts a shadow.
        let half = Rgb::new(0.4, 0.1, 0.1) * 0.75 + behind * 0.25;
        let found = scene("dissolve-j.obj", "dissolve-j.mtl");
        assert!(apart(&[found], &[half]) < 1e-6, "{found:?} {half:?}");
    }
}

mod colours {
    use super::*;

    #[test]
    fn an_exponent_of_0_is_no_highlight() {
        alike("scan.obj", "matte.obj", 0.0);
        alike("rough1.obj", "matte.obj", 0.0);
    }

    #[test]
    fn colours_from_0_to_255_are_told_and_read() {
        alike("kd255.obj", "matte.obj", 0.01);
        let (_, warnings) = model("kd255.obj");
        assert!(warnings.contains("kd255.mtl:2:1: warning: `Kd` goes beyond 1"), "{warnings}");
        for (file, warning) in [
            ("colours-255.obj", "vertex colours go up to 255: they are read as shares of 255"),
            ("colours-below-0.obj", "`v` has a colour with numbers below 0, which count as 0 (6 times)"),
        ] {
            alike(file, "colours-01.obj", 1e-4);
            let (_, warnings) = model(file);
            assert!(warnings.contains(warning), "{warnings}");
        }
    }
}

mod normals {
    use super::*;

    /// The normals at the corners of every triangle.
    fn corners(mesh: &Mesh) -> Vec<(Vec3, Vec3, Vec3)> {
        assert_eq!(mesh.normals.len(), mesh.positions.len());
        let all = mesh.triangles.iter().flat_map(|triangle| {
            let [a, b, c] = triangle.map(|i| mesh.positions[i as usize]);
            let flat = (b - a).cross(c - a).normalize();
            triangle.map(|i| (mesh.positions[i as usize], mesh.normals[i as usize], flat))
        });
        all.collect()
    }

    #[test]
    fn a_box_whose_normals_are_there_in_part_has_flat_sides() {
        for (file, warning) in [
            ("normals-of-one-face.obj", ""),
            ("normals-missing.obj", "`f` refers to normals that don't exist; they are computed (4 times)"),
            ("nan-normal.obj", "nan-normal.obj:10:1: warning: `vn` isn't finite; normals there are computed"),
            ("nan-normals.obj", "`vn` isn't finite; normals there are computed (3 times)"),
        ] {
            let (model, warnings) = model(file);
            assert!(warnings.contains(warning) && warnings.is_empty() == warning.is_empty(), "{file}: {warnings}");
            for (p, normal, flat) in corners(&model.meshes[0]) {
                assert!((normal - flat).length() < 1e-6, "{file}: {normal} at {p}");
            }
            alike(file, "normals.obj", 1e-4);
        }
        // All normals have zero length, which equals a file without normals.
        assert!(model("normals-zero.ply").0.meshes[0].normals.is_empty());
        alike("normals-zero.ply", "normals.obj", 1e-4);
    }

    /// The prism's sides form a smoothing group, its ends have none. Normals point away from the axis on the sides and
    /// along it on the ends.
    #[test]
    fn smoothing_groups_are_followed() {
        let (smooth, warnings) = model("smoothing-1.obj");
        assert_eq!(warnings, "");
        for (p, normal, flat) in corners(&smooth.meshes[0]) {
            let right = if flat.y.abs() > 0.5 { flat } else { Vec3::new(p.x, 0.0, p.z).normalize() };
            assert!((normal - right).length() < 1e-4, "{normal} at {p}");
        }
        // `s off` gives flat faces. A model alone would otherwise be smooth except at creases.
        let (off, warnings) = model("smoothing-off.obj");
        assert!(warnings.is_empty() && off.meshes[0].normals.is_empty());
        let (scene, _) = import::load("smoothing-off.obj", &folder(), &import::Staging::classic()).unwrap();
        assert!(scene.meshes[0].normals.is_empty());
    }

    /// Normals of the file take precedence over smoothing groups.
    #[test]
    fn given_normals_count_before_groups() {
        let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvn 0 1 1\ns 1\nf 1//1 2//1 3//1\nf 1 3 4\ns off\nf 1 4 2\n";
        let files = MemoryAssets::new().with("a.obj", text);
        let mesh = &import::load_objects("a.obj", &files, &AssetPath::base()).unwrap().0.meshes[0];
        let normals = |t: usize| mesh.triangles[t].map(|i| mesh.normals[i as usize]);
        assert!(normals(0).iter().all(|n| (*n - Vec3::new(0.0, 1.0, 1.0).normalize()).length() < 1e-6));
        // At the common edge of the first two faces, (0 0 1) and (1 0 0) are weighted by their angles.
        let shared = Vec3::new(1.0, 0.0, 1.0).normalize();
        assert!((normals(1)[0] - shared).length() < 1e-6, "{:?}", normals(1));
        assert_eq!(normals(2), [Vec3::Y; 3]);
    }
}

mod coordinates {
    use super::*;

    #[test]
    fn vertices_without_a_place_are_left_out() {
        let (model, warnings) = model("nan-unused-vertex.obj");
        assert_eq!(model.meshes[0].triangles.len(), 12);
        assert!(warnings.contains("nan-unused-vertex.obj:9:1: warning: `v` has no finite place"), "{warnings}");
        alike("nan-unused-vertex.obj", "trailing-comment.obj", 0.0);
    }

    #[test]
    fn what_has_no_area_is_an_error() {
        for file in ["single-point.obj", "line.obj"] {
            let wanted = "nothing in it has an area: 1 triangles, whose corners lie on a line or at one place";
            let alone = import::load(file, &folder(), &import::Staging::classic()).unwrap_err().to_string();
            assert!(alone.contains(&format!("{file}: error: {wanted}\n")), "{alone}");
            let text = format!("mesh file=\"{file}\"\n");
            let bytes = fs::read(root().join("tests/cases/models").join(file)).unwrap();
            let files = MemoryAssets::new().with(file, bytes).with("case.kdl", text);
            let placed = read_scene("case.kdl", &files).unwrap_err().to_string();
            assert!(placed.contains(wanted), "{placed}");
        }
    }

    /// The polygon covers 4 of 16 square units, seen from far above.
    #[test]
    fn polygons_with_corners_that_come_twice_keep_their_area() {
        for file in ["dart.obj", "dart-twice.obj", "dart-two-vertices.obj", "dart-closed.obj"] {
            let (model, _) = model(file);
            let mesh = &model.meshes[0];
            let area = |i: usize| {
                let [a, b, c] = mesh.corners(i);
                (b - a).cross(c - a).length() / 2.0
            };
            assert_eq!((0..mesh.len()).map(area).sum::<f32>(), 4.0, "{file}");
            let text = format!(
                "background 0\nintegrator \"whitted\" {{ stage \"unlit\" }}\nmaterial \"m\" {{ kd 1 }}\n\
                 film {{ transfer \"none\" }}\ncamera {{ eye 2 2 1000; center 2 2 0; fovy 0.4583638; size 200 200 }}\n\
                 mesh file=\"{file}\" material=\"m\"\n"
            );
            let bytes = fs::read(root().join("tests/cases/models").join(file)).unwrap();
            let pixels = drawn(&text, MemoryAssets::new().with(file, bytes));
            // The camera sees 8 × 8 units.
            let seen = pixels.iter().map(|c| c.r).sum::<f32>() * 64.0 / pixels.len() as f32;
            assert!((seen - 4.0).abs() < 0.02, "{file}: {seen}");
        }
    }
}

mod text {
    use super::*;

    #[test]
    fn capitals_comments_and_utf_16_are_read() {
        let plain = &model("trailing-comment.obj").0.meshes[0].clone();
        assert_eq!(plain.triangles.len(), 12);
        for file in ["upper.obj", "utf16.obj"] {
            let (model, warnings) = model(file);
            let mesh = &model.meshes[0];
            assert_eq!((&mesh.positions, &mesh.triangles, warnings.as_str()), (&plain.positions, &plain.triangles, ""));
        }
    }

    #[test]
    fn material_files_and_names_are_found() {
        for (file, material, warning) in [
            ("quoted-mtllib.obj", "red", "is read without its quotes"),
            ("abs-mtllib.obj", "red", "m.mtl\", which lies beside the model, is read instead"),
            ("latin1.obj", "gr\u{fc}n", ""),
        ] {
            let (model, warnings) = model(file);
            let mesh = &model.meshes[0];
            assert_eq!(model.materials[mesh.materials[0] as usize].name, material, "{file}: {warnings}");
            assert!(warnings.contains(warning) && warnings.is_empty() == warning.is_empty(), "{file}: {warnings}");
        }
        assert_eq!(model("latin1.obj").0.meshes[0].name, "Stra\u{df}e/Geb\u{e4}ude");
    }
}

/// Orientation of pictures on meshes: (0, 0) of OBJ and PLY is the picture's lower left corner.
mod orientation {
    use super::*;

    /// Red, green, blue and white: the upper row from the left, then the lower one.
    const PICTURE: [[f32; 3]; 4] = [[1., 0., 0.], [0., 1., 0.], [0., 0., 1.], [1., 1., 1.]];

    fn png(size: u32, color: impl Fn(u32, u32) -> [f32; 3]) -> Vec<u8> {
        let image = Image::from_rgb(size, size, (0..size * size).map(|i| color(i % size, i / size)));
        PictureFormat::Png
            .encode_image(&image, canaletto::scene::Transfer::None, &EncodeSettings::default(), &[])
            .unwrap()
    }

    const OBJ: &str = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n";

    /// Four vertices with texture coordinates and two triangles; `names` are those of the properties.
    fn ply(format: &str, names: [&str; 2]) -> Vec<u8> {
        let mut bytes = format!(
            "ply\nformat {format} 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
             property float {}\nproperty float {}\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n",
            names[0], names[1]
        )
        .into_bytes();
        let rows = [[-1f32, -1., 0., 0., 0.], [1., -1., 0., 1., 0.], [1., 1., 0., 1., 1.], [-1., 1., 0., 0., 1.]];
        let faces = [[0i32, 1, 2], [0, 2, 3]];
        match format {
            "ascii" => {
                let row = |row: &[f32; 5]| row.map(|n| n.to_string()).join(" ") + "\n";
                bytes.extend(rows.iter().flat_map(|r| row(r).into_bytes()));
                bytes.extend(faces.iter().flat_map(|[a, b, c]| format!("3 {a} {b} {c}\n").into_bytes()));
            }
            _ => {
                bytes.extend(rows.iter().flatten().flat_map(|n| n.to_be_bytes()));
                for face in faces {
                    bytes.push(3);
                    bytes.extend(face.iter().flat_map(|n| n.to_be_bytes()));
                }
            }
        }
        bytes
    }

    fn files() -> Vec<(&'static str, Vec<u8>)> {
        vec![
            ("a.obj", OBJ.into()),
            ("a.ply", ply("ascii", ["u", "v"])),
            ("a.ply", ply("binary_big_endian", ["s", "t"])),
            ("a.ply", ply("binary_big_endian", ["texture_u", "texture_v"])),
        ]
    }

    /// The four quarters of the square are seen from the front and from behind.
    #[test]
    fn the_picture_stands_upright_on_meshes() {
        for (name, bytes) in files() {
            for (eye, order) in [(6.0, [0, 1, 2, 3]), (-6.0, [1, 0, 3, 2])] {
                let text = format!(
                    "background 0.5\ncamera {{ eye 0 0 {eye}; center 0 0 0; fovy 18.9246; size 2 2 }}\n\
                     film {{ sample \"center\"; transfer \"none\" }}\n\
                     texture \"p\" file=\"p.png\" {{ filter \"nearest\"; space \"linear\" }}\n\
                     material \"m\" {{ texture \"p\" use=\"replace\" }}\nmesh file=\"{name}\" material=\"m\"\n"
                );
                let picture = png(2, |x, y| PICTURE[(2 * y + x) as usize]);
                let found = drawn(&text, MemoryAssets::new().with(name, bytes.clone()).with("p.png", picture));
                let right = order.map(|i| Rgb::from(PICTURE[i]));
                assert_eq!(found, right, "{name} from {eye}");
            }
        }
    }

    /// Heights grow towards the picture's upper edge. Bumps, normal maps and displacements lean down there.
    #[test]
    fn heights_and_normals_follow_the_picture() {
        let ramp = png(64, |_, y| [1.0 - y as f32 / 63.0; 3]);
        // In OpenGL's convention green points upwards in the image.
        let up = png(2, |_, _| [0.5, 0.85, 0.85]);
        for (name, bytes) in files() {
            for (use_, sign) in
                [("use=\"bump\" height=2", -1.0), ("use=\"normal\"", 1.0), ("use=\"displace\" height=2", -1.0)]
            {
                let text = format!(
                    "background 0\nambient 0\ncamera {{ eye 0 0 9; center 0 0 0; fovy 5; size 2 2 }}\nfilm {{ transfer \"none\" }}\n\
                     texture \"p\" file=\"p.png\" {{ space \"linear\" }}\n\
                     material \"m\" {{ kd 1; texture \"p\" {use_} }}\nmesh file=\"{name}\" material=\"m\"\n\
                     light \"directional\" {{ direction 0 -1 -0.2; intensity 0.5; shadows #false }}\n"
                );
                let picture = if use_.contains("normal") { up.clone() } else { ramp.clone() };
                let light = |direction: &str| {
                    let text = text.replace("0 -1 -0.2", direction);
                    let files = MemoryAssets::new().with(name, bytes.clone()).with("p.png", picture.clone());
                    drawn(&text, files)[0].r
                };
                let (above, below) = (light("0 -1 -0.2"), light("0 1 -0.2"));
                assert!((above - below) * sign > 0.1, "{name} {use_}: {above} from above, {below} from below");
            }
        }
    }

    #[test]
    fn the_globe_in_the_book_stands_upright() {
        let assets = FolderAssets::new(root().join("scenes")).unwrap();
        let (scene, warnings) = read_scene("mesh-pictures.kdl", &assets).unwrap_or_else(|errors| panic!("{errors}"));
        assert!(warnings.is_empty(), "{warnings}");
        assert!(scene.nodes.iter().any(|node| !matches!(node.content, Content::Light(_))));
        let globe = &scene.meshes[0];
        // The north pole is the picture's top row, and east is to the right, seen from outside.
        for (p, uv) in globe.positions.iter().zip(&globe.uvs) {
            assert!((p.y - libm::cosf(std::f32::consts::PI * uv.y)).abs() < 1e-4, "{p} {uv}");
            if p.y.abs() < 0.999 {
                let east = libm::atan2f(p.x, p.z) / std::f32::consts::TAU;
                let around = uv.x - 0.5 - east;
                assert!((around - around.round()).abs() < 1e-4, "{p} {uv}");
            }
        }
    }
}
