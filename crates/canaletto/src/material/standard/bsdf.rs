//! The scattering of a standard surface at a point: evaluation, sampling and density over all its lobes.

use super::super::bsdf::{FacetAxes, LobeDirections, mirrored_at};
use super::super::ggx::Ggx;
use super::super::{
    BsdfSample, Lobe, MaterialPoint, Phong, ScatteringFrame, SpecularTransmission, fresnel_dielectric, reflect, refract,
};
use super::diffuse;
use super::layers::{Layer, Layers, weighted_ior};
use super::metal::MetalFresnel;
use super::opaque_base::{BaseNumbers, OpaqueBase, OpaqueBaseLobes};
use super::{StandardFuzz, StandardSurface, StandardThinFilm};
use crate::math::{Rgb, warp};
use glam::{DMat3, DVec3, Vec3};
use std::f64::consts::FRAC_1_PI;

/// The coat at a point.
#[derive(Clone, Copy, Debug)]
pub(super) struct CoatPoint {
    pub(super) weight: f32,
    pub(super) color: Rgb,
    /// The widths of the facets along the surface's axes.
    pub(super) alpha: [f32; 2],
    pub(super) ior: f32,
    pub(super) darkening: f32,
    /// The coat's shading normal on the viewer's side, if it isn't that of the base.
    normal: Option<DVec3>,
}

/// A standard surface at a point.
#[derive(Clone, Copy, Debug)]
pub struct StandardBsdf {
    frame: ScatteringFrame,
    /// The ratio ηᵢ/ηₜ at the base.
    eta_ratio: f64,
    pub(super) diffuse: Rgb,
    diffuse_roughness: f32,
    /// The cosine to the normal above which diffuse light leaves: that of the critical angle inside a clear body, where
    /// light to others is reflected totally, if need be for ever.
    diffuse_from: f64,
    pub(super) metal: MetalFresnel,
    pub(super) metalness: f32,
    pub(super) metal_weight: f32,
    pub(super) specular_tint: Rgb,
    pub(super) roughness: f32,
    /// The widths of the base's facets along the surface's axes.
    pub(super) alpha: [f32; 2],
    /// The clear share of a dielectric base, and the tint of what crosses it.
    pub(super) clear: f32,
    pub(super) clear_tint: Rgb,
    /// The share of an opaque thin wall that is translucent, and its colour.
    pub(super) translucent: f32,
    pub(super) translucent_color: Rgb,
    /// The shares of translucent light that a thin wall sends back and through.
    pub(super) scattered: [f32; 2],
    pub(super) thin_walled: bool,
    /// F0 and F90 of the base's reflection by Schlick's curve, instead of Fresnel's equations.
    pub(super) schlick: Option<[Rgb; 2]>,
    pub(super) film: StandardThinFilm,
    pub(super) coat: CoatPoint,
    pub(super) fuzz: StandardFuzz,
    /// Whether the surface is a rough opaque base alone.
    is_base: bool,
}

/// The widths αx and αy of a roughness and an anisotropy: αx² + αy² = 2 r⁴ and αy / αx = 1 − anisotropy.
fn widths(roughness: f32, anisotropy: f32) -> [f32; 2] {
    let squash = f64::from((1.0 - anisotropy).max(1e-2));
    let along = f64::from(roughness * roughness) * (2.0 / (1.0 + squash * squash)).sqrt();
    [along as f32, (along * squash) as f32]
}

/// The directions of the viewer and of light in the frame of the facets.
struct Local {
    wo: DVec3,
    wi: DVec3,
    /// Whether the light comes to the facets by the geometric surface, which mirrors it or lets it through.
    is_mirrored: bool,
}

