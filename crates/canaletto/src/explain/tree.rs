//! The tree of rays behind a pixel, as plain data.

use crate::integrator::RayKind;
use crate::light::environment::EnvironmentLookup;
use crate::material::Phong;
use crate::math::Rgb;
use crate::render::weighted_mean;
use serde::{Serialize, Serializer};

/// A pixel with all its samples.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct PixelTree {
    /// Column and row from the top left.
    pub pixel: [u32; 2],
    /// The chapter's x and y, with y upwards.
    pub chapter_pixel: [u32; 2],
    /// The picture's width and height.
    pub size: [u32; 2],
    /// The rays from the eye.
    pub samples: Vec<SampleNode>,
    /// The pixel's colour as rendered.
    pub color: Rgb,
}

/// One ray from the eye with its weight in the pixel.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct SampleNode {
    /// Where in the picture, in pixels with y upwards: x and y of (5.10).
    pub position: [f64; 2],
    /// Its weight; the pixel is the weighted mean.
    pub weight: f64,
    /// When, from 0, the shutter's opening, to 1, its closing; if anything moves.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time: Option<f64>,
    /// The point of the lens that the ray left, to the right and upwards from the eye; without a lens it left the eye.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lens: Option<[f64; 2]>,
    /// d of (5.10), from the eye to the projection plane. Without a lens, the ray below has the same direction with
    /// length 1.
    pub chapter_direction: [f64; 3],
    /// The ray.
    pub ray: RayNode,
}

/// A ray, what it met and what it brought.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct RayNode {
    /// Why it was traced.
    pub kind: RayKind,
    /// 1 for rays from the eye.
    pub depth: u32,
    /// What its colour is multiplied with in its parent: 1, k, or 1 − o.
    pub factor: Rgb,
    /// Its origin.
    pub origin: [f64; 3],
    /// Its unit direction.
    pub direction: [f32; 3],
    /// Of a rough surface, the facet that sent it this way.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lobe: Option<LobeNode>,
    /// Of a refracted ray, η of the medium that it comes from, and of the one that it goes into.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub media: Option<[f32; 2]>,
    /// The clear bodies past whose surfaces it went before, since another body fills the place.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub hidden: Vec<String>,
    /// The objects through whose cut-out holes it went before.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub holes: Vec<String>,
    /// What it met.
    pub outcome: Outcome,
    /// The colour it brought, before the factor.
    pub color: Rgb,
}

/// The facet of a rough surface that a ray leaves, chosen at random.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct LobeNode {
    /// How far such facets lean, 0..=1.
    pub roughness: f32,
    /// Its unit normal, on the viewer's side: the ray is mirrored or refracted by it.
    pub facet: [f32; 3],
}

/// What a ray met.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Outcome {
    /// Nothing: the background.
    Miss {
        /// The background's colour.
        background: Rgb,
        /// The look at the environment that brought it, if the scene has one.
        #[serde(skip_serializing_if = "Option::is_none")]
        environment: Option<Box<EnvironmentLookup>>,
    },
    /// A surface.
    Hit(Box<HitNode>),
}

/// The side of a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Side {
    /// Where the normal points to.
    Outside,
    /// The other.
    Inside,
}

/// A surface that was met, with the terms of the shading equation there.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct HitNode {
    /// The object's name.
    pub object: String,
    /// "sphere", "mesh", …
    pub kind: &'static str,
    /// Which triangle or sphere of the object; 0 for single shapes.
    pub primitive: u32,
    /// The ray's parameter: the distance, since its direction has length 1.
    pub t: f32,
    /// The point.
    pub point: [f64; 3],
    /// The unit geometric normal, on the outer side.
    pub normal: [f32; 3],
    /// The unit normal that is shaded with, on the viewer's side.
    pub shading_normal: [f32; 3],
    /// Texture coordinates.
    pub uv: [f32; 2],
    /// The side the ray came from.
    pub side: Side,
    /// The material's name.
    pub material: String,
    /// Its numbers here.
    pub phong: Phong,
    /// The textures that were read for them, in order.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub textures: Vec<TextureNode>,

    /// kd, where nothing is lit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unlit: Option<Rgb>,
    /// Iₐ ⊗ kd.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ambient: Option<Rgb>,
    /// Each point of each light.
    pub lights: Vec<LightNode>,
    /// The reflected and the refracted ray.
    pub children: Vec<RayNode>,
    /// A colour over the shaded one, and its share.
    #[serde(rename = "print", skip_serializing_if = "Option::is_none")]
    pub overlay: Option<(Rgb, f32)>,
    /// The share of the surface that is there, where a texture cuts out the rest.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub coverage: Option<f32>,
    /// The ray that goes on where the surface isn't there.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub behind: Option<RayNode>,
    /// Child rays that were not followed.
    pub cut: Vec<CutNode>,
}

