//! The layers of a standard surface as they are seen from one direction: what each of them keeps, and what it leaves to
//! those below. Albedos scale the layers, as OpenPBR proposes, so that no more light leaves than arrives.
//! These factors depend on the viewer's direction only, so that layers are not reciprocal where single lobes are.

use super::super::conductor_albedo::{conductor_albedo, grazing_albedos};
use super::super::dielectric_albedo::{self, DielectricAlbedo, Kept, facets};
use super::super::ggx::Ggx;
use super::super::{fresnel_dielectric, reflect};
use super::bsdf::StandardBsdf;
use super::fuzz::Fuzz;
use super::opaque_base::schlick_curve;
use super::stretched_albedo::stretched_albedo;
use super::thin_film::{UnderFilm, reflectance};
use crate::math::Rgb;
use canaletto_bvh::lanes::Real64;
use glam::{DVec2, DVec3};
use std::sync::LazyLock;

/// The share that a boundary of relative η mirrors at right angles.
#[inline(always)]
pub(super) fn reflection_at_right_angles<F: Real64>(eta: F) -> F {
    let one = F::splat(1.0);
    let amplitude = (eta - one) / (eta + one);
    amplitude * amplitude
}

/// The relative η whose reflection at right angles is that of `eta` times a weight.
pub(super) fn weighted_ior(eta: f64, weight: f64) -> f64 {
    weighted_iors(eta, weight)
}

/// [`weighted_ior`] in each lane.
#[inline(always)]
pub(super) fn weighted_iors<F: Real64>(eta: F, weight: F) -> F {
    let one = F::splat(1.0);
    let amplitude = (weight * reflection_at_right_angles(eta)).min(F::splat(0.999)).sqrt();
    let amplitude = F::select(eta.less(one), -amplitude, amplitude);
    (one + amplitude) / (one - amplitude)
}

/// The lobes of a standard surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Layer {
    Fuzz,
    Coat,
    /// The facets of the base. A facet is chosen first, and then what it does: it mirrors as metal and dielectric do,
    /// or it lets light through the clear part.
    Facets,
    Diffuse,
    /// The clear part of a dielectric base whose rough facets bend no light.
    Straight,
    /// Diffuse transmission through a thin wall.
    Translucent,
}

impl Layer {
    pub(super) const ALL: [Layer; 6] =
        [Layer::Fuzz, Layer::Coat, Layer::Facets, Layer::Diffuse, Layer::Straight, Layer::Translucent];
}

/// The layers as they are seen from one direction.
pub(super) struct Layers {
    /// The fuzz, if there is any.
    pub(super) fuzz: Option<Fuzz>,
    /// The factor of the fuzz's density.
    pub(super) fuzz_share: Rgb,
    /// The factor of the coat's single scattering.
    pub(super) coat_share: f64,
    /// The factors of what lies below the fuzz: without a coat, and through it but for its absorption.
    pub(super) below: [Rgb; 2],
    /// The factor of a metal's single scattering.
    pub(super) metal_share: Rgb,
    /// The factors of the base's single reflection and transmission.
    pub(super) gloss_share: Rgb,
    pub(super) clear_share: Rgb,
    /// The factors of diffuse reflection, and of a translucent wall's diffuse reflection and transmission.
    pub(super) diffuse_share: Rgb,
    pub(super) back_share: Rgb,
    pub(super) through_share: Rgb,
    /// The cumulative probabilities of the lobes, in the order of [`Layer::ALL`].
    sums: [f64; 6],
}

impl Layers {
    /// The sum of the probabilities of the lobes before this one.
    fn before(&self, layer: usize) -> f64 {
        if layer == 0 { 0.0 } else { self.sums[layer - 1] }
    }

    /// The probability of a lobe.
    pub(super) fn probability(&self, layer: Layer) -> f64 {
        let i = layer as usize;
        self.sums[i] - self.before(i)
    }

    /// The lobe at `u` of [0, 1), and the place of `u` among the numbers that lead to it; none if the surface scatters
    /// nothing.
    pub(super) fn choose(&self, u: f64) -> Option<(Layer, f64)> {
        let i = self.sums.iter().position(|sum| u < *sum)?;
        let before = self.before(i);
        Some((Layer::ALL[i], (u - before) / (self.sums[i] - before)))
    }
}

