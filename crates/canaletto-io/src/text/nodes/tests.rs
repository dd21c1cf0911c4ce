//! Every field of every table is read, and every field that is read stands in the table of its node.

use super::*;
use crate::assets::MemoryAssets;
use crate::picture::{EncodeSettings, Image, PictureFormat};
use crate::source::SceneSource;
use crate::text::SceneDocument;
use canaletto::scene::Transfer;
use std::cell::RefCell;
use std::collections::HashSet;

thread_local! {
    /// The fields that were read in this thread: the schema's address and the field's name.
    static READ: RefCell<HashSet<(usize, &'static str)>> = RefCell::default();
}

/// Notes that a field of a node of this schema is read.
pub(crate) fn note_read(schema: &'static NodeSchema, field: &'static str) {
    READ.with_borrow_mut(|read| read.insert((address(schema), field)));
}

fn address(schema: &'static NodeSchema) -> usize {
    std::ptr::from_ref(schema) as usize
}

/// All schemas, with a title.
fn schemas() -> Vec<(&'static NodeSchema, String)> {
    let settings = SETTINGS.iter().map(|setting| setting.schema);
    let objects = OBJECTS.iter().map(|object| &object.schema);
    let blocks = [
        &SAMPLE,
        &FILTER,
        &LENS,
        &CAMERA_MOTION,
        &CONDUCTOR,
        &MEDIUM,
        &PART,
        &SURFACE_TEXTURE,
        &MOTION,
        &FOLLOW,
        &CAMERA_FOLLOW,
        &POINT_FOLLOW,
    ]
    .into_iter()
    .chain([&STANDARD])
    .chain(STANDARD_BLOCKS);
    let lights = LIGHTS.iter().map(|light| &light.schema);
    let environments = ENVIRONMENTS.iter().map(|environment| &environment.schema);
    let textures = TEXTURES.iter().map(|texture| &texture.schema);
    let all = settings.chain(objects).chain(blocks).chain(lights).chain(environments).chain(textures);
    all.map(|schema| (schema, format!("{} {}", schema.name, kind_of(schema)))).collect()
}

/// Whether a field is read without its node's fields: words that select a schema, names that are read before the rest,
/// and paths that are replaced by points.
fn is_read_apart(schema: &'static NodeSchema, field: &FieldSchema) -> bool {
    let name_of_camera = || CAMERA.argument.is_some_and(|argument| argument.name == field.name);
    matches!(field.value_type, ValueType::Keyword([_])) && field.name == Field::kind(&[], "").name()
        || std::ptr::eq(schema, &INCLUDE)
        || std::ptr::eq(schema, &CAMERA) && (field.name == CAMERA_FOLLOW.name || name_of_camera())
}

fn picture(width: u32, height: u32) -> Vec<u8> {
    let image = Image::from_rgb(width, height, (0..width * height).map(|_| [0.5; 3]));
    PictureFormat::Png.encode_image(&image, Transfer::Srgb, &EncodeSettings::default(), &[]).unwrap()
}

/// Scenes that read fields which no example reads, since their examples say the same in another form.
const MORE: &[&str] = &[
    "film { filter \"gaussian\" sigma=0.5 }",
    "film { sample \"jittered\" { n 3 } }",
    "film { sample \"adaptive\" n=3 threshold=0.1 }",
    "spheres radius=1 file=\"a.csv\"",
    "spheres radius=1 data=\"0 0 0\"",
    "cylinders file=\"b.csv\"",
    "cylinders radius=1 data=\"0 0 0 1 1 1\"",
    "light \"directional\" { direction 0 -1 0; temperature 5000 }",
    "light \"omni\" { position 0 9 0; ies \"lamp.ies\"; axis 0 -1 0; front 1 0 0 }",
    "light \"spot\" { position 0 9 0; target 0 0 0; outer 9; ies \"lamp.ies\" }",
    "material \"m\" { emission 9; temperature 2700 }",
    "light \"spot\" { position 0 9 0; target 0 0 0; outer 9; exponent 2 }",
    "texture \"t\" kind=\"grid\" file=\"raw\" { size 1 1 1 }",
    "environment \"sky\" { height 9; azimuth 9 }",
    "environment \"sky\" { sun 0 1 0 }",
    "texture \"t\" file=\"bricks.png\"\nmaterial \"m\" { texture \"t\" use=\"normal\"; texture \"t\" use=\"displace\" height=1 }",
    "path \"p\" { points 0 0 0  1 0 0 }\nsphere { center 0 0 0; radius 1; follow \"p\" { at 0.5; face 1 0 0 } }",
    "integrator \"zbuffer\" { shading \"flat\" }",
    "integrator \"radiosity\" { method \"shooting\"; error 0.1 }",
    "integrator \"path\" { max-depth 4; roulette #false; guiding \"on\" }",
    "material \"m\" { conductor { eta 1 1 1; k 1 1 1 }; alpha 0.1 }",
    "material \"m\" { dielectric 1.5; absorption 0.1 0.2 0.3 }",
    "material \"m\" { standard { base { weight 1; diffuse-roughness 0 }; specular { weight 1; color 1; anisotropy 0 }; coat { color 1; anisotropy 0; ior 1.6; darkening 1 }; fuzz { roughness 0.5 }; thin-film { ior 1.4 }; transmission { dispersion-scale 0; dispersion-abbe-number 20 }; opacity 1; thin-walled #true; preset \"velvet\" } }",
    "cylinder { base 0 0 0; top 0 1 0; radius 1; angle 90; start-angle 10 }",
    "cone { base 0 0 0; top 0 1 0; radius 1; angle 90; start-angle 10 }",
    "disk { center 0 0 0; normal 0 1 0; radius 1; angle 90; start-angle 10 }",
    "path \"p\" { points 0 0 0  1 0 0 }\ncamera { follow \"p\" along=#true }",
    "path \"p\" { points 0 0 0  1 0 0 }\nsphere { center { follow \"p\" at=1 }; radius 1 }",
];

#[test]
fn every_field_of_a_table_is_read_and_no_other() {
    let names = ["bricks", "px", "nx", "py", "ny", "pz", "nz", "slice-01", "slice-02"];
    let assets =
        names.iter().fold(MemoryAssets::new(), |assets, name| assets.with(&format!("{name}.png"), picture(2, 2)));
    let assets = assets
        .with("cross.png", picture(8, 6))
        .with("studio.png", picture(4, 2))
        .with("stage.kdl", "")
        .with("bunny.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
        .with("a.csv", "0,0,0\n")
        .with("b.csv", "0,0,0,1,1,1,1\n")
        .with("raw", vec![0]);
    READ.with_borrow_mut(HashSet::clear);
    let ramp = |kind: &str| {
        format!(
            "texture \"a\" kind=\"{kind}\"\ntexture \"b\" kind=\"{kind}\" {{ stops 0 0 0 0 }}\ntexture \"c\" kind=\"{kind}\" {{ stops-alpha 0 0 0 0 1 }}"
        )
    };
    let ramps = TEXTURES.iter().filter(|texture| texture.schema.word("stops-alpha").is_some());
    let scenes = schemas().into_iter().map(|(schema, _)| schema.example.to_owned());
    let scenes = scenes.chain(MORE.iter().map(ToString::to_string)).chain(ramps.map(|t| ramp(kind_of(&t.schema))));
    for scene in scenes {
        // Names that examples use and don't define are mistakes, which stop no reader.
        if let Ok(mut document) = SceneDocument::of_text(&scene, "s", &assets, &[]) {
            let _ = document.scene(&assets, 0.0);
        }
    }
    let read = READ.take();
    let mut known = HashSet::new();
    let mut wrong = Vec::new();
    for (schema, title) in schemas() {
        for field in schema.argument.iter().chain(schema.own()) {
            known.insert((address(schema), field.name));
            let is_read = read.contains(&(address(schema), field.name));
            if !is_read && !is_read_apart(schema, field) {
                wrong.push(format!("{title}: {} is in the table and not read", field.name));
            }
        }
        for (_, name) in read.iter().filter(|(of, _)| *of == address(schema)) {
            let stands = known.contains(&(address(schema), *name)) || field(schema, name).is_some();
            if !stands {
                wrong.push(format!("{title}: {name} is read and not in the table"));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
