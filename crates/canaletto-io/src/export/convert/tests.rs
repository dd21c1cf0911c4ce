//! Scenes come back from the text that they are converted to.

use super::*;
use crate::assets::MemoryAssets;
use crate::text::read_scene_text;

/// The files of a conversion, to be read.
fn assets_of(files: &[ConvertedFile]) -> MemoryAssets {
    files.iter().fold(MemoryAssets::new(), |assets, file| assets.with(&file.name, file.bytes.clone()))
}

fn converted(scene: &Scene, format: ConvertFormat) -> Conversion {
    let source =
        Source { scene, originals: &Originals::new(), stem: "s", has_default_material: true, remarks: Vec::new() };
    convert(&source, format)
}

/// Converts the scene of a text, and reads it again. Names of images apart, nothing may have changed.
fn comes_back(text: &str, assets: &MemoryAssets) -> (String, Vec<Loss>) {
    let (scene, _) = read_scene_text(text, "s.kdl", assets, &[]).unwrap_or_else(|e| panic!("{text}\n{e}"));
    let Conversion { files, lost } = converted(&scene, ConvertFormat::Text);
    let written = String::from_utf8(files[0].bytes.clone()).unwrap();
    let (mut again, _) =
        read_scene_text(&written, "s.kdl", &assets_of(&files), &[]).unwrap_or_else(|e| panic!("{written}\n{e}"));
    again.images.iter_mut().zip(&scene.images).for_each(|(new, old)| new.name.clone_from(&old.name));
    again.spheres.iter_mut().zip(&scene.spheres).for_each(|(new, old)| new.name.clone_from(&old.name));
    again.cylinders.iter_mut().zip(&scene.cylinders).for_each(|(new, old)| new.name.clone_from(&old.name));
    assert_eq!(again, scene, "{written}");
    let second = String::from_utf8(converted(&again, ConvertFormat::Text).files[0].bytes.clone()).unwrap();
    assert_eq!(second, written);
    (written, lost)
}

fn stays(text: &str) -> String {
    let (written, lost) = comes_back(text, &MemoryAssets::new());
    assert!(lost.is_empty(), "{lost:?}");
    written
}

#[test]
fn settings_come_back() {
    for text in [
        "camera { eye 0.1 2 3; center 1 2 0.3; fovy 33.3; size 64 48; shift 0.1 0.2; far 9 }",
        "camera \"a \\\"b\\\" \\u{7}\" { eye 0 0 9; orthographic 3; lens { radius 0.2; focus 3; blades 6; \
         rotation 15 } }",
        "camera \"a\" { eye 0 0 9; near 2; lens { f-number 2.8; focus-point 0 1 2 }; shutter 0 0.5 }\ncamera \
         \"b\" { eye 1 1 1 }",
        "camera { eye 0 2 9; motion { eye 1 2 9 } }",
        "film { samples 64; sampler \"blue-noise\"; filter \"gaussian\" sigma=0.7; exposure 0.5; tone \"agx\"; alpha }",
        "film { sample \"jittered\" n=3; filter \"mitchell\"; exposure \"auto\"; transfer \"none\"; tone \"clamp\" }",
        "film { sample \"adaptive\" n=5 threshold=0.02; crop 1 2 3 4 }\ncamera { eye 0 0 9 }",
        "integrator \"whitted\" { max-depth 3; min-weight 0.01; stage \"shadow\"; shadows #false }",
        "integrator \"zbuffer\" { shading \"flat\"; shadows \"none\"; shadow-map-size 64; multisampling 4; \
         tolerance 0.1 }",
        "integrator \"radiosity\" { method \"full\"; error 0.1; show \"patches\"; max-patches 9; light-samples 4 }",
        "integrator \"path\" { max-depth 4; roulette #false; guiding \"on\" }",
        "background 0.1 0.2 0.3\nambient 0.5",
        "environment \"gradient\" { stops -90 0.2 0.1 0.15  90 0.1 0.3 0.7; rotate-z 10; intensity 2; ambient }",
        "environment \"sky\" { sun 0 1 0.1; turbidity 5; ground 0.5; exposure 1; disk #false; light #false; \
         visible #false }",
    ] {
        stays(&format!("{text}\nsphere {{ center 0 0 0; radius 1 }}"));
    }
}

