//! The report of a comparison, as text and as JSON.

use super::{CompareFlags, Threshold};
use crate::format::JSON_VERSION;
use canaletto::Named;
use canaletto_io::picture::{ChannelDifference, Comparison, Image, RestDifference, Window};
use serde_json::{Value, json};

/// A comparison with everything that its report needs.
pub(super) struct ComparisonReport<'a> {
    pub(super) flags: &'a CompareFlags,
    pub(super) result: Comparison,
    pub(super) rest: RestDifference,
    /// The parts of each file that were not compared.
    pub(super) left_out: [Vec<String>; 2],
    pub(super) colors_differ: bool,
    /// Whether plain numbers were compared instead of colours.
    pub(super) raw: bool,
    pub(super) image: &'a Image,
}

impl ComparisonReport<'_> {
    /// Whether the pictures have no difference and no part that was left out.
    fn equal(&self) -> bool {
        self.result.differing == 0 && self.rest.is_none() && self.left_out.iter().all(Vec::is_empty)
    }

    fn names(&self) -> [String; 2] {
        [&self.flags.a, &self.flags.b].map(|path| path.display().to_string())
    }

    pub(super) fn text(&self) -> String {
        let what =
            self.flags.layer.as_ref().map_or_else(|| "pictures".to_owned(), |layer| format!("layers \"{layer}\""));
        if self.equal() {
            return format!("the {what} are equal\n");
        }
        let result = &self.result;
        let pixels = u64::from(self.image.width) * u64::from(self.image.height);
        let mut out = String::new();
        if self.colors_differ {
            let max = &result.max;
            out += &format!("rmse       {:.6}\n", result.rmse);
            if !self.raw {
                out += &format!("psnr       {:.2} dB\n", result.psnr);
            }
            out += &format!("max        {:.6} at {},{} in {}\n", max.value, max.x, max.y, max.channel);
        } else {
            out += match (&self.flags.layer, &self.rest.unseen) {
                (Some(_), None) => "the layers' numbers are equal\n",
                (None, None) => "the colours are equal\n",
                (_, Some(_)) => "the colours are equal as they are seen, from 0 to 1\n",
            };
        }
        if result.differing > 0 {
            let percent = result.differing as f64 * 100.0 / pixels as f64;
            out += &format!("differing  {} of {pixels} pixels ({percent:.2}%)\n", result.differing);
        }
        if self.colors_differ && !self.raw {
            let ssim = result.ssim.map_or("undefined under 11 x 11 pixels".to_owned(), |v| format!("{v:.6}"));
            out += &format!("ssim       {ssim}\nflip       {:.6}\n", result.flip);
        }
        if let Some(found) = &self.rest.unseen {
            let ([x, y], channel) = (found.at, &found.channel);
            out += &format!(
                "linear light differs unseen in {} pixels, by up to {:.6} at {x},{y} in {channel} (--linear compares \
                 it)\n",
                found.differing, found.max
            );
        }
        for found in &self.rest.channels {
            let name = if found.channel == "A" { "alpha" } else { &found.channel };
            let [x, y] = found.at;
            out += &format!("{name} differs in {} pixels, by up to {:.6} at {x},{y}\n", found.differing, found.max);
        }
        for ((channels, parts), name) in self.rest.only.iter().zip(&self.left_out).zip(self.names()) {
            if !channels.is_empty() {
                out += &format!("only in {name}, not compared: {}\n", channels.join(", "));
            }
            if !parts.is_empty() {
                out += &format!("parts of {name} with another size or place, not compared: {}\n", parts.join(", "));
            }
        }
        if let Some(windows) = &self.rest.windows {
            let [a, b] = windows.map(|Window { at: [x, y], whole: [w, h] }| format!("at {x},{y} of {w} x {h} pixels"));
            out += &format!("the pictures are parts of larger ones: {a} and {b}\n");
        }
        if let Some(curves) = self.rest.curves {
            let [a, b] = curves.map(|curve| curve.name());
            out += &format!(
                "the files declare different curves, {a} and {b}; their numbers were compared as they are stored\n"
            );
        }
        out
    }

    pub(super) fn json(&self, exceeded: &[&Threshold]) -> Value {
        let result = &self.result;
        let number = |v: f64| if v.is_finite() { json!(v) } else { json!("infinity") };
        let colors = |v: Value| if self.raw { Value::Null } else { v };
        let channel = |found: &ChannelDifference| json!({ "channel": found.channel, "differing": found.differing, "max": number(found.max), "at": found.at });
        let window = |w: &Window| json!({ "at": w.at, "whole": w.whole });
        json!({
            "version": JSON_VERSION,
            "equal": self.equal(),
            "mse": number(result.mse),
            "rmse": number(result.rmse),
            "psnr": colors(number(result.psnr)),
            "max": {
                "x": result.max.x, "y": result.max.y, "channel": result.max.channel, "value": number(result.max.value),
            },
            "differing": result.differing,
            "ssim": colors(json!(result.ssim)),
            "flip": colors(json!(result.flip)),
            "linear": self.flags.linear,
            "layer": self.flags.layer,
            "unseen": self.rest.unseen.as_ref().map(channel),
            "channels": self.rest.channels.iter().map(channel).collect::<Vec<_>>(),
            "only_in_a": self.rest.only[0],
            "only_in_b": self.rest.only[1],
            "left_out": self.left_out,
            "windows": self.rest.windows.as_ref().map(|windows| windows.each_ref().map(window)),
            "curves": self.rest.curves.map(|curves| curves.map(|curve| curve.name())),
            "exceeded": exceeded.iter().map(|t| t.metric.name()).collect::<Vec<_>>(),
        })
    }
}
