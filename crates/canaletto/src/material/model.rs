//! The closed set of material models.

use super::{Conductor, Dielectric, Parameter, ParameterValue, Phong, StandardSurface};
use crate::OutOfRange;
use serde::{Deserialize, Serialize};

/// A model of how a surface responds to light, with its numbers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum MaterialModel {
    /// Phong's model with a mirror and a clear body.
    Phong(Phong),
    /// A metal.
    Conductor(Conductor),
    /// A clear body whose boundary obeys Fresnel's equations.
    Dielectric(Dielectric),
    /// The standard surface.
    Standard(Box<StandardSurface>),
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

impl From<StandardSurface> for MaterialModel {
    fn from(surface: StandardSurface) -> MaterialModel {
        MaterialModel::Standard(Box::new(surface))
    }
}

impl MaterialModel {
    /// The classic view: the coefficients of (5.39b), from which Whitted's integrator computes the chapter's terms.
    /// Other models have those that come nearest to them.
    pub fn classic(&self) -> Phong {
        match self {
            MaterialModel::Phong(phong) => *phong,
            MaterialModel::Conductor(metal) => metal.classic(),
            MaterialModel::Dielectric(body) => body.classic(),
            MaterialModel::Standard(surface) => surface.classic(),
        }
    }

    /// Phong's model, to be changed, if it is this one.
    pub fn phong_mut(&mut self) -> Option<&mut Phong> {
        match self {
            MaterialModel::Phong(phong) => Some(phong),
            _ => None,
        }
    }

    /// Sets a parameter. Returns whether the model has it; the standard surface has parameters of its own.
    pub fn set(&mut self, parameter: Parameter, value: ParameterValue) -> bool {
        let mut numbers = self.classic();
        parameter.info().set(&mut numbers, value);
        let Phong { eta, roughness, emission, .. } = numbers;
        match (self, parameter) {
            (MaterialModel::Phong(phong), _) => *phong = numbers,
            (MaterialModel::Conductor(metal), Parameter::Roughness | Parameter::Emission) => {
                (metal.roughness, metal.emission) = (roughness, emission);
            }
            (MaterialModel::Dielectric(body), Parameter::Eta | Parameter::Roughness | Parameter::Emission) => {
                (body.eta, body.roughness, body.emission) = (eta, roughness, emission);
            }
            _ => return false,
        }
        true
    }

    /// Whether bodies of the model have no surface in air: η is 1.
    pub fn is_index_matched_to_air(&self) -> bool {
        matches!(self, MaterialModel::Dielectric(dielectric) if dielectric.eta == 1.0)
    }

    /// Checks every number's range.
    ///
    /// # Errors
    /// An [`OutOfRange`] that names the number, its value and the range.
    pub fn check(&self) -> Result<(), OutOfRange> {
        let classic = self.classic();
        match self {
            MaterialModel::Phong(_) => {}
            MaterialModel::Conductor(metal) => metal.check()?,
            // The other numbers follow from η.
            MaterialModel::Dielectric(_) => Parameter::Eta.info().check(&classic)?,
            MaterialModel::Standard(surface) => surface.check()?,
        }
        classic.check()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Rgb;

    /// What other integrators take of a clear body follows from its η. A metal has no numbers of Phong's model.
    #[test]
    fn models_have_their_own_numbers() {
        let [mut glass, mut gold] =
            [Dielectric::new(1.5).into(), MaterialModel::from(Conductor::named("gold").unwrap())];
        assert!(glass.set(Parameter::Eta, ParameterValue::Number(2.0)));
        assert_eq!(glass, Dielectric::new(2.0).into());
        assert!(gold.set(Parameter::Roughness, ParameterValue::Number(0.5)) && gold.classic().roughness == 0.5);
        for model in [&mut glass, &mut gold] {
            let before = model.clone();
            assert!(!model.set(Parameter::Diffuse, ParameterValue::Color(Rgb::WHITE)) && *model == before);
        }
        assert!(glass.set(Parameter::Eta, ParameterValue::Number(0.0)));
        assert_eq!(glass.check().unwrap_err().field, Some("eta"));
    }
}
