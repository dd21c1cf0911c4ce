//! The reflection of metals from two colours: Schlick's curve with the "F82 tint" (Kutz, Hašan & Edmondson, *Novel
//! Aspects of the Adobe Standard Material*, 2021).

use crate::math::Rgb;

/// The cosine of about 82°, where the tint has its full effect.
const RIM: f64 = 1.0 / 7.0;

/// The reflection of a metal.
#[derive(Clone, Copy, Debug)]
pub(super) struct MetalFresnel {
    /// F at right angles.
    pub(super) f0: Rgb,
    /// The factor of µ (1 − µ)⁶ that is taken off.
    dip: Rgb,
}

fn schlick(f0: f64, cos: f64) -> f64 {
    let x = 1.0 - cos;
    let x2 = x * x;
    f0 + (1.0 - f0) * x2 * x2 * x
}

impl MetalFresnel {
    pub(super) fn new(f0: Rgb, tint: Rgb) -> MetalFresnel {
        let x2 = (1.0 - RIM) * (1.0 - RIM);
        let at_rim = RIM * x2 * x2 * x2;
        let [f, t] = [f0, tint].map(|color| color.to_array().map(f64::from));
        let dip = Rgb::from([0, 1, 2].map(|c: usize| (schlick(f[c], RIM) * (1.0 - t[c]) / at_rim) as f32));
        MetalFresnel { f0, dip }
    }

    /// F at the cosine of an angle.
    pub(super) fn at(&self, cos: f64) -> Rgb {
        let x = 1.0 - cos;
        let x2 = x * x;
        let dip = cos * x2 * x2 * x2;
        let [f, d] = [self.f0, self.dip].map(|color| color.to_array().map(f64::from));
        Rgb::from([0, 1, 2].map(|c: usize| (schlick(f[c], cos) - d[c] * dip).clamp(0.0, 1.0) as f32))
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
            [0, 1, 2].map(|c: usize| (f64::from(rim.to_array()[c]) / schlick(f0.to_array()[c].into(), RIM)) as f32),
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
