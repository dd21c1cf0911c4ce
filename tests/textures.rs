//! Effects of textures on surfaces: cutouts let light through, bumps don't.

use canaletto::Ray;
use canaletto::film::srgb_encode;
use canaletto::integrator::Whitted;
use canaletto::light::{Light, LightKind, Omni};
use canaletto::material::{Mapping, Material, Phong, Projection, Repeat, Space, Target, TextureUse};
use canaletto::math::{Rgb, Transform};
use canaletto::scene::{Content, Node, Scene, WhittedSettings};
use canaletto::shape::{Cuboid, Mesh, Plane, Shape, Sphere};
use canaletto::texture::{
    ColorSpace, Filter, Image, ImageTexture, Placement, Prefilter, Samples, Texture, TextureKind, srgb_decode,
};
use canaletto::world::{OccluderCache, World};
use canaletto_tests::textured::textured_still_life;
use glam::{DVec3, Vec2, Vec3, Vec4};

/// Texels of equal width side by side, with unchanged values.
fn strip(texels: &[[u8; 4]], filter: Filter) -> (Image, Texture) {
    let image = Image {
        name: "strip".into(),
        width: texels.len() as u32,
        height: 1,
        channels: 4,
        samples: Samples::U8(texels.concat()),
        space: ColorSpace::Linear,
        premultiplied: false,
    };
    let texture =
        ImageTexture { filter, placement: Placement::Edges, prefilter: Prefilter::None, ..ImageTexture::new(0) };
    (image, Texture { name: "strip".into(), kind: TextureKind::Image(texture) })
}

/// A lit floor, and above it a board with this material; `board` is its shape.
fn scene(material: Material, strip: (Image, Texture), board: Shape) -> Scene {
    let light = Light::new(LightKind::Omni(Omni::at(Vec3::new(0.0, 8.0, 0.0))), Rgb::WHITE);
    Scene {
        background: Rgb::new(0.1, 0.2, 0.3),
        ambient: Rgb::gray(0.1),
        materials: vec![
            material,
            Material::new("floor", Phong::default()),
            Material::new("mirror", Phong { kd: Rgb::BLACK, k: Rgb::WHITE, ..Phong::default() }),
        ],
        images: vec![strip.0],
        textures: vec![strip.1],
        nodes: vec![
            Node::from(board).with_material(0),
            Node::from(Shape::Plane(Plane { point: Vec3::ZERO, normal: Vec3::Y })).with_material(1),
            Node::from(Shape::Box(Cuboid { min: Vec3::new(6.0, 0.0, -2.0), max: Vec3::new(6.5, 7.0, 2.0) }))
                .with_material(2),
            Node::from(light),
        ],
        ..Scene::default()
    }
}

fn board() -> Shape {
    Shape::Box(Cuboid { min: Vec3::new(-2.0, 4.0, -2.0), max: Vec3::new(2.0, 4.0, 2.0) })
}

fn color(scene: &Scene, from: [f32; 3], to: [f32; 3]) -> Rgb {
    let world = World::build(scene.clone()).unwrap();
    let (from, to) = (Vec3::from(from), Vec3::from(to));
    Whitted::new(&world, WhittedSettings::default()).eye(&Ray::new(from, (to - from).normalize()), None, &mut ())
}

/// A board whose left half is cut out, and an equal scene with the board far away.
fn halved(share: u8) -> (Scene, Scene) {
    let cut = TextureUse::new(0, Target::Cutout);
    let texels = strip(&[[255, 255, 255, share], [255; 4]], Filter::Nearest);
    let material = Material::new("cut", Phong { kd: Rgb::new(0.9, 0.1, 0.1), ..Phong::default() }).with_texture(cut);
    let with = scene(material.clone(), texels.clone(), board());
    let away = Shape::Box(Cuboid { min: Vec3::splat(900.0), max: Vec3::splat(901.0) });
    (with, scene(material, texels, away))
}

#[test]
fn rays_shadows_and_mirrors_go_through_holes() {
    let (with, without) = halved(0);
    // The views are from above, on the floor below, and in the mirror: each half in turn.
    let views = [
        ([-1.0, 7.0, 0.1], [-1.0, 0.0, 0.1], [1.0, 7.0, 0.1], [1.0, 0.0, 0.1]),
        ([-5.0, 1.0, 0.1], [-1.0, 0.0, 0.1], [5.0, 1.0, 0.1], [1.0, 0.0, 0.1]),
        ([3.0, 6.0, 0.1], [6.0, 5.4, 0.1], [3.0, 6.0, 0.1], [6.0, 5.25, 0.1]),
    ];
    for (from, to, from_right, to_right) in views {
        assert_eq!(color(&with, from, to), color(&without, from, to), "{from:?} {to:?}");
        assert_ne!(color(&with, from_right, to_right), color(&without, from_right, to_right), "{from:?} {to:?}");
    }
}

