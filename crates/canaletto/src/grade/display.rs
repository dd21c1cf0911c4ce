//! From linear colours to the numbers in a student's file, with the mistakes that are made there.

use super::mistake::{Mistake, form};
use super::tracer::TracerSettings;
use crate::film::{Agx, PbrNeutral, Picture, metered_exposure, srgb_encode};
use crate::math::Rgb;
use crate::scene::{Developing, Exposure, Tone, Transfer};
use glam::{DVec3, Vec3Swizzles};

/// The largest error of a pixel in steps of 8 bits. A pixel that is quite wrong counts no more than one that is wrong.
const MOST: f64 = 40.0;

/// Develops linear colours into display values from 0 to 1.
pub(super) fn displayed(colors: &[DVec3], developing: &Developing, settings: &TracerSettings) -> Vec<DVec3> {
    let exposure = match developing.exposure {
        Exposure::Stops(stops) => libm::exp2(f64::from(stops)),
        Exposure::Auto => {
            let pixels = colors.iter().map(|c| Rgb::from(c.as_vec3().to_array())).collect();
            let picture = Picture { pixels, ..Picture::new(colors.len() as u32, 1) };
            libm::exp2(f64::from(metered_exposure(&picture)))
        }
    };
    let scale = match developing.tone {
        Tone::Scale => {
            let largest = colors.iter().map(|c| c.max_element() * exposure).fold(0.0, f64::max);
            if largest > 1.0 { exposure / largest } else { exposure }
        }
        Tone::Clamp | Tone::Agx | Tone::PbrNeutral => exposure,
    };
    let toned = |c: DVec3| {
        let exposed = Rgb::from(c.max(DVec3::ZERO).min(DVec3::splat(f32::MAX.into())).as_vec3().to_array());
        let linear = match developing.tone {
            Tone::Clamp | Tone::Scale => return c,
            Tone::Agx => Agx::of(exposed).linear,
            Tone::PbrNeutral => PbrNeutral::of(exposed).linear,
        };
        DVec3::from(linear.to_array().map(f64::from))
    };
    let overflows = settings.amount(Mistake::Overflow).is_some();
    let swapped = settings.amount(Mistake::SwappedChannels);
    let gamma = settings.amount(Mistake::Gamma);
    let value = |v: f64| {
        let v = if overflows { wrapped(v) } else { v.clamp(0.0, 1.0) };
        let v = if developing.transfer == Transfer::Srgb { f64::from(srgb_encode(v as f32)) } else { v };
        match gamma {
            Some(form::EXTRA_CURVE) => f64::from(srgb_encode(v as f32)),
            Some(form::UNDONE_CURVE) => srgb_decode(v),
            Some(form::EXTRA_POWER) => libm::pow(v, 1.0 / 2.2),
            Some(_) => libm::pow(v, 2.2),
            None => v,
        }
    };
    let develop = |c: &DVec3| {
        let c = toned(*c * scale);
        let shown = DVec3::new(value(c.x), value(c.y), value(c.z));
        match swapped {
            None => shown,
            Some(0.0) => shown.zyx(),
            Some(1.0) => shown.yxz(),
            Some(2.0) => shown.xzy(),
            Some(3.0) => shown.yzx(),
            Some(_) => shown.zxy(),
        }
    };
    colors.iter().map(develop).collect()
}

/// A value as the lowest 8 bits of its whole steps.
fn wrapped(v: f64) -> f64 {
    ((v * 255.0).floor().clamp(-1e9, 1e9) as i64).rem_euclid(256) as f64 / 255.0
}

pub(super) fn srgb_decode(v: f64) -> f64 {
    if v <= 0.04045 { v / 12.92 } else { libm::pow((v + 0.055) / 1.055, 2.4) }
}

/// The error of a pixel of the student against the display values from `low` to `high`, in steps of 8 bits above the
/// tolerance.
pub(super) fn error([low, high]: [DVec3; 2], pixel: [f32; 3], tolerance: f64) -> f64 {
    let pixel = DVec3::from(pixel.map(f64::from));
    let difference = (low - pixel).max(pixel - high).max_element().max(0.0) * 255.0;
    // A colour that isn't a number is as wrong as can be.
    if low.is_nan() || high.is_nan() { MOST } else { (difference - tolerance).clamp(0.0, MOST) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_wrap_around_like_bytes() {
        assert_eq!(
            [0.5, 1.0, 256.0 / 255.0, 300.0 / 255.0].map(|v| (wrapped(v) * 255.0).round()),
            [127.0, 255.0, 0.0, 44.0]
        );
    }

    #[test]
    fn decoding_undoes_the_curve() {
        for v in [0.0, 0.001, 0.2, 0.9, 1.0] {
            assert!((srgb_decode(f64::from(srgb_encode(v as f32))) - v).abs() < 1e-6);
        }
    }
}
