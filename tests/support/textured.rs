//! A still life with every use, mapping and space of textures.

use crate::gallery::{icosphere, still_life};
use canaletto::material::{Channel, Mapping, Parameter, Projection, Repeat, Space, Target, TextureUse};
use canaletto::math::{Rgb, Transform};
use canaletto::scene::Scene;
use canaletto::texture::{ColorSpace, Filter, Image, ImageTexture, Placement, Samples, Texture, TextureKind, Wrap};
use glam::{DVec3, Vec2};

/// An image of pseudorandom texels; alpha is 0, 1 or in between.
pub fn image(name: &str, width: u32, height: u32, channels: u8) -> Image {
    let count = width * height * u32::from(channels);
    let value = |i: u32| {
        let x = i.wrapping_mul(2654435761).wrapping_add(channels.into());
        ((x ^ (x >> 15)).wrapping_mul(0x85eb_ca6b) >> 24) as u8
    };
    let alpha = |i: u32| channels == 4 && i % 4 == 3;
    let samples = (0..count).map(|i| if alpha(i) { [0, 255, 255, 90][value(i) as usize % 4] } else { value(i) });
    Image {
        name: name.into(),
        width,
        height,
        channels,
        samples: Samples::U8(samples.collect()),
        space: ColorSpace::Srgb,
        premultiplied: false,
    }
}

/// The still life with textures on all its materials. Lengths of textures are scaled as those of shapes are.
pub fn textured_still_life(scale: f32) -> Scene {
    let mut scene = still_life(scale);
    scene.images = vec![image("gray", 16, 8, 1), image("colours", 8, 8, 3), image("cut", 16, 16, 4)];
    let texture = |name: &str, image: u32, change: &dyn Fn(&mut ImageTexture)| {
        let mut texture = ImageTexture { placement: Placement::Edges, ..ImageTexture::new(image) };
        change(&mut texture);
        Texture { name: name.into(), kind: TextureKind::Image(texture) }
    };
    scene.textures = vec![
        texture("gray", 0, &|_| {}),
        texture("colours", 1, &|t| t.wrap = [Wrap::Mirror; 2]),
        texture("cut", 2, &|t| t.filter = Filter::Nearest),
        texture("label", 2, &|t| t.wrap = [Wrap::Transparent; 2]),
    ];
    let s = f64::from(scale);
    let mapping = |projection, space, size: f64| Mapping {
        projection,
        space,
        transform: Transform::rotate(DVec3::new(0.3, 1.0, 0.2), 20.0)
            .unwrap()
            .after(&Transform::scale(DVec3::splat(size)).unwrap()),
        repeat: Repeat([2.0, 1.0]),
        uv_set: 0,
    };
    let on = |texture, target, mapping| TextureUse { mapping, ..TextureUse::new(texture, target) };
    let uv = Mapping::default();
    let solid = |space| mapping(Projection::Solid, space, s);
    let [clay, blue, mirror, glass, red] = &mut scene.materials[..] else { panic!("five materials") };
    clay.textures = vec![
        on(1, Target::Parameter(Parameter::Diffuse), mapping(Projection::Planar, Space::World, s)),
        on(3, Target::Decal, mapping(Projection::Spherical, Space::Object, s)),
    ];
    blue.textures = vec![
        on(1, Target::Parameter(Parameter::Diffuse), mapping(Projection::Box, Space::Bounds, 1.0)),
        TextureUse {
            range: [5.0, 80.0],
            ..on(0, Target::Parameter(Parameter::Exponent), mapping(Projection::Cylindrical, Space::Bounds, 1.0))
        },
        TextureUse { range: [0.0, 0.03 * scale], ..on(0, Target::Bump, uv) },
    ];
    mirror.textures = vec![
        on(1, Target::Parameter(Parameter::Mirror), mapping(Projection::Triplanar, Space::Object, s)),
        TextureUse {
            range: [0.0, 0.02 * scale],
            ..on(0, Target::Bump, mapping(Projection::Triplanar, Space::Object, s))
        },
    ];
    glass.textures = vec![
        on(0, Target::Parameter(Parameter::Opacity), uv),
        TextureUse {
            range: [1.1, 1.8],
            channel: Channel::Red,
            ..on(0, Target::Parameter(Parameter::Eta), solid(Space::World))
        },
        on(1, Target::Normal { strength: 0.3, down: true }, uv),
    ];
    red.textures = vec![
        on(2, Target::Parameter(Parameter::Diffuse), uv),
        on(1, Target::Parameter(Parameter::Specular), uv),
        on(3, Target::Replace, Mapping { repeat: Repeat([3.0, 3.0]), ..uv }),
        on(2, Target::Cutout, mapping(Projection::Planar, Space::Bounds, 1.0)),
    ];
    // A replaced colour hides the textures under it. It stays only on the mesh with coordinates of its own.
    red.textures.retain(|t| t.target != Target::Replace);
    red.textures.push(on(1, Target::Decal, solid(Space::Object)));
    red.textures.push(TextureUse { range: [0.0, 1.5], ..on(1, Target::Parameter(Parameter::Emission), uv) });
    glass.model.phong_mut().unwrap().emission = Rgb::new(0.02, 0.01, 0.04);
    glass.two_sided = true;
    blue.model.phong_mut().unwrap().emission = Rgb::new(0.0, 0.1, 0.0);
    let mut mesh = icosphere(1, 0.5 * scale, true);
    mesh.uvs = mesh.positions.iter().map(|p| Vec2::new(p.x, p.y + p.z) / scale).collect();
    scene.meshes[0] = mesh;
    scene
}
