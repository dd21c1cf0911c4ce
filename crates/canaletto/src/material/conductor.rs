//! Metals: a smooth or rough boundary of a conductor, with GGX microfacets.
//!
//! Light that one scattering loses between the microfacets is given back as a share of it (Turquin, *Practical Multiple
//! Scattering Compensation for Microfacet Models*, 2019). A metal that reflects all light is exactly white. This part
//! is not reciprocal.

use super::{BsdfSample, Lobe, Phong, ScatteringFrame, fresnel_conductor, ggx, ggx_vndf_pdf, reflect, sample_ggx_vndf};
use crate::OutOfRange;
use crate::math::Rgb;
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// A metal.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Conductor {
    /// The index of refraction η > 0 in red, green and blue.
    pub eta: Rgb,
    /// The absorption k ≥ 0, the imaginary part of the index.
    pub k: Rgb,
    /// What integrators without this model take in its place. Its roughness and emission are those of the metal, too.
    pub phong: Phong,
}

/// Metals by name: η and k in red, green and blue. They are means of published measurements over the three curves.
pub const METALS: [(&str, [f32; 3], [f32; 3]); 5] = [
    ("gold", [0.143, 0.375, 1.442], [3.983, 2.386, 1.603]),
    ("silver", [0.155, 0.117, 0.138], [4.828, 3.122, 2.147]),
    ("copper", [0.200, 0.924, 1.102], [3.912, 2.452, 2.142]),
    ("aluminium", [1.657, 0.880, 0.521], [9.224, 6.270, 4.837]),
    ("chromium", [4.369, 2.917, 1.655], [5.206, 4.231, 3.755]),
];

impl Conductor {
    /// A metal with this complex index.
    pub fn new(eta: Rgb, k: Rgb) -> Conductor {
        let mirrored = fresnel_conductor(1.0, eta, k);
        let phong = Phong { kd: Rgb::BLACK, k: mirrored, ..Phong::default() };
        Conductor { eta, k, phong }
    }

    /// A metal by its name in [`METALS`].
    pub fn named(name: &str) -> Option<Conductor> {
        let (_, eta, k) = METALS.iter().find(|(metal, ..)| *metal == name)?;
        Some(Conductor::new((*eta).into(), (*k).into()))
    }

    /// Checks every number's range.
    ///
    /// # Errors
    /// An [`OutOfRange`] that names the number, its value and the range.
    pub fn check(&self) -> Result<(), OutOfRange> {
        for (name, color, may_be_zero) in [("eta", self.eta, false), ("k", self.k, true)] {
            let is_right = |v: f32| v.is_finite() && (v > 0.0 || may_be_zero && v == 0.0);
            if !color.to_array().into_iter().all(is_right) {
                let range = if may_be_zero { "0 or more" } else { "more than 0" };
                let problem = format!("is {} {} {}; each component must be {range}", color.r, color.g, color.b);
                return Err(OutOfRange::new(name, problem));
            }
        }
        self.phong.check()
    }
}

/// A metal at a point.
#[derive(Clone, Copy, Debug)]
pub struct ConductorBsdf {
    eta: Rgb,
    k: Rgb,
    roughness: f64,
    frame: ScatteringFrame,
}

impl ConductorBsdf {
    pub(super) fn new(conductor: &Conductor, frame: ScatteringFrame) -> ConductorBsdf {
        let Conductor { eta, k, phong } = conductor;
        ConductorBsdf { eta: *eta, k: *k, roughness: phong.roughness.into(), frame }
    }

    pub(super) fn is_delta(&self) -> bool {
        self.roughness == 0.0
    }

    /// The normal around which microfacets are distributed. It is on the side of `wo`.
    fn normal(&self, wo: DVec3) -> DVec3 {
        if wo.dot(self.frame.normal) > 0.0 { self.frame.normal } else { self.frame.facing }
    }

