//! The GGX distribution of microfacets (Walter et al., *Microfacet Models for Refraction through Rough Surfaces*, 2007)
//! with Smith's masking and shadowing (Heitz, *Understanding the Masking-Shadowing Function*, 2014).
//!
//! All directions are in the frame of the surface, where z is the normal and the viewer is above it.

use crate::math::Vector;
use crate::math::functions::sin_cos;
use canaletto_bvh::lanes::Real64;
use glam::DVec2;
use std::f64::consts::{PI, TAU};

/// The distribution of microfacets on a rough surface in each lane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Ggx<F = f64> {
    /// The widths αx and αy > 0 along the two axes of the surface.
    pub(super) alpha: [F; 2],
}

impl<F: Real64> Ggx<F> {
    /// The distribution of width α in all directions.
    #[inline(always)]
    pub(crate) fn isotropic(alpha: F) -> Ggx<F> {
        Ggx { alpha: [alpha; 2] }
    }

    /// The direction with x and y scaled by α.
    #[inline(always)]
    fn scaled(&self, w: Vector<F>) -> Vector<F> {
        Vector { x: w.x * self.alpha[0], y: w.y * self.alpha[1], z: w.z }
    }

    /// The squared length of x and y scaled by α.
    #[inline(always)]
    fn across2(&self, w: Vector<F>) -> F {
        let Vector { x, y, .. } = self.scaled(w);
        x * x + y * y
    }

    /// D(m), the density of facets with the unit normal `m` per unit of solid angle and of the surface's area.
    #[inline(always)]
    pub(super) fn d(&self, m: impl Into<Vector<F>>) -> F {
        let (m, [ax, ay], zero) = (m.into(), self.alpha, F::splat(0.0));
        let (x, y) = (m.x / ax, m.y / ay);
        // D(m) = 1 / (π αx αy (x²/αx² + y²/αy² + z²)²)
        let spread = x * x + y * y + m.z * m.z;
        let d = F::splat(1.0) / (ax * PI * ay * spread * spread);
        F::select(zero.less(m.z), d, zero)
    }

    /// Λ of Smith's masking function for a direction off the surface's plane.
    #[inline(always)]
    pub(super) fn lambda(&self, w: impl Into<Vector<F>>) -> F {
        let w = w.into();
        ((F::splat(1.0) + self.across2(w) / (w.z * w.z)).sqrt() - 1.0) * 0.5
    }

    /// G₁(w): the share of the facets facing a direction that is seen from it.
    #[inline(always)]
    fn g1(&self, w: Vector<F>) -> F {
        let one = F::splat(1.0);
        one / (one + self.lambda(w))
    }

    /// G₂ / G₁(wo): the share of the facets seen by the viewer that light along `wi` reaches. `wi` is on either side.
    /// High facets are seen more often and lit more often: G₂ = 1 / (1 + Λ(wo) + Λ(wi)).
    #[inline(always)]
    pub(super) fn shadowing(&self, wo: impl Into<Vector<F>>, wi: impl Into<Vector<F>>) -> F {
        let (o, i) = (self.lambda(wo), self.lambda(wi));
        let seen = F::splat(1.0) + o;
        seen / (seen + i)
    }

    /// G₂: the share of the facets that both the viewer and the light reach.
    #[inline(always)]
    pub(super) fn g2(&self, wo: impl Into<Vector<F>>, wi: impl Into<Vector<F>>) -> F {
        let wo = wo.into();
        self.g1(wo) * self.shadowing(wo, wi)
    }

    /// The viewer's direction where the facets form a sphere.
    #[inline(always)]
    pub(super) fn squeezed(&self, wo: impl Into<Vector<F>>) -> Vector<F> {
        let wo = wo.into();
        Vector { z: wo.z.max(F::splat(0.0)), ..self.scaled(wo) }.normalized()
    }

    /// The normal of the facet at `u` of the unit square that the viewer sees (Dupuy & Benyoub, *Sampling Visible GGX
    /// Normals with Spherical Caps*, 2023).
    #[inline(always)]
    pub(super) fn sample_visible(&self, wo: impl Into<Vector<F>>, u: [F; 2]) -> Vector<F> {
        let squeezed = self.squeezed(wo);
        self.on_cap(squeezed, squeezed.z, circle_point(u[0]), u[1])
    }

