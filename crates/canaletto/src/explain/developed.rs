//! The way of a pixel's colour from linear light to the bytes of a file.

use super::text_writer::TextWriter;
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

    pub(super) fn write(&self, w: &mut TextWriter, linear: Rgb) {
        let DevelopedNode { alpha, exposure, tone, transfer, values } = self;
        let mut linear = linear;
        if let (Some(alpha), Some(straight)) = (alpha, values.and_then(|values| values.straight)) {
            writeln!(w, "alpha, the share of the background that is hidden: {}", w.number(*alpha));
            writeln!(w, "colour divided by alpha: {}", w.rgb(straight));
            linear = straight;
        }
        if let (Some(stops), Some(values)) = (exposure.filter(|stops| *stops != 0.0), values) {
            let (stops, factor) = (w.number(stops), w.number(libm::exp2f(stops)));
            writeln!(w, "exposure of {stops} stops, times {factor}: {}", w.rgb(values.exposed));
        }
        let Some(values) = values else {
            let [what, why] = self.unknown().unwrap_or_default();
            writeln!(w, "{what} {why}");
            return;
        };
        match &values.curve {
            Some(ToneCurve::Agx(agx)) => {
                writeln!(w, "tone \"agx\", after the inset matrix: {}", w.rgb(agx.inset));
                writeln!(w, "  log2, from -12.47393 (0) to 4.026069 (1): {}", w.rgb(agx.logarithm));
                writeln!(w, "  curve of contrast: {}", w.rgb(agx.curve));
                writeln!(w, "  after the outset matrix: {}", w.rgb(agx.outset));
                writeln!(w, "  to the power of 2.2: {}", w.rgb(agx.linear));
            }
            Some(ToneCurve::PbrNeutral(neutral)) => {
                let PbrNeutral { offset, peak, compressed_peak, white, linear } = *neutral;
                let [offset, peak_, compressed, share] = [offset, peak, compressed_peak, white].map(|v| w.number(v));
                writeln!(w, "tone \"pbr-neutral\", {offset} subtracted: the largest component is {peak_}");
                if compressed_peak != peak {
                    writeln!(w, "  compressed to {compressed}, with a share of {share} of white");
                }
                writeln!(w, "  result: {}", w.rgb(linear));
            }
            None => {}
        }
        let before = match &values.curve {
            Some(ToneCurve::Agx(agx)) => agx.linear,
            Some(ToneCurve::PbrNeutral(neutral)) => neutral.linear,
            None if *exposure == Some(0.0) => linear,
            None => values.exposed,
        };
        let changed = if values.toned == before { "" } else { ", each component between 0 and 1" };
        if values.curve.is_none() {
            writeln!(w, "tone \"{tone}\"{changed}: {}", w.rgb(values.toned));
        } else if !changed.is_empty() {
            writeln!(w, "  between 0 and 1: {}", w.rgb(values.toned));
        }
        writeln!(w, "transfer \"{transfer}\": {}", w.rgb(values.displayed));
        let [r, g, b] = values.bytes;
        let alpha = values.alpha_byte.map_or_else(String::new, |byte| format!(", alpha {byte}"));
        writeln!(w, "bytes in the file {r} {g} {b}  (#{r:02x}{g:02x}{b:02x}){alpha}");
    }
}
