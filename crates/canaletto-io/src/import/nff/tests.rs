use super::*;
use crate::assets::MemoryAssets;
use crate::import::Staging;
use canaletto::scene::Scene;

const VIEW: &str = "v\nfrom 2 1 1.5\nat 0 0 0\nup 0 0 1\nangle 45\nhither 0.01\nresolution 512 256\n";

fn load(text: &str) -> Result<(Scene, Diagnostics), Diagnostics> {
    super::super::load("a.nff", &MemoryAssets::new().with("a.nff", text), &Staging::default())
}

fn error(text: &str) -> String {
    load(text).unwrap_err().to_string()
}

#[test]
fn every_entity_is_read() {
    let text = format!(
        "# a comment\nb 0.1 0.2 0.3\n{VIEW}l 4 3 2\nl 1 -4 4 0.5 0.6 0.7\nf 1 0.5 0.25 0.8 0.3 20 0.4 1.5\n\
        s 0 0 1 .5 # a ball\nc 0 0 0 1\n0 0 2 1\nc 0 0 0 1 0 0 2 0\np 4\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n\
        f 1 1 1 1 0 0 0 0\npp 3\n0 0 0 0 0 1\n1 0 0 0 0 0\n0 1 0 0 1 1\nf 1 0.5 0.25 0.8 0.3 20 0.4 1.5\np 3 0 0 0 1 0 0 0 0 1\n"
    );
    let (scene, warnings) = load(&text).unwrap();
    assert!(warnings.is_empty());
    assert_eq!(scene.background, Rgb::new(0.1, 0.2, 0.3));
    let view = &scene.views[0];
    assert_eq!((view.intrinsics.fovy, view.intrinsics.width, view.intrinsics.height), (45.0, 512, 256));
    assert_eq!((view.extrinsics.eye, view.extrinsics.up), (DVec3::new(2., 1., 1.5), DVec3::Z));
    assert_eq!(scene.materials.len(), 2, "the same numbers are the same material");
    let phong = scene.materials[0].classic();
    assert_eq!((phong.kd, phong.ks, phong.k), (Rgb::new(0.8, 0.4, 0.2), Rgb::gray(0.3), Rgb::gray(0.3)));
    assert_eq!((phong.n, phong.opacity, phong.eta), (20.0, 1.0 - 0.4, 1.5));
    assert_eq!(scene.materials[1].classic().eta, 1.0);
    let meshes: Vec<(usize, usize)> = scene.meshes.iter().map(|m| (m.triangles.len(), m.normals.len())).collect();
    assert_eq!(meshes, [(3, 0), (1, 3)]);
    assert_eq!(scene.meshes[1].normals[1], Vec3::Z);
    let kinds: Vec<&str> = scene
        .nodes
        .iter()
        .map(|n| match &n.content {
            Content::Shape(Shape::Sphere(_)) => "s",
            Content::Shape(Shape::Cylinder(_)) => "cylinder",
            Content::Shape(Shape::Cone(_)) => "cone",
            Content::Mesh(_) => "m",
            Content::Light(_) => "l",
            _ => "?",
        })
        .collect();
    assert_eq!(kinds, ["s", "cylinder", "cone", "m", "m", "l", "l"]);
    let Content::Light(light) = &scene.nodes[5].content else { panic!() };
    assert!((light.intensity.r - 0.5f32.sqrt()).abs() < 1e-6);
    let Content::Light(light) = &scene.nodes[6].content else { panic!() };
    assert_eq!(light.intensity, Rgb::new(0.5, 0.6, 0.7));
}

#[test]
fn without_a_view_all_is_seen() {
    let (scene, _) = load("s 0 0 0 1\ns 5 0 0 1\n").unwrap();
    assert!(scene.views[0].extrinsics.eye.y < -5.0);
    assert_eq!(scene.materials[0].name, "default");
}

#[test]
fn what_has_no_extent_is_left_out() {
    let (scene, warnings) = load(&format!(
        "{VIEW}s 0 0 0 0\ns 0 0 0 0\nc 0 0 0 1 0 0 0 1\nc 0 0 0 0 0 0 1 0\np 2 0 0 0 1 1 1\ns 0 0 0 -2\n"
    ))
    .unwrap();
    assert_eq!((scene.nodes.len(), warnings.warnings()), (1, 4));
    assert!(
        warnings.to_string().contains("a.nff:8:1: warning: a sphere of radius 0 is left out (2 of them)"),
        "{warnings}"
    );
}

#[test]
fn errors_name_line_and_reason() {
    for (text, message) in [
        ("s 0 0 0\n", "a.nff:1:7: error: s is not complete: the file ends here"),
        ("s 0 0 x 1\n", "a.nff:1:7: error: s: \"x\" is not a number"),
        ("s 0 0 0 1\nq 1\n", "a.nff:2:1: error: \"q\" is not a word of NFF: b, v, l, f, s, c, p or pp"),
        ("p 99999999999\n", "p: \"99999999999\" is not a whole number from 0 to 4294967295"),
        ("p 4000000000 1 2 3\n", "corner is not complete: the file ends here"),
        ("f 1 1 1 1 1 1 2 1\n", "a.nff:1:1: error: opacity is -1; it must be between 0 (clear) and 1 (opaque)"),
        ("v from 0 0 0\n", "the view needs `from` and `at`"),
        ("v from 0 0 0 at 0 0 1 up 0 0 1\n", "the view has no direction"),
        ("v angle 180\n", "angle is 180; it must lie between 0 and 180 degrees"),
        ("v resolution 0 4\n", "resolution: \"0\" is not a whole number from 1 to 65536"),
        ("b 1 -1 1\n", "background is -1; it must be 0 or more"),
        ("", "a.nff: error: there are no objects in it"),
    ] {
        let found = error(text);
        assert!(found.contains(message), "{text}: {found}");
    }
}

#[test]
fn polygons_without_an_area_are_left_out() {
    let line = "p 3\n0 0 0\n0.1 0.1 0.1\n0.3 0.3 0.3\n";
    let (scene, warnings) = load(&format!("{VIEW}{line}{line}s 0 0 0 1\n")).unwrap();
    assert_eq!((scene.nodes.len(), scene.meshes.len()), (1, 0));
    assert!(warnings.to_string().contains("lie on a line or at one place is left out (2 of them)"), "{warnings}");
    assert!(error(&format!("{VIEW}{line}")).contains("there are no objects in it"));
    let far = "p 3\n4000000 0 0\n4000000.25 0 0\n4000000 0.25 0\n";
    assert_eq!(load(&format!("{VIEW}{far}")).unwrap().0.meshes[0].len(), 1, "small, but not flat");
}