#[test]
fn a_surface_that_is_there_in_part_blends_with_what_is_behind() {
    let (with, without) = halved(51);
    let (whole, _) = halved(255);
    let (from, to) = ([-1.0, 7.0, 0.1], [-1.0, 3.99, 0.1]);
    let [part, front] = [&with, &whole].map(|scene| color(scene, from, to));
    // The floor behind lies in the board's shadow, of which a fifth remains.
    let floor = color(&with, [-5.0, 1.0, 0.1], [-1.0, 0.0, 0.1]);
    let lit = color(&without, [-5.0, 1.0, 0.1], [-1.0, 0.0, 0.1]);
    assert!(floor.r < lit.r && floor.r > 0.5 * lit.r);
    let expected = front * 0.2 + floor * 0.8;
    assert!((part - expected).to_array().into_iter().all(|d| d.abs() < 1e-5), "{part:?} {expected:?}");
}

#[test]
fn a_bent_normal_lets_no_light_in_from_behind() {
    // The heights are as steep as possible, and a light is just below the board's plane, without shadows.
    let texels: Vec<[u8; 4]> = (0..64).map(|i| if i / 2 % 2 == 0 { [0, 0, 0, 255] } else { [255; 4] }).collect();
    let bump = TextureUse { range: [0.0, 3.0], ..TextureUse::new(0, Target::Bump) };
    let material = Material::new("rough", Phong { ks: Rgb::WHITE, n: 2.0, ..Phong::default() });
    let mut scene = scene(material.with_texture(bump), strip(&texels, Filter::Bilinear), board());
    scene.ambient = Rgb::BLACK;
    scene.nodes.pop();
    let mut light = Light::new(LightKind::Omni(Omni::at(Vec3::new(9.0, 3.9, 0.0))), Rgb::WHITE);
    light.shadows = false;
    scene.nodes.push(Node::from(light.clone()));
    let brightest = |scene: &Scene| {
        let at = |i: i32| color(scene, [0.0, 9.0, 0.0], [i as f32 * 0.019 - 1.9, 4.0, 0.2]).max_component();
        (0..200).map(at).fold(0.0, f32::max)
    };
    assert_eq!(brightest(&scene), 0.0, "lit from below");
    // A light slightly above the plane lights the slopes that lean towards it.
    light.kind = LightKind::Omni(Omni::at(Vec3::new(9.0, 4.1, 0.0)));
    scene.nodes.pop();
    scene.nodes.push(Node::from(light));
    assert!(brightest(&scene) > 0.2, "not lit from above");
}

#[test]
fn a_slope_is_shaded_like_a_turned_plane() {
    // A height that grows by 2 over the board's width of 4 is a plane at an angle whose tangent is one half.
    let texels: Vec<[u8; 4]> = (0..256).map(|i| [i as u8, i as u8, i as u8, 255]).collect();
    let bump = TextureUse { range: [0.0, 2.0], ..TextureUse::new(0, Target::Bump) };
    let material = Material::new("slope", Phong::default()).with_texture(bump);
    let mut bumped = scene(material, strip(&texels, Filter::Bilinear), board());
    bumped.ambient = Rgb::BLACK;
    let found = color(&bumped, [0.5, 7.0, 0.5], [0.5, 4.0, 0.5]).r;
    let normal = DVec3::new(-0.5, 1.0, 0.0).normalize();
    let to_light = (DVec3::new(0.0, 8.0, 0.0) - DVec3::new(0.5, 4.0, 0.5)).normalize();
    // The heights rise by 255 steps over 256 texels.
    assert!((f64::from(found) - 0.8 * normal.dot(to_light)).abs() < 2e-3, "{found}");
}

