//! The tree of rays behind a pixel, as plain data.

use super::developed::DevelopedNode;
use super::patch::{RadiosityNode, RadiosityTerms};
use super::steps::{CameraSteps, HitSteps, LightSteps, RaySteps};
use super::summing::Summing;
use crate::integrator::{RasterNode, RayKind};
use crate::light::environment::EnvironmentLookup;
use crate::material::Phong;
use crate::math::Rgb;
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
    /// The samples, one camera ray each.
    pub samples: Vec<SampleNode>,
    /// What the chapter makes of the camera's parameters, if steps are explained.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub camera: Option<CameraSteps>,
    /// What lights the surfaces under the pixel's rays.
    #[serde(flatten)]
    pub radiosity: RadiosityTerms,
    #[serde(skip)]
    pub(super) summing: Summing,
    /// The pixel's colour as rendered.
    pub color: Rgb,
    /// The colour's way into a file.
    pub developed: DevelopedNode,
}

/// One camera ray with its weight in the pixel.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct SampleNode {
    /// The position in the picture, in pixels with y upwards: x and y of (5.10).
    pub position: [f64; 2],
    /// The sample's weight; the pixel is the weighted mean of its samples.
    pub weight: f64,
    /// The time, from 0 (the shutter opens) to 1 (it closes), if anything moves.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time: Option<f64>,
    /// The point of the lens that the ray left, relative to its centre, to the right and upwards. The centre is where
    /// the ray starts without a lens: the eye, or `start`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lens: Option<[f64; 2]>,
    /// Where the ray starts on the plane through the eye without a lens, if the camera is orthographic.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub start: Option<[f64; 3]>,
    /// d of (5.10), from the eye to the projection plane. Without a lens, `ray` has this direction, normalised.
    pub chapter_direction: [f64; 3],
    /// The triangle that a z-buffer shows here.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub raster: Option<RasterNode>,
    /// The camera ray.
    pub ray: RayNode,
}

/// A ray, its hit or miss, and its colour.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct RayNode {
    /// The kind of the ray.
    pub kind: RayKind,
    /// The depth in the ray tree; 1 for camera rays.
    pub depth: u32,
    /// The factor of the ray's colour in its parent: 1, k, or 1 − o.
    pub factor: Rgb,
    /// The ray's origin.
    pub origin: [f64; 3],
    /// The ray's unit direction.
    pub direction: [f32; 3],
    /// The microfacet that the ray left, for a rough surface.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lobe: Option<LobeNode>,
    /// For a refracted ray, η of the medium that it leaves and of the one that it enters.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub media: Option<[f32; 2]>,
    /// The clear bodies whose surfaces the ray passed before its hit, because another body hides them.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub hidden: Vec<String>,
    /// The objects whose cut-out holes the ray passed before its hit.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub holes: Vec<String>,
    /// How the hit is found, if steps are explained.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub steps: Option<Box<RaySteps>>,
    /// The hit or miss.
    pub outcome: Outcome,
    /// The ray's colour, before the factor.
    pub color: Rgb,
}

/// The random microfacet of a rough surface that a ray leaves.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct LobeNode {
    /// The roughness, 0..=1: how far microfacets are tilted.
    pub roughness: f32,
    /// The unit normal of the microfacet, on the viewer's side. The ray is mirrored or refracted by it.
    pub facet: [f32; 3],
}

/// The result of a ray: a hit or a miss.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Outcome {
    /// The ray hit nothing and has the background's colour.
    Miss {
        /// The background's colour.
        background: Rgb,
        /// The lookup in the environment, if the scene has one.
        #[serde(skip_serializing_if = "Option::is_none")]
        environment: Option<Box<EnvironmentLookup>>,
    },
    /// The ray hit a surface.
    Hit(Box<HitNode>),
}

/// A side of a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Side {
    /// The side that the normal points to.
    Outside,
    /// The other side.
    Inside,
}

/// A hit on a surface, with the terms of the shading equation there.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct HitNode {
    /// The object's name.
    pub object: String,
    /// The object's number, [`crate::world::World::object_id`]. Copies have equal names and different numbers.
    pub object_id: u32,
    /// The kind of the object: "sphere", "mesh", …
    pub kind: &'static str,
    /// The index of the triangle or sphere in the object; 0 for single shapes.
    pub primitive: u32,
    /// The ray's t: the distance, since its direction has length 1.
    pub t: f32,
    /// The point in the scene's coordinates.
    pub point: [f64; 3],
    /// The unit geometric normal, on the outer side.
    pub normal: [f32; 3],
    /// The unit shading normal, on the viewer's side.
    pub shading_normal: [f32; 3],
    /// Texture coordinates.
    pub uv: [f32; 2],
    /// The side that the ray came from.
    pub side: Side,
    /// The vectors of the chapter, if steps are explained.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub steps: Option<HitSteps>,
    /// The material's name.
    pub material: String,
    /// The classic view of the material with its values at the hit.
    pub phong: Phong,
    /// The textures that were read for these values, in order.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub textures: Vec<TextureNode>,

    /// kd, if the picture has no lighting.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unlit: Option<Rgb>,
    /// Iₐ ⊗ kd, or the light of `radiosity` in place of Iₐ.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ambient: Option<Rgb>,
    /// The light of a radiosity solution that takes the place of Iₐ.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub radiosity: Option<RadiosityNode>,
    /// The light that comes straight from emitting surfaces, if they are lights of the picture.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub emitters: Option<EmittersNode>,
    /// The radiance that the surface emits towards the viewer, if it emits any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub emission: Option<Rgb>,
    /// The terms of each point of each light.
    pub lights: Vec<LightNode>,
    /// The reflected and the refracted ray.
    pub children: Vec<RayNode>,
    /// The colour of an overlay, and its share.
    #[serde(rename = "print", skip_serializing_if = "Option::is_none")]
    pub overlay: Option<(Rgb, f32)>,
    /// The coverage of the surface, if a texture cuts out a part of it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub coverage: Option<f32>,
    /// The ray that goes on through the part that is cut out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub behind: Option<RayNode>,
    /// Child rays that were not followed.
    pub cut: Vec<CutNode>,
}

