//! A finished picture in linear light, with its layers.

use crate::math::Rgb;
use canaletto_bvh::memory;

/// Linear pixels in rows from the top left, with layers of other quantities.
///
/// ```
/// use canaletto::film::{Picture, develop};
/// use canaletto::math::Rgb;
/// use canaletto::scene::Developing;
///
/// let mut picture = Picture::new(2, 1);
/// picture.pixels[1] = Rgb::new(4.0, 0.5, 0.0);
/// assert_eq!(picture.pixel(1, 0).r, 4.0);
/// // What a screen shows lies in [0, 1].
/// assert!(develop(&picture, &Developing::default())[1].r <= 1.0);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// The width × height colours, the top row first.
    pub pixels: Vec<Rgb>,
    /// The requested layers.
    pub layers: Vec<Layer>,
    /// How much of what lies under the picture each pixel hides, 0 to 1, if the background is left out
    /// ([`FilmSettings::alpha`](crate::scene::FilmSettings::alpha)); else empty. Colours are multiplied by it.
    pub alpha: Vec<f32>,
    /// How much darker shadows make what lies under each pixel, where nothing hides it, 0 to 1. They are those on
    /// [catchers](crate::material::Material::shadow_catcher). Empty without them, or before
    /// [`Picture::separate_shadow`].
    pub shadow: Vec<f32>,
}

/// One additional quantity of every pixel.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Layer {
    /// The name of the quantity, such as "depth".
    pub name: &'static str,
    /// The names of its channels, such as X, Y, Z.
    pub channels: &'static [&'static str],
    /// The width × height × channels values, the top row first. The channels of a pixel are adjacent.
    pub data: Vec<f32>,
    /// The exact numbers of a layer of object or material numbers. Some may be above 2²⁴ and so are rounded in `data`.
    /// Empty for other layers.
    pub ids: Vec<u32>,
}

impl Layer {
    /// A layer of numbers; see [`Layer::data`].
    pub fn new(name: &'static str, channels: &'static [&'static str], data: Vec<f32>) -> Layer {
        Layer { name, channels, data, ids: Vec::new() }
    }

    /// The object or material number of pixel `i`, in a layer of such numbers.
    pub fn id(&self, i: usize) -> u32 {
        self.ids.get(i).copied().unwrap_or(self.data[i] as u32)
    }
}

impl Picture {
    /// A black picture without layers.
    pub fn new(width: u32, height: u32) -> Picture {
        // Zeros are black.
        let pixels = memory::zeros(width as usize * height as usize);
        Picture { width, height, pixels, layers: Vec::new(), alpha: Vec::new(), shadow: Vec::new() }
    }

    /// The colour of a pixel. x and y count from the top left.
    pub fn pixel(&self, x: u32, y: u32) -> Rgb {
        self.pixels[y as usize * self.width as usize + x as usize]
    }

    /// The colour of pixel number `i` without its multiplication by alpha; black where alpha is 0.
    pub fn straight(&self, i: usize) -> Rgb {
        match self.alpha.get(i) {
            None => self.pixels[i],
            Some(alpha) => unpremultiplied(self.pixels[i], *alpha),
        }
    }

    /// How much of the light under pixel number `i` is lost by what hides it and by shadows, 0 to 1; 1 without alpha.
    /// A linear file has it as its alpha.
    pub fn opacity(&self, i: usize) -> f32 {
        let Some(alpha) = self.alpha.get(i) else { return 1.0 };
        self.shadow.get(i).map_or(*alpha, |shadow| alpha + (1.0 - alpha) * shadow)
    }

    /// The layer of this name.
    pub fn layer(&self, name: &str) -> Option<&Layer> {
        self.layers.iter().find(|layer| layer.name == name)
    }
}

/// A colour divided by its alpha, which counts as 1 if it is more, as filters with negative parts make it; black where
/// alpha isn't above 0.
pub fn unpremultiplied(color: Rgb, alpha: f32) -> Rgb {
    if alpha >= 1.0 {
        return color;
    }
    if alpha > 0.0 { color.map(|v| v / alpha).saturated() } else { Rgb::BLACK }
}
