//! Settings of path tracing.

use crate::{OutOfRange, named};
use serde::{Deserialize, Serialize};

/// Settings of path tracing.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PathSettings {
    /// The most surfaces of a path that scatter light. 0 is no limit, which leaves nothing out.
    pub max_depth: u32,
    /// Whether Russian roulette ends paths of small throughput and very long ones. The picture's mean is the same
    /// without it.
    pub roulette: bool,
    /// Whether paths learn where light comes from before the picture is made. The picture's mean is the same.
    pub guiding: Guiding,
}

/// Whether paths are guided to where light was found before.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Guiding {
    /// In scenes where that lowers noise by more than it costs time, as far as the first paths tell.
    #[default]
    Auto,
    /// Always.
    On,
    /// Never.
    Off,
}

named!(Guiding {
    Auto => "auto",
    On => "on",
    Off => "off",
});

impl PathSettings {
    /// The settings of a scene that names none.
    pub const DEFAULT: PathSettings = PathSettings { max_depth: 0, roulette: true, guiding: Guiding::Auto };

    /// Checks that every path ends.
    ///
    /// # Errors
    /// An [`OutOfRange`] if neither a depth nor roulette ends paths.
    pub fn check(&self) -> Result<(), OutOfRange> {
        if self.max_depth == 0 && !self.roulette {
            let problem = "is #false, and max-depth 0 is no limit, so paths would never end; give a max-depth";
            return Err(OutOfRange::new("roulette", problem));
        }
        Ok(())
    }
}

impl Default for PathSettings {
    fn default() -> PathSettings {
        PathSettings::DEFAULT
    }
}
