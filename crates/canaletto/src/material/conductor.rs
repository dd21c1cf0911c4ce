//! Metals: a smooth or rough boundary of a conductor, with GGX microfacets.
//!
//! Light that one scattering loses between the microfacets is given back as a share of it (Turquin, *Practical Multiple
//! Scattering Compensation for Microfacet Models*, 2019). A metal that reflects all light is exactly white. This part
//! is not reciprocal.

use super::bsdf::{FacetAxes, mirrored_at, mirrored_directions};
use super::conductor_albedo::conductor_albedos;
use super::fresnel::fresnel_conductors;
use super::ggx::Ggx;
use super::{BsdfSample, Lobe, MaterialPoint, Phong, ScatteringFrame, fresnel_conductor, reflect};
use crate::OutOfRange;
use crate::math::{Rgb, Vector};
use canaletto_bvh::lanes::{Mask, Real, Real64};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// A metal.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Conductor {
    /// The index of refraction η > 0 in red, green and blue.
    pub eta: Rgb,
    /// The absorption k ≥ 0, the imaginary part of the index.
    pub k: Rgb,
    /// The roughness r, 0 (polished) to 1; α = r².
    #[serde(default)]
    pub roughness: f32,
    /// The radiance that the surface emits by itself ([`Phong::emission`]).
    #[serde(default)]
    pub emission: Rgb,
}

/// Metals by name: η and k in red, green and blue. The first five are means of published measurements over the three
/// curves. The others are those at 650, 550 and 450 nm: iron, nickel, titanium, cobalt and palladium by Johnson &
/// Christy (*Phys. Rev. B* 9, 1974), platinum and tungsten by Rakić et al. (*Appl. Opt.* 37, 1998), mercury by Inagaki
/// et al. (*Phys. Rev. B* 23, 1981), brass of 70 % copper by Querry (1985), stainless steel by Karlsson & Ribbing (*J.
/// Appl. Phys.* 53, 1982), all as refractiveindex.info lists them (CC0).
#[rustfmt::skip]
pub const METALS: [(&str, [f32; 3], [f32; 3]); 15] = [
    ("gold", [0.143, 0.375, 1.442], [3.983, 2.386, 1.603]),
    ("silver", [0.155, 0.117, 0.138], [4.828, 3.122, 2.147]),
    ("copper", [0.200, 0.924, 1.102], [3.912, 2.452, 2.142]),
    ("aluminium", [1.657, 0.880, 0.521], [9.224, 6.270, 4.837]),
    ("chromium", [4.369, 2.917, 1.655], [5.206, 4.231, 3.755]),
    ("iron", [2.911, 2.950, 2.584], [3.089, 2.932, 2.767]),
    ("nickel", [1.990, 1.921, 1.729], [4.209, 3.616, 2.944]),
    ("titanium", [2.741, 2.542, 2.267], [3.814, 3.435, 3.038]),
    ("cobalt", [2.237, 2.052, 1.736], [4.236, 3.824, 3.274]),
    ("palladium", [1.789, 1.641, 1.408], [4.375, 3.845, 3.254]),
    ("platinum", [2.376, 2.085, 1.845], [4.265, 3.715, 3.136]),
    ("tungsten", [3.652, 3.506, 3.313], [2.795, 2.758, 2.605]),
    ("mercury", [2.073, 1.552, 1.061], [5.338, 4.651, 3.863]),
    ("brass", [0.444, 0.527, 1.094], [3.695, 2.765, 1.829]),
    ("stainless-steel", [2.440, 2.044, 1.678], [4.182, 3.673, 3.117]),
];

impl Conductor {
    /// A polished metal with this complex index.
    pub fn new(eta: Rgb, k: Rgb) -> Conductor {
        Conductor { eta, k, roughness: 0.0, emission: Rgb::BLACK }
    }

    /// A metal by its name in [`METALS`].
    pub fn named(name: &str) -> Option<Conductor> {
        let (_, eta, k) = METALS.iter().find(|(metal, ..)| *metal == name)?;
        Some(Conductor::new((*eta).into(), (*k).into()))
    }