/// A mesh that is used once has vertices in the world's space, and one that is used twice in its own. A normal map
/// looks alike on both, also on a stretched, a turned and a mirrored one.
#[test]
fn normal_maps_are_alike_on_copies() {
    let mesh = Mesh {
        positions: [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[x, y]| Vec3::new(x, y, 0.0)).into(),
        normals: vec![Vec3::new(0.2, 0.1, 1.0); 4],
        tangents: vec![Vec4::new(1.0, 0.4, 0.0, -1.0); 4],
        uvs: vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    };
    let turned = Transform::rotate(DVec3::new(1.0, 2.0, 0.5), 20.0).unwrap();
    let mut bent = 0.0f32;
    for (scale, with_tangents) in
        [[1.0, 3.0, 1.0], [0.3, 1.0, -2.0], [-2.0, 0.5, 1.0]].into_iter().flat_map(|s| [(s, true), (s, false)])
    {
        let place = turned.after(&Transform::scale(DVec3::from_array(scale)).unwrap());
        let color = |copies: usize, strength: f32| {
            let mut material = Material::new("m", Phong { kd: Rgb::gray(0.8), ..Phong::default() });
            material.textures.push(TextureUse::new(0, Target::Normal { strength, down: false }));
            let mut scene = scene(material, strip(&[[200, 160, 220, 255]], Filter::Nearest), board());
            scene.nodes.truncate(1);
            scene.meshes.push(mesh.clone());
            if !with_tangents {
                scene.meshes[0].tangents.clear();
            }
            let material = scene.nodes[0].material.unwrap_or(0);
            let far = Transform::translate(DVec3::X * 50.0).after(&place);
            let nodes = [place, far].into_iter().take(copies);
            let nodes = nodes.map(|place| Node::new(Content::Mesh(0)).with_material(material).with_transform(&place));
            scene.nodes = nodes.collect();
            let lamp = Omni::at(Vec3::new(3.0, 4.0, 8.0));
            scene.nodes.push(Node::new(Content::Light(Light::new(LightKind::Omni(lamp), Rgb::WHITE))));
            color(&scene, [0.1, 0.2, 6.0], [0.05, 0.1, 0.0])
        };
        let [once, twice, flat] = [color(1, 1.0), color(2, 1.0), color(1, 0.0)];
        assert!(
            (once - twice).to_array().iter().all(|v| v.abs() < 1e-5),
            "{scale:?} {with_tangents}: {once:?} {twice:?}"
        );
        bent = bent.max((once - flat).to_array()[1].abs());
    }
    assert!(bent > 0.05, "{bent}");
}

#[test]
fn a_turned_or_moved_object_takes_its_texture_along() {
    let texels = strip(&[[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255], [255; 4]], Filter::Nearest);
    let ball = Shape::Sphere(Sphere { center: Vec3::ZERO, radius: 1.0 });
    let turn = Transform::translate(DVec3::new(0.0, 3.0, 0.0))
        .after(&Transform::rotate(DVec3::new(1.0, 0.5, 0.2), 70.0).unwrap())
        .after(&Transform::scale(DVec3::splat(1.5)).unwrap());
    for (projection, space) in [
        (Projection::Uv, Space::Object),
        (Projection::Planar, Space::Object),
        (Projection::Planar, Space::Bounds),
        (Projection::Solid, Space::Object),
    ] {
        let mapping = Mapping::new(projection, space);
        let material = Material::new("m", Phong::default())
            .with_texture(TextureUse { mapping, ..TextureUse::new(0, Target::Replace) });
        let still = scene(material.clone(), texels.clone(), ball);
        let mut turned = scene(material, texels.clone(), ball);
        turned.nodes[0] = turned.nodes[0].clone().with_transform(&turn);
        let (mut seen, mut borders) = (std::collections::HashSet::new(), 0);
        for i in 0..300 {
            let (a, b) = (f64::from(i) * 0.77, f64::from(i) * 1.31 + 0.2);
            let out = DVec3::new(libm::sin(a) * libm::cos(b), libm::sin(b), libm::cos(a) * libm::cos(b));
            let ray = |scene: &Scene, t: &Transform| {
                let [from, to] = [out * 1.3, out * 0.5].map(|p| t.point(p).as_vec3().to_array());
                color(scene, from, to).to_array().map(f32::to_bits)
            };
            let (one, other) = (ray(&still, &Transform::IDENTITY), ray(&turned, &turn));
            seen.insert(one);
            borders += u32::from(one != other);
        }
        // A texel's border may lie between the two points.
        assert!(borders <= 3, "{projection:?} {space:?}: {borders} of 300 differ");
        assert!(seen.len() >= 3, "{projection:?}: {} colours", seen.len());
    }
}

