//! The reflection of metals from two colours: Schlick's curve with the "F82 tint" (Kutz, Hašan & Edmondson, *Novel
//! Aspects of the Adobe Standard Material*, 2021).

use crate::math::{Rgb, Vector};
use canaletto_bvh::lanes::{Real32, Real64};

/// The cosine of about 82°, where the tint has its full effect.
const RIM: f64 = 1.0 / 7.0;

/// The reflection of a metal.
#[derive(Clone, Copy, Debug)]
pub(super) struct MetalFresnel {
    /// F at right angles.
    pub(super) f0: Rgb,
    /// The factor of µ (1 − µ)⁶ that is taken off.
    pub(super) dip: Rgb,
}

#[inline(always)]
fn schlick<F: Real64>(f0: F, cos: F) -> F {
    let one = F::splat(1.0);
    let x = one - cos;
    let x2 = x * x;
    f0 + (one - f0) * x2 * x2 * x
}

/// The factors of µ (1 − µ)⁶ that are taken off in each lane, for what metals mirror at right angles and their tints.
#[inline(always)]
pub(super) fn metal_dips<F: Real64>(f0: Vector<F::Narrow>, tint: Vector<F::Narrow>) -> Vector<F::Narrow> {
    Vector { x: dip::<F>(f0.x, tint.x), y: dip::<F>(f0.y, tint.y), z: dip::<F>(f0.z, tint.z) }
}

#[inline(always)]
fn dip<F: Real64>(f0: F::Narrow, tint: F::Narrow) -> F::Narrow {
    let x2 = (1.0 - RIM) * (1.0 - RIM);
    let at_rim = RIM * x2 * x2 * x2;
    (schlick(f0.widen(), F::splat(RIM)) * (F::splat(1.0) - tint.widen()) / at_rim).narrow()
}

/// F at the cosines of angles in each lane.
#[inline(always)]
pub(super) fn metal_fresnels<F: Real64>(cos: F, f0: Vector<F::Narrow>, dip: Vector<F::Narrow>) -> Vector<F::Narrow> {
    let x = F::splat(1.0) - cos;
    let x2 = x * x;
    let shape = cos * x2 * x2 * x2;
    Vector {
        x: at_cosine(cos, shape, f0.x, dip.x),
        y: at_cosine(cos, shape, f0.y, dip.y),
        z: at_cosine(cos, shape, f0.z, dip.z),
    }
}

#[inline(always)]
fn at_cosine<F: Real64>(cos: F, shape: F, f0: F::Narrow, dip: F::Narrow) -> F::Narrow {
    (schlick(f0.widen(), cos) - dip.widen() * shape).max(F::splat(0.0)).min(F::splat(1.0)).narrow()
}

impl MetalFresnel {
    pub(super) fn new(f0: Rgb, tint: Rgb) -> MetalFresnel {
        MetalFresnel { f0, dip: metal_dips::<f64>(f0.into(), tint.into()).into() }
    }

    /// F at the cosine of an angle.
    pub(super) fn at(&self, cos: f64) -> Rgb {
        metal_fresnels(cos, self.f0.into(), self.dip.into()).into()
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::fresnel_conductor;
    use super::*;

    /// F has its colours at 0° and 82°, and is near the exact curve of a metal with these two colours between.
    #[test]
    fn the_curve_is_near_the_exact_one() {
        let (eta, k) = (Rgb::new(1.657, 0.880, 0.521), Rgb::new(9.224, 6.270, 4.837));
        let f0 = fresnel_conductor(1.0, eta, k);
        let rim = fresnel_conductor(RIM, eta, k);
        let tint = Rgb::from(
            [0, 1, 2].map(|c: usize| (f64::from(rim.to_array()[c]) / schlick(f64::from(f0.to_array()[c]), RIM)) as f32),
        );
        let metal = MetalFresnel::new(f0, tint);
        assert!(
            (metal.at(1.0) - f0).max_component().abs() < 1e-6 && (metal.at(RIM) - rim).max_component().abs() < 1e-6
        );
        for cos in [0.9, 0.6, 0.4, 0.25, 0.1] {
            for (ours, exact) in metal.at(cos).to_array().into_iter().zip(fresnel_conductor(cos, eta, k).to_array()) {
                assert!((ours - exact).abs() < 0.021, "{cos}: {ours} and {exact}");
            }
        }
        assert_eq!(metal.at(0.0), Rgb::WHITE);
    }
}