/// A texture that was read at a hit.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct TextureNode {
    /// Its name.
    pub texture: String,
    /// What for: the scene text's word.
    pub used: &'static str,
    /// Where it was read: one place, or several that were blended.
    pub readings: Vec<ReadingNode>,
    /// Its linear red, green, blue and alpha.
    pub value: [f32; 4],
    /// What stood there before, and what stands there with it.
    pub replaced: [Vec<f32>; 2],
}

/// A place at which a texture was read.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ReadingNode {
    /// Its share in the value.
    pub weight: f64,
    /// Texture coordinates.
    pub at: [f64; 3],
    /// How they change to the next sample on the right and above.
    pub footprint: [[f64; 3]; 2],
    /// Where that is on the texture's image.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub image: Option<ImageNode>,
}

/// Where a lookup lies on an image.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ImageNode {
    /// The place in texels, (0, 0) the upper left corner of the first one.
    pub texel: [f64; 2],
    /// The image's width and height in texels.
    pub size: [u32; 2],
    /// The longer and the shorter radius of the sample's ellipse, in texels.
    pub radii: [f64; 2],
    /// The level of the pyramid: 0 is the image itself; below it texels are larger than samples.
    pub level: f64,
}

/// One point of a light as a hit sees it.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct LightNode {
    /// The light's name or kind and number.
    pub light: String,
    /// Which of its points.
    pub point: u32,
    /// Where the point is, if it was chosen at random.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub position: Option<[f64; 3]>,
    /// L̂.
    pub direction: [f32; 3],
    /// Its distance; `null` in JSON for light from infinity.
    #[serde(serialize_with = "finite_or_null")]
    pub distance: f32,
    /// The intensity that would arrive.
    pub intensity: Rgb,
    /// n·L.
    pub n_dot_l: f32,
    /// Whether the light stands behind the surface although the bent normal leans towards it.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub behind: bool,
    /// r·L.
    pub r_dot_l: f32,
    /// What stands between, nearest first.
    pub blockers: Vec<BlockerNode>,
    /// f_s.
    pub f_s: f32,
    /// l ⊗ kd (n·L).
    pub diffuse: Rgb,
    /// l ⊗ ks (r·L)ⁿ.
    pub specular: Rgb,
    /// f_s (diffuse + specular).
    pub contribution: Rgb,
}

/// A surface between a hit and a light.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct BlockerNode {
    /// The object's name.
    pub object: String,
    /// Its opacity o there.
    pub opacity: f32,
}

/// A child ray that was not followed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct CutNode {
    /// What it would have been.
    pub kind: RayKind,
    /// The factor it would have had.
    pub factor: Rgb,
}

impl PixelTree {
    /// The pixel from its terms: every product and sum done again in the picture's order. Equal to `color` bit for bit.
    pub fn sum(&self) -> Rgb {
        match &self.samples[..] {
            // A single sample is the pixel, whatever its weight.
            [only] => only.ray.sum(),
            samples => weighted_mean(samples.iter().map(|sample| (sample.ray.sum(), sample.weight))),
        }
    }
}

impl RayNode {
    /// The ray's colour from the terms of its hit and its children.
    pub fn sum(&self) -> Rgb {
        let hit = match &self.outcome {
            Outcome::Miss { background, .. } => return *background,
            Outcome::Hit(hit) => hit,
        };
        if let Some(kd) = hit.unlit {
            return hit.covered(kd);
        }
        let mut color = Rgb::BLACK;
        if let Some(ambient) = hit.ambient {
            color += ambient;
        }
        for light in &hit.lights {
            color = (color + (light.diffuse + light.specular).saturated() * light.f_s).saturated();
        }
        for child in &hit.children {
            color += (child.sum() * child.factor).saturated();
        }
        hit.covered(color.saturated())
    }
}

impl HitNode {
    /// The colour with what lies over it, and what is behind where the surface isn't there.
    fn covered(&self, mut color: Rgb) -> Rgb {
        if let Some((overlay, share)) = self.overlay {
            color = (overlay * share + color * (1.0 - share)).saturated();
        }
        let Some(coverage) = self.coverage else { return color };
        color *= coverage;
        match &self.behind {
            Some(child) => (color + (child.sum() * child.factor).saturated()).saturated(),
            None => color,
        }
    }
}

fn finite_or_null<S: Serializer>(value: &f32, serializer: S) -> Result<S::Ok, S::Error> {
    if value.is_finite() { serializer.serialize_some(value) } else { serializer.serialize_none() }
}
