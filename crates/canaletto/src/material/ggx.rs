//! The GGX distribution of microfacets (Walter et al., *Microfacet Models for Refraction through Rough Surfaces*, 2007)
//! with Smith's masking and shadowing (Heitz, *Understanding the Masking-Shadowing Function*, 2014).
//!
//! All directions are in the frame of the surface, where z is the normal and the viewer is above it.

use crate::math::{larger, select, smaller};
use glam::{DVec2, DVec3};
use std::f64::consts::{PI, TAU};

/// The distribution of microfacets on a rough surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Ggx {
    /// The widths αx and αy > 0 along the two axes of the surface.
    pub(super) alpha: [f64; 2],
}

impl Ggx {
    /// The distribution of width α in all directions.
    #[inline(always)]
    pub(crate) fn isotropic(alpha: f64) -> Ggx {
        Ggx { alpha: [alpha; 2] }
    }

    /// The direction with x and y scaled by α.
    #[inline(always)]
    fn scaled(&self, w: DVec3) -> DVec2 {
        DVec2::new(w.x * self.alpha[0], w.y * self.alpha[1])
    }

    /// D(m), the density of facets with the unit normal `m` per unit of solid angle and of the surface's area.
    #[inline(always)]
    pub(super) fn d(&self, m: DVec3) -> f64 {
        let [ax, ay] = self.alpha;
        let (x, y) = (m.x / ax, m.y / ay);
        // D(m) = 1 / (π αx αy (x²/αx² + y²/αy² + z²)²)
        let spread = x * x + y * y + m.z * m.z;
        let d = 1.0 / (PI * ax * ay * spread * spread);
        if m.z > 0.0 { d } else { 0.0 }
    }

    /// Λ of Smith's masking function for a direction off the surface's plane.
    #[inline(always)]
    pub(super) fn lambda(&self, w: DVec3) -> f64 {
        0.5 * ((1.0 + self.scaled(w).length_squared() / (w.z * w.z)).sqrt() - 1.0)
    }

    /// G₁(w): the share of the facets facing a direction that is seen from it.
    #[inline(always)]
    fn g1(&self, w: DVec3) -> f64 {
        1.0 / (1.0 + self.lambda(w))
    }

    /// G₂ / G₁(wo): the share of the facets seen by the viewer that light along `wi` reaches. `wi` is on either side.
    /// High facets are seen more often and lit more often: G₂ = 1 / (1 + Λ(wo) + Λ(wi)).
    #[inline(always)]
    pub(super) fn shadowing(&self, wo: DVec3, wi: DVec3) -> f64 {
        let (o, i) = (self.lambda(wo), self.lambda(wi));
        (1.0 + o) / (1.0 + o + i)
    }

    /// G₂: the share of the facets that both the viewer and the light reach.
    #[inline(always)]
    pub(super) fn g2(&self, wo: DVec3, wi: DVec3) -> f64 {
        self.g1(wo) * self.shadowing(wo, wi)
    }

    /// The viewer's direction where the facets form a sphere.
    #[inline(always)]
    pub(super) fn squeezed(&self, wo: DVec3) -> DVec3 {
        self.scaled(wo).extend(larger(wo.z, 0.0)).normalize()
    }

    /// The normal of the facet at `u` of the unit square that the viewer sees (Dupuy & Benyoub, *Sampling Visible GGX
    /// Normals with Spherical Caps*, 2023).
    pub(super) fn sample_visible(&self, wo: DVec3, u: [f64; 2]) -> DVec3 {
        let squeezed = self.squeezed(wo);
        self.on_cap(squeezed, squeezed.z, on_circle(u[0]), u[1])
    }

    /// The density of [`Ggx::sample_visible`], D(m) G₁(wo) max(0, wo·m) / wo·n.
    pub(super) fn visible_pdf(&self, wo: DVec3, m: DVec3) -> f64 {
        // G₁(wo) / (wo·n) = 2 / (wo·n + √((wo·n)² + αx² x² + αy² y²))
        let seen = 2.0 / (wo.z + (wo.z * wo.z + self.scaled(wo).length_squared()).sqrt());
        self.d(m) * seen * wo.dot(m).max(0.0)
    }

