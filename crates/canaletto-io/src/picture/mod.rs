//! Pictures in files: their formats, atomic writing, and comparison. [`PictureFormat`] is the table of formats.

mod channels;
mod compare;
mod convolve;
#[cfg(feature = "exr")]
mod exr;
#[cfg(feature = "exr")]
mod exr_part;
mod flip;
mod format;
#[cfg(feature = "jpeg")]
mod jpeg;
mod label;
mod levels;
mod pixel_hash;
#[cfg(feature = "png")]
mod png;
mod pnm;
mod rest;
mod samples;
#[cfg(feature = "exr")]
mod scan_line_file;
mod ssim;
mod temporary;
mod texture;
#[cfg(feature = "webp")]
mod webp;
mod write;
#[cfg(any(feature = "jpeg", feature = "webp"))]
mod xmp;

#[cfg(feature = "png")]
pub(crate) use self::png::png_texts;
pub use channels::{channel_names, layer_channel_names};
pub use compare::{Comparison, Difference, Unequal, compare, difference, differing};
pub use flip::{Flip, PIXELS_PER_DEGREE, flip};
pub use format::{
    Capabilities, Compression, EncodeSettings, PartError, PictureFormat, Rendered, SeekWrite, announced_size, decode,
};
pub use label::{CHARACTER_WIDTH, Canvas, LINE_HEIGHT, text_width};
pub use pixel_hash::PixelHash;
pub use rest::{ChannelDifference, RestDifference};
pub use samples::{SAMPLES_TEXT, SamplesError, read_samples};
#[cfg(feature = "exr")]
pub use scan_line_file::{Rows, ScanLineError, ScanLineFile};
pub use ssim::ssim;
pub use temporary::sweep;
pub(crate) use texture::image_of_texture;
pub use write::{AtomicFile, WriteError, WriteOptions, write_atomically};

use crate::diagnostic::word_list;
use crate::image::ImageError;
use canaletto::film::unpremultiplied;
use canaletto::math::Rgb;
use canaletto::scene::Transfer;

/// The program name and version that pictures carry.
pub const SOFTWARE: &str = concat!("Canaletto ", env!("CARGO_PKG_VERSION"));

/// A picture as named channels of numbers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Image {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// The channels. Colour is `R`, `G`, `B`, or `Y` for grey. Other channels have a layer prefix before a point:
    /// `depth.Z`.
    pub channels: Vec<Channel>,
}

/// A channel: one number per pixel.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Channel {
    /// The channel's name.
    pub name: String,
    /// The width × height values, the top row first.
    pub data: Vec<f32>,
    /// The exact values if they are 32-bit unsigned integers that `f32` may round; else empty.
    pub ids: Vec<u32>,
}

impl Channel {
    /// A channel of numbers.
    pub fn new(name: impl Into<String>, data: Vec<f32>) -> Channel {
        Channel { name: name.into(), data, ids: Vec::new() }
    }

    /// The value of pixel `i`.
    fn value(&self, i: usize) -> f64 {
        self.ids.get(i).map_or_else(|| self.data[i].into(), |id| f64::from(*id))
    }
}

impl Image {
    /// A picture with the channels `R`, `G` and `B`; the top row comes first.
    pub fn from_rgb(width: u32, height: u32, pixels: impl Iterator<Item = [f32; 3]> + Clone) -> Image {
        let channels = ["R", "G", "B"].iter().enumerate();
        let channels = channels.map(|(i, name)| Channel::new(*name, pixels.clone().map(|p| p[i]).collect()));
        Image { width, height, channels: channels.collect() }
    }

    /// The values of a channel.
    pub fn channel(&self, name: &str) -> Option<&[f32]> {
        self.channels.iter().find(|c| c.name == name).map(|c| c.data.as_slice())
    }

    /// The red, green and blue values; a grey channel stands for all three.
    pub fn rgb(&self) -> Option<[&[f32]; 3]> {
        match (self.channel("R"), self.channel("G"), self.channel("B")) {
            (Some(r), Some(g), Some(b)) => Some([r, g, b]),
            _ => self.channel("Y").map(|y| [y; 3]),
        }
    }