    /// The mirror that comes nearest, for integrators without this model.
    pub(super) fn classic(&self) -> Phong {
        let Conductor { eta, k, roughness, emission, .. } = *self;
        Phong { kd: Rgb::BLACK, k: fresnel_conductor(1.0, eta, k), roughness, emission, ..Phong::default() }
    }

    /// Checks the range of the complex index.
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
        Ok(())
    }
}

/// The numbers of a metal at a point.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ConductorPoint {
    pub(crate) eta: Rgb,
    pub(crate) k: Rgb,
    /// What it mirrors at right angles.
    f0: Rgb,
    /// The width of the facets, 0 for a polished metal.
    pub(crate) alpha: f64,
}

impl ConductorPoint {
    pub(crate) fn new(conductor: &Conductor, point: &MaterialPoint) -> ConductorPoint {
        let Conductor { eta, k, .. } = *conductor;
        let roughness = f64::from(point.classic.roughness);
        ConductorPoint { eta, k, f0: fresnel_conductor(1.0, eta, k), alpha: roughness * roughness }
    }
}

/// The factor of what one scattering reflects towards the cosine `cos`, with what facets reflect to each other, of a
/// metal that mirrors `f0` at right angles.
#[inline(always)]
fn returned<F: Real64>(f0: Vector<F::Narrow>, cos: F, alpha: F) -> Vector<F::Narrow> {
    let (one, albedo) = (F::Narrow::splat(1.0), conductor_albedos(cos, alpha).narrow());
    Vector { x: one, y: one, z: one } + f0 * ((one - albedo) / albedo)
}

/// A metal at a point.
#[derive(Clone, Copy, Debug)]
pub struct ConductorBsdf {
    point: ConductorPoint,
    frame: ScatteringFrame,
}

impl ConductorBsdf {
    pub(super) fn new(conductor: &Conductor, point: &MaterialPoint, frame: ScatteringFrame) -> ConductorBsdf {
        ConductorBsdf { point: ConductorPoint::new(conductor, point), frame }
    }

    pub(super) fn is_delta(&self) -> bool {
        self.point.alpha == 0.0
    }

    /// The facets as they are seen from `wo`. The metal must be rough.
    fn facets(&self, wo: DVec3) -> MetalFacets<f64> {
        let ConductorBsdf { point, frame } = self;
        let axes = frame.facet_axes(wo);
        let axes = FacetAxes::gather(|_| &axes);
        MetalFacets::gather(|_| point, frame.facing.into(), axes, wo.into())
    }
}

/// A metal at a point, as it is seen from one direction.
pub(crate) struct SeenConductor {
    bsdf: ConductorBsdf,
    wo: DVec3,
    /// The facets of a rough metal.
    facets: Option<MetalFacets<f64>>,
}

/// The facets of a rough metal in each lane, as they are seen from one direction.
pub(crate) struct MetalFacets<F: Real64> {
    eta: Vector<F::Narrow>,
    k: Vector<F::Narrow>,
    ggx: Ggx<F>,
    /// The geometric normal on the viewer's side.
    facing: Vector<F>,
    /// Where the facets' own normal is another one.
    bent: F::Mask,
    /// The axes of the facets, and the viewer's direction in them.
    axes: FacetAxes<F>,
    wo: Vector<F>,
    /// The factor of what one scattering reflects.
    returned: Vector<F::Narrow>,
}

