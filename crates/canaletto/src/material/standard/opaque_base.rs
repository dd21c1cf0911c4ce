//! The scattering of standard surfaces that are an opaque base alone, without coat, fuzz and film: facets that mirror
//! as metal and dielectric do, over diffuse reflection. Most surfaces of files are such ones. One text serves single
//! points and eight of them side by side.

use super::super::bsdf::{FacetAxes, LobeDirections, mirrored_directions};
use super::super::conductor_albedo::{conductor_albedos, grazing_albedos};
use super::super::dielectric_albedo::kept_in_lanes;
use super::super::fresnel::fresnel_dielectrics;
use super::super::ggx::Ggx;
use super::super::{Parameter, Target};
use super::layers::{OF_GRAZED, grazed_cosines, weighted_iors};
use super::metal::{metal_dips, metal_fresnels};
use super::{StandardBlock, StandardSurface};
use crate::math::warp::cosine_hemisphere_lanes;
use crate::math::{Rgb, Vector};
use canaletto_bvh::lanes::{Mask, Real, Real32, Real64};
use std::f64::consts::FRAC_1_PI;

/// The numbers of an opaque base at a point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OpaqueBase {
    diffuse: Rgb,
    /// What a metal mirrors at right angles.
    f0: Rgb,
    /// The factor of what a metal mirrors at its rim, and of all that a dielectric mirrors.
    tint: Rgb,
    metalness: f32,
    /// The factor of what a metal mirrors.
    metal_weight: f32,
    /// The index of a dielectric and the factor of its reflection at right angles.
    ior: f32,
    weight: f32,
    /// F0 and F90 of Schlick's curve, instead of Fresnel's equations.
    schlick: Option<[Rgb; 2]>,
    /// The width of the facets.
    pub(crate) alpha: f32,
}

impl Default for OpaqueBase {
    fn default() -> OpaqueBase {
        let surface = StandardSurface::default();
        OpaqueBase::new(&surface, surface.specular.roughness)
    }
}

impl OpaqueBase {
    /// Whether a surface is nothing else.
    pub(crate) fn is_all_of(surface: &StandardSurface) -> bool {
        let StandardSurface { base, specular, transmission, coat, fuzz, thin_film, thin_walled, .. } = surface;
        let others = [transmission.weight, coat.weight, fuzz.weight, thin_film.weight];
        others == [0.0; 4] && !thin_walled && base.diffuse_roughness == 0.0 && specular.anisotropy == 0.0
    }

    /// Whether a texture of this target leaves a surface one.
    pub(crate) fn keeps(target: Target) -> bool {
        match target {
            Target::Parameter(parameter) => matches!(parameter, Parameter::Diffuse | Parameter::Roughness),
            Target::Standard(standard) => {
                let parameter = standard.parameter();
                let in_base = matches!(
                    parameter.block,
                    StandardBlock::Base | StandardBlock::Specular | StandardBlock::Subsurface
                );
                in_base && !matches!(parameter.name, "diffuse-roughness" | "anisotropy" | "anisotropy-rotation")
            }
            Target::Bump | Target::Normal { .. } | Target::Displace { .. } => true,
            Target::Replace
            | Target::Decal
            | Target::Cutout
            | Target::CoatNormal { .. }
            | Target::AnisotropyDirection => false,
        }
    }

    /// The numbers of a surface that is nothing else, with the roughness at a point.
    pub(crate) fn new(surface: &StandardSurface, roughness: f32) -> OpaqueBase {
        let StandardSurface { base, specular, subsurface, .. } = surface;
        let color = base.color * base.weight;
        let schlick = surface.schlick.then(|| surface.schlick_ends());
        OpaqueBase {
            diffuse: color * (1.0 - subsurface.weight) + subsurface.color * subsurface.weight,
            f0: color,
            tint: if surface.schlick { Rgb::WHITE } else { specular.color },
            metalness: base.metalness,
            metal_weight: if surface.schlick { 1.0 } else { specular.weight.min(1.0) },
            ior: specular.ior,
            weight: specular.weight,
            schlick,
            alpha: roughness * roughness,
        }
    }
}

