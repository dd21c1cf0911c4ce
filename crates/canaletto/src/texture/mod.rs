//! Textures (5.5): functions that give a colour, or another number of a material, at a point of a line, a rectangle or
//! space.
//!
//! A [`Texture`] is a description: plain values and indices into [`crate::scene::Scene::images`]. [`World::build`]
//! makes a [`PreparedTexture`] of it, with a mip pyramid where one is needed. [`PreparedTexture::eval`] evaluates the
//! texture. The mapping from a point of a surface to texture coordinates belongs to [`crate::material`].
//!
//! [`World::build`]: crate::world::World::build

mod codec;
mod ellipse;
mod grid;
mod half;
mod halves;
mod image;
mod image_map;
mod kernel;
mod level;
mod noise;
mod prepared;
mod procedural;
mod pyramid;
mod ramp;
mod space;
#[cfg(test)]
mod tests;
mod worley;
mod wrap;

pub use grid::GridTexture;
pub use half::{from_half, to_half};
pub use image::{Image, Samples};
pub use prepared::{Footprint, Lookup, PreparedTexture, Unresolved};
pub use procedural::{Feature, Function, Gradient, Procedural, Spectrum};
pub(crate) use pyramid::{Pyramid, Weighing, zone};
pub use ramp::{Interpolation, Ramp, Stop};
pub use space::{ColorSpace, srgb_decode};
pub use wrap::{Placement, Wrap};

use crate::named;
use serde::{Deserialize, Serialize};

/// A named texture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Texture {
    /// The name that materials and environments refer to.
    pub name: String,
    /// The kind of the texture and its values.
    pub kind: TextureKind,
}

/// The kinds of textures.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum TextureKind {
    /// A constant colour: linear red, green, blue and alpha.
    Constant([f32; 4]),
    /// An image over the unit square.
    Image(ImageTexture),
    /// A grid of voxels over the unit cube.
    Grid(GridTexture),
    /// A function that is computed.
    Procedural(Procedural),
    /// The colours and alphas of a mesh's vertices, interpolated; white on other surfaces.
    VertexColor,
}

/// An image as a texture: u goes from its left (0) to its right (1), v from its top row (0) to its bottom row (1).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ImageTexture {
    /// The index into [`crate::scene::Scene::images`].
    pub image: u32,
    /// The reconstruction filter between texels.
    pub filter: Filter,
    /// The prefilter against aliasing where texels are smaller than pixels.
    pub prefilter: Prefilter,
    /// The continuation outside the unit square, along u and along v.
    pub wrap: [Wrap; 2],
    /// The places of u = 0 and u = 1 relative to the outermost texels.
    pub placement: Placement,
    /// The meaning of the image's numbers. It overrides the image's own.
    pub space: Option<ColorSpace>,
}

impl ImageTexture {
    /// The image with this index, filtered bilinearly and by EWA, and repeated.
    pub fn new(image: u32) -> ImageTexture {
        ImageTexture {
            image,
            filter: Filter::default(),
            prefilter: Prefilter::default(),
            wrap: [Wrap::default(); 2],
            placement: Placement::default(),
            space: None,
        }
    }
}

/// The reconstruction filter: it makes a function of real coordinates from texels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Filter {
    /// The nearest texel.
    Nearest,
    /// Linear interpolation between the four nearest texels.
    #[default]
    Bilinear,
    /// Quadratic interpolation in each direction: the mean of the two parabolas through three texels. It passes through
    /// the texels. It is continuous, but has corners.
    Biquadratic,
    /// Catmull and Rom's cubic interpolation in each direction. It passes through the texels and has no corners, but
    /// overshoots at edges.
    Bicubic,
    /// The quadratic B-spline. It is smooth and never overshoots, but doesn't pass through the texels.
    QuadraticSpline,
    /// The cubic B-spline. It is smoother than the quadratic one, and blurs more.
    CubicSpline,
}

named!(Filter {
    Nearest => "nearest",
    Bilinear => "bilinear",
    Biquadratic => "biquadratic",
    Bicubic => "bicubic",
    QuadraticSpline => "quadratic-spline",
    CubicSpline => "cubic-spline",
});

/// The prefilter where texels are smaller than pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Prefilter {
    /// No prefilter: the texture is evaluated at a point. It needs no memory for coarser levels.
    None,
    /// The mean over a square as wide as the footprint is long (Williams 1983). It is fast, but blurs surfaces at
    /// grazing angles.
    Trilinear,
    /// The mean over the footprint's ellipse (Heckbert 1989). Ellipses more than 16 times longer than wide are made
    /// wider.
    #[default]
    Ewa,
}

named!(Prefilter {
    None => "none",
    Trilinear => "trilinear",
    Ewa => "ewa",
});