    pub(super) fn eval(&self, wo: DVec3, wi: DVec3) -> Rgb {
        let normal = self.normal(wo);
        let (o, i) = (wo.dot(normal), wi.dot(normal));
        if self.is_delta() || i <= 0.0 || wi.dot(self.frame.facing) <= 0.0 {
            return Rgb::BLACK;
        }
        let Some(m) = (wo + wi).try_normalize() else { return Rgb::BLACK };
        // F D G₂ / (4 wo·n), where D G₁ wo·m / wo·n is the density of visible normals.
        let cos = wo.dot(m);
        let density = ggx_vndf_pdf(wo, normal, self.roughness, m) / (4.0 * cos);
        let f = fresnel_conductor(cos, self.eta, self.k) * (density * ggx::shadowing(o, i, self.roughness)) as f32;
        let albedo = ggx::albedo(o, self.roughness) as f32;
        let lost = (1.0 - albedo) / albedo;
        f * (Rgb::WHITE + fresnel_conductor(1.0, self.eta, self.k) * lost)
    }

    pub(super) fn pdf(&self, wo: DVec3, wi: DVec3) -> f64 {
        if self.is_delta() {
            return 0.0;
        }
        let Some(m) = (wo + wi).try_normalize() else { return 0.0 };
        ggx_vndf_pdf(wo, self.normal(wo), self.roughness, m) / (4.0 * wo.dot(m))
    }

    pub(super) fn sample(&self, wo: DVec3, u: [f64; 2]) -> Option<BsdfSample> {
        let normal = self.normal(wo);
        let lobe = Lobe::Mirror;
        if self.is_delta() {
            let mirrored = reflect(wo, normal);
            let wi = if mirrored.dot(self.frame.facing) > 0.0 { mirrored } else { reflect(wo, self.frame.facing) };
            let f = fresnel_conductor(wo.dot(normal), self.eta, self.k);
            return Some(BsdfSample { wi, f, pdf: 1.0, lobe, is_delta: true });
        }
        let wi = reflect(wo, sample_ggx_vndf(wo, normal, self.roughness, u));
        Some(BsdfSample { wi, f: self.eval(wo, wi), pdf: self.pdf(wo, wi), lobe, is_delta: false })
    }
}

#[cfg(test)]
mod tests {
    use super::super::bsdf_tests::{albedo, check_density};
    use super::super::{Bsdf, MaterialPoint};
    use super::*;

    fn metal(conductor: Conductor, roughness: f32) -> Bsdf {
        let conductor = Conductor { phong: Phong { roughness, ..conductor.phong }, ..conductor };
        let frame = ScatteringFrame { normal: DVec3::Z, facing: DVec3::Z, eta_ratio: 1.0 };
        MaterialPoint { model: conductor.into(), ..MaterialPoint::default() }.bsdf(frame)
    }

    /// A metal with k ≫ η reflects nearly all light. It is white at any roughness and angle.
    #[test]
    fn a_metal_that_reflects_all_light_is_white() {
        let perfect = Conductor::new(Rgb::gray(1e-6), Rgb::gray(1e6));
        for roughness in [0.0, 0.2, 0.5, 0.8, 1.0] {
            for degrees in [0.0, 30.0, 60.0, 80.0] {
                let albedo = albedo(&metal(perfect, roughness), degrees);
                assert!((albedo - 1.0).abs() < 5e-3, "roughness {roughness}, {degrees}°: {albedo}");
            }
        }
    }

    #[test]
    fn directions_have_their_density() {
        for roughness in [0.3, 0.7, 1.0] {
            for degrees in [10.0, 70.0] {
                check_density(&metal(Conductor::named("gold").unwrap(), roughness), degrees);
            }
        }
    }

    #[test]
    fn metals_have_names_and_ranges() {
        for (name, ..) in METALS {
            Conductor::named(name).unwrap().check().unwrap();
        }
        assert!(Conductor::named("cheese").is_none());
        assert!(Conductor::new(Rgb::BLACK, Rgb::WHITE).check().is_err());
    }
}
