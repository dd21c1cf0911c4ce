use super::*;
use canaletto::light::environment::{Environment, EnvironmentKind, Smoothing};
use canaletto::light::{Light, LightKind, Omni, SphereLight};
use canaletto::scene::Integrator;
use canaletto::shape::{Mesh, Sphere};
use canaletto::texture::Samples;
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

/// A model staged for the classic integrators.
fn classic(model: Fragment) -> Option<Scene> {
    stage(model, UpAxis::Y, &Staging::classic())
}

fn staged(model: Fragment, staging: Staging) -> Scene {
    stage(model, UpAxis::Y, &staging).unwrap()
}

fn names(scene: &Scene) -> Vec<&str> {
    scene.nodes.iter().map(|node| node.name.as_deref().unwrap_or_default()).collect()
}

#[test]
fn what_a_model_has_of_its_own_is_kept() {
    let staged = classic(model(vec![Node::new(Content::Mesh(0)).named("m")])).unwrap();
    assert_eq!((names(&staged), staged.views.len()), (vec!["m", "ground", "key", "fill"], 1));
    // Its own camera, with the lights of staging.
    let own = View { name: "own".into(), ..staged.views[0].clone() };
    let with_view = Fragment { views: vec![own.clone()], ..model(vec![Node::new(Content::Mesh(0))]) };
    let scene = classic(with_view).unwrap();
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
        let scene = classic(lit).unwrap();
        assert_eq!((scene.nodes.len(), scene.views.len(), scene.ambient), (nodes, 1, Rgb::BLACK));
    }
}

#[test]
fn only_what_has_no_material_is_clay() {
    let painted = Mesh { materials: vec![0], ..mesh() };
    let nodes = vec![Node::new(Content::Mesh(0)), Node::new(Content::Mesh(1)), ball(), ball().with_material(0)];
    let materials = vec![Material::new("paint", Phong::default())];
    let scene = classic(Fragment { meshes: vec![mesh(), painted], materials, nodes, ..Fragment::default() }).unwrap();
    let names: Vec<&str> = scene.materials.iter().map(|material| material.name.as_str()).collect();
    assert_eq!(names, ["paint", "clay", "ground"]);
    let of: Vec<Option<u32>> = scene.nodes.iter().map(|node| node.material).collect();
    assert_eq!(of, [Some(1), None, Some(1), Some(0), Some(2), None, None]);
}

/// The view of a model is that of the same points elsewhere, wherever its nodes put them.
#[test]
fn moved_nodes_and_shapes_are_framed() {
    let eye = |nodes: Vec<Node>| classic(model(nodes)).unwrap().views[0].extrinsics.eye;
    let by = DVec3::new(3.0, 5.0, -7.0);
    let moved = |node: Node| node.with_transform(&Transform::translate(by));
    assert!((eye(vec![moved(ball())]) - eye(vec![ball()]) - by).length() < 1e-9);
    // The vertices of a mesh, also where it is moved.
    let [here, there] = [Node::new(Content::Mesh(0)), moved(Node::new(Content::Mesh(0)))].map(|node| eye(vec![node]));
    assert!((there - here - by).length() < 1e-9, "{here} {there}");
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
    let [far_eye, near_eye] = [fragment, near].map(|model| classic(model).unwrap().views[0].extrinsics.eye);
    assert!((far_eye - far - near_eye).length() < 1e-6, "{far_eye} {near_eye}");
}