impl StandardBsdf {
    pub(in crate::material) fn new(
        surface: &StandardSurface,
        point: &MaterialPoint,
        frame: ScatteringFrame,
    ) -> StandardBsdf {
        let Phong { opacity, roughness, .. } = point.classic;
        let surface = point.standard.as_ref().unwrap_or(surface);
        let schlick = surface.schlick.then(|| surface.schlick_ends());
        let is_base = OpaqueBase::is_all_of(surface) && roughness * roughness > 0.0;
        let StandardSurface { base, specular, transmission, subsurface, coat, fuzz, thin_film, thin_walled, .. } =
            *surface;
        let is_clear = transmission.weight > 0.0 && (thin_walled || frame.is_closed && opacity < 1.0);
        let from_inside = is_clear && !thin_walled && !frame.outside;
        // From inside a clear body only the base's boundary is met.
        let coat_weight = if from_inside { 0.0 } else { coat.weight };
        let fuzz_weight = if from_inside { 0.0 } else { fuzz.weight };
        let [own, over] = [specular.ior, coat.ior].map(f64::from);
        // Inside the coat no total reflection happens that the refraction at its surface would not have (OpenPBR).
        let coated = if over > own { over / own } else { own / over };
        let ior = own + f64::from(coat_weight) * (coated - own);
        let eta_ratio = match is_clear && !thin_walled {
            true => frame.eta_ratio,
            // The index whose reflection at right angles is that of Schlick's curve.
            false if let Some([f0, _]) = schlick => 1.0 / weighted_ior(1e12, f0.luminance().into()),
            false => 1.0 / weighted_ior(ior, specular.weight.into()),
        };
        let diffuse_from = if from_inside { (1.0 - 1.0 / (eta_ratio * eta_ratio)).max(0.0).sqrt() } else { 0.0 };
        let base_color = base.color * base.weight;
        let [r4, coat_r4] = [roughness, coat.roughness].map(|r| f64::from(r * r) * f64::from(r * r));
        let rougher = (r4 + 2.0 * coat_r4).min(1.0).sqrt().sqrt();
        let roughness = roughness + coat_weight * (rougher as f32 - roughness);
        let blended = base_color * (1.0 - subsurface.weight) + subsurface.color * subsurface.weight;
        StandardBsdf {
            frame,
            eta_ratio,
            diffuse: if thin_walled { base_color } else { blended },
            diffuse_roughness: if from_inside { 0.0 } else { base.diffuse_roughness },
            diffuse_from,
            metal: MetalFresnel::new(base_color, if surface.schlick { Rgb::WHITE } else { specular.color }),
            metalness: base.metalness,
            metal_weight: if surface.schlick { 1.0 } else { specular.weight.min(1.0) },
            specular_tint: if from_inside || surface.schlick { Rgb::WHITE } else { specular.color },
            roughness,
            alpha: widths(roughness, specular.anisotropy),
            clear: if is_clear { transmission.weight } else { 0.0 },
            clear_tint: match thin_walled || transmission.depth == 0.0 {
                true => transmission.color * transmission.tint,
                false => transmission.tint,
            },
            translucent: if thin_walled { subsurface.weight } else { 0.0 },
            translucent_color: subsurface.color,
            scattered: [-1.0, 1.0].map(|side| 0.5 * (1.0 + side * subsurface.scatter_anisotropy)),
            thin_walled,
            schlick,
            film: thin_film,
            coat: CoatPoint {
                weight: coat_weight,
                color: coat.color,
                alpha: widths(coat.roughness, coat.anisotropy),
                ior: coat.ior,
                darkening: coat.darkening,
                normal: (point.coat_normal != Vec3::ZERO && coat_weight > 0.0).then(|| {
                    let outwards = point.coat_normal.as_dvec3().normalize();
                    if frame.outside { outwards } else { -outwards }
                }),
            },
            fuzz: StandardFuzz { weight: fuzz_weight, ..fuzz },
            is_base,
        }
    }

    /// The numbers of the base.
    fn base_numbers(&self) -> BaseNumbers<f64> {
        let [f0, f90] = self.schlick.unwrap_or([Rgb::BLACK; 2]);
        BaseNumbers {
            diffuse: self.diffuse.into(),
            f0: self.metal.f0.into(),
            dip: self.metal.dip.into(),
            metalness: self.metalness.into(),
            metal_weight: self.metal_weight.into(),
            tint: self.specular_tint.into(),
            eta_ratio: self.eta_ratio,
            schlick: self.schlick.is_some(),
            ends: [f0.into(), f90.into()],
            alpha: self.alpha[0].into(),
        }
    }