#[test]
fn materials_and_textures_come_back() {
    for text in [
        "kd 0.1 0.2 0.3; ks 0.5; n 50; k 0.1; eta 1.5; opacity 0.5; roughness 0.2; emission 3",
        "conductor \"gold\"; roughness 0.3; emission 1",
        "conductor { eta 1 1.1 1.2; k 3 }",
        "dielectric 1.5; alpha 0.04; absorption 0.1 0.2 0.3; priority 2",
        "medium { absorption 0.1; scattering 0.5; anisotropy 0.3 }",
        "kd 1; coverage 0.5; alpha-cutoff 0.25; emission 1; two-sided #true",
        "standard { preset \"velvet\" }",
        "standard { base { color 0.8 0.1 0.05; metalness 0.5; diffuse-roughness 0.2 }; specular { weight 0.7; ior 1.3; \
         anisotropy 0.4; anisotropy-rotation 30 }; coat { weight 1; ior 1.5; darkening 0 }; thin-film { weight 1 }; \
         emission { radiance 5; color 1 0.8 0.6 }; thin-walled; schlick; opacity 0.5 }",
        "standard { transmission { weight 1; color 0.9 1 0.9; depth 2 }; fuzz { weight 0.5; color 0.1 0.2 0.3 } }",
    ] {
        stays(&format!("material \"m\" {{ {text} }}\nsphere material=\"m\" {{ center 0 0 0; radius 1 }}"));
    }
    for kind in [
        "kind=\"constant\" { color 0.1 0.2 0.3; alpha 0.5 }",
        "kind=\"vertex-color\"",
        "kind=\"ramp\" { stops 0 1 0 0  0.5 0 1 0; interpolation \"smooth\"; wrap \"mirror\" }",
        "kind=\"checker\" { even 0.1; odd 0.9 0.9 0.8 }",
        "kind=\"gradient\" { shape \"angular\"; axis 0 0 1; wrap \"repeat\"; stops-alpha 0 0 0 0 0.5  1 1 1 1 1 }",
        "kind=\"noise\" { seed 3 }",
        "kind=\"fbm\" { octaves 8; lacunarity 3; gain 0.6; seed 1; stops 0.3 0.1 0.3 0.1  0.7 0.5 0.4 0.3 }",
        "kind=\"turbulence\"",
        "kind=\"marble\" { strength 3; octaves 2 }",
        "kind=\"wood\" { strength 0.5 }",
        "kind=\"worley\" { feature \"edge\"; jitter 0.5 }",
    ] {
        stays(&format!(
            "texture \"t\" {kind}\nmaterial \"m\" {{ texture \"t\" mapping=\"box\" space=\"world\" {{ scale \
             2; repeat 3 4 }} \n \
             texture \"t\" use=\"roughness\" channel=\"red\" multiply=#true {{ range 0.1 0.9 }} \n \
             texture \"t\" use=\"bump\" height=0.1; texture \"t\" use=\"decal\" mapping=\"triplanar\" }}\n\
             sphere material=\"m\" {{ center 0 0 0; radius 1 }}"
        ));
    }
}

