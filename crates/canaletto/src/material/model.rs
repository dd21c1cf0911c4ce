//! The closed set of material models.

use super::{Conductor, Dielectric, Phong};
use crate::OutOfRange;
use serde::{Deserialize, Serialize};

/// A model of how a surface responds to light, with its numbers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum MaterialModel {
    /// Phong's model with a mirror and a clear body.
    Phong(Phong),
    /// A metal.
    Conductor(Conductor),
    /// A clear body whose boundary obeys Fresnel's equations.
    Dielectric(Dielectric),
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

impl From<Conductor> for MaterialModel {
    fn from(conductor: Conductor) -> MaterialModel {
        MaterialModel::Conductor(conductor)
    }
}

impl From<Dielectric> for MaterialModel {
    fn from(dielectric: Dielectric) -> MaterialModel {
        MaterialModel::Dielectric(dielectric)
    }
}

impl MaterialModel {
    /// The coefficients of (5.39b), from which Whitted's integrator computes the chapter's terms. Other models have
    /// those that come nearest to them.
    #[inline(always)]
    pub fn phong(&self) -> &Phong {
        match self {
            MaterialModel::Phong(phong)
            | MaterialModel::Conductor(Conductor { phong, .. })
            | MaterialModel::Dielectric(Dielectric { phong }) => phong,
        }
    }

    /// The coefficients of (5.39b), to be changed.
    #[inline(always)]
    pub fn phong_mut(&mut self) -> &mut Phong {
        match self {
            MaterialModel::Phong(phong)
            | MaterialModel::Conductor(Conductor { phong, .. })
            | MaterialModel::Dielectric(Dielectric { phong }) => phong,
        }
    }

    /// Whether bodies of the model have no surface in air: η is 1.
    pub fn is_index_matched_to_air(&self) -> bool {
        matches!(self, MaterialModel::Dielectric(dielectric) if dielectric.phong.eta == 1.0)
    }

    /// Checks every number's range.
    ///
    /// # Errors
    /// An [`OutOfRange`] that names the number, its value and the range.
    pub fn check(&self) -> Result<(), OutOfRange> {
        match self {
            MaterialModel::Phong(phong) => phong.check(),
            MaterialModel::Conductor(conductor) => conductor.check(),
            MaterialModel::Dielectric(dielectric) => dielectric.check(),
        }
    }
}
