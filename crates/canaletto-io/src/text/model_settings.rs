//! Overrides of a model's scene: `--set camera.fovy=25` for an OBJ file.
//!
//! What can be set is described by nodes as a scene text would: cameras, film, integrator, colours, materials and
//! lights. The nodes that an assignment changes are decoded over the scene, and all else keeps its bits.

use super::decode::override_scene;
use super::files::Files;
use super::nodes::{CAMERA, INTEGRATOR, LIGHT, MATERIAL_NODE, NAME};
use super::overrides::{Settable, apply_set};
use super::report::Report;
use super::syntax::{Node, Span, Value, ValueKind};
use crate::assets::{AssetPath, Assets};
use crate::diagnostic::Diagnostics;
use canaletto::Named;
use canaletto::light::{Directional, DiskLight, Light, LightKind, Omni};
use canaletto::math::Transform;
use canaletto::scene::{self, Content, Scene};
use glam::{DMat3, DVec3, Vec3};

/// Applies assignments to the scene of the model `name`; returns it with warnings.
///
/// # Errors
/// The mistakes in the assignments.
pub(crate) fn set_in_model(
    scene: Scene,
    name: &str,
    assets: &dyn Assets,
    set: &[String],
) -> Result<(Scene, Diagnostics), Diagnostics> {
    let (mut files, mut report) = (Files::default(), Report::default());
    let file = files.add(name.to_owned(), AssetPath::new("", name, name), "".into());
    let mut nodes = described(&scene, Span { file, start: 0, end: 0 });
    apply_set(&mut nodes, set, Settable::Model, &mut files, &mut report);
    let (scene, report) = override_scene(scene, &nodes, Some(file), &files, assets, report);
    let failed = report.has_errors();
    let diagnostics = report.finish(&files);
    match scene {
        Some(scene) if !failed => Ok((scene, diagnostics)),
        _ => Err(diagnostics),
    }
}

/// The nodes of what has a name. Cameras and materials are decoded over those of the scene, so their fields may be
/// left out. Lights are decoded anew.
fn described(scene: &Scene, span: Span) -> Vec<Node> {
    let with_text = |word: &str, text: &str| {
        let mut node = Node::new(word, span);
        node.values.push(Value { kind: ValueKind::Text(text.into()), span });
        node
    };
    let cameras = scene.views.iter().map(|view| with_text(CAMERA.name, &view.name));
    let materials = scene.materials.iter().map(|material| with_text(MATERIAL_NODE.name, &material.name));
    let lights = scene.nodes.iter().filter_map(|node| described_light(node, span));
    let integrator = with_text(INTEGRATOR.name, scene.integrator.name());
    cameras.chain([integrator]).chain(materials).chain(lights).collect()
}

/// Whether a light of the scene can be described: one of a kind that importers and staging make, and not turned.
pub(crate) fn is_described(node: &scene::Node) -> bool {
    let is_known = |light: &Light| {
        matches!(
            light.kind,
            LightKind::Omni(Omni { position: [.., 0.0 | 1.0], range: 0.0 })
                | LightKind::Directional(_)
                | LightKind::Disk(_)
        )
    };
    matches!(&node.content, Content::Light(light) if is_known(light)) && is_translation(&node.transform)
}

fn is_translation(transform: &Transform) -> bool {
    transform.matrix().matrix3 == DMat3::IDENTITY
}