#[test]
fn objects_and_lights_come_back() {
    for text in [
        "sphere \"a\" { center 0.1 0.2 408201.58; radius 0.3; translate 1 2 3 }",
        "box { min -1 -1 -1; max 1 1 1; rotate-x 10; motion { translate 3 0 0 } }",
        "box { min -1 -1 -1; max 1 1 1; motion { rotate-y 900; translate 3 0 0 } }",
        "box { min -1 -1 -1; max 1 1 1; motion { scale 2; rotate-z -100 } }",
        "box { min -1 -1 -1; max 1 1 1; motion { rotate-x 360 } }",
        "triangle { a 3 2 1; b 8 2 1; c 4 8 -4; one-sided }",
        "plane { point 0 -50 0; normal 0 1 0 }",
        "disk { center 0 0 0; normal 0 1 0; radius 3; angle 90; start-angle 10 }",
        "rectangle { corner -1 0 1; u 2 0 0; v 0 0 -2 }",
        "cylinder { base 0 0 0; top 0 10 0; radius 2; caps #false }",
        "cone { base 0 0 0; top 0 5 0; radius 2; top-radius 0.5; angle 90 }",
        "torus { center 0 0 0; axis 0 1 0; radius 5; tube 1; casts-shadow #false }",
        "spheres \"s\" radius=1 { points 0 0 0  2 0 0.1  4 0 0 }",
        "spheres { data \"0 0 0 1 0.5 0 0\\n2 0 0 2 1 0.25 0.1\" }",
        "spheres radius=0.5 { points 408201.58 102.4 -4080928.02  408204.58 102.57 -4080928.32 }",
        "cylinders radius=0.5 caps=#false { axes 0 0 0 0 5 0  2 0 0 2 5 0 }",
        "cylinders radius=0.5 { data \"0 0 0 0 5 0 0.5\\n2 0 0 2 5 0 1\" }",
        "group \"lamp\" { translate 0 5 0; sphere { center 0 0 0; radius 1 }\n light \"omni\" { position 0 1 0 } }\n\
         instance \"lamp\" name=\"second\" { translate 9 0 0; rotate 1 2 3 33; scale 1 2 3 }",
        "prototype \"ball\" { scale 2; sphere { center 0 0 0; radius 1 } }\ninstance \"ball\"\ninstance \
         \"ball\" { scale -1 1 1 }",
        "sphere \"b\" { center 0 0 0; radius 1 }\ngroup { instance \"b\" { translate 2 0 0; rotate-y 7; rotate-x 3 } }",
        "light \"omni\" { position 1 2 3 0; intensity 0.5 0.6 0.7; name \"sun\"; shadows #false }",
        "light \"omni\" { position 0.1 2 3; attenuation 0 0 1; range 9 }",
        "light \"directional\" { direction -0.2 -1 -0.1; axis 0 20 0; radius 45 }",
        "light \"spot\" { position 0 50 0; target 0 0 0.1; inner 20; outer 30; edge \"squared\" }",
        "light \"spot\" { position 0 50 0; target 0 0 0.1; exponent 20; outer 30 }",
        "light \"disk\" { position 40 120 0; normal 0 -1 0; radius 10; points 4 }",
        "light \"rectangle\" { corner -1 5 -1; u 2 0 0; v 0 0 2; samples 1; emission \"matte\"; visible; intensity 8 }",
        "light \"sphere\" { center 0 5 0; radius 0.5; points 32; rotate-z 3 }",
    ] {
        stays(text);
    }
}

#[test]
fn motion_that_keys_make_is_told() {
    let text = "camera { eye 0 0 9; shutter 0 0.5 }\nbox \"wheel\" { min -1 -1 -1; max 1 1 1; rotate-y { key \
     0 0; key 1 90 } }";
    let (scene, _) = read_scene_text(text, "s.kdl", &MemoryAssets::new(), &[]).unwrap();
    let lost = converted(&scene, ConvertFormat::Text).lost;
    assert_eq!(lost[0].to_string(), "motion while the shutter is open (1): \"wheel\"");
}

/// An OBJ of two materials, whose triangles change between them.
const TWO: &str = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 0.3\nvn 0 0 1\nusemtl a\n\
                   f 1/1/1 2/2/1 3/3/1\nusemtl b\nf 1/1/1 3/3/1 4/2/1\n";