    /// Whether the surface is a sheet with no inside.
    pub fn is_thin_walled(&self) -> bool {
        self.thin_walled
    }

    /// Whether light passes the base.
    #[cfg(test)]
    pub(in crate::material) fn is_clear(&self) -> bool {
        self.clear > 0.0
    }

    pub(in crate::material) fn eta_ratio(&self) -> f64 {
        self.eta_ratio
    }

    /// Whether the base mirrors and refracts to single directions.
    pub(super) fn is_smooth(&self) -> bool {
        self.alpha[0] == 0.0
    }

    /// Whether facets bend no light that passes them, though they mirror to all sides.
    pub(super) fn goes_straight(&self) -> bool {
        !self.is_smooth() && !self.thin_walled && self.eta_ratio == 1.0
    }

    /// Whether rough facets refract light.
    fn refracts(&self) -> bool {
        self.clear > 0.0 && !self.thin_walled && !self.goes_straight()
    }

    /// Whether a lobe is a single direction.
    fn is_delta_layer(&self, layer: Layer) -> bool {
        match layer {
            Layer::Fuzz | Layer::Diffuse | Layer::Translucent => false,
            Layer::Coat => self.coat.alpha[0] == 0.0,
            Layer::Facets => self.is_smooth(),
            Layer::Straight => true,
        }
    }

    pub(in crate::material) fn is_delta(&self) -> bool {
        let opaque = (1.0 - self.metalness) * (1.0 - self.clear);
        self.is_smooth()
            && self.fuzz.weight == 0.0
            && (self.coat.weight == 0.0 || self.is_delta_layer(Layer::Coat))
            && (opaque == 0.0 || self.translucent == 0.0 && self.diffuse.is_black())
    }

    pub(super) fn coat_ggx(&self) -> Ggx {
        Ggx { alpha: self.coat.alpha.map(f64::from) }
    }

    /// The share that a facet of a dielectric base mirrors; of a thin wall, with all reflections inside it.
    pub(super) fn gloss_fresnel(&self, cos: f64) -> Rgb {
        let single = self.dielectric_fresnel(cos);
        if !self.thin_walled {
            return single;
        }
        single.map(|f| f + self.clear * (2.0 * f / (1.0 + f) - f))
    }

    /// The share that passes a facet of a dielectric base; of a thin wall, both its sides.
    fn clear_fresnel(&self, cos: f64) -> Rgb {
        self.dielectric_fresnel(cos).map(|f| if self.thin_walled { (1.0 - f) / (1.0 + f) } else { 1.0 - f })
    }

    /// The share that a facet of the base mirrors.
    fn mirrored(&self, layers: &Layers, cos: f64) -> Rgb {
        let gloss = self.gloss_fresnel(cos) * layers.gloss_share;
        if self.metalness > 0.0 { gloss + self.metal_fresnel(cos) * layers.metal_share } else { gloss }
    }

    /// The probability that a chosen facet mirrors. Otherwise light passes it.
    fn mirror_probability(&self, layers: &Layers, cos: f64) -> f64 {
        if self.clear == 0.0 || self.goes_straight() {
            return 1.0;
        }
        self.mirror_probability_of(layers, self.mirrored(layers, cos), cos)
    }

    /// [`StandardBsdf::mirror_probability`] of a facet that mirrors this share.
    fn mirror_probability_of(&self, layers: &Layers, mirrored: Rgb, cos: f64) -> f64 {
        if self.clear == 0.0 || self.goes_straight() {
            return 1.0;
        }
        let [mirrored, passed] =
            [mirrored, self.clear_fresnel(cos) * layers.clear_share].map(|share| f64::from(share.max_component()));
        if passed > 0.0 { mirrored / (mirrored + passed) } else { 1.0 }
    }

