//! Highlights of Phong's model as those of a glossy dielectric, for pictures by paths: plastic and lacquer as files of
//! older programs describe them.
//!
//! n is the exponent of Blinn's distribution of facets: α² = 2 / (n + 2) (Walter et al., *Microfacet Models for
//! Refraction through Rough Surfaces*, 2007, 5.2). ks is a share of the reflection 0.08 at right angles, as in Blender
//! and in Burley, *Physically Based Shading at Disney*, 2012. So the usual ks of 0.5 is the reflection of plastic,
//! 0.04.

use super::add;
use crate::import::reflectance::index_of;
use canaletto::Named;
use canaletto::material::{MaterialModel, Parameter, Phong, StandardSurface, Target, TextureUse};
use canaletto::scene::Scene;
use canaletto::texture::{ColorSpace, Image, ImageTexture, Samples, Texture, TextureKind};

/// The reflection at right angles of ks 1.
const STRONGEST: f32 = 0.08;

const SPECULAR: Target = Target::Parameter(Parameter::Specular);
const EXPONENT: Target = Target::Parameter(Parameter::Exponent);

/// Gives opaque materials with highlights the standard surface. Mirrors, glass and matte materials stay.
pub(super) fn make_glossy(scene: &mut Scene) {
    for index in 0..scene.materials.len() {
        let material = &scene.materials[index];
        let MaterialModel::Phong(phong) = material.model else { continue };
        let is_shiny = !phong.ks.is_black() || material.textures.iter().any(|used| used.target == SPECULAR);
        let is_plain = phong.k.is_black() && phong.roughness == 0.0 && material.is_opaque();
        if is_shiny && is_plain && material.textures.iter().all(|used| fits(scene, used)) {
            let textures = material.textures.clone();
            let textures = textures.into_iter().map(|used| glossy_use(scene, &phong, used)).collect();
            let material = &mut scene.materials[index];
            material.set_standard(surface(&phong));
            material.textures = textures;
        }
    }
}

/// The standard surface of a material with highlights.
fn surface(phong: &Phong) -> StandardSurface {
    let mut surface = StandardSurface::default();
    surface.base.color = phong.kd.map(|v| v.min(1.0));
    let most = strength(phong);
    if !phong.ks.is_black() {
        surface.specular.color = phong.ks * (1.0 / most);
    }
    surface.specular.ior = index_of(STRONGEST * most.min(1.0));
    surface.specular.roughness = roughness(phong.n);
    (surface.emission.color, surface.emission.radiance) = (phong.emission, 1.0);
    surface
}

/// The largest component of ks; 1 beside a picture that stands for it.
fn strength(phong: &Phong) -> f32 {
    if phong.ks.is_black() { 1.0 } else { phong.ks.max_component() }
}

/// The roughness of an exponent: √α.
fn roughness(n: f32) -> f32 {
    (2.0 / (n.max(0.0) + 2.0)).sqrt().sqrt()
}

/// Whether a texture has a meaning on the standard surface. Exponents are converted texel by texel.
fn fits(scene: &Scene, used: &TextureUse) -> bool {
    let kind = scene.textures.get(used.texture as usize).map(|texture| &texture.kind);
    match used.target {
        Target::Parameter(parameter) => match parameter {
            Parameter::Diffuse | Parameter::Specular | Parameter::Emission => true,
            Parameter::Exponent => matches!(kind, Some(TextureKind::Image(_))) && !used.multiply,
            _ => false,
        },
        _ => true,
    }
}

/// The texture on the standard surface.
fn glossy_use(scene: &mut Scene, phong: &Phong, used: TextureUse) -> TextureUse {
    match used.target {
        SPECULAR => {
            let range = used.range.map(|v| if used.multiply { v } else { v / strength(phong) });
            TextureUse { target: Target::from_name("specular-color").unwrap_or(SPECULAR), range, ..used }
        }
        EXPONENT => {
            let target = Target::Parameter(Parameter::Roughness);
            let texture = roughness_texture(scene, &used).unwrap_or(used.texture);
            TextureUse { target, texture, range: [0.0, 1.0], ..used }
        }
        _ => used,
    }
}