/// A texture that was read at a hit.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct TextureNode {
    /// The texture's name.
    pub texture: String,
    /// The texture's use, as the word in the scene text.
    pub used: &'static str,
    /// The lookups: one place, or several that were blended.
    pub readings: Vec<ReadingNode>,
    /// The texture's linear red, green, blue and alpha.
    pub value: [f32; 4],
    /// The values before and after this texture.
    pub replaced: [Vec<f32>; 2],
}

/// A place at which a texture was read.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ReadingNode {
    /// The weight of this reading in the value.
    pub weight: f64,
    /// Texture coordinates.
    pub at: [f64; 3],
    /// The changes of the coordinates to the next sample on the right and to the next one above.
    pub footprint: [[f64; 3]; 2],
    /// The position on the texture's image, if it has one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub image: Option<ImageNode>,
}

/// The position of a lookup on an image.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ImageNode {
    /// The position in texels; (0, 0) is the upper left corner of the first texel.
    pub texel: [f64; 2],
    /// The image's width and height in texels.
    pub size: [u32; 2],
    /// The longer and the shorter radius of the sample's ellipse, in texels.
    pub radii: [f64; 2],
    /// The level of the image pyramid. 0 is the image itself; below 0, texels are larger than samples.
    pub level: f64,
}

/// One light point, as seen from a hit.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct LightNode {
    /// The light's name or kind and number.
    pub light: String,
    /// Index of the light's point.
    pub point: u32,
    /// The position of the point in the scene's coordinates, if it was chosen at random.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub position: Option<[f64; 3]>,
    /// L̂, the unit direction to the point.
    pub direction: [f32; 3],
    /// The distance to the point; `null` in JSON for light from infinity.
    #[serde(serialize_with = "finite_or_null")]
    pub distance: f32,
    /// The intensity at the hit, before shadows.
    pub intensity: Rgb,
    /// The factors of this intensity, if steps are explained.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub steps: Option<LightSteps>,
    /// n·L.
    pub n_dot_l: f32,
    /// Whether the light is behind the surface but in front of its bent normal.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub behind: bool,
    /// r·L.
    pub r_dot_l: f32,
    /// The surfaces between the hit and the light, nearest first.
    pub blockers: Vec<BlockerNode>,
    /// f_s, the share of the light that passes these surfaces, 0..=1.
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
    /// The surface's opacity o at that point.
    pub opacity: f32,
}

/// A child ray that was not followed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct CutNode {
    /// The kind of the ray.
    pub kind: RayKind,
    /// The factor that the ray's colour would have had.
    pub factor: Rgb,
}

impl PixelTree {
    /// The pixel's colour from its terms: every product and sum is repeated in the picture's order. Equal to `color`
    /// bit for bit.
    pub fn sum(&self) -> Rgb {
        match &self.samples[..] {
            // A single sample is the pixel, whatever its weight.
            [only] => only.ray.sum(),
            samples => self.summing.color(samples.iter().map(|sample| (sample.ray.sum(), sample.weight))),
        }
    }
}

/// The light that comes straight from emitting surfaces to a hit.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub struct EmittersNode {
    /// The light with nothing between, as the radiance of a white surface: Σ form factor × radiance.
    pub unoccluded: Rgb,
    /// The light that arrives, likewise.
    pub arriving: Rgb,
    /// The number of shadow rays.
    pub rays: u32,
    /// The number of shadow rays that pass. Clear surfaces let a share of one pass.
    pub passed: f32,
    /// arriving ⊗ kd.
    pub contribution: Rgb,
}

impl RayNode {
    /// The rays that leave its hit.
    pub(super) fn below(&self) -> impl Iterator<Item = &RayNode> {
        let hit = match &self.outcome {
            Outcome::Hit(hit) => Some(hit),
            Outcome::Miss { .. } => None,
        };
        hit.into_iter().flat_map(|hit| hit.children.iter().chain(&hit.behind))
    }

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
            color += hit.radiosity.as_ref().map_or(ambient, |light| light.reflected(hit.phong.kd));
        }
        if let Some(emitters) = &hit.emitters {
            color = (color + emitters.contribution).saturated();
        }
        if let Some(emission) = hit.emission {
            color = (color + emission).saturated();
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
    /// The colour with the overlay on top, and with the light from behind if the surface is partly cut out.
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

/// Whether objects of a kind have primitives with numbers.
pub(super) fn has_primitives(kind: &str) -> bool {
    matches!(kind, "mesh" | "spheres" | "cylinders")
}

pub(super) fn is_zero(number: &usize) -> bool {
    *number == 0
}

fn finite_or_null<S: Serializer>(value: &f32, serializer: S) -> Result<S::Ok, S::Error> {
    if value.is_finite() { serializer.serialize_some(value) } else { serializer.serialize_none() }
}