    /// The share of light that the coat's colour leaves on its way in, out, or both.
    fn absorbed(&self, cosines: &[f64]) -> Rgb {
        if self.coat.color == Rgb::WHITE || self.coat.weight == 0.0 {
            return Rgb::WHITE;
        }
        let eta2 = f64::from(self.coat.ior) * f64::from(self.coat.ior);
        // The lengths inside the coat, relative to those at right angles; the colour is that of two of them.
        let inside = |cos: &f64| 1.0 / (1.0 - (1.0 - cos * cos) / eta2).max(1e-6).sqrt();
        let length: f64 = 0.5 * cosines.iter().map(inside).sum::<f64>();
        self.coat.color.map(|share| libm::pow(share.into(), length) as f32)
    }

    /// The factor of what lies below the coat.
    fn below(&self, layers: &Layers, cosines: &[f64]) -> Rgb {
        layers.below[0] + layers.below[1] * self.absorbed(cosines)
    }

    /// f cos θ and the density of a direction in the frame of the facets. `matte` is the factor of diffuse lobes.
    fn eval_and_pdf_local(&self, layers: &Layers, &Local { wo, wi, is_mirrored }: &Local, matte: f64) -> (Rgb, f64) {
        let matte = if is_mirrored { 0.0 } else { matte };
        // The density of the layers that have more than one direction.
        let probability = |layer: Layer| if self.is_delta_layer(layer) { 0.0 } else { layers.probability(layer) };
        if wi.z <= 0.0 {
            let below = self.below(layers, &[wo.z]);
            let translucent = layers.through_share * (-wi.z * FRAC_1_PI * matte) as f32;
            let (clear, density) = self.eval_and_pdf_clear(layers, wo, wi);
            let even = if is_mirrored { 0.0 } else { -wi.z * FRAC_1_PI };
            let mut pdf = 0.0;
            add_density(&mut pdf, probability(Layer::Translucent), even);
            add_density(&mut pdf, probability(Layer::Facets), density);
            return (below * (translucent + clear), pdf);
        }
        let (mut f, mut pdf) = (Rgb::BLACK, 0.0);
        let m = (wo + wi).normalize();
        let cos = wo.dot(m);
        if let Some(fuzz) = layers.fuzz {
            let density = fuzz.pdf(wi);
            f = layers.fuzz_share * density as f32;
            add_density(&mut pdf, probability(Layer::Fuzz), density);
        }
        if self.coat.normal.is_none() {
            let (of_coat, pdf_coat) = self.eval_and_pdf_coat(layers, wo, m, wi);
            f += of_coat;
            pdf += pdf_coat;
        }
        let mut base = self.eval_diffuse(wo, wi) * layers.diffuse_share + layers.back_share * (wi.z * FRAC_1_PI) as f32;
        base *= matte as f32;
        add_density(&mut pdf, probability(Layer::Diffuse), if is_mirrored { 0.0 } else { self.diffuse_pdf(wi) });
        if !self.is_smooth() {
            let (ggx, mirrored) = (self.ggx(), self.mirrored(layers, cos));
            // D G₂ / (4 wo·n), the factor of F
            let facets = ggx.d(m) * ggx.g2(wo, wi) / (4.0 * wo.z);
            base += mirrored * facets as f32;
            let density = match self.refracts() {
                true => ggx.visible_pdf(wo, m) / (4.0 * cos),
                false => ggx.mirrored_pdf(wo, m),
            };
            let mirrors = self.mirror_probability_of(layers, mirrored, cos);
            add_density(&mut pdf, probability(Layer::Facets), density * mirrors);
        }
        (f + self.below(layers, &[wo.z, wi.z]) * base, pdf)
    }

