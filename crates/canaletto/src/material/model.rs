//! The closed set of material models.

use super::Phong;
use crate::OutOfRange;
use serde::{Deserialize, Serialize};

/// A model of how a surface responds to light, with its numbers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum MaterialModel {
    /// Phong's model with a mirror and a clear body.
    Phong(Phong),
}

impl Default for MaterialModel {
    fn default() -> MaterialModel {
        MaterialModel::Phong(Phong::default())
    }
}

impl From<Phong> for MaterialModel {
    fn from(phong: Phong) -> MaterialModel {
        MaterialModel::Phong(phong)
    }
}

impl MaterialModel {
    /// The coefficients of (5.39b), from which Whitted's integrator computes the chapter's terms.
    #[inline(always)]
    pub fn phong(&self) -> &Phong {
        match self {
            MaterialModel::Phong(phong) => phong,
        }
    }

    /// The coefficients of (5.39b), to be changed.
    #[inline(always)]
    pub fn phong_mut(&mut self) -> &mut Phong {
        match self {
            MaterialModel::Phong(phong) => phong,
        }
    }

    /// Checks every number's range.
    ///
    /// # Errors
    /// An [`OutOfRange`] that names the number, its value and the range.
    pub fn check(&self) -> Result<(), OutOfRange> {
        match self {
            MaterialModel::Phong(phong) => phong.check(),
        }
    }
}