/// The least probability of rough facets, as a share of what the most grazed of them mirrors. Few facets are grazed,
/// and a direction that is found rarely must not weigh much more than others.
pub(super) const OF_GRAZED: f64 = 0.4;

/// The cosine at the most grazed facet that mirrors light to a viewer at this cosine: at half the angle to the horizon.
fn grazed_cosine(cos: f64) -> f64 {
    grazed_cosines(cos)
}

/// [`grazed_cosine`] in each lane.
#[inline(always)]
pub(super) fn grazed_cosines<F: Real64>(cos: F) -> F {
    let one = F::splat(1.0);
    ((one - (one - cos * cos).max(F::splat(0.0)).sqrt()) * 0.5).sqrt()
}

fn lerp(a: Rgb, b: Rgb, t: f64) -> Rgb {
    a * (1.0 - t) as f32 + b * t as f32
}

/// The mean of Fresnel's share over the hemisphere for η > 1 (Kulla & Conty 2017), within 0.002 up to η = 3.
fn mean_fresnel(eta: f64) -> f64 {
    let eta = eta.clamp(1.0, 3.0);
    libm::log((10_893.0 * eta - 1_438.2) / (-774.4 * eta * eta + 10_212.0 * eta + 1.0)).max(0.0)
}

/// The facets of the quadrature for albedos that no table has: those of stretched facets from inside.
static FACETS: LazyLock<Vec<(DVec2, f64)>> = LazyLock::new(|| facets(233, 1.0));

/// The facets of the quadrature for what a film changes.
static FILM_FACETS: LazyLock<Vec<(DVec2, f64)>> = LazyLock::new(|| facets(55, 1.0));

/// The angles at which it is computed, equally spaced by their cosines.
const FILM_ANGLES: usize = 17;

/// What one scattering of a boundary keeps.
fn kept(wo: DVec3, eta_ratio: f64, ggx: &Ggx) -> Kept {
    let [x, y] = ggx.alpha;
    if x == 0.0 || eta_ratio == 1.0 {
        let mirrored = fresnel_dielectric(wo.z, eta_ratio);
        return Kept { mirrored, refracted: 1.0 - mirrored };
    }
    if x != y {
        return if eta_ratio <= 1.0 {
            stretched_albedo(wo, eta_ratio, ggx).1
        } else {
            dielectric_albedo::kept(wo, eta_ratio, ggx, &FACETS)
        };
    }
    DielectricAlbedo::new(eta_ratio, x).kept(wo.z, true)
}

impl StandardBsdf {
    /// The share that a facet of a dielectric base mirrors, under its film.
    pub(super) fn dielectric_fresnel(&self, cos: f64) -> Rgb {
        let plain = self.bare_fresnel(cos);
        if self.film.weight == 0.0 {
            return plain;
        }
        let under = |inside: f64| match self.schlick {
            Some(_) => UnderFilm::Metal(self.bare_fresnel(inside).to_array().map(f64::from)),
            None => UnderFilm::Dielectric(1.0 / self.eta_ratio()),
        };
        let film = reflectance(cos, self.film.ior.into(), self.film.thickness.into(), under);
        lerp(plain, film, self.film.weight.into())
    }

    /// The share that a facet of a dielectric base mirrors without a film.
    fn bare_fresnel(&self, cos: f64) -> Rgb {
        let Some([f0, f90]) = self.schlick else {
            return Rgb::gray(fresnel_dielectric(cos, self.eta_ratio()) as f32);
        };
        schlick_curve(f0.into(), f90.into(), cos, self.eta_ratio()).into()
    }

    /// The share that a facet of a metal mirrors, under its film.
    pub(super) fn metal_fresnel(&self, cos: f64) -> Rgb {
        let plain = self.metal.at(cos);
        if self.film.weight == 0.0 {
            return plain;
        }
        let under = |inside: f64| UnderFilm::Metal(self.metal.at(inside).to_array().map(f64::from));
        let film = reflectance(cos, self.film.ior.into(), self.film.thickness.into(), under);
        lerp(plain, film, self.film.weight.into())
    }