    /// The facet's normal at `u` of the unit square whose mirrored direction is rarely below the surface (Eto &
    /// Tokuyoshi, *Bounded VNDF Sampling for Smith–GGX Reflections*, 2023).
    pub(super) fn sample_mirroring(&self, wo: DVec3, u: [f64; 2]) -> DVec3 {
        self.mirroring_at(wo, on_circle(u[0]), u[1])
    }

    /// The facet's normal of [`Ggx::sample_mirroring`] at this point of the circle around the axis.
    #[inline(always)]
    pub(super) fn mirroring_at(&self, wo: DVec3, circle: DVec2, u: f64) -> DVec3 {
        let squeezed = self.squeezed(wo);
        self.on_cap(squeezed, self.bound(wo) * squeezed.z, circle, u)
    }

    /// The density of the directions mirrored in [`Ggx::sample_mirroring`]'s normals, for the facet `m` between `wo`
    /// and the mirrored direction.
    #[inline(always)]
    pub(super) fn mirrored_pdf(&self, wo: DVec3, m: DVec3) -> f64 {
        let length = (wo.z * wo.z + self.scaled(wo).length_squared()).sqrt();
        self.d(m) / (2.0 * (self.bound(wo) * wo.z + length))
    }

    /// k of (5) of Eto & Tokuyoshi: where the cap of facets ends, as a share of the viewer's height.
    #[inline(always)]
    fn bound(&self, wo: DVec3) -> f64 {
        let a = smaller(smaller(self.alpha[0], self.alpha[1]), 1.0);
        let s = 1.0 + wo.truncate().length();
        let (a2, s2) = (a * a, s * s);
        (1.0 - a2) * s2 / (s2 + a2 * wo.z * wo.z)
    }

    /// The facet's normal of a point of the spherical cap above −`bottom`, for a viewer at `squeezed` where the facets
    /// form a sphere. The point has the direction `circle` around the axis, and `u` of the cap's area is above it.
    #[inline(always)]
    pub(super) fn on_cap(&self, squeezed: DVec3, bottom: f64, circle: DVec2, u: f64) -> DVec3 {
        let z = (1.0 - u) * (1.0 + bottom) - bottom;
        let half = (circle * larger(1.0 - z * z, 0.0).sqrt()).extend(z) + squeezed;
        let facet = self.scaled(half).extend(larger(half.z, 0.0));
        let shrink = facet.length_recip();
        let is_facet = (shrink > 0.0) & (shrink < f64::INFINITY);
        select(is_facet, facet * shrink, DVec3::Z)
    }
}

/// The point of the unit circle after this part of a turn.
pub(crate) fn on_circle(turn: f64) -> DVec2 {
    let (sin, cos) = libm::sincos(TAU * turn);
    DVec2::new(cos, sin)
}

#[cfg(test)]
mod tests {
    use super::super::reflect;
    use super::*;
    use crate::shape::testing::Random;

    /// The facets between the viewer and any direction above the surface are on the cap that is sampled for mirrors.
    /// Some are near its end where the widths are equal.
    #[test]
    fn the_cap_has_all_facets_that_mirror_upwards() {
        let mut random = Random(1);
        for alpha in [[0.2, 0.2], [0.7, 0.7], [1.0, 1.0], [0.9, 0.3]] {
            let ggx = Ggx { alpha };
            let mut nearest = f64::INFINITY;
            for _ in 0..40_000 {
                let [wo, wi] = [(); 2].map(|()| {
                    let (z, circle) = (f64::from(random.unit()), on_circle(random.unit().into()));
                    (circle * (1.0 - z * z).sqrt()).extend(z.max(1e-6))
                });
                let m = (wo + wi).normalize();
                let squeezed = ggx.squeezed(wo);
                let half = DVec3::new(m.x / alpha[0], m.y / alpha[1], m.z).normalize();
                let above = reflect(squeezed, half).z + ggx.bound(wo) * squeezed.z;
                assert!(above > -1e-9, "{alpha:?}, {wo}, {wi}: {above}");
                nearest = nearest.min(above);
            }
            assert!(nearest < 2e-3 || alpha[0] != alpha[1], "{alpha:?}: {nearest}");
        }
    }
}