/// The node of a light with all of its fields, in the coordinates of the scene.
fn described_light(node: &scene::Node, span: Span) -> Option<Node> {
    let light = match &node.content {
        Content::Light(light) if is_described(node) => light,
        _ => return None,
    };
    let number = |number: f64| Value { kind: ValueKind::Number(number), span };
    let child = |word: &str, values: Vec<Value>| {
        let mut child = Node::new(word, span);
        child.values = values;
        child
    };
    let numbers = |word: &str, all: &[f64]| child(word, all.iter().map(|v| number(*v)).collect());
    let vector = |word: &str, v: Vec3| numbers(word, &v.as_dvec3().to_array());
    // The remainder of a point is smaller than the precision of the point by itself.
    let point = |word: &str, index: usize, p: Vec3| {
        let exact: DVec3 = p.as_dvec3() + node.rest[index].as_dvec3();
        numbers(word, &node.transform.point(exact).to_array())
    };
    let text = |word: &str, text: &str| child(word, vec![Value { kind: ValueKind::Text(text.into()), span }]);
    let flag = |word: &str, on: bool| child(word, vec![Value { kind: ValueKind::Flag(on), span }]);
    let count = |word: &str, count: u32| numbers(word, &[f64::from(count)]);
    let (kind, mut children) = match light.kind {
        LightKind::Omni(Omni { position: [x, y, z, 0.0], .. }) => {
            ("omni", vec![numbers("position", &[x, y, z, 0.0].map(f64::from))])
        }
        LightKind::Omni(Omni { position: [x, y, z, _], .. }) => {
            ("omni", vec![point("position", 0, Vec3::new(x, y, z))])
        }
        LightKind::Directional(Directional { towards, beam }) => {
            let mut children = vec![vector("direction", towards)];
            if let Some((axis, radius)) = beam {
                children.extend([point("axis", 0, axis), numbers("radius", &[f64::from(radius)])]);
            }
            ("directional", children)
        }
        LightKind::Disk(DiskLight { disk, points }) => {
            let mut children = vec![
                point("position", 0, disk.center),
                vector("normal", disk.normal),
                numbers("radius", &[f64::from(disk.radius)]),
                text("emission", light.emission.name()),
            ];
            children.push(if light.samples > 0 { count("samples", light.samples) } else { count("points", points) });
            ("disk", children)
        }
        _ => return None,
    };
    if kind != "directional" {
        children.push(numbers("attenuation", &light.attenuation.map(f64::from)));
    }
    children.push(numbers("intensity", &light.intensity.to_array().map(f64::from)));
    children.push(flag("shadows", light.shadows));
    children.extend(node.name.as_deref().or(light.name.as_deref()).map(|name| text(NAME.name(), name)));
    let mut described = Node::new(LIGHT, span);
    described.values.push(Value { kind: ValueKind::Text(kind.into()), span });
    described.children = children;
    Some(described)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assets::MemoryAssets;
    use crate::import::{Staging, load};
    use canaletto::math::Rgb;

    const OBJ: &str = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nusemtl red\nf 1 2 3\n";
    const NFF: &str = "b 0.1 0.2 0.3\nv\nfrom 1 1 9\nat 0 0 0\nup 0 1 0\nangle 45\nhither 1\nresolution 4 4\n\
        l 3 4 5\nf 1 0.5 0.1 0.8 0.2 7 0.5 1.1\ns 0 0 0 1\n";

    fn assets(obj: &str) -> MemoryAssets {
        MemoryAssets::new().with("a.obj", obj).with("a.nff", NFF).with("a.mtl", "newmtl red\nKd 1 0 0\nKs 0.5\nNs 9\n")
    }

    fn set_in(file: &str, obj: &str, set: &[&str]) -> Result<(Scene, Scene), String> {
        let set: Vec<String> = set.iter().map(|set| (*set).to_owned()).collect();
        let (before, _) = load(file, &assets(obj), &Staging::classic()).unwrap();
        match set_in_model(before.clone(), file, &assets(obj), &set) {
            Ok((after, _)) => Ok((before, after)),
            Err(mistakes) => Err(mistakes.to_string()),
        }
    }

    #[test]
    fn fields_change_alone() {
        let (before, after) = set_in("a.obj", OBJ, &["camera.fovy=20"]).unwrap();
        let mut expected = before.clone();
        expected.views[0].intrinsics.fovy = 20.0;
        assert_eq!(after, expected);
        let (before, after) = set_in("a.obj", OBJ, &["material.red.k=0.5", "background=0 0 1", "ambient=0.5"]).unwrap();
        let mut expected = before.clone();
        expected.materials[0].model.phong_mut().unwrap().k = Rgb::gray(0.5);
        (expected.background, expected.ambient) = (Rgb::new(0.0, 0.0, 1.0), Rgb::gray(0.5));
        assert_eq!(after, expected);
        let (before, after) = set_in("a.obj", OBJ, &["integrator.shadows=none", "integrator=zbuffer"]).unwrap();
        let mut expected = before.clone();
        let shadows = canaletto::scene::ShadowMethod::None;
        expected.integrator = canaletto::scene::ZbufferSettings { shadows, ..Default::default() }.into();
        assert_eq!(after, expected);
    }

    /// A light that is set to what it has stays what it is, also far from zero.
    #[test]
    fn lights_are_described_as_they_are() {
        let far = OBJ.replace("v ", "v 4000000.").replace("4000000.0 0", "4000000 0").replace("4000000.1 ", "4000001 ");
        for obj in [OBJ, &far] {
            let (before, after) = set_in("a.obj", obj, &["light.key.points=24"]).unwrap();
            let light = |scene: &Scene| {
                let node = scene.nodes.iter().find(|node| node.name.as_deref() == Some("key")).unwrap().clone();
                let Content::Light(light) = &node.content else { panic!("the key is a light") };
                let LightKind::Disk(disk) = &light.kind else { panic!("the key is a disk") };
                let exact = disk.disk.center.as_dvec3() + node.rest[0].as_dvec3();
                (node.transform.point(exact), light.intensity, light.shadows, disk.points, disk.disk.normal)
            };
            let (a, b) = (light(&before), light(&after));
            assert!((a.0 - b.0).length() < 1e-6, "{} {}", a.0, b.0);
            assert_eq!((a.1, a.2, a.3, a.4), (b.1, b.2, b.3, b.4));
        }
        let (before, after) = set_in("a.obj", OBJ, &["light.key.points=24", "light.fill.shadows=#false"]).unwrap();
        assert_eq!(before, after);
        let (before, after) = set_in("a.nff", OBJ, &["light.shadows=#true", "material.kd=1 0.5 0.1"]).unwrap();
        assert_eq!(before.nodes, after.nodes);
        let (_, after) = set_in("a.nff", OBJ, &["light.position=1 2 3", "light.intensity=2"]).unwrap();
        let lit: Vec<_> = after.nodes.iter().filter(|node| matches!(node.content, Content::Light(_))).collect();
        let [scene::Node { content: Content::Light(light), .. }] = lit[..] else { panic!("there is one light") };
        assert_eq!(
            (&light.kind, light.intensity),
            (&LightKind::Omni(Omni::at(Vec3::new(1.0, 2.0, 3.0))), Rgb::gray(2.0))
        );
    }

    #[test]
    fn what_a_model_lacks_is_told() {
        for (set, words) in [
            ("materiel.red.kd=1", "did you mean material?"),
            ("material.rot.kd=1", "there is no material called \"rot\""),
            ("material.red.kx=1", "did you mean"),
            ("mesh.a.material=red", "a model has no mesh to set"),
            ("environment.gain=2", "a model has no environment to set"),
            ("camera.top.fovy=20", "there is no camera called \"top\""),
            ("camera.fovy=200", "200"),
            ("material.red.texture=wood", "there is no texture \"wood\""),
            ("integrator.shadows=none", "takes #true or #false"),
            ("light.key.radius=-1", "radius"),
        ] {
            let told = set_in("a.obj", OBJ, &[set]).unwrap_err();
            assert!(told.contains(words) && told.contains("--set"), "{set}: {told}");
        }
    }
}