#[test]
fn too_large_and_nothing_at_all_have_no_classic() {
    let huge = Mesh { positions: mesh().positions.iter().map(|p| *p * 3e38).collect(), ..mesh() };
    let nodes = vec![Node::new(Content::Mesh(0))];
    assert!(classic(Fragment { meshes: vec![huge], nodes, ..Fragment::default() }).is_none());
    assert!(classic(model(Vec::new())).is_none());
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

#[test]
fn paths_get_a_studio() {
    let whole = |staging: Staging| staged(model(vec![Node::new(Content::Mesh(0)).named("m")]), staging);
    let scene = whole(Staging::default());
    assert_eq!((names(&scene), scene.images.len()), (vec!["m", "ground"], 1));
    assert_eq!((scene.film.exposure, scene.film.tone), (Some(Exposure::Stops(0.0)), Some(Tone::PbrNeutral)));
    assert!(matches!(scene.integrator, Integrator::Path(_)));
    let environment = scene.environment.clone().unwrap();
    assert!(!environment.visible && matches!(environment.kind, EnvironmentKind::LatLong { image: 0, .. }));
    // The same from file to file.
    let other = staged(model(vec![ball()]), Staging::default());
    assert_eq!((&other.images, &other.environment), (&scene.images, &scene.environment));
    // No floor, or one of a colour.
    assert_eq!(names(&whole(Staging { ground: Ground::None, ..Staging::default() })), ["m"]);
    let red = Rgb::new(0.5, 0.0, 0.0);
    let scene = whole(Staging { ground: Ground::Color(red), ..Staging::default() });
    assert_eq!(scene.materials.last().unwrap().classic().kd, red);
    // The lights of the file, unless others are asked for.
    let lamp = || Node::from(Light::new(LightKind::Omni(Omni::at(Vec3::ONE)), Rgb::WHITE)).named("lamp");
    let lit = || model(vec![ball().named("b"), lamp()]);
    assert_eq!(names(&staged(lit(), Staging::default())), ["b", "lamp"]);
    let studio = Staging { light: Some(StageLight::Neutral), ..Staging::default() };
    assert_eq!(names(&staged(lit(), studio)), ["b", "ground"]);
    let sky = whole(Staging { light: Some(StageLight::Sky), ..Staging::default() });
    assert!(sky.environment.unwrap().visible);
}

/// The lit floor has the background's radiance, so that there is no horizon between them.
#[test]
fn the_floor_meets_the_background() {
    for light in [StageLight::Studio, StageLight::Neutral] {
        let scene = staged(model(vec![ball()]), Staging { light: Some(light), ..Staging::default() });
        let image = &scene.images[0];
        let Samples::F32(radiances) = &image.samples else { panic!("the studio's image is of f32") };
        let [width, height] = [f64::from(image.width), f64::from(image.height)];
        let mut irradiance = 0.0;
        for (i, radiance) in radiances.iter().enumerate() {
            let polar = std::f64::consts::PI * ((i as u32 / image.width) as f64 + 0.5) / height;
            let area = std::f64::consts::TAU / width * std::f64::consts::PI / height * polar.sin();
            irradiance += f64::from(*radiance) * polar.cos().max(0.0) * area;
        }
        let kd = scene.materials.last().unwrap().classic().kd;
        let floor = f64::from(kd.g) * irradiance / std::f64::consts::PI;
        assert!((floor - f64::from(scene.background.g)).abs() < 1e-3, "{light:?}: {floor} {:?}", scene.background);
    }
}

#[test]
fn models_are_turned_and_seen_from_all_sides() {
    let eye = |staging: Staging| {
        let view = staged(model(vec![ball()]), staging).views[0].clone();
        (view.extrinsics.eye - view.extrinsics.center).normalize()
    };
    for (view, from) in [
        (StandardView::Front, DVec3::Z),
        (StandardView::Back, DVec3::NEG_Z),
        (StandardView::Left, DVec3::X),
        (StandardView::Right, DVec3::NEG_X),
        (StandardView::Top, DVec3::Y),
        (StandardView::Iso, DVec3::ONE.normalize()),
    ] {
        let seen = eye(Staging { view: Some(view), ..Staging::default() });
        assert!((seen - from).length() < 1e-9, "{view:?}: {seen}");
    }
    // A quarter turn leads the front, +z, to the right, +x; z upwards becomes y.
    let place = |staging: Staging| staged(model(vec![Node::new(Content::Mesh(0))]), staging).nodes[0].transform.clone();
    let turned = place(Staging { turn: 90.0, ..Staging::default() });
    assert!((turned.vector(DVec3::Z) - DVec3::X).length() < 1e-12);
    // It turns about its own middle.
    let middle = |turn: f64| {
        let off_center = model(vec![ball().with_transform(&Transform::translate(DVec3::new(9.0, 0.0, 4.0)))]);
        staged(off_center, Staging { turn, ..Staging::default() }).nodes[0].transform.point(DVec3::ZERO)
    };
    assert!((middle(0.0) - middle(120.0)).length() < 1e-9);
    let upright = place(Staging { up: Some(UpAxis::Z), ..Staging::default() });
    assert!((upright.point(DVec3::Z) - DVec3::Y).length() < 1e-12);
}
