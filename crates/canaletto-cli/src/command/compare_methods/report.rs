//! The report of a comparison of methods, as text and as JSON.

use super::{CompareMethodsFlags, Limit, MethodComparison, word_of};
use crate::format::{JSON_VERSION, count, plural};
use canaletto::Named;
use canaletto::causes::{Cause, WorstPixel};
use serde_json::{Value, json};
use std::path::PathBuf;

/// All comparisons with the reference, and the files.
pub(super) struct MethodsReport<'a> {
    pub(super) flags: &'a CompareMethodsFlags,
    pub(super) scene: String,
    pub(super) camera: String,
    pub(super) size: [u32; 2],
    /// The name of the reference's integrator.
    pub(super) reference: &'static str,
    /// The file of each method's picture.
    pub(super) files: Vec<(&'static str, PathBuf)>,
    /// The file of the picture of causes.
    pub(super) file: PathBuf,
    pub(super) comparisons: Vec<MethodComparison>,
}

impl MethodsReport<'_> {
    /// The limits that are exceeded, with the methods.
    pub(super) fn exceeded(&self) -> Vec<(&'static str, &Limit)> {
        let mut all = Vec::new();
        for MethodComparison { method, causes } in &self.comparisons {
            for limit in &self.flags.threshold {
                let pixels = limit.cause.map_or_else(|| causes.differing(), |cause| causes.count(cause));
                if pixels > limit.pixels {
                    all.push((*method, limit));
                }
            }
        }
        all
    }

    fn pixels(&self) -> u64 {
        u64::from(self.size[0]) * u64::from(self.size[1])
    }

    pub(super) fn text(&self) -> String {
        let mut out = String::new();
        for (name, file) in &self.files {
            let role = if *name == self.reference { ", the reference" } else { "" };
            out += &format!("{name:<15} {}{role}\n", file.display());
        }
        out += &format!("{:<15} {}\n", "causes", self.file.display());
        let percent = |n: u64| n as f64 * 100.0 / self.pixels() as f64;
        for MethodComparison { method, causes } in &self.comparisons {
            let (differing, pixels) = (causes.differing(), plural(self.pixels(), "pixel"));
            out += &format!(
                "\n{method} against {}: {} of {pixels} differ ({:.2}%)\n",
                self.reference,
                count(differing),
                percent(differing)
            );
            for worst in &causes.worst {
                let n = causes.count(worst.cause);
                out += &format!("  {:<15} {:>9} {:>6.2}%  {}\n", worst.cause.name(), count(n), percent(n), told(worst));
            }
            for ([first, second], n) in causes.pairs.iter().take(MOST_PAIRS) {
                out += &format!("    {} and {} in {}\n", first.name(), second.name(), plural(*n, "pixel"));
            }
            let others: u64 = causes.pairs.iter().skip(MOST_PAIRS).map(|(_, n)| n).sum();
            if others > 0 {
                out += &format!("    others in {}\n", plural(others, "pixel"));
            }
        }
        for (method, limit) in self.exceeded() {
            let word = word_of(limit.cause);
            out += &format!("{method}: {word} is over the threshold {}\n", limit.pixels);
        }
        out
    }

    pub(super) fn json(&self) -> Value {
        let comparisons = self.comparisons.iter().map(|MethodComparison { method, causes }| {
            let each = causes.worst.iter().map(|worst| {
                let n = causes.count(worst.cause);
                json!({ "cause": worst.cause.name(), "pixels": n, "worst": worst_json(worst) })
            });
            let pairs = causes.pairs.iter().map(|(pair, n)| json!({ "causes": pair.map(|c| c.name()), "pixels": n }));
            json!({
                "method": method,
                "differing": causes.differing(),
                "causes": each.collect::<Vec<_>>(),
                "pairs": pairs.collect::<Vec<_>>(),
            })
        });
        let files = self.files.iter().map(|(name, file)| json!({ "name": name, "file": file }));
        let exceeded = self
            .exceeded()
            .into_iter()
            .map(|(method, limit)| json!({ "method": method, "cause": word_of(limit.cause), "limit": limit.pixels }));
        json!({
            "version": JSON_VERSION,
            "scene": self.scene,
            "camera": self.camera,
            "size": self.size,
            "pixels": self.pixels(),
            "tolerance": self.flags.tolerance,
            "reference": self.reference,
            "methods": files.collect::<Vec<_>>(),
            "picture": self.file,
            "comparisons": comparisons.collect::<Vec<_>>(),
            "exceeded": exceeded.collect::<Vec<_>>(),
        })
    }
}

/// The most pairs of causes that the text lists.
const MOST_PAIRS: usize = 4;

/// The worst pixel of a cause in words.
fn told(worst: &WorstPixel) -> String {
    let [x, y] = worst.pixel;
    let mut text = format!("worst at {x},{y}: {:.1} steps", worst.steps);
    let name = |object: &Option<String>| object.clone().unwrap_or_else(|| "the background".into());
    match (worst.cause, &worst.light) {
        (Cause::Unexplained, _) => {}
        (_, Some(light)) => text += &format!(", {light} on {}", name(&worst.object)),
        _ if worst.object == worst.other_object => text += &format!(", on {}", name(&worst.object)),
        _ => text += &format!(", {} in place of {}", name(&worst.other_object), name(&worst.object)),
    }
    text
}

fn worst_json(worst: &WorstPixel) -> Value {
    let shares = worst.shares.iter().map(|(cause, share)| json!({ "cause": cause.name(), "share": share }));
    json!({
        "pixel": worst.pixel,
        "steps": worst.steps,
        "shares": shares.collect::<Vec<_>>(),
        "object": worst.object,
        "other_object": worst.other_object,
        "light": worst.light,
    })
}
