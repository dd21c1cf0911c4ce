//! Textures (5.5): functions that give a colour, or any other number of a material, for a place on a line, in a
//! rectangle or in space.
//!
//! A [`Texture`] is a description: plain values and indices into [`crate::scene::Scene::images`]. [`World::build`] turns
//! it into a [`PreparedTexture`], with mip pyramids where it needs them; a pattern is looked up with [`PreparedTexture::eval`]. How a
//! surface gets from a point to texture coordinates is not its business.
//!
//! [`World::build`]: crate::world::World::build

mod codec;
mod ellipse;
#[cfg(test)]
mod filter_tests;
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

use serde::{Deserialize, Serialize};

/// A named texture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Texture {
    /// The name that materials and environments refer to.
    pub name: String,
    /// What it is.
    pub kind: TextureKind,
}

/// The kinds of textures.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum TextureKind {
    /// The same colour everywhere: linear red, green, blue and alpha.
    Constant([f32; 4]),
    /// An image over the unit square.
    Image(ImageTexture),
    /// A grid of voxels over the unit cube.
    Grid(GridTexture),
    /// A function that is computed.
    Procedural(Procedural),
}

/// An image as a texture: u goes from its left (0) to its right (1), v from its top row (0) to its bottom row (1).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ImageTexture {
    /// Index into [`crate::scene::Scene::images`].
    pub image: u32,
    /// How its texels become a function.
    pub filter: Filter,
    /// What is done against aliasing where texels are smaller than pixels.
    pub prefilter: Prefilter,
    /// What is outside the unit square, along u and along v.
    pub wrap: [Wrap; 2],
    /// Where u = 0 and u = 1 are.
    pub placement: Placement,
    /// What its numbers mean, instead of what the image says.
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

/// How texels become a function of real coordinates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Filter {
    /// The nearest texel.
    Nearest,
    /// Linear between the four nearest.
    #[default]
    Bilinear,
    /// Quadratic in each direction: the mean of the two parabolas through three texels. Goes through the texels; without
    /// jumps, but with corners.
    Biquadratic,
    /// Cubic in each direction: Catmull and Rom's. Goes through the texels, without corners; overshoots at edges.
    Bicubic,
    /// The quadratic B-spline: smooth, never overshoots, doesn't go through the texels.
    QuadraticSpline,
    /// The cubic B-spline: smoother still, and blurs more.
    CubicSpline,
}

/// What is done where texels are smaller than pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Prefilter {
    /// Nothing: the texture is taken at a point. Needs no memory for coarser levels.
    None,
    /// The mean over a square as wide as the footprint is long (Williams 1983): fast, and blurred where surfaces are seen at a
    /// slant.
    Trilinear,
    /// The mean over the footprint's ellipse (Heckbert 1989). Ellipses more than 16 times longer than wide are made
    /// wider.
    #[default]
    Ewa,
}