/// The texture of the roughness whose exponents a texture has.
fn roughness_texture(scene: &mut Scene, used: &TextureUse) -> Option<u32> {
    let texture = scene.textures.get(used.texture as usize)?.clone();
    let TextureKind::Image(image) = texture.kind else { return None };
    let own = scene.images.get(image.image as usize)?;
    let channels = usize::from(own.channels);
    let [low, high] = used.range;
    let value = |texel: usize| {
        let of = |c: usize| own.samples.number(texel * channels + c);
        let color = match channels {
            1 | 2 => [of(0); 3],
            _ => [of(0), of(1), of(2)],
        };
        let alpha = if channels % 2 == 0 { of(channels - 1) } else { 1.0 };
        let [r, g, b] = color;
        roughness(low + (high - low) * used.channel.of([r, g, b, alpha]))
    };
    let count = own.width as usize * own.height as usize;
    let converted = Image {
        name: format!("roughness of {}", own.name),
        channels: 1,
        samples: Samples::F32((0..count).map(value).collect()),
        space: ColorSpace::Linear,
        premultiplied: false,
        ..*own
    };
    let converted = add(&mut scene.images, converted);
    let kind = TextureKind::Image(ImageTexture { image: converted, space: Some(ColorSpace::Raw), ..image });
    let name = scene.images[converted as usize].name.clone();
    Some(add(&mut scene.textures, Texture { name, kind }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use canaletto::material::{Channel, Material};
    use canaletto::math::Rgb;

    #[test]
    fn highlights_are_those_of_plastic() {
        let shiny = Phong { kd: Rgb::new(0.8, 0.1, 0.1), ks: Rgb::gray(0.5), n: 98.0, ..Phong::default() };
        let matte = Phong { ks: Rgb::BLACK, ..shiny };
        let mirror = Phong { k: Rgb::gray(0.5), ..shiny };
        let glass = Phong { opacity: 0.2, eta: 1.5, ..shiny };
        let materials = [shiny, matte, mirror, glass].map(|phong| Material::new("m", phong));
        let mut scene = Scene { materials: materials.to_vec(), ..Scene::default() };
        make_glossy(&mut scene);
        assert_eq!(scene.materials[1..], materials[1..]);
        let surface = *scene.materials[0].standard().unwrap();
        let f0 = ((surface.specular.ior - 1.0) / (surface.specular.ior + 1.0)).powi(2);
        // α² = 2 / 100, roughness² = α.
        assert!((f0 - 0.04).abs() < 1e-6 && (surface.specular.roughness.powi(4) - 0.02).abs() < 1e-6, "{surface:?}");
        assert_eq!((surface.base.color, surface.specular.color), (shiny.kd, Rgb::WHITE));
        scene.materials[0].check().unwrap();
    }

    /// A picture of exponents becomes one of roughness.
    #[test]
    fn exponents_are_converted_texel_by_texel() {
        let phong = Phong { ks: Rgb::gray(1.0), n: 200.0, ..Phong::default() };
        let image = Image {
            name: "n".into(),
            width: 2,
            height: 1,
            channels: 3,
            samples: Samples::U8(vec![0, 0, 0, 255, 255, 255]),
            space: ColorSpace::Srgb,
            premultiplied: false,
        };
        let texture = Texture { name: "n".into(), kind: TextureKind::Image(ImageTexture::new(0)) };
        let used = TextureUse { range: [0.0, 200.0], channel: Channel::Luminance, ..TextureUse::new(0, EXPONENT) };
        let material = Material::new("m", phong).with_texture(used);
        let mut scene =
            Scene { materials: vec![material], images: vec![image], textures: vec![texture], ..Scene::default() };
        make_glossy(&mut scene);
        let used = scene.materials[0].textures[0];
        assert_eq!((used.target, used.texture), (Target::Parameter(Parameter::Roughness), 1));
        assert_eq!(scene.images[1].samples, Samples::F32(vec![1.0, roughness(200.0)]));
        assert_eq!(scene.images.len(), 2);
    }
}