    /// f cos θ and the density of a rough coat, for directions above it in the frame of its facets, and the facet that
    /// mirrors one to the other.
    fn eval_and_pdf_coat(&self, layers: &Layers, wo: DVec3, m: DVec3, wi: DVec3) -> (Rgb, f64) {
        if self.coat.weight == 0.0 || self.is_delta_layer(Layer::Coat) {
            return (Rgb::BLACK, 0.0);
        }
        let ggx = self.coat_ggx();
        let share = fresnel_dielectric(wo.dot(m), 1.0 / f64::from(self.coat.ior));
        let f = Rgb::gray((share * layers.coat_share * (ggx.d(m) * ggx.g2(wo, wi) / (4.0 * wo.z))) as f32);
        let mut pdf = 0.0;
        add_density(&mut pdf, layers.probability(Layer::Coat), ggx.mirrored_pdf(wo, m));
        (f, pdf)
    }

    /// f cos θ of the diffuse part of the base, without the layers over it.
    fn eval_diffuse(&self, wo: DVec3, wi: DVec3) -> Rgb {
        if self.diffuse_from > 0.0 {
            return self.diffuse * self.diffuse_pdf(wi) as f32;
        }
        diffuse::eval(self.diffuse, self.diffuse_roughness.into(), wo, wi)
    }

    /// The density of diffuse directions: the cosine over the part of the hemisphere that they leave to.
    fn diffuse_pdf(&self, wi: DVec3) -> f64 {
        let sin2 = 1.0 - self.diffuse_from * self.diffuse_from;
        if wi.z > self.diffuse_from { wi.z * FRAC_1_PI / sin2 } else { 0.0 }
    }

    /// A random diffuse direction.
    fn sample_diffuse(&self, u: [f64; 2]) -> DVec3 {
        let wi = warp::cosine_hemisphere(u);
        if self.diffuse_from == 0.0 {
            return wi;
        }
        let sin2 = 1.0 - self.diffuse_from * self.diffuse_from;
        let (x, y) = (wi.x * sin2.sqrt(), wi.y * sin2.sqrt());
        DVec3::new(x, y, (1.0 - x * x - y * y).sqrt())
    }

    /// What passes the clear part of the base, without the layers over it, and the density of directions there if a
    /// facet is chosen.
    fn eval_and_pdf_clear(&self, layers: &Layers, wo: DVec3, wi: DVec3) -> (Rgb, f64) {
        if self.clear == 0.0 || self.is_smooth() || self.goes_straight() {
            return (Rgb::BLACK, 0.0);
        }
        let ggx = self.ggx();
        let (m, facets, density) = if self.thin_walled {
            // The reflection of the other side, seen through the wall.
            let wi = wi * DVec3::new(1.0, 1.0, -1.0);
            let m = (wo + wi).normalize();
            (m, ggx.d(m) * ggx.g2(wo, wi) / (4.0 * wo.z), ggx.mirrored_pdf(wo, m))
        } else {
            let Some((m, jacobian)) = self.refracting_facet(wo, wi) else { return (Rgb::BLACK, 0.0) };
            let density = ggx.visible_pdf(wo, m) * jacobian;
            let squeezed = self.eta_ratio * self.eta_ratio;
            (m, density * ggx.shadowing(wo, wi) * squeezed, density)
        };
        let cos = wo.dot(m);
        let f = self.clear_fresnel(cos) * layers.clear_share * facets as f32;
        (f, density * (1.0 - self.mirror_probability(layers, cos)))
    }

    /// The facet that refracts `wo` to `wi`, and dω_m / dω_i (Walter et al. 2007, (16) and (17)).
    fn refracting_facet(&self, wo: DVec3, wi: DVec3) -> Option<(DVec3, f64)> {
        let m = (wo * self.eta_ratio + wi).try_normalize()?;
        let m = if m.z < 0.0 { -m } else { m };
        let (o, i) = (wo.dot(m), wi.dot(m));
        let length = self.eta_ratio * o + i;
        (o > 0.0 && i < 0.0).then(|| (m, -i / (length * length)))
    }

    /// The share that passes a smooth clear base at this cosine.
    fn smooth_clear(&self, layers: &Layers, cos: f64) -> Rgb {
        layers.clear_share * self.below(layers, &[cos]) * self.clear_fresnel(cos)
    }

