//! The sampling, reconstruction and developing of a picture.

use crate::named;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// Settings of the film.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FilmSettings {
    /// The places of a pixel's rays.
    pub sampling: Sampling,
    /// The distribution of the random numbers of a pixel's samples. They place rays with [`Sampling::Sampled`], and
    /// sample lens, time, lights and lobes.
    #[serde(default)]
    pub sampler: SamplerKind,
    /// The reconstruction filter.
    pub filter: Filter,
    /// The exposure. Without it, that of [`FilmSettings::developing`].
    #[serde(default)]
    pub exposure: Option<Exposure>,
    /// The tone mapping. Without it, that of [`FilmSettings::developing`].
    pub tone: Option<Tone>,
    /// The transfer from linear light to the numbers in an 8- or 16-bit file.
    pub transfer: Transfer,
    /// Whether the background that camera rays see straight on is left out, so that it shows what is laid under the
    /// picture. Reflections, refractions and light from it stay. The picture has an alpha then.
    #[serde(default)]
    pub alpha: bool,
    /// The only part of the picture to render: x, y (from the top left), width, height in pixels.
    pub crop: Option<[u32; 4]>,
}

/// The places of a pixel's rays (5.6, fig. 5.36).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub enum Sampling {
    /// One ray through the pixel's lower left corner: (5.10) at integer x, y, as in the chapter.
    Corner,
    /// One ray through the pixel's centre.
    #[default]
    Center,
    /// n × n rays on a regular grid, n in 1..=16.
    Regular(u32),
    /// n × n rays, each at a random place of its sub-pixel, n in 1..=16.
    Jittered(u32),
    /// Rays through the corners and centres of all pixels within the filter's radius; with the box filter these are the
    /// pixel's four corners and its centre. Where their values differ, n × n jittered rays replace them.
    Adaptive {
        /// The size n of the refined grid, 2..=16.
        n: u32,
        /// The largest difference in a developed component, 0..=1, that is not refined.
        threshold: f32,
    },
    /// This number of rays, 1..=[`Sampling::MAX_SAMPLES`], placed by [`FilmSettings::sampler`]. A single ray goes
    /// through the centre.
    Sampled(u32),
}

/// The patterns of rays in a pixel, [`Sampling`] without its numbers. [`Sampling::Sampled`] has no pattern: the
/// sampler places its rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SamplePattern {
    /// [`Sampling::Corner`].
    Corner,
    /// [`Sampling::Center`].
    Center,
    /// [`Sampling::Regular`].
    Regular,
    /// [`Sampling::Jittered`].
    Jittered,
    /// [`Sampling::Adaptive`].
    Adaptive,
}

named!(SamplePattern {
    Corner => "corner": "One ray through the pixel's lower left corner",
    Center => "center": "One ray through the pixel's centre",
    Regular => "regular": "n x n rays on a regular grid",
    Jittered => "jittered": "n x n rays, each at a random place of its sub-pixel",
    Adaptive => "adaptive": "Corners and centre; where they differ, n x n jittered rays",
});

impl SamplePattern {
    /// The default n of the patterns of n × n rays.
    pub const DEFAULT_GRID: u32 = 4;
    /// The default threshold of the adaptive pattern.
    pub const DEFAULT_THRESHOLD: f32 = 0.1;
}

impl Sampling {
    /// The pattern of the rays; none if the sampler places them.
    pub fn pattern(&self) -> Option<SamplePattern> {
        match self {
            Sampling::Corner => Some(SamplePattern::Corner),
            Sampling::Center => Some(SamplePattern::Center),
            Sampling::Regular(_) => Some(SamplePattern::Regular),
            Sampling::Jittered(_) => Some(SamplePattern::Jittered),
            Sampling::Adaptive { .. } => Some(SamplePattern::Adaptive),
            Sampling::Sampled(_) => None,
        }
    }

    /// The number of rays of a pixel; for adaptive sampling, of a refined pixel.
    pub fn count(&self) -> u32 {
        match self {
            Sampling::Corner | Sampling::Center => 1,
            Sampling::Regular(n) | Sampling::Jittered(n) | Sampling::Adaptive { n, .. } => n * n,
            Sampling::Sampled(n) => *n,
        }
    }

    /// Whether each pixel has one ray.
    pub fn is_single(&self) -> bool {
        match self {
            Sampling::Corner | Sampling::Center => true,
            Sampling::Regular(n) | Sampling::Jittered(n) | Sampling::Sampled(n) => *n == 1,
            Sampling::Adaptive { .. } => false,
        }
    }

    /// The largest n of a grid of n × n rays in a pixel.
    pub const MAX_GRID: u32 = 16;
    /// The largest number of rays of [`Sampling::Sampled`].
    pub const MAX_SAMPLES: u32 = 65_536;
}

/// The distribution of random numbers over the samples of a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum SamplerKind {
    /// Sobol's sequence with Owen's scrambling. It has the least noise, and is best with powers of two.
    #[default]
    Sobol,
    /// Sobol's sequence over all pixels in an order that makes their errors unlike those of their neighbours. The error
    /// is as large as with `Sobol`, but less visible. It is for few samples, such as 1 to 16.
    BlueNoise,
    /// The chapter's jittered grid (fig. 5.36). It is best with square numbers of samples.
    Jittered,
    /// Independent numbers. They have the most noise, and serve for comparison.
    Independent,
}