/// The numbers of opaque bases in each lane.
pub(crate) struct BaseNumbers<F: Real64> {
    pub(super) diffuse: Vector<F::Narrow>,
    /// What metals mirror at right angles, and the dip of the curve at their rims.
    pub(super) f0: Vector<F::Narrow>,
    pub(super) dip: Vector<F::Narrow>,
    pub(super) metalness: F,
    pub(super) metal_weight: F,
    /// The factor of what dielectrics mirror.
    pub(super) tint: Vector<F::Narrow>,
    /// The ratio ηᵢ/ηₜ of dielectrics.
    pub(super) eta_ratio: F,
    /// Where Schlick's curve holds, with its ends.
    pub(super) schlick: F::Mask,
    pub(super) ends: [Vector<F::Narrow>; 2],
    pub(super) alpha: F,
}

impl<F: Real64> BaseNumbers<F> {
    #[inline(always)]
    pub(crate) fn gather<'a>(of_lane: impl Fn(usize) -> &'a OpaqueBase) -> BaseNumbers<F> {
        let (f0, tint) = (Rgb::gather(|lane| of_lane(lane).f0), Rgb::gather(|lane| of_lane(lane).tint));
        let schlick = F::Mask::gather(|lane| of_lane(lane).schlick.is_some());
        let black = F::Narrow::splat(0.0);
        let mut ends = [Vector { x: black, y: black, z: black }; 2];
        let mut index =
            weighted_iors(F::gather(|lane| of_lane(lane).ior.into()), F::gather(|lane| of_lane(lane).weight.into()));
        if schlick.any() {
            let end = |lane: usize, i: usize| of_lane(lane).schlick.map_or(Rgb::BLACK, |ends| ends[i]);
            ends = [Rgb::gather(|lane| end(lane, 0)), Rgb::gather(|lane| end(lane, 1))];
            // The index whose reflection at right angles is that of Schlick's curve.
            let luminance = F::gather(|lane| end(lane, 0).luminance().into());
            index = F::select(schlick, weighted_iors(F::splat(1e12), luminance), index);
        }
        BaseNumbers {
            diffuse: Rgb::gather(|lane| of_lane(lane).diffuse),
            f0,
            dip: metal_dips::<F>(f0, tint),
            metalness: F::gather(|lane| of_lane(lane).metalness.into()),
            metal_weight: F::gather(|lane| of_lane(lane).metal_weight.into()),
            tint,
            eta_ratio: F::splat(1.0) / index,
            schlick,
            ends,
            alpha: F::gather(|lane| of_lane(lane).alpha.into()),
        }
    }

    /// The share that a facet of a dielectric mirrors.
    #[inline(always)]
    fn gloss_fresnel(&self, cos: F) -> Vector<F::Narrow> {
        let exact = fresnel_dielectrics(cos, self.eta_ratio).narrow();
        let exact = Vector { x: exact, y: exact, z: exact };
        if !self.schlick.any() {
            return exact;
        }
        let [f0, f90] = self.ends;
        Vector::select(self.schlick, schlick_curve::<F>(f0, f90, cos, self.eta_ratio), exact)
    }

    #[inline(always)]
    fn metal_fresnel(&self, cos: F) -> Vector<F::Narrow> {
        metal_fresnels(cos, self.f0, self.dip)
    }

    /// The share that facets at this cosine mirror in the largest component, of which the dielectric mirrors `gloss`.
    #[inline(always)]
    fn mirrored(&self, cos: F, gloss: Vector<F::Narrow>, has_metal: F::Mask) -> F {
        let of_gloss = largest::<F>(gloss.times(self.tint)) * (F::splat(1.0) - self.metalness);
        if !has_metal.any() {
            return of_gloss;
        }
        largest::<F>(self.metal_fresnel(cos)) * self.metalness * self.metal_weight + of_gloss
    }

    /// What one scattering of the dielectric mirrors, and all that it keeps, at the cosine of the viewer.
    #[inline(always)]
    fn kept(&self, cos: F, wanted: u32) -> [F; 2] {
        let is_matched = self.eta_ratio.equal(F::splat(1.0));
        let [mirrored, total] = kept_in_lanes(self.eta_ratio, self.alpha, cos, wanted & !is_matched.bits());
        [F::select(is_matched, fresnel_dielectrics(cos, self.eta_ratio), mirrored), total]
    }
}

