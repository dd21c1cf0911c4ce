//! Settings of path tracing.

use crate::OutOfRange;
use serde::{Deserialize, Serialize};

/// Settings of path tracing.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PathSettings {
    /// The most surfaces of a path that scatter light. 0 is no limit, which leaves nothing out.
    pub max_depth: u32,
    /// Whether Russian roulette ends paths of small throughput. The picture's mean is the same without it.
    pub roulette: bool,
}

impl PathSettings {
    /// The settings of a scene that names none.
    pub const DEFAULT: PathSettings = PathSettings { max_depth: 0, roulette: true };

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