    /// What the dielectric base mirrors once, of which one scattering mirrors `mirrored` without a film, times `gain`.
    fn gloss_albedo(&self, wo: DVec3, mirrored: f64, gain: f64) -> Rgb {
        let plain = match self.schlick {
            None => Rgb::gray((mirrored * gain) as f32),
            Some(_) if self.is_smooth() => self.bare_fresnel(wo.z),
            Some([f0, f90]) => {
                let alpha = (self.alpha[0] * self.alpha[1]).sqrt().into();
                let (all, grazing) = (conductor_albedo(wo.z, alpha), grazing_albedos(wo.z, alpha));
                (f0 * (all - grazing) as f32 + f90 * grazing as f32) * gain as f32
            }
        };
        if self.film.weight == 0.0 {
            return plain;
        }
        if self.is_smooth() {
            return self.dielectric_fresnel(wo.z);
        }
        // The mean of what the film changes, over few facets, and at few angles between which it is interpolated.
        let changes: [Rgb; FILM_ANGLES] = std::array::from_fn(|i| {
            let cos = i as f64 / (FILM_ANGLES - 1) as f64;
            self.dielectric_fresnel(cos) - self.bare_fresnel(cos)
        });
        let ggx = self.ggx();
        let squeezed = ggx.squeezed(wo);
        let mut sum = Rgb::BLACK;
        for (circle, u) in FILM_FACETS.iter() {
            let m = DVec3::from(ggx.on_cap(squeezed, squeezed.z, (*circle).into(), *u));
            let cos = wo.dot(m);
            let mirrored = reflect(wo, m);
            if mirrored.z > 0.0 {
                let at = cos * (FILM_ANGLES - 1) as f64;
                let i = (at as usize).min(FILM_ANGLES - 2);
                sum += lerp(changes[i], changes[i + 1], at - i as f64) * ggx.shadowing(wo, mirrored) as f32;
            }
        }
        (plain + sum * (gain / FILM_FACETS.len() as f64) as f32).map(|v| v.clamp(0.0, 1.0))
    }