#[test]
fn meshes_come_back_with_their_parts() {
    let assets =
        MemoryAssets::new().with("two.obj", TWO).with("m.mtl", "newmtl a\nKd 1 0 0\nnewmtl b\nKd 0 1 0\n").with(
            "c.ply",
            "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
               property uchar red\nproperty uchar green\nproperty uchar blue\nelement face 1\n\
               property list uchar int vertex_indices\nend_header\n0 0 0 255 0 0\n1 0 0 0 255 0\n0 1 0.1 0 0 \
                255\n3 0 1 2\n",
        );
    let (scene, _) = read_scene_text("mesh file=\"two.obj\" { one-sided; scale 2 }", "s.kdl", &assets, &[]).unwrap();
    let Conversion { files, lost } = converted(&scene, ConvertFormat::Text);
    assert!(lost.is_empty(), "{lost:?}");
    let written = String::from_utf8(files[0].bytes.clone()).unwrap();
    assert!(written.contains("part \"a\"") && written.contains("part \"b\""), "{written}");
    let (again, _) = read_scene_text(&written, "s.kdl", &assets_of(&files), &[]).unwrap();
    let [old, new] = [&scene, &again].map(|scene| &scene.meshes[0]);
    assert_eq!((&new.slots, new.materials.len(), new.one_sided), (&old.slots, 2, true));
    for i in 0..2 {
        assert_eq!(new.corners(i), old.corners(i));
        let uvs =
            |mesh: &canaletto::shape::Mesh| mesh.triangles[i].map(|v| (mesh.uvs[v as usize], mesh.normals[v as usize]));
        assert_eq!(uvs(new), uvs(old));
    }
    // Colours of vertices replace those of a material, which is said as that of a part.
    let (scene, _) =
        read_scene_text("material \"m\"\nmesh file=\"c.ply\" material=\"m\"", "s.kdl", &assets, &[]).unwrap();
    let Conversion { files, lost } = converted(&scene, ConvertFormat::Text);
    let written = String::from_utf8(files[0].bytes.clone()).unwrap();
    assert!(lost.is_empty() && written.contains("part \"m\""), "{written}");
    let (again, _) = read_scene_text(&written, "s.kdl", &assets_of(&files), &[]).unwrap();
    assert_eq!((&again.meshes[0].colors, again.meshes[0].materials.len()), (&scene.meshes[0].colors, 1));
    assert_eq!((again.materials.len(), again.textures.len()), (1, 0));
}

#[test]
fn names_of_parts_are_checked() {
    let assets = MemoryAssets::new().with("two.obj", TWO).with("m.mtl", "newmtl a\nnewmtl b\n");
    for (text, problem) in [
        ("mesh file=\"two.obj\" { part \"m\" }", "part stands 1 times, but the file has 2 parts"),
        ("mesh file=\"two.obj\" { part \"m\"; part \"o\" }", "no material \"o\""),
        ("mesh file=\"two.obj\" material=\"m\" { part \"m\"; part \"m\" }", "material is given twice"),
    ] {
        let text = format!("material \"m\"\n{text}");
        let mistakes = read_scene_text(&text, "s.kdl", &assets, &[]).unwrap_err().to_string();
        assert!(mistakes.contains(problem), "{mistakes}");
    }
}

#[test]
fn a_matrix_has_its_own_inverse() {
    let read = |rows: &str| {
        let text = format!("sphere {{ center 0 0 0; radius 1; matrix {rows} }}");
        read_scene_text(&text, "s.kdl", &MemoryAssets::new(), &[])
    };
    let scale = "2 0 0 6  0 2 0 0  0 0 2 0";
    let (scene, _) = read(&format!("{scale}  0.5 0 0 -3  0 0.5 0 0  0 0 0.5 0")).unwrap();
    assert_eq!(scene.nodes[0].transform.point(glam::DVec3::ONE), glam::DVec3::new(8.0, 2.0, 2.0));
    for wrong in ["0.5 0 0 3  0 0.5 0 0  0 0 0.5 0", "0.5 0 0 -3  0 0.5 0 0  0 0 0.6 0", "0 0 0 0  0 0 0 0  0 0 0 0"] {
        let mistakes = read(&format!("{scale}  {wrong}")).unwrap_err().to_string();
        assert!(mistakes.contains("aren't the inverse of the first 12"), "{mistakes}");
    }
}