    /// The picture with `f` applied to the colour channels.
    pub fn map_color(mut self, f: impl Fn(f32) -> f32) -> Image {
        for channel in &mut self.channels {
            if ["R", "G", "B", "Y"].contains(&channel.name.as_str()) {
                channel.data.iter_mut().for_each(|v| *v = f(*v));
            }
        }
        self
    }

    /// The picture with its colours divided by its alpha, if it has one.
    pub fn unpremultiplied(self) -> Image {
        self.with_alpha(unpremultiplied)
    }

    /// The picture with its colours multiplied by its alpha, if it has one.
    pub fn premultiplied(self) -> Image {
        self.with_alpha(|color, alpha| color * alpha)
    }

    fn with_alpha(mut self, of: impl Fn(Rgb, f32) -> Rgb) -> Image {
        let Some(alpha) = self.channel("A").map(<[f32]>::to_vec) else { return self };
        for channel in &mut self.channels {
            if ["R", "G", "B", "Y"].contains(&channel.name.as_str()) {
                channel.data.iter_mut().zip(&alpha).for_each(|(v, alpha)| *v = of(Rgb::gray(*v), *alpha).r);
            }
        }
        self
    }

    fn pixels(&self) -> usize {
        self.width as usize * self.height as usize
    }
}

/// A picture that was read, with the metadata of its file.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Decoded {
    /// The picture: values from 0 to 1 as stored in a PNG (without decoding of the transfer curve), or any values of an
    /// EXR.
    pub image: Image,
    /// The number of bits of each colour in the file; without colours, of the widest channel.
    pub bits: u8,
    /// The transfer curve of the values, if the file declares it. EXR is linear.
    pub transfer: Option<Transfer>,
    /// Texts as pairs of key and value.
    pub metadata: Vec<(String, String)>,
    /// The position of the picture in a larger one.
    pub window: Window,
    /// The names of parts that aren't aligned with the picture because their size or position differs.
    pub left_out: Vec<String>,
    /// Whether the pixels aren't those that this program wrote: the file is damaged, or another program changed it.
    /// Only files that hold a hash of their pixels tell.
    pub is_changed: bool,
    /// Whether the values are display values, possibly encoded by their transfer curve. Otherwise they are linear light
    /// of any range.
    pub display_referred: bool,
}

/// The position of a picture in a larger one, of which it is a crop: OpenEXR's data window in its display window.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Window {
    /// The column and the row of the upper left pixel in the whole picture.
    pub at: [i32; 2],
    /// The width and height of the whole picture.
    pub whole: [u32; 2],
}

impl Window {
    /// The window of a picture that isn't a crop.
    pub fn whole(width: u32, height: u32) -> Window {
        Window { at: [0, 0], whole: [width, height] }
    }
}

/// The reasons why a picture can't be read or written.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PictureError {
    /// The first bytes match no recognised format.
    #[error("it is no picture that can be read: {} can", readable())]
    Unknown,
    /// The file is damaged, not supported or too large.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// The format can't represent this picture.
    #[error("{0}")]
    Unfit(String),
}

/// The names of all formats that are read.
fn readable() -> String {
    let names: Vec<&str> = PictureFormat::readable().map(PictureFormat::name).collect();
    word_list(&names, "and")
}

impl PictureError {
    /// A hint for the user.
    pub fn help(&self) -> Option<&'static str> {
        if let PictureError::Image(error) = self { error.help() } else { None }
    }
}

/// The largest number of pixels of a picture that is read.
pub const MAX_PIXELS: u64 = canaletto::texture::Image::MAX_TEXELS;

/// Checks that every channel has a value for each pixel.
fn check(image: &Image) -> Result<(), PictureError> {
    if image.pixels() == 0 {
        return Err(no_pixels());
    }
    match image.channels.iter().find(|c| c.data.len() != image.pixels()) {
        Some(c) => Err(PictureError::Unfit(format!(
            "channel {} has {} values for {} × {} pixels",
            c.name,
            c.data.len(),
            image.width,
            image.height
        ))),
        None => Ok(()),
    }
}

fn no_pixels() -> PictureError {
    PictureError::Unfit("a picture needs at least one pixel".into())
}
