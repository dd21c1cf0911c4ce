//! The closed set of material models.

use super::{Conductor, Dielectric, MicrofacetOptions, Phong, StandardPoint};
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
    /// The standard surface, of which the material holds the other numbers.
    Standard(StandardPoint),
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
            | MaterialModel::Dielectric(Dielectric { phong, .. })
            | MaterialModel::Standard(StandardPoint { phong, .. }) => phong,
        }
    }

    /// The coefficients of (5.39b), to be changed.
    #[inline(always)]
    pub fn phong_mut(&mut self) -> &mut Phong {
        match self {
            MaterialModel::Phong(phong)
            | MaterialModel::Conductor(Conductor { phong, .. })
            | MaterialModel::Dielectric(Dielectric { phong, .. })
            | MaterialModel::Standard(StandardPoint { phong, .. }) => phong,
        }
    }

    /// The options of the scattering by microfacets, of models that have them.
    pub fn microfacets_mut(&mut self) -> Option<&mut MicrofacetOptions> {
        match self {
            MaterialModel::Phong(_) | MaterialModel::Standard(_) => None,
            MaterialModel::Conductor(Conductor { microfacets, .. })
            | MaterialModel::Dielectric(Dielectric { microfacets, .. }) => Some(microfacets),
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
            MaterialModel::Standard(standard) => standard.phong.check(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every hit of every integrator copies a model, so none may make it larger than a metal with its options.
    #[test]
    fn models_are_small() {
        assert!(size_of::<MaterialModel>() <= 92, "{}", size_of::<MaterialModel>());
    }
}
