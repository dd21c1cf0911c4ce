//! Materials: how surfaces respond to light.

mod bsdf;
mod bump;
mod conductor;
mod conductor_albedo;
mod dielectric;
mod dielectric_albedo;
mod diffuse_bsdf;
mod fresnel;
mod ggx;
mod mapping;
mod medium;
mod microfacet;
mod model;
mod parameter;
mod phong;
mod phong_bsdf;
mod point;
mod prepared;
mod refract;
mod standard;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;
mod texture_use;

pub use bsdf::{Bsdf, BsdfSample, Lobe, ScatteringFrame};
pub(crate) use bsdf::{FacetAxes, LobeDirections, SeenBsdf, SpecularTransmission};
pub use bump::{apply_bump, apply_normal_map, clamp_to_hemisphere};
pub use conductor::{Conductor, ConductorBsdf, METALS};
pub(crate) use conductor::{ConductorPoint, MetalFacets};
pub use dielectric::{Dielectric, DielectricBsdf};
pub(crate) use dielectric::{RoughBoundaries, SeenDielectric};
pub use diffuse_bsdf::DiffuseBsdf;
pub(crate) use diffuse_bsdf::{diffuse_direction, diffuse_pdf, diffuse_share};
pub use fresnel::{fresnel_conductor, fresnel_dielectric};
pub use mapping::{Mapping, Place, Projection, Repeat, Space, TexCoord, TexCoords};
pub use medium::{HenyeyGreenstein, Medium, MediumSample};
pub use microfacet::{ggx_vndf_pdf, reflect_into_hemisphere, sample_ggx_vndf};
pub use model::MaterialModel;
pub use parameter::{Parameter, ParameterInfo, ParameterValue, Shown};
pub use phong::Phong;
pub(crate) use phong::highlights;
pub use phong_bsdf::PhongBsdf;
pub(crate) use phong_bsdf::{GlossyLobes, GlossyPoint};
pub use point::MaterialPoint;
pub use prepared::PreparedMaterial;
pub use refract::{reflect, refract};
pub(crate) use standard::{BaseNumbers, OpaqueBase, OpaqueBaseLobes};
pub use standard::{
    PRESETS, Preset, StandardBase, StandardBlock, StandardBsdf, StandardCoat, StandardEmission, StandardFuzz,
    StandardParameter, StandardSpecular, StandardSubsurface, StandardSurface, StandardTarget, StandardThinFilm,
    StandardTransmission,
};
pub use texture_use::{Channel, Target, TextureUse};

use crate::Named;
use crate::OutOfRange;
use serde::{Deserialize, Serialize};

/// A named material.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Material {
    /// The name that objects refer to.
    pub name: String,
    /// The model and its numbers.
    #[serde(flatten)]
    pub model: MaterialModel,
    /// The share of the surface that exists, 0 (nothing) to 1: alpha of glTF, `d` of MTL. Light passes straight through
    /// the rest, by 1 − coverage, and the rest is not shaded. Opacity is different: a transparent surface such as glass
    /// is shaded as a whole.
    #[serde(default = "whole")]
    pub coverage: f32,
    /// The least coverage that counts as all of the surface, 0 to 1; less counts as a hole. It is compared after
    /// textures and their filters (`alphaCutoff` of glTF). `None` keeps partial coverage.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub alpha_cutoff: Option<f32>,
    /// The priority of the body where several clear bodies overlap: the largest number fills the overlap. Among equal
    /// numbers the smallest volume does. Any finite number.
    #[serde(default)]
    pub priority: f32,
    /// Whether the inner side emits [`Phong::emission`], too.
    #[serde(default)]
    pub two_sided: bool,
    /// Whether surfaces stand for the scene's background. A picture with an alpha leaves them out, but for how much
    /// darker than the background they are ([`Picture::shadow`](crate::film::Picture::shadow)).
    #[serde(default)]
    pub shadow_catcher: bool,
    /// What fills a closed clear body of the material.
    #[serde(default)]
    pub medium: Medium,
    /// The textures that modify the material, applied in this order.
    #[serde(default)]
    pub textures: Vec<TextureUse>,
}

/// The coverage of surfaces without holes.
fn whole() -> f32 {
    1.0
}

impl Default for Material {
    fn default() -> Material {
        Material {
            name: String::new(),
            model: MaterialModel::default(),
            coverage: whole(),
            alpha_cutoff: None,
            priority: 0.0,
            two_sided: false,
            shadow_catcher: false,
            medium: Medium::VACUUM,
            textures: Vec::new(),
        }
    }
}

impl Material {
    /// A material without textures.
    pub fn new(name: impl Into<String>, model: impl Into<MaterialModel>) -> Material {
        Material { name: name.into(), model: model.into(), ..Material::default() }
    }

    /// A material of the standard surface without textures.
    pub fn new_standard(name: impl Into<String>, surface: StandardSurface) -> Material {
        let mut material = Material::new(name, Phong::default());
        material.set_standard(surface);
        material
    }

    /// Makes the material one of the standard surface. What absorbs light inside its clear bodies follows from it.
    pub fn set_standard(&mut self, surface: StandardSurface) {
        self.medium = Medium { absorption: surface.absorption(), ..Medium::VACUUM };
        self.model = surface.into();
    }

    /// Returns the material with this coverage.
    pub fn with_coverage(self, coverage: f32) -> Material {
        Material { coverage, ..self }
    }