    /// The layers as they are seen from `wo`, in the frame of the base's facets; `over` is the same direction in that
    /// of the coat's.
    pub(super) fn layers(&self, wo: DVec3, over: DVec3) -> Layers {
        let cos = wo.z;
        // Fuzz
        let fuzz = (self.fuzz.weight > 0.0).then(|| Fuzz::new(wo, self.fuzz.roughness.into()));
        let covered = fuzz.map_or(0.0, |fuzz| f64::from(self.fuzz.weight) * fuzz.albedo);
        let fuzz_share = self.fuzz.color * covered as f32;
        // Coat
        let share = f64::from(self.coat.weight);
        let (mut coat_share, mut coat_albedo, mut coat_grazed, mut darkened) = (0.0, 0.0, 0.0, Rgb::WHITE);
        if share > 0.0 {
            let kept = kept(over, 1.0 / f64::from(self.coat.ior), &self.coat_ggx());
            coat_albedo = kept.mirrored / kept.total();
            coat_share = (1.0 - covered) * share / kept.total();
            if self.coat.alpha[0] > 0.0 {
                coat_grazed = OF_GRAZED * fresnel_dielectric(grazed_cosine(over.z), 1.0 / f64::from(self.coat.ior));
            }
            darkened = lerp(Rgb::WHITE, self.darkening(cos), share * f64::from(self.coat.darkening));
        }
        let bare = darkened * (1.0 - covered) as f32;
        let below = [bare * (1.0 - share) as f32, bare * (share * (1.0 - coat_albedo)) as f32];
        // The base
        let metalness = f64::from(self.metalness);
        let mut metal_share = Rgb::BLACK;
        let mirrors = metalness > 0.0 || self.thin_walled;
        let metal_albedo = if self.is_smooth() || !mirrors { 1.0 } else { self.facet_albedo(wo) };
        if metalness > 0.0 {
            let lost = (1.0 - metal_albedo) / metal_albedo;
            let scattered = Rgb::WHITE + self.metal.f0 * lost as f32;
            metal_share = scattered * (metalness * f64::from(self.metal_weight)) as f32;
        }
        let (dielectric, clear) = (1.0 - metalness, f64::from(self.clear));
        let [mut gloss_share, mut clear_share, mut diffuse_share, mut gloss] = [Rgb::BLACK; 4];
        let [mut back_share, mut through_share] = [Rgb::BLACK; 2];
        let mut refracted = 0.0;
        if dielectric > 0.0 {
            let kept = kept(wo, self.eta_ratio(), &self.ggx());
            // The facets of a thin wall mirror what passes, too: all that they lose is lost by mirroring.
            let gain = if self.thin_walled { 1.0 / metal_albedo } else { 1.0 / kept.total() };
            gloss = self.gloss_albedo(wo, kept.mirrored, gain);
            refracted = kept.refracted * gain;
            gloss_share = self.specular_tint * (dielectric * gain) as f32;
            clear_share = self.clear_tint * (dielectric * clear * gain) as f32;
            let entering = (Rgb::WHITE - gloss).map(|v| v.max(0.0)) * (dielectric * (1.0 - clear)) as f32;
            let translucent = f64::from(self.translucent);
            diffuse_share = entering * (1.0 - translucent) as f32;
            let scattered = entering * self.translucent_color * translucent as f32;
            [back_share, through_share] = self.scattered.map(|share| scattered * share);
        }
        let base = below[0] + below[1] * self.coat.color;
        let size = |color: Rgb| f64::from(color.max_component());
        let passed = (Rgb::WHITE - gloss).map(|v| v.max(refracted as f32));
        let mirrors = |metal: Rgb, gloss: Rgb| {
            size(base * metal) * metalness * f64::from(self.metal_weight)
                + size(base * gloss * self.specular_tint) * dielectric
        };
        let grazed = grazed_cosine(cos);
        let mirrored = match self.is_smooth() {
            true => mirrors(self.metal_fresnel(cos), gloss),
            false => {
                let most = mirrors(self.metal_fresnel(grazed), self.gloss_fresnel(grazed));
                mirrors(self.metal_fresnel(cos), gloss).max(most * OF_GRAZED)
            }
        };
        let through = size(base * self.clear_tint * passed) * dielectric * clear;
        let [through, straight] = if self.goes_straight() { [0.0, through] } else { [through, 0.0] };
        let albedos = [
            size(fuzz_share),
            (1.0 - covered) * share * coat_albedo.max(coat_grazed),
            mirrored + through,
            size(base * (diffuse_share * self.diffuse + back_share)),
            straight,
            size(base * through_share),
        ];
        let total: f64 = albedos.iter().sum();
        let mut sum = 0.0;
        let sums = albedos.map(|albedo| {
            sum += albedo;
            if total > 0.0 { sum / total } else { 0.0 }
        });
        Layers {
            fuzz,
            fuzz_share,
            coat_share,
            below,
            metal_share,
            gloss_share,
            clear_share,
            diffuse_share,
            back_share,
            through_share,
            sums,
        }
    }

    /// The albedo of one scattering by the base's facets that mirror all light.
    fn facet_albedo(&self, wo: DVec3) -> f64 {
        let ggx = self.ggx();
        let [x, y] = ggx.alpha;
        if x == y {
            return conductor_albedo(wo.z, x);
        }
        stretched_albedo(wo, 1.0, &ggx).0
    }

    /// Δ of OpenPBR: the darkening of the base by reflections inside the coat.
    fn darkening(&self, cos: f64) -> Rgb {
        let eta = f64::from(self.coat.ior);
        let [metalness, roughness] = [self.metalness, self.roughness].map(f64::from);
        let f0 = reflection_at_right_angles(self.eta_ratio());
        let rough = (1.0 - metalness) * (1.0 + (roughness - 1.0) * f0) + metalness * roughness;
        let even = 1.0 - (1.0 - mean_fresnel(eta)) / (eta * eta);
        let internal = (1.0 - rough) * fresnel_dielectric(cos, 1.0 / eta) + rough * even;
        let clear = f64::from(self.clear);
        let entering = lerp(self.diffuse, Rgb::WHITE, clear) * (1.0 - f0) as f32;
        let base = lerp(entering + Rgb::gray(f0 as f32), self.metal.f0, metalness);
        base.map(|albedo| ((1.0 - internal) / (1.0 - f64::from(albedo) * internal)) as f32)
    }

    /// The distribution of the base's facets.
    pub(super) fn ggx(&self) -> Ggx {
        Ggx { alpha: self.alpha.map(f64::from) }
    }
}