    /// The direction of a lobe that has only one, with its factor. `passes` tells that light passes the base.
    fn smooth(
        &self,
        wo: DVec3,
        normal: DVec3,
        layers: &Layers,
        (layer, passes): (Layer, bool),
    ) -> Option<(DVec3, Rgb)> {
        let facing = self.frame.facing;
        let cos = wo.dot(normal);
        if passes {
            let factor = self.smooth_clear(layers, cos);
            if self.thin_walled || self.eta_ratio == 1.0 {
                return Some((-wo, factor));
            }
            let wi = refract(wo, normal, self.eta_ratio)?;
            let wi = if wi.dot(facing) < 0.0 { wi } else { mirrored_at(facing, wi) };
            return Some((wi, factor * (self.eta_ratio * self.eta_ratio) as f32));
        }
        let mirrored = reflect(wo, normal);
        let wi = if mirrored.dot(facing) > 0.0 { mirrored } else { mirrored_at(facing, mirrored) };
        let factor = match layer {
            Layer::Coat => {
                Rgb::gray((layers.coat_share * fresnel_dielectric(cos, 1.0 / f64::from(self.coat.ior))) as f32)
            }
            _ => self.mirrored(layers, cos) * self.below(layers, &[cos, cos]),
        };
        Some((wi, factor))
    }
}

/// The frame of a coat with a normal of its own.
struct CoatFrame {
    frame: ScatteringFrame,
    /// The axes of its facets as columns, and the viewer's direction in them.
    axes: DMat3,
    local: DVec3,
}

/// Adds the density of a layer that is chosen with a probability.
#[inline]
fn add_density(sum: &mut f64, probability: f64, density: f64) {
    if probability > 0.0 {
        *sum += probability * density;
    }
}

/// A standard surface at a point, as it is seen from one direction.
pub(crate) struct SeenStandard {
    pub(crate) bsdf: StandardBsdf,
    lobes: SeenLobes,
}

/// The lobes of a standard surface.
#[expect(clippy::large_enum_variant, reason = "one lives on the stack, at the last vertex of a path")]
enum SeenLobes {
    Base(OpaqueBaseLobes<f64>),
    Layered(LayeredLobes),
}

/// The lobes of a standard surface of any kind.
struct LayeredLobes {
    wo: DVec3,
    /// The axes of the facets as columns, and the viewer's direction in them.
    axes: DMat3,
    local: DVec3,
    /// The same of the coat, if it has a normal of its own.
    coat: Option<CoatFrame>,
    layers: Layers,
    /// The factor of diffuse lobes: over the part of their hemisphere that is above the geometric surface.
    matte: f64,
}

impl SeenStandard {
    pub(in crate::material) fn new(bsdf: StandardBsdf, wo: DVec3) -> SeenStandard {
        let lobes = if bsdf.is_base {
            let ScatteringFrame { normal, facing, .. } = bsdf.frame;
            let axes = FacetAxes::isotropic(normal.into(), facing.into(), wo.into());
            SeenLobes::Base(OpaqueBaseLobes::new(bsdf.base_numbers(), 1, (axes, facing.into()), wo.into()))
        } else {
            SeenLobes::Layered(LayeredLobes::new(&bsdf, wo))
        };
        SeenStandard { bsdf, lobes }
    }

    /// What passes in one direction.
    pub(in crate::material) fn specular_transmission(&self) -> SpecularTransmission {
        match &self.lobes {
            SeenLobes::Base(_) => SpecularTransmission::NONE,
            SeenLobes::Layered(layered) => layered.specular_transmission(&self.bsdf),
        }
    }

    /// f |cos θ| and the density, whose costly parts are the same.
    pub(in crate::material) fn eval_and_pdf(&self, wi: DVec3) -> (Rgb, f64) {
        match &self.lobes {
            SeenLobes::Base(base) => {
                let (f, pdf) = base.eval_and_pdf(wi.into());
                (f.into(), pdf)
            }
            SeenLobes::Layered(layered) => layered.eval_and_pdf(&self.bsdf, wi),
        }
    }