#[test]
fn the_last_blocker_changes_no_shadow() {
    let world = World::build(textured_still_life(1.0)).unwrap();
    let mut last = OccluderCache::NONE;
    let (mut dark, mut half) = (0, 0);
    for i in 0..4000u32 {
        let h = |k: u32| {
            let x = i.wrapping_mul(2654435761).wrapping_add(k.wrapping_mul(0x9e37_79b1));
            (x ^ (x >> 15)).wrapping_mul(0x85eb_ca6b) as f32 / u32::MAX as f32 * 2.0 - 1.0
        };
        let origin = Vec3::new(h(1) * 3.0, h(2) + 1.1, h(3) * 3.0);
        let ray = Ray { origin, direction: Vec3::new(4.0, 6.0, 5.0) - origin };
        let with = world.transmittance(&ray, 1.0, 0.0, None, &mut last, &mut ());
        let without = world.transmittance(&ray, 1.0, 0.0, None, &mut OccluderCache::NONE.clone(), &mut ());
        assert_eq!(with, without, "{ray:?}");
        dark += u32::from(with == 0.0);
        half += u32::from(with > 0.0 && with < 1.0);
    }
    assert!(dark > 100 && half > 100, "{dark} {half}");
}

/// The heights of a strip: a ridge all around the middle.
fn ridge(target: Target, range: [f32; 2]) -> Material {
    Material::new("ridge", Phong::default()).with_texture(TextureUse {
        range,
        mapping: Mapping {
            transform: Transform::rotate(DVec3::Z, 90.0).unwrap(),
            ..Mapping::new(Projection::Planar, Space::Bounds)
        },
        ..TextureUse::new(0, target)
    })
}

#[test]
fn outline_and_shadow_follow_a_displacement() {
    let texels = strip(&[[0, 0, 0, 255], [0, 0, 0, 255], [255; 4], [0, 0, 0, 255], [0, 0, 0, 255]], Filter::Bilinear);
    let ball = Shape::Sphere(Sphere { center: Vec3::new(0.0, 4.0, 0.0), radius: 1.0 });
    let displaced = scene(ridge(Target::Displace { detail: 100.0 }, [0.0, 0.5]), texels.clone(), ball);
    let bumped = scene(ridge(Target::Bump, [0.0, 0.5]), texels, ball);
    // The rays pass beside the middle of the ball. They hit the ridge, and its shadow on the floor.
    let looks = [([1.3, 4.0, 9.0], [1.3, 4.0, 0.0]), ([2.45, 3.0, 4.0], [2.45, 0.0, 0.0])];
    for (from, to) in looks {
        assert_ne!(color(&displaced, from, to), color(&bumped, from, to), "{from:?}");
    }
    // Above the ridge nothing changes.
    let (from, to) = ([0.5, 5.2, 9.0], [0.5, 5.2, 0.0]);
    assert_eq!(color(&displaced, from, to), color(&bumped, from, to));
}

#[test]
fn what_cant_be_displaced_is_told() {
    let texels = strip(&[[0, 0, 0, 255], [255; 4]], Filter::Bilinear);
    let error = |material: Material, shape: Shape| {
        World::build(scene(material, texels.clone(), shape)).expect_err("a mistake").to_string()
    };
    let displace = Target::Displace { detail: 64.0 };
    let floor = Shape::Plane(Plane { point: Vec3::ZERO, normal: Vec3::Y });
    assert_eq!(
        error(ridge(displace, [0.0, 1.0]), floor),
        "plane #1: a plane can't be displaced; spheres, boxes, triangles, cylinders, cones and meshes can be"
    );
    let mut world = ridge(displace, [0.0, 1.0]);
    world.textures[0].mapping.space = Space::World;
    assert!(error(world, board()).contains("happens in the object's own space"));
    let mut fine = ridge(Target::Displace { detail: 60000.0 }, [0.0, 1e6]);
    fine.textures[0].mapping = Mapping { repeat: Repeat([4321.0, 1234.0]), ..Mapping::default() };
    let explodes = error(fine, board());
    assert!(explodes.starts_with("box #1: its displacement needs more than 2097152 triangles"), "{explodes}");
    let far = error(ridge(displace, [0.0, 3e38]), Shape::Sphere(Sphere { center: Vec3::X * 3e38, radius: 1e37 }));
    assert!(far.contains("reaches beyond"), "{far}");
    assert_eq!(
        error(ridge(Target::Displace { detail: 2.0 }, [0.0, 1.0]), board()),
        "material \"ridge\": texture for displace: detail is 2; it must be between 16 and 65536"
    );
}

/// The film encodes colours by the curve that textures are decoded by.
#[test]
fn the_srgb_curve_has_published_values_in_both_directions() {
    for (linear, encoded) in [(0.0, 0.0), (0.18, 0.461_356), (0.5, 0.735_357), (1.0, 1.0)] {
        assert!((srgb_encode(linear) - encoded).abs() < 1e-5 && (srgb_decode(encoded) - linear).abs() < 1e-5);
    }
    for byte in 0..=255u8 {
        let v = f32::from(byte) / 255.0;
        assert!((srgb_encode(srgb_decode(v)) - v).abs() < 1e-6);
    }
}
