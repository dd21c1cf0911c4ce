//! How a picture is sampled, reconstructed and developed.

use serde::{Deserialize, Serialize};

/// Settings of the film.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FilmSettings {
    /// Where in the pixel rays go.
    pub sampling: Sampling,
    /// How the random numbers of a pixel's samples are spread: where they go in the pixel with [`Sampling::Sampled`], and
    /// whatever else is sampled, be it lens, time, lights or lobes.
    #[serde(default)]
    pub sampler: SamplerKind,
    /// How samples become a pixel.
    pub filter: Filter,
    /// How values over 1 are treated.
    pub tone: Tone,
    /// From linear light to the numbers in an 8- or 16-bit file.
    pub transfer: Transfer,
    /// Only this part of the picture: x, y (from the top left), width, height in pixels.
    pub crop: Option<[u32; 4]>,
}

/// Where in the pixel rays go (5.6, fig. 5.36).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub enum Sampling {
    /// One ray through the pixel's lower left corner: (5.10) at integer x, y, as the chapter does.
    Corner,
    /// One ray through the pixel's centre.
    #[default]
    Center,
    /// n × n rays on a regular grid, n in 1..=16.
    Regular(u32),
    /// n × n rays, each at a random place of its sub-pixel, n in 1..=16.
    Jittered(u32),
    /// The corners and centres of pixels, as far as the filter reaches from the pixel: with the box its four corners and its
    /// centre. Where these differ, n × n jittered rays instead.
    Adaptive {
        /// The refined grid, 2..=16.
        n: u32,
        /// The largest difference in a developed component, 0..=1, that is left unrefined.
        threshold: f32,
    },
    /// This many rays, 1..=[`Sampling::MAX_SAMPLES`], placed by [`FilmSettings::sampler`]; a single one goes through the
    /// centre.
    Sampled(u32),
}

impl Sampling {
    /// The largest grid, n × n rays in a pixel.
    pub const MAX_GRID: u32 = 16;
    /// The most rays of [`Sampling::Sampled`].
    pub const MAX_SAMPLES: u32 = 65_536;
}

/// How random numbers are spread over the samples of a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum SamplerKind {
    /// Sobol's sequence with Owen's scrambling: the least noise, best with powers of two.
    #[default]
    Sobol,
    /// The chapter's jittered grid (fig. 5.36), best with squares.
    Jittered,
    /// Each number by itself: the most noise, and the one to compare with.
    Independent,
}

impl SamplerKind {
    /// Every kind with its name.
    pub const ALL: [(SamplerKind, &'static str); 3] =
        [(SamplerKind::Sobol, "sobol"), (SamplerKind::Jittered, "jittered"), (SamplerKind::Independent, "independent")];

    /// Its name.
    pub fn name(self) -> &'static str {
        SamplerKind::ALL[self as usize].1
    }
}

/// The reconstruction filter. Lengths are in pixels. A pixel's rays are spread like the filter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Filter {
    /// The mean over the pixel's area: the chapter's.
    #[default]
    Box,
    /// Linear fall-off, radius 1.
    Tent,
    /// Gaussian of the given standard deviation, cut off at three of them.
    Gaussian {
        /// σ in pixels; 0.5 is a common choice.
        sigma: f32,
    },
    /// Mitchell and Netravali's cubic with B = C = 1/3, radius 2. It is negative beyond 8/7; of two and more rays, some go
    /// there and are subtracted.
    Mitchell,
}

impl Sampling {
    /// Its name: where its rays go.
    pub fn name(self) -> &'static str {
        match self {
            Sampling::Corner => "corner",
            Sampling::Center => "center",
            Sampling::Regular(_) => "regular",
            Sampling::Jittered(_) => "jittered",
            Sampling::Adaptive { .. } => "adaptive",
            Sampling::Sampled(_) => "sampled",
        }
    }
}

impl Filter {
    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Filter::Box => "box",
            Filter::Tent => "tent",
            Filter::Gaussian { .. } => "gaussian",
            Filter::Mitchell => "mitchell",
        }
    }
}

impl Tone {
    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Tone::Clamp => "clamp",
            Tone::Scale => "scale",
        }
    }
}

impl Transfer {
    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Transfer::None => "none",
            Transfer::Srgb => "srgb",
        }
    }
}

/// How values over 1 are treated (after 5.36).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Tone {
    /// Each component is cut at 1.
    #[default]
    Clamp,
    /// The picture is divided by its largest component if that exceeds 1.
    Scale,
}

/// From linear light to the numbers in an 8- or 16-bit file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Transfer {
    /// The values themselves, as the chapter shows them.
    None,
    /// The sRGB curve (IEC 61966-2-1).
    #[default]
    Srgb,
}