/// Schlick's curve between two ends. From inside it is that of the angle outside.
#[inline(always)]
pub(super) fn schlick_curve<F: Real64>(
    f0: Vector<F::Narrow>,
    f90: Vector<F::Narrow>,
    cos: F,
    eta_ratio: F,
) -> Vector<F::Narrow> {
    let (zero, one) = (F::splat(0.0), F::splat(1.0));
    let sin2 = eta_ratio * eta_ratio * (one - cos * cos);
    let is_inside = one.less(eta_ratio);
    let cos = F::select(is_inside, (one - sin2).max(zero).sqrt(), cos);
    let x = one - cos.max(zero).min(one);
    let x2 = x * x;
    let t = x2 * x2 * x;
    let curve = f0 * (one - t).narrow() + f90 * t.narrow();
    let white = F::Narrow::splat(1.0);
    Vector::select(is_inside & one.at_most(sin2), Vector { x: white, y: white, z: white }, curve)
}

/// An opaque base in each lane, as it is seen from one direction.
pub(crate) struct OpaqueBaseLobes<F: Real64> {
    numbers: BaseNumbers<F>,
    ggx: Ggx<F>,
    axes: FacetAxes<F>,
    /// The viewer's direction in the axes of the facets.
    wo: Vector<F>,
    /// The geometric normal on the viewer's side, and where the facets' own normal is another one.
    facing: Vector<F>,
    bent: F::Mask,
    /// The factors of single reflection by metal and dielectric, and of diffuse reflection.
    metal_share: Vector<F::Narrow>,
    gloss_share: Vector<F::Narrow>,
    diffuse_share: Vector<F::Narrow>,
    has_metal: F::Mask,
    /// The probability of facets, and that of both lobes: 1, or 0 if nothing is scattered.
    sums: [F; 2],
    /// The factor of diffuse reflection: over the part of its hemisphere that is above the geometric surface.
    matte: F,
}

#[inline(always)]
fn largest<F: Real64>(color: Vector<F::Narrow>) -> F {
    color.x.max(color.y).max(color.z).widen()
}

/// What a dielectric doesn't mirror.
#[inline(always)]
fn entering<F: Real64>(Vector { x, y, z }: Vector<F::Narrow>) -> Vector<F::Narrow> {
    let (black, white) = (F::Narrow::splat(0.0), F::Narrow::splat(1.0));
    Vector { x: (white - x).max(black), y: (white - y).max(black), z: (white - z).max(black) }
}

impl<F: Real64> OpaqueBaseLobes<F> {
    /// The lobes of bases with rough facets around these axes. `lanes` has a bit for each lane that counts.
    #[inline(always)]
    pub(crate) fn new(
        numbers: BaseNumbers<F>,
        lanes: u32,
        (axes, facing): (FacetAxes<F>, Vector<F>),
        wo: Vector<F>,
    ) -> OpaqueBaseLobes<F> {
        let (zero, one, white) = (F::splat(0.0), F::splat(1.0), F::Narrow::splat(1.0));
        let (ggx, wo) = (Ggx::isotropic(numbers.alpha), axes.local(wo));
        let cos = wo.z;
        let has_metal = zero.less(numbers.metalness);
        let mut metal_share = numbers.f0 * F::Narrow::splat(0.0);
        if has_metal.any() {
            // What facets reflect to each other comes back with the metal's colour (Turquin 2019).
            let albedo = conductor_albedos(cos, numbers.alpha);
            let lost = ((one - albedo) / albedo).narrow();
            let white = Vector { x: white, y: white, z: white };
            let share = (white + numbers.f0 * lost) * (numbers.metalness * numbers.metal_weight).narrow();
            metal_share = Vector::select(has_metal, share, metal_share);
        }
        let dielectric = one - numbers.metalness;
        let has_gloss = zero.less(dielectric);
        let black = F::Narrow::splat(0.0);
        let black = Vector { x: black, y: black, z: black };
        let [mut gloss_share, mut diffuse_share, mut gloss] = [black; 3];
        if has_gloss.any() {
            let [mirrored, total] = numbers.kept(cos, has_gloss.bits() & lanes);
            let gain = one / total;
            let exact = (mirrored * gain).narrow();
            let mut albedo = Vector { x: exact, y: exact, z: exact };
            if numbers.schlick.any() {
                let ([f0, f90], alpha) = (numbers.ends, numbers.alpha);
                let (all, grazing) = (conductor_albedos(cos, alpha), grazing_albedos(cos, alpha));
                let curve = (f0 * (all - grazing).narrow() + f90 * grazing.narrow()) * gain.narrow();
                albedo = Vector::select(numbers.schlick, curve, albedo);
            }
            gloss = Vector::select(has_gloss, albedo, black);
            let share = numbers.tint * (dielectric * gain).narrow();
            gloss_share = Vector::select(has_gloss, share, black);
            diffuse_share = Vector::select(has_gloss, entering::<F>(gloss) * dielectric.narrow(), black);
        }
        let grazed = grazed_cosines(cos);
        let most = numbers.mirrored(grazed, numbers.gloss_fresnel(grazed), has_metal);
        let mirrored = numbers.mirrored(cos, gloss, has_metal).max(most * OF_GRAZED);
        let total = mirrored + largest::<F>(diffuse_share.times(numbers.diffuse));
        let is_lit = zero.less(total);
        let z = axes.z;
        let same = z.equal(facing);
        OpaqueBaseLobes {
            ggx,
            axes,
            wo,
            facing,
            bent: !same,
            metal_share,
            gloss_share,
            diffuse_share,
            has_metal,
            sums: [F::select(is_lit, mirrored / total, zero), F::select(is_lit, one, zero)],
            matte: F::select(same, one, F::splat(2.0) / (z.dot(facing) + one)),
            numbers,
        }
    }