impl<F: Real64> MetalFacets<F> {
    /// The facets of the metal that a function gives for each lane, around these axes.
    #[inline(always)]
    pub(crate) fn gather<'a>(
        of_lane: impl Fn(usize) -> &'a ConductorPoint,
        facing: Vector<F>,
        axes: FacetAxes<F>,
        wo: Vector<F>,
    ) -> MetalFacets<F> {
        let (alpha, wo) = (F::gather(|lane| of_lane(lane).alpha), axes.local(wo));
        MetalFacets {
            eta: Rgb::gather(|lane| of_lane(lane).eta),
            k: Rgb::gather(|lane| of_lane(lane).k),
            ggx: Ggx::isotropic(alpha),
            facing,
            bent: !axes.z.equal(facing),
            axes,
            wo,
            returned: returned(Rgb::gather(|lane| of_lane(lane).f0), wo.z, alpha),
        }
    }

    /// The unit direction in the frame of the facets, and the facet that mirrors it, which is 0 where there is none.
    #[inline(always)]
    fn local(&self, wi: Vector<F>) -> (Vector<F>, Vector<F>) {
        let wi = self.axes.local(wi);
        let half = self.wo + wi;
        let (zero, shrink) = (F::splat(0.0), F::splat(1.0) / half.length());
        let is_facet = zero.less(shrink) & shrink.less(F::splat(f64::INFINITY));
        (wi, half * F::select(is_facet, shrink, zero))
    }

    /// f |cos θ| and the density.
    #[inline(always)]
    pub(crate) fn eval_and_pdf(&self, wi: Vector<F>) -> (Vector<F::Narrow>, F) {
        let (mut f, mut pdf) = self.eval_and_pdf_facets(wi);
        if self.bent.any() {
            let (again, again_pdf) = self.eval_and_pdf_facets(mirrored_directions(self.facing, wi));
            f = Vector::select(self.bent, f + again, f);
            pdf = F::select(self.bent, pdf + again_pdf, pdf);
        }
        let (zero, black) = (F::splat(0.0), F::Narrow::splat(0.0));
        let is_above = zero.less(wi.dot(self.facing));
        (Vector::select(is_above, f, Vector { x: black, y: black, z: black }), F::select(is_above, pdf, zero))
    }

    /// What facets send in a direction on either side of the geometric surface, and the density there.
    #[inline(always)]
    fn eval_and_pdf_facets(&self, wi: Vector<F>) -> (Vector<F::Narrow>, F) {
        let (wi, m) = self.local(wi);
        // F D G₂ / (4 wo·n)
        let facets = self.ggx.d(m) * self.ggx.g2(self.wo, wi) / (self.wo.z * 4.0);
        let (zero, black) = (F::splat(0.0), F::Narrow::splat(0.0));
        let is_lit = zero.less(wi.z) & zero.less(m.z);
        let f = fresnel_conductors(self.wo.dot(m), self.eta, self.k) * facets.narrow();
        let f = Vector::select(is_lit, f.times(self.returned), Vector { x: black, y: black, z: black });
        (f, F::select(is_lit, self.ggx.mirrored_pdf(self.wo, m), zero))
    }

    /// The unit direction at `u` of the unit square, which a facet mirrors.
    #[inline(always)]
    pub(crate) fn direction(&self, u: [F; 2]) -> Vector<F> {
        let m = self.ggx.sample_mirroring(self.wo, u);
        let local = m * (self.wo.dot(m) * 2.0) - self.wo;
        let wi = self.axes.world(local).normalized();
        let zero = F::splat(0.0);
        let is_through = zero.less(local.z) & wi.dot(self.facing).less(zero) & self.bent;
        Vector::select(is_through, mirrored_directions(self.facing, wi), wi)
    }
}

impl SeenConductor {
    pub(super) fn new(bsdf: ConductorBsdf, wo: DVec3) -> SeenConductor {
        SeenConductor { bsdf, wo, facets: (!bsdf.is_delta()).then(|| bsdf.facets(wo)) }
    }

    /// f |cos θ| and the density.
    pub(super) fn eval_and_pdf(&self, wi: DVec3) -> (Rgb, f64) {
        let Some(facets) = &self.facets else { return (Rgb::BLACK, 0.0) };
        let (f, pdf) = facets.eval_and_pdf(wi.into());
        (f.into(), pdf)
    }

    pub(super) fn sample(&self, u: [f64; 2]) -> Option<BsdfSample> {
        let lobe = Lobe::Mirror;
        let SeenConductor { bsdf: ConductorBsdf { point, frame }, wo, facets } = self;
        let Some(facets) = facets else {
            let normal = frame.facet_normal(*wo);
            let mirrored = reflect(*wo, normal);
            let is_above = mirrored.dot(frame.facing) > 0.0;
            let wi = if is_above { mirrored } else { mirrored_at(frame.facing, mirrored) };
            let f = fresnel_conductor(wo.dot(normal), point.eta, point.k);
            return Some(BsdfSample { wi, f, pdf: 1.0, lobe, is_delta: true });
        };
        let wi = facets.direction(u);
        let (f, pdf) = facets.eval_and_pdf(wi);
        (pdf > 0.0).then(|| BsdfSample { wi: wi.into(), f: f.into(), pdf, lobe, is_delta: false })
    }
}