    /// The density of [`Ggx::sample_visible`], D(m) G₁(wo) max(0, wo·m) / wo·n.
    #[inline(always)]
    pub(super) fn visible_pdf(&self, wo: impl Into<Vector<F>>, m: impl Into<Vector<F>>) -> F {
        let (wo, m) = (wo.into(), m.into());
        // G₁(wo) / (wo·n) = 2 / (wo·n + √((wo·n)² + αx² x² + αy² y²))
        let seen = F::splat(2.0) / (wo.z + (wo.z * wo.z + self.across2(wo)).sqrt());
        self.d(m) * seen * wo.dot(m).max(F::splat(0.0))
    }

    /// The facet's normal at `u` of the unit square whose mirrored direction is rarely below the surface (Eto &
    /// Tokuyoshi, *Bounded VNDF Sampling for Smith–GGX Reflections*, 2023).
    #[inline(always)]
    pub(super) fn sample_mirroring(&self, wo: impl Into<Vector<F>>, u: [F; 2]) -> Vector<F> {
        let wo = wo.into();
        let squeezed = self.squeezed(wo);
        self.on_cap(squeezed, self.bound(wo) * squeezed.z, circle_point(u[0]), u[1])
    }

    /// The density of the directions mirrored in [`Ggx::sample_mirroring`]'s normals, for the facet `m` between `wo`
    /// and the mirrored direction.
    #[inline(always)]
    pub(super) fn mirrored_pdf(&self, wo: impl Into<Vector<F>>, m: impl Into<Vector<F>>) -> F {
        let wo = wo.into();
        let length = (wo.z * wo.z + self.across2(wo)).sqrt();
        self.d(m) / ((self.bound(wo) * wo.z + length) * 2.0)
    }

    /// k of (5) of Eto & Tokuyoshi: where the cap of facets ends, as a share of the viewer's height.
    #[inline(always)]
    fn bound(&self, wo: Vector<F>) -> F {
        let one = F::splat(1.0);
        let a = self.alpha[0].min(self.alpha[1]).min(one);
        let s = one + (wo.x * wo.x + wo.y * wo.y).sqrt();
        let (a2, s2) = (a * a, s * s);
        (one - a2) * s2 / (s2 + a2 * wo.z * wo.z)
    }

    /// The facet's normal of a point of the spherical cap above −`bottom`, for a viewer at `squeezed` where the facets
    /// form a sphere. The point has the direction `circle` around the axis, and `u` of the cap's area is above it.
    #[inline(always)]
    pub(super) fn on_cap(&self, squeezed: Vector<F>, bottom: F, [x, y]: [F; 2], u: F) -> Vector<F> {
        let (zero, one) = (F::splat(0.0), F::splat(1.0));
        let z = (one - u) * (one + bottom) - bottom;
        let across = (one - z * z).max(zero).sqrt();
        let half = Vector { x: x * across, y: y * across, z } + squeezed;
        let facet = Vector { z: half.z.max(zero), ..self.scaled(half) };
        let shrink = one / facet.length();
        let is_facet = zero.less(shrink) & shrink.less(F::splat(f64::INFINITY));
        Vector::select(is_facet, facet * shrink, Vector { x: zero, y: zero, z: one })
    }
}

/// The point of the unit circle after this part of a turn.
#[inline(always)]
pub(crate) fn circle_point<F: Real64>(turn: F) -> [F; 2] {
    let [sin, cos] = sin_cos(turn * TAU);
    [cos, sin]
}

/// [`circle_point`] of one number.
pub(crate) fn on_circle(turn: f64) -> DVec2 {
    circle_point(turn).into()
}

#[cfg(test)]
mod tests {
    use super::super::reflect;
    use super::*;
    use crate::shape::testing::Random;
    use glam::DVec3;

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
                let squeezed = DVec3::from(ggx.squeezed(wo));
                let half = DVec3::new(m.x / alpha[0], m.y / alpha[1], m.z).normalize();
                let above = reflect(squeezed, half).z + ggx.bound(wo.into()) * squeezed.z;
                assert!(above > -1e-9, "{alpha:?}, {wo}, {wi}: {above}");
                nearest = nearest.min(above);
            }
            assert!(nearest < 2e-3 || alpha[0] != alpha[1], "{alpha:?}: {nearest}");
        }
    }
}