    pub(in crate::material) fn sample(&self, u_lobe: f64, u: [f64; 2]) -> Option<BsdfSample> {
        let base = match &self.lobes {
            SeenLobes::Base(base) => base,
            SeenLobes::Layered(layered) => return layered.sample(&self.bsdf, u_lobe, u),
        };
        let LobeDirections { wi, is_valid, is_mirrored } = base.directions(u_lobe, u);
        let (f, pdf) = base.eval_and_pdf(wi);
        let lobe = if is_mirrored { Lobe::Mirror } else { Lobe::Diffuse };
        (is_valid && pdf > 0.0).then(|| BsdfSample { wi: wi.into(), f: f.into(), pdf, lobe, is_delta: false })
    }
}

impl LayeredLobes {
    fn new(bsdf: &StandardBsdf, wo: DVec3) -> LayeredLobes {
        let axes = bsdf.frame.facet_axes(wo);
        let local = axes.transpose() * wo;
        let frame = &bsdf.frame;
        let matte =
            if frame.is_bent() && bsdf.diffuse_from == 0.0 { 2.0 / (1.0 + axes.z_axis.dot(frame.facing)) } else { 1.0 };
        let coat = bsdf.coat.normal.map(|normal| {
            let frame = ScatteringFrame { normal, ..bsdf.frame };
            let axes = frame.facet_axes(wo);
            CoatFrame { frame, axes, local: axes.transpose() * wo }
        });
        let over = coat.as_ref().map_or(local, |coat| coat.local);
        LayeredLobes { wo, axes, local, layers: bsdf.layers(local, over), coat, matte }
    }

    /// The directions in the frame of the base's facets whose light leads to `wi`.
    fn local(&self, bsdf: &StandardBsdf, wi: DVec3) -> impl Iterator<Item = Local> {
        locals(&bsdf.frame, self.axes, self.local, wi)
    }

    /// The directions in the frame of the coat's facets whose light leads to `wi`, if it has a frame of its own.
    fn coat_local(&self, wi: DVec3) -> impl Iterator<Item = Local> {
        self.coat.iter().flat_map(move |coat| locals(&coat.frame, coat.axes, coat.local, wi))
    }

    /// What passes in one direction.
    fn specular_transmission(&self, bsdf: &StandardBsdf) -> SpecularTransmission {
        let LayeredLobes { local, layers, .. } = self;
        if bsdf.clear == 0.0 || !bsdf.is_smooth() && !bsdf.goes_straight() {
            return SpecularTransmission::NONE;
        }
        let is_straight = bsdf.thin_walled || bsdf.eta_ratio == 1.0;
        let reflects_totally = !is_straight && bsdf.eta_ratio > 1.0;
        let eta_ratio = if reflects_totally { 1.0 / bsdf.eta_ratio } else { bsdf.eta_ratio };
        let thinner = StandardBsdf { eta_ratio, ..*bsdf };
        SpecularTransmission { share: thinner.smooth_clear(layers, local.z), is_straight }
    }

    /// f |cos θ| and the density, whose costly parts are the same.
    fn eval_and_pdf(&self, bsdf: &StandardBsdf, wi: DVec3) -> (Rgb, f64) {
        let (mut f, mut pdf) = (Rgb::BLACK, 0.0);
        for local in self.local(bsdf, wi) {
            let (of_local, pdf_local) = bsdf.eval_and_pdf_local(&self.layers, &local, self.matte);
            (f, pdf) = (f + of_local, pdf + pdf_local);
        }
        for Local { wo, wi, .. } in self.coat_local(wi).filter(|local| local.wi.z > 0.0) {
            let (of_coat, pdf_coat) = bsdf.eval_and_pdf_coat(&self.layers, wo, (wo + wi).normalize(), wi);
            (f, pdf) = (f + of_coat, pdf + pdf_coat);
        }
        (f, pdf)
    }

