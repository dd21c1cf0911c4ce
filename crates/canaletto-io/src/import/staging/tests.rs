use super::*;
use canaletto::light::environment::{Environment, EnvironmentKind, Smoothing};
use canaletto::light::{Omni, SphereLight};
use canaletto::shape::Sphere;
use glam::Vec3;

fn mesh() -> Mesh {
    let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::new(1.0, 1.0, -1.0)];
    Mesh { positions, triangles: vec![[0, 1, 2], [1, 3, 2]], ..Mesh::default() }
}

fn ball() -> Node {
    Node::from(Shape::Sphere(Sphere { center: Vec3::ZERO, radius: 1.0 }))
}

fn model(nodes: Vec<Node>) -> Fragment {
    Fragment { meshes: vec![mesh()], nodes, ..Fragment::default() }
}

fn names(scene: &Scene) -> Vec<&str> {
    scene.nodes.iter().map(|node| node.name.as_deref().unwrap_or_default()).collect()
}

#[test]
fn what_a_model_has_of_its_own_is_kept() {
    let staged = stage(model(vec![Node::new(Content::Mesh(0)).named("m")])).unwrap();
    assert_eq!((names(&staged), staged.views.len()), (vec!["m", "ground", "key", "fill"], 1));
    // Its own camera, with the lights of staging.
    let own = View { name: "own".into(), ..staged.views[0].clone() };
    let with_view = Fragment { views: vec![own.clone()], ..model(vec![Node::new(Content::Mesh(0))]) };
    let scene = stage(with_view).unwrap();
    assert_eq!((&scene.views, names(&scene).len()), (&vec![own], 4));
    assert_eq!(scene.ambient, staged.ambient);
    // Its own light, wherever it is, or its own environment, with the camera of staging.
    let omni = || Node::from(Light::new(LightKind::Omni(Omni::at(Vec3::ONE)), Rgb::WHITE));
    let inside = Node::new(Content::Group(vec![ball(), Node::new(Content::Group(vec![omni()]))]));
    let environment = Some(Environment::new(EnvironmentKind::LatLong { image: 0, smoothing: Smoothing::Nearest }));
    for lit in [
        model(vec![Node::new(Content::Mesh(0)), inside]),
        Fragment { prototypes: vec![omni()], ..model(vec![Node::new(Content::Mesh(0))]) },
        Fragment { environment, ..model(vec![Node::new(Content::Mesh(0))]) },
    ] {
        let nodes = lit.nodes.len();
        let scene = stage(lit).unwrap();
        assert_eq!((scene.nodes.len(), scene.views.len(), scene.ambient), (nodes, 1, Rgb::BLACK));
    }
}

#[test]
fn only_what_has_no_material_is_clay() {
    let painted = Mesh { materials: vec![0], ..mesh() };
    let nodes = vec![Node::new(Content::Mesh(0)), Node::new(Content::Mesh(1)), ball(), ball().with_material(0)];
    let materials = vec![Material::new("paint", Phong::default())];
    let scene = stage(Fragment { meshes: vec![mesh(), painted], materials, nodes, ..Fragment::default() }).unwrap();
    let names: Vec<&str> = scene.materials.iter().map(|material| material.name.as_str()).collect();
    assert_eq!(names, ["paint", "clay", "ground"]);
    let of: Vec<Option<u32>> = scene.nodes.iter().map(|node| node.material).collect();
    assert_eq!(of, [Some(1), None, Some(1), Some(0), Some(2), None, None]);
}

/// The view of a model is that of the same points elsewhere, wherever its nodes put them.
#[test]
fn moved_nodes_and_shapes_are_framed() {
    let eye = |nodes: Vec<Node>| stage(model(nodes)).unwrap().views[0].extrinsics.eye;
    let by = DVec3::new(3.0, 5.0, -7.0);
    let moved = |node: Node| node.with_transform(&Transform::translate(by));
    assert!((eye(vec![moved(ball())]) - eye(vec![ball()]) - by).length() < 1e-9);
    // The vertices of a mesh in place, the corners of the box of one that is moved.
    let [here, there] = [Node::new(Content::Mesh(0)), moved(Node::new(Content::Mesh(0)))].map(|node| eye(vec![node]));
    assert!((there - here - by).length() < 2.0, "{here} {there}");
    assert!(eye(vec![ball(), moved(ball())]).z > eye(vec![ball()]).z + 2.0);
    // The first mesh lies far away.
    let far = DVec3::new(4e6, 0.0, 0.0);
    let fragment = Fragment {
        meshes: vec![Mesh { origin: far, ..mesh() }, Mesh { origin: far + by, ..mesh() }],
        nodes: vec![Node::new(Content::Mesh(0)), Node::new(Content::Mesh(1))],
        ..Fragment::default()
    };
    let near = Fragment {
        meshes: vec![
            mesh(),
            Mesh { positions: mesh().positions.iter().map(|p| *p + by.as_vec3()).collect(), ..mesh() },
        ],
        ..fragment.clone()
    };
    let [far_eye, near_eye] = [fragment, near].map(|model| stage(model).unwrap().views[0].extrinsics.eye);
    assert!((far_eye - far - near_eye).length() < 1e-6, "{far_eye} {near_eye}");
}

#[test]
fn too_large_and_nothing_at_all_have_no_stage() {
    let huge = Mesh { positions: mesh().positions.iter().map(|p| *p * 3e38).collect(), ..mesh() };
    let nodes = vec![Node::new(Content::Mesh(0))];
    assert!(stage(Fragment { meshes: vec![huge], nodes, ..Fragment::default() }).is_none());
    assert!(stage(model(Vec::new())).is_none());
}

/// A lamp over the objects is in the view of a scene, and a sun far away isn't.
#[test]
fn visible_lights_near_objects_are_framed() {
    let lamp = |height: f32, visible: bool| {
        let sphere = Sphere { center: Vec3::Y * height, radius: 0.5 };
        let kind = LightKind::Sphere(SphereLight { sphere, points: 1 });
        Node::from(Light { visible, ..Light::new(kind, Rgb::WHITE) })
    };
    let eye = |nodes: Vec<Node>| {
        let view = default_camera(&Scene { nodes, ..Scene::default() });
        view.map(|view| view.extrinsics.eye)
    };
    let alone = eye(vec![ball()]).unwrap();
    assert_eq!(eye(vec![ball(), lamp(2.5, false)]), Some(alone));
    assert_eq!(eye(vec![ball(), lamp(100.0, true)]), Some(alone));
    let framed = eye(vec![ball(), lamp(2.5, true)]).unwrap();
    // As if it were an object.
    let object = Node::from(Shape::Sphere(Sphere { center: Vec3::Y * 2.5, radius: 0.5 }));
    assert_eq!(Some(framed), eye(vec![ball(), object]));
    let moved = lamp(100.0, true).with_transform(&Transform::translate(DVec3::Y * -97.5));
    let group = Node::new(Content::Group(vec![ball(), moved]));
    // Bounds in `f32` are a little wider far from zero.
    assert!((eye(vec![group]).unwrap() - framed).length() < 1e-3);
    assert!(eye(vec![lamp(1.0, true)]).is_some() && eye(vec![lamp(1.0, false)]).is_none());
}