#[cfg(test)]
mod tests {
    use super::super::Bsdf;
    use super::super::testing::{albedo, bsdf_of, check_sampling, direction};
    use super::*;

    fn point(conductor: Conductor, roughness: f32) -> ConductorPoint {
        let conductor = Conductor { roughness, ..conductor };
        ConductorPoint::new(&conductor, &MaterialPoint { classic: conductor.classic(), ..MaterialPoint::default() })
    }

    fn metal(conductor: Conductor, roughness: f32) -> Bsdf {
        bsdf_of(Conductor { roughness, ..conductor }, ScatteringFrame::flat(DVec3::Z, 1.0))
    }

    /// A metal with k ≫ η reflects nearly all light. It is white at any roughness and angle.
    #[test]
    fn a_metal_that_reflects_all_light_is_white() {
        let perfect = Conductor::new(Rgb::gray(1e-6), Rgb::gray(1e6));
        for roughness in [0.0, 0.2, 0.5, 0.8, 1.0] {
            for degrees in [0.0, 30.0, 60.0, 80.0, 88.0] {
                let albedo = albedo(&metal(perfect, roughness), degrees);
                assert!(albedo.is_one_within(2e-3), "roughness {roughness}, {degrees}°: {albedo:?}");
            }
        }
    }

    /// Facets mirror by the angle at them, and a polished metal by the viewer's.
    #[test]
    fn facets_mirror_by_their_angle() {
        let gold = Conductor::named("gold").unwrap();
        let (wo, wi) = (direction(50.0), direction(-75.0));
        // What one scattering mirrors, without what facets reflect to each other.
        let single = |conductor: Conductor| {
            let point = point(conductor, 0.6);
            let [all, returned] =
                [metal(conductor, 0.6).eval(wo, wi), returned(point.f0.into(), wo.z, point.alpha).into()];
            Rgb::new(all.r / returned.r, all.g / returned.g, all.b / returned.b)
        };
        // A metal with k ≫ η mirrors all light.
        let white = single(Conductor::new(Rgb::gray(1e-6), Rgb::gray(1e6)));
        let expected = fresnel_conductor(direction(62.5).z, gold.eta, gold.k);
        let ours = single(gold);
        for ((ours, white), expected) in ours.to_array().into_iter().zip(white.to_array()).zip(expected.to_array()) {
            assert!((ours / white - expected).abs() < 1e-3, "{ours} of {white}, not {expected}");
        }
        let polished = metal(gold, 0.0).sample(direction(80.0), 0.5, [0.5; 2]).unwrap();
        assert_eq!(polished.f, fresnel_conductor(direction(80.0).z, gold.eta, gold.k));
    }

    /// What facets lose is given back as 1 + F₀ (1 − E) / E (Turquin 2019). E is 1 − ln 2 at right angles for α = 1.
    #[test]
    fn lost_light_comes_back_with_the_metals_colour() {
        let gold = Conductor::named("gold").unwrap();
        let (kept, f0) = (1.0 - std::f32::consts::LN_2, fresnel_conductor(1.0, gold.eta, gold.k));
        let gold_point = point(gold, 1.0);
        let returned = Rgb::from(returned(gold_point.f0.into(), 1.0, gold_point.alpha));
        for (returned, f0) in returned.to_array().into_iter().zip(f0.to_array()) {
            let gain = 1.0 + f0 * (1.0 - kept) / kept;
            assert!((returned / gain - 1.0).abs() < 5e-3, "{returned}, {gain}");
        }
    }

    #[test]
    fn directions_have_their_density() {
        for roughness in [0.3, 0.7, 1.0] {
            for degrees in [10.0, 70.0] {
                check_sampling(&metal(Conductor::named("gold").unwrap(), roughness), direction(degrees), 0.0);
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