named!(SamplerKind {
    Sobol => "sobol": "Sobol's sequence with Owen's scrambling: the least noise, best with powers of two",
    BlueNoise => "blue-noise": "Sobol's sequence over neighbouring pixels: as much noise, less visible; for few samples",
    Jittered => "jittered": "A jittered grid, best with squares",
    Independent => "independent": "Independent random numbers: the most noise",
});

/// The reconstruction filter. Lengths are in pixels. A pixel's rays are distributed like the filter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Filter {
    /// The mean over the pixel's area, as in the chapter.
    #[default]
    Box,
    /// A linear fall-off with a radius of 1.
    Tent,
    /// A Gaussian of the given standard deviation, cut off at three of them.
    Gaussian {
        /// The standard deviation σ in pixels; 0.5 is a common choice.
        sigma: f32,
    },
    /// Mitchell and Netravali's cubic with B = C = 1/3, radius 2. It is negative beyond 8/7. Of two and more rays, some
    /// sample the negative part and are subtracted.
    Mitchell,
}

named!(Filter {
    Box => "box",
    Tent => "tent",
    Gaussian { sigma: Filter::DEFAULT_SIGMA } => "gaussian",
    Mitchell => "mitchell",
});

impl Filter {
    /// The default standard deviation of the Gaussian in pixels.
    pub const DEFAULT_SIGMA: f32 = 0.5;
}

/// How much light a picture takes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Exposure {
    /// Linear light is multiplied by 2 to the power of this number, as photographers count.
    Stops(f32),
    /// The stops are metered in the picture ([`metered_exposure`](crate::film::metered_exposure)).
    Auto,
}

impl Default for Exposure {
    fn default() -> Exposure {
        Exposure::Stops(0.0)
    }
}

impl Exposure {
    /// The word for [`Exposure::Auto`] in scene text, on the command line and in metadata.
    pub const AUTO: &'static str = "auto";
    /// The most stops up or down.
    pub const MOST_STOPS: f32 = 64.0;

    /// An exposure of so many stops, if they are at most [`Exposure::MOST_STOPS`] up or down.
    pub fn stops(stops: f32) -> Option<Exposure> {
        (stops.abs() <= Exposure::MOST_STOPS).then_some(Exposure::Stops(stops))
    }
}

/// The stops, or the word.
impl fmt::Display for Exposure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Exposure::Stops(stops) => stops.fmt(f),
            Exposure::Auto => f.write_str(Exposure::AUTO),
        }
    }
}

/// Reads what [`Display`](fmt::Display) writes.
impl FromStr for Exposure {
    type Err = String;

    fn from_str(text: &str) -> Result<Exposure, String> {
        match text.trim() {
            Exposure::AUTO => Ok(Exposure::Auto),
            text => text.parse().ok().and_then(Exposure::stops).ok_or_else(|| {
                format!("write a number of stops from -{most} to {most}, or auto", most = Exposure::MOST_STOPS)
            }),
        }
    }
}

/// The mapping of exposed linear light to the range 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Tone {
    /// Each component is clamped to 1 (after 5.36).
    #[default]
    Clamp,
    /// The picture is divided by its largest component if that exceeds 1 (after 5.36).
    Scale,
    /// Sobotka's AgX, a filmic curve over 16.5 stops ([`Agx`](crate::film::Agx)).
    Agx,
    /// Khronos' PBR Neutral, which keeps the colours of materials
    /// ([`PbrNeutral`](crate::film::PbrNeutral)).
    PbrNeutral,
}

named!(Tone {
    Clamp => "clamp": "Each component is cut at 1",
    Scale => "scale": "The picture is divided by its largest component",
    Agx => "agx": "AgX, a filmic curve: bright colours fade to white as in a photo",
    PbrNeutral => "pbr-neutral": "Khronos' PBR Neutral: colours of materials stay, highlights are compressed",
});

/// The way from linear light to the numbers of a display file: exposure, tone, transfer, in this order.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Developing {
    /// The exposure.
    pub exposure: Exposure,
    /// The tone mapping.
    pub tone: Tone,
    /// The transfer curve.
    pub transfer: Transfer,
}

impl FilmSettings {
    /// How pictures are developed.
    ///
    /// Path tracing is photographic, which means that it has the range of real light: a room by day is far darker than
    /// its window. Its pictures are photos, if nothing else is said: the tone is `agx`, and the exposure of a tone
    /// curve is metered. The other integrators show a scene's own numbers: `clamp`, and 0 stops. So do pictures without
    /// a transfer curve, whose numbers are to be read. The tones `clamp` and `scale` have 0 stops, too.
    pub fn developing(&self, is_photographic: bool) -> Developing {
        let is_photo = is_photographic && self.transfer == Transfer::Srgb;
        let tone = self.tone.unwrap_or(if is_photo { Tone::Agx } else { Tone::Clamp });
        let default = if is_photo && tone.is_curve() { Exposure::Auto } else { Exposure::default() };
        Developing { exposure: self.exposure.unwrap_or(default), tone, transfer: self.transfer }
    }
}

impl Tone {
    /// Whether the tone is a curve for photos. The others keep a scene's numbers up to a factor.
    pub fn is_curve(self) -> bool {
        match self {
            Tone::Clamp | Tone::Scale => false,
            Tone::Agx | Tone::PbrNeutral => true,
        }
    }
}

/// The transfer from linear light to the numbers in an 8- or 16-bit file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Transfer {
    /// Linear values, as in the chapter.
    None,
    /// The sRGB curve (IEC 61966-2-1).
    #[default]
    Srgb,
}

named!(Transfer {
    None => "none": "The values themselves",
    Srgb => "srgb": "The sRGB curve, which screens expect",
});
