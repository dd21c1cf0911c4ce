//! Textures (5.5): functions that give a colour, or any other number of a material, for a place on a line, in a
//! rectangle or in space.
//!
//! A [`Texture`] is a description: plain values and indices into [`crate::scene::Scene::images`]. [`World::build`] turns
//! it into a [`Pattern`], with mip pyramids where it needs them; a pattern is looked up with [`Pattern::eval`]. How a
//! surface gets from a point to texture coordinates is not its business.
//!
//! [`World::build`]: crate::world::World::build

mod image;
mod image_map;
mod pattern;
mod raster;
mod space;
mod wrap;

pub use image::{Image, Samples};
pub use pattern::{Lookup, Pattern, Unresolved};
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
pub enum TextureKind {
    /// The same colour everywhere: linear red, green, blue and alpha.
    Constant([f32; 4]),
    /// An image over the unit square.
    Image(ImageTexture),
}

/// An image as a texture: u goes from its left (0) to its right (1), v from its top row (0) to its bottom row (1).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ImageTexture {
    /// Index into [`crate::scene::Scene::images`].
    pub image: u32,
    /// How its texels become a function.
    pub filter: Filter,
    /// What is outside the unit square, along u and along v.
    pub wrap: [Wrap; 2],
    /// Where u = 0 and u = 1 are.
    pub placement: Placement,
    /// What its numbers mean, instead of what the image says.
    pub space: Option<ColorSpace>,
}

impl ImageTexture {
    /// The image with this index, filtered bilinearly and repeated.
    pub fn new(image: u32) -> ImageTexture {
        ImageTexture {
            image,
            filter: Filter::default(),
            wrap: [Wrap::default(); 2],
            placement: Placement::default(),
            space: None,
        }
    }
}

/// How texels become a function of real coordinates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Filter {
    /// The nearest texel.
    Nearest,
    /// Linear between the four nearest.
    #[default]
    Bilinear,
}
