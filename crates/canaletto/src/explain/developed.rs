//! The way of a pixel's colour from linear light to the bytes of a file.

use super::term::{Line, line, of_ray};
use crate::Named;
use crate::film::{Agx, Developer, PbrNeutral, Picture, unpremultiplied};
use crate::math::Rgb;
use crate::scene::{Developing, Exposure, Tone, Transfer};
use serde::Serialize;

/// What becomes of a pixel's colour when its picture is developed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct DevelopedNode {
    /// The exposure in stops. None stands for `auto`, where it isn't metered.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub exposure: Option<f32>,
    /// The share of the background that the pixel hides, if the background is left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub alpha: Option<f32>,
    /// How colours are brought into 0 to 1, as a word of the scene text.
    pub tone: &'static str,
    /// The curve between linear light and the numbers of the file, as a word of the scene text.
    pub transfer: &'static str,
    /// The values on the way. None if they depend on the whole picture: with `tone "scale"`, and where `exposure
    /// "auto"` isn't metered.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub values: Option<DevelopedValues>,
}

/// A pixel's colour on its way to the file.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct DevelopedValues {
    /// The linear light divided by alpha, if there is one: a PNG's colours aren't multiplied by it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub straight: Option<Rgb>,
    /// That light times 2 to the power of the exposure.
    pub exposed: Rgb,
    /// The numbers of the tone curve, if the tone is one.
    #[serde(flatten)]
    pub curve: Option<ToneCurve>,
    /// The linear light in 0 to 1.
    pub toned: Rgb,
    /// The light after the transfer curve.
    pub displayed: Rgb,
    /// The bytes in a file of 8 bits, each the nearest to 255 times the value.
    pub bytes: [u8; 3],
    /// The byte of alpha, if there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub alpha_byte: Option<u8>,
}

/// A colour on its way through a tone curve.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum ToneCurve {
    /// [`Tone::Agx`].
    Agx(Agx),
    /// [`Tone::PbrNeutral`].
    PbrNeutral(PbrNeutral),
}

impl DevelopedNode {
    pub(super) fn new(color: Rgb, alpha: Option<f32>, developing: &Developing) -> DevelopedNode {
        let Developing { exposure, tone, transfer } = *developing;
        let stops = if let Exposure::Stops(stops) = exposure { Some(stops) } else { None };
        let straight = alpha.map(|alpha| unpremultiplied(color, alpha));
        let color = straight.unwrap_or(color);
        let values = stops.filter(|_| tone != Tone::Scale).map(|stops| {
            let developer = |transfer| Developer::new(&Picture::new(1, 1), &Developing { transfer, ..*developing });
            let displayed_by = |transfer| {
                let mut values = [color.to_array()];
                developer(transfer).develop(&mut values);
                values[0]
            };
            let exposed = developer(transfer).exposed(color);
            let curve = match tone {
                Tone::Agx => Some(ToneCurve::Agx(Agx::of(exposed))),
                Tone::PbrNeutral => Some(ToneCurve::PbrNeutral(PbrNeutral::of(exposed))),
                Tone::Clamp | Tone::Scale => None,
            };
            let displayed = displayed_by(transfer);
            // Halves are rounded up, as in PNG files.
            let byte = |v: f32| (f64::from(v * 255.0) + 0.5) as u8;
            let bytes = displayed.map(byte);
            let exposed = if curve.is_some() { exposed } else { color * libm::exp2f(stops) };
            DevelopedValues {
                straight,
                alpha_byte: alpha.map(|alpha| byte(alpha.clamp(0.0, 1.0))),
                exposed,
                curve,
                toned: displayed_by(Transfer::None).into(),
                displayed: displayed.into(),
                bytes,
            }
        });
        DevelopedNode { alpha, exposure: stops, tone: tone.name(), transfer: transfer.name(), values }
    }

    /// Why the values aren't known, as the words and the end of a sentence.
    pub(super) fn unknown(&self) -> Option<[&'static str; 2]> {
        match (self.values, self.exposure) {
            (Some(_), _) => None,
            (None, None) => {
                Some(["exposure \"auto\"", "is metered in the whole picture, which one pixel doesn't tell"])
            }
            (None, Some(_)) => {
                Some(["tone \"scale\"", "divides by the picture's largest component, which one pixel doesn't tell"])
            }
        }
    }

    /// The way of the pixel's colour, with its terms.
    pub(super) fn lines<'t>(&self, color: Rgb) -> Vec<Line<'t>> {
        let DevelopedNode { alpha, exposure, tone, transfer, values } = *self;
        let settings = line!("{alpha}{exposure}{tone}{transfer}", alpha, exposure, tone, transfer).written_if(false);
        let mut lines = vec![line!("{colour of the pixel}", of_ray(color)).written_if(false), settings];
        let Some(values) = values else {
            let [what, why] = self.unknown().unwrap_or_default();
            lines.push(line!("{} {}", what, why));
            return lines;
        };
        let mut linear = color;
        if let (Some(alpha), Some(straight)) = (alpha, values.straight) {
            lines.push(line!("alpha, the share of the background that is hidden: {}", alpha));
            lines.push(line!("colour divided by alpha: {}", straight));
            linear = straight;
        }
        if let Some(stops) = exposure.filter(|stops| *stops != 0.0) {
            let (factor, exposed) = (libm::exp2f(stops), of_ray(values.exposed));
            lines.push(line!("exposure of {} stops, times {}: {exposed colour}", stops, factor, exposed));
        }
        match values.curve {
            Some(ToneCurve::Agx(agx)) => lines.extend([
                line!("tone \"agx\", after the inset matrix: {}", agx.inset),
                line!("  log2, from -12.47393 (0) to 4.026069 (1): {}", agx.logarithm),
                line!("  curve of contrast: {}", agx.curve),
                line!("  after the outset matrix: {}", agx.outset),
                line!("  to the power of 2.2: {}", agx.linear),
            ]),
            Some(ToneCurve::PbrNeutral(neutral)) => {
                let PbrNeutral { offset, peak, compressed_peak, white, linear } = neutral;
                let words = line!("tone \"pbr-neutral\", {} subtracted: the largest component is {}", offset, peak);
                let compressed = line!("  compressed to {}, with a share of {} of white", compressed_peak, white);
                lines.extend([words, compressed.written_if(compressed_peak != peak), line!("  result: {}", linear)]);
            }
            None => {}
        }
        let before = match values.curve {
            Some(ToneCurve::Agx(agx)) => agx.linear,
            Some(ToneCurve::PbrNeutral(neutral)) => neutral.linear,
            None if exposure == Some(0.0) => linear,
            None => values.exposed,
        };
        let (toned, is_changed) = (of_ray(values.toned), values.toned != before);
        let toned = if values.curve.is_some() {
            line!("  between 0 and 1: {toned colour}", toned).written_if(is_changed)
        } else {
            let changed = if is_changed { ", each component between 0 and 1" } else { "" };
            line!("tone \"{}\"{}: {toned colour}", tone, changed, toned)
        };
        lines.push(toned);
        lines.push(line!("transfer \"{}\": {displayed colour}", transfer, values.displayed).of_ray());
        let [r, g, b] = values.bytes;
        let words = format!("{r} {g} {b}  (#{r:02x}{g:02x}{b:02x})");
        let alpha = values.alpha_byte.map(|byte| format!(", alpha {byte}"));
        lines.push(line!("bytes in the file {}{}", words, alpha));
        lines.push(line!("{bytes}", values.bytes.map(f64::from)).written_if(false).of_ray());
        lines
    }
}