    /// Returns the material with this priority where clear bodies overlap.
    pub fn with_priority(self, priority: f32) -> Material {
        Material { priority, ..self }
    }

    /// Returns the material with both sides emitting its emission, or only the outer one.
    pub fn with_two_sided(self, two_sided: bool) -> Material {
        Material { two_sided, ..self }
    }

    /// Returns the material whose surfaces stand for the background ([`Material::shadow_catcher`]).
    pub fn catching_shadows(self) -> Material {
        Material { shadow_catcher: true, ..self }
    }

    /// Returns the material with this medium in its closed bodies.
    pub fn with_medium(self, medium: Medium) -> Material {
        Material { medium, ..self }
    }

    /// Returns the material with one more texture.
    pub fn with_texture(mut self, texture: TextureUse) -> Material {
        self.textures.push(texture);
        self
    }

    /// The scattering at a point of the material. Phong's model is scaled to return no more light than arrives.
    pub fn bsdf(&self, point: &MaterialPoint, frame: ScatteringFrame) -> Bsdf {
        match &self.model {
            MaterialModel::Phong(_) => {
                let bounded = point.classic.bounded();
                let phong = Phong { opacity: if frame.is_closed { bounded.opacity } else { 1.0 }, ..bounded };
                match phong.is_diffuse() {
                    true => Bsdf::Diffuse(DiffuseBsdf { kd: phong.kd, normal: frame.normal, facing: frame.facing }),
                    false => Bsdf::Phong(PhongBsdf::new(phong, frame)),
                }
            }
            MaterialModel::Conductor(metal) => Bsdf::Conductor(ConductorBsdf::new(metal, point, frame)),
            MaterialModel::Dielectric(_) => Bsdf::Dielectric(DielectricBsdf::new(point, frame)),
            MaterialModel::Standard(surface) => Bsdf::Standard(StandardBsdf::new(surface, point, frame)),
        }
    }

    /// The numbers of the standard surface, if that is the model.
    pub fn standard(&self) -> Option<&StandardSurface> {
        match &self.model {
            MaterialModel::Standard(surface) => Some(surface),
            _ => None,
        }
    }

    /// Whether the scattering depends on ∂P/∂u.
    pub fn is_anisotropic(&self) -> bool {
        let is_stretched =
            |surface: &StandardSurface| surface.specular.anisotropy > 0.0 || surface.coat.anisotropy > 0.0;
        self.standard()
            .is_some_and(|surface| is_stretched(surface) || self.textures.iter().any(|t| t.target.stretches()))
    }

    /// Whether red, green and blue are refracted by different angles.
    pub fn is_dispersive(&self) -> bool {
        self.standard().is_some_and(StandardSurface::is_dispersive)
    }

    /// The classic view of the model ([`MaterialModel::classic`]).
    pub fn classic(&self) -> Phong {
        self.model.classic()
    }

    /// Whether the material has no texture and its coverage isn't zero, so that it is constant on all its surfaces.
    #[inline]
    pub(crate) fn is_plain(&self) -> bool {
        self.textures.is_empty() && self.coverage > 0.0
    }

    /// Whether the material lets no light through anywhere.
    pub fn is_opaque(&self) -> bool {
        self.classic().opacity >= 1.0
            && self.coverage >= 1.0
            && !self.textures.iter().any(|texture| texture.target.may_transmit())
    }

    /// Whether the material may emit light anywhere.
    pub fn may_emit(&self) -> bool {
        let emission = Target::Parameter(Parameter::Emission);
        !self.classic().emission.is_black() || self.textures.iter().any(|texture| texture.target == emission)
    }

    /// Whether the coverage may be less than 1.
    pub fn has_holes(&self) -> bool {
        self.coverage < 1.0 || self.has_cutouts()
    }

    /// Whether a texture sets the coverage.
    pub(crate) fn has_cutouts(&self) -> bool {
        self.textures.iter().any(|texture| texture.target == Target::Cutout)
    }

    /// Whether light may go straight on through a surface of the material in air: a thin wall, or a clear body of η 1.
    pub(crate) fn may_pass_straight(&self) -> bool {
        match self.standard() {
            Some(surface) if surface.thin_walled => surface.transmission.weight > 0.0,
            _ => self.classic().eta == 1.0 && !self.is_opaque(),
        }
    }

    /// Checks every number's range.
    ///
    /// # Errors
    /// An [`OutOfRange`] that names the number, its value and the range.
    pub fn check(&self) -> Result<(), OutOfRange> {
        self.model.check()?;
        self.medium.check()?;
        if !(0.0..=1.0).contains(&self.coverage) {
            return Err(OutOfRange::new(
                "coverage",
                format!("is {}; it must be between 0 (nothing is there) and 1 (all of it)", self.coverage),
            ));
        }
        if let Some(cutoff) = self.alpha_cutoff.filter(|cutoff| !(0.0..=1.0).contains(cutoff)) {
            return Err(OutOfRange::new("alpha-cutoff", format!("is {cutoff}; it must be between 0 and 1")));
        }
        if !self.priority.is_finite() {
            return Err(OutOfRange::new("priority", format!("is {}; it must be finite", self.priority)));
        }
        self.textures.iter().try_for_each(|texture| {
            let target = texture.target.name();
            texture.check().map_err(|problem| OutOfRange::new("texture", format!("for {target}: {problem}")))
        })
    }
}