    /// f |cos θ| and the density.
    #[inline(always)]
    pub(crate) fn eval_and_pdf(&self, wi: Vector<F>) -> (Vector<F::Narrow>, F) {
        let is_above = F::splat(0.0).less(wi.dot(self.facing));
        let (mut f, mut pdf) = self.eval_and_pdf_local(wi, is_above, self.matte, F::splat(FRAC_1_PI));
        // The direction that is mirrored at the geometric surface leads there, too, from facets.
        if self.bent.any() {
            let zero = F::splat(0.0);
            let mirrored = mirrored_directions(self.facing, wi);
            let (again, again_pdf) = self.eval_and_pdf_local(mirrored, is_above & self.bent, zero, zero);
            (f, pdf) = (f + again, pdf + again_pdf);
        }
        (f, pdf)
    }

    /// The same of one direction from the facets, where it is above them. `matte` and `even` are the factors of diffuse
    /// reflection and of its density.
    #[inline(always)]
    fn eval_and_pdf_local(&self, wi: Vector<F>, is_above: F::Mask, matte: F, even: F) -> (Vector<F::Narrow>, F) {
        let (wo, wi, zero) = (self.wo, self.axes.local(wi), F::splat(0.0));
        let is_lit = is_above & zero.less(wi.z);
        let m = (wo + wi).normalized();
        let cos = wo.dot(m);
        let lambert = (wi.z * FRAC_1_PI).narrow();
        let diffuse = (self.numbers.diffuse * lambert).times(self.diffuse_share) * matte.narrow();
        let mut mirrored = self.numbers.gloss_fresnel(cos).times(self.gloss_share);
        if self.has_metal.any() {
            mirrored = mirrored + self.numbers.metal_fresnel(cos).times(self.metal_share);
        }
        // D G₂ / (4 wo·n), the factor of F
        let facets = self.ggx.d(m) * self.ggx.g2(wo, wi) / (wo.z * 4.0);
        let [of_facets, of_both] = self.sums;
        let pdf = (of_both - of_facets) * (wi.z * even) + of_facets * self.ggx.mirrored_pdf(wo, m);
        let black = F::Narrow::splat(0.0);
        let f = Vector::select(is_lit, diffuse + mirrored * facets.narrow(), Vector { x: black, y: black, z: black });
        (f, F::select(is_lit, pdf, zero))
    }

    /// The directions that the numbers choose: `u_lobe` of [0, 1) the lobe, and `u` of the unit square the direction
    /// within it.
    #[inline(always)]
    pub(crate) fn directions(&self, u_lobe: F, u: [F; 2]) -> LobeDirections<F> {
        let [of_facets, of_both] = self.sums;
        let is_facet = u_lobe.less(of_facets);
        let m = self.ggx.sample_mirroring(self.wo, u);
        let mirrored = m * (self.wo.dot(m) * 2.0) - self.wo;
        let local = Vector::select(is_facet, mirrored, cosine_hemisphere_lanes(u));
        let zero = F::splat(0.0);
        let wi = self.axes.world(local).normalized();
        let is_below = wi.dot(self.facing).less(zero);
        let is_valid = u_lobe.less(of_both) & !local.z.less(zero) & (is_facet | !is_below);
        // What facets send to the wrong side of the geometric surface is mirrored there.
        let wi = Vector::select(is_below, mirrored_directions(self.facing, wi), wi);
        LobeDirections { wi, is_valid, is_mirrored: is_facet }
    }
}