    fn sample(&self, bsdf: &StandardBsdf, u_lobe: f64, u: [f64; 2]) -> Option<BsdfSample> {
        let LayeredLobes { wo, axes, local: o, layers, .. } = self;
        let (layer, u_facet) = layers.choose(u_lobe)?;
        let own = self.coat.as_ref().filter(|_| layer == Layer::Coat);
        let (axes, o) = own.map_or((axes, *o), |coat| (&coat.axes, coat.local));
        let mirrors = |cos: f64| u_facet < bsdf.mirror_probability(layers, cos);
        if bsdf.is_delta_layer(layer) {
            let share = if layer == Layer::Facets { bsdf.mirror_probability(layers, o.z) } else { 1.0 };
            let passes = layer == Layer::Straight || layer == Layer::Facets && u_facet >= share;
            let (lobe, share) = match passes {
                true if layer == Layer::Facets => (Lobe::Refraction, 1.0 - share),
                true => (Lobe::Refraction, 1.0),
                false => (Lobe::Mirror, share),
            };
            return bsdf.smooth(*wo, axes.z_axis, layers, (layer, passes)).map(|(wi, f)| {
                let pdf = layers.probability(layer) * share;
                BsdfSample { wi, f, pdf, lobe, is_delta: true }
            });
        }
        let (lobe, i) = match layer {
            Layer::Fuzz => (Lobe::Diffuse, layers.fuzz?.sample(u)),
            Layer::Diffuse => (Lobe::Diffuse, bsdf.sample_diffuse(u)),
            Layer::Translucent => (Lobe::Diffuse, -warp::cosine_hemisphere(u)),
            Layer::Coat => (Lobe::Mirror, reflect(o, bsdf.coat_ggx().sample_mirroring(o, u).into())),
            Layer::Straight => return None,
            Layer::Facets if bsdf.refracts() => {
                let m = DVec3::from(bsdf.ggx().sample_visible(o, u));
                match mirrors(o.dot(m)) {
                    true => (Lobe::Mirror, reflect(o, m)),
                    false => (Lobe::Refraction, refract(o, m, bsdf.eta_ratio)?),
                }
            }
            Layer::Facets => {
                let m = DVec3::from(bsdf.ggx().sample_mirroring(o, u));
                let mirrored = reflect(o, m);
                match mirrors(o.dot(m)) {
                    true => (Lobe::Mirror, mirrored),
                    false if mirrored.z > 0.0 => (Lobe::Refraction, mirrored * DVec3::new(1.0, 1.0, -1.0)),
                    false => return None,
                }
            }
        };
        let goes_through = layer == Layer::Translucent || lobe == Lobe::Refraction;
        if (i.z < 0.0) != goes_through {
            return None;
        }
        let (wi, facing) = ((*axes * i).normalize(), bsdf.frame.facing);
        let wi = match (wi.dot(facing) < 0.0) == goes_through {
            true => wi,
            false if matches!(layer, Layer::Diffuse | Layer::Translucent) => return None,
            false => mirrored_at(facing, wi),
        };
        let (f, pdf) = self.eval_and_pdf(bsdf, wi);
        (pdf > 0.0).then_some(BsdfSample { wi, f, pdf, lobe, is_delta: false })
    }
}

/// The directions in the frame of facets whose light leads to `wi`. One is `wi` itself. The other is mirrored at the
/// geometric surface, if it is on the same side of the facets. `axes` are those of the facets, and `wo` is the viewer's
/// direction in them.
fn locals(frame: &ScatteringFrame, axes: DMat3, wo: DVec3, wi: DVec3) -> impl Iterator<Item = Local> + use<> {
    let facing = frame.facing;
    let is_above = wi.dot(facing) > 0.0;
    let one = move |wi: DVec3, is_mirrored: bool| {
        let local = Local { wo, wi: axes.transpose() * wi, is_mirrored };
        ((local.wi.z > 0.0) == is_above).then_some(local)
    };
    let mirrored = if frame.is_bent() { one(mirrored_at(facing, wi), true) } else { None };
    one(wi, false).into_iter().chain(mirrored)
}
