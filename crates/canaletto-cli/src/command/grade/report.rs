//! The report of a grade, as text and as JSON.

use super::GradeFlags;
use crate::command::info::quoted;
use crate::format::{JSON_VERSION, plural, short};
use canaletto::Named;
use canaletto::grade::{EvidencePixel, Grade, Hypothesis, Remark, Verdict, WrongRegion};
use canaletto::scene::Stage;
use serde_json::{Value, json};
use std::cmp::Ordering;

/// A grade with everything that its report needs.
pub(super) struct GradeReport<'a> {
    pub(super) flags: &'a GradeFlags,
    pub(super) scene: String,
    pub(super) camera: String,
    /// The size of the picture.
    pub(super) size: [u32; 2],
    /// The size that the scene asks for.
    pub(super) own_size: [u32; 2],
    pub(super) grade: Grade,
}

/// The most other hypotheses that are listed.
const OTHERS: usize = 4;

fn verdict_name(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Right => "right",
        Verdict::Unfinished => "unfinished",
        Verdict::Mistaken => "mistaken",
        _ => "unexplained",
    }
}

impl GradeReport<'_> {
    /// The stages that the picture lacks.
    fn missing(&self) -> Vec<Stage> {
        let last = self.grade.hypotheses.iter().map(|guess| guess.stage).max().unwrap_or(Stage::Full);
        Stage::ALL.iter().copied().filter(|stage| *stage > self.grade.stage && *stage <= last).collect()
    }

    pub(super) fn text(&self) -> String {
        let grade = &self.grade;
        let mut out = String::new();
        let student = self.flags.student.display();
        match (grade.verdict, grade.mistake) {
            (Verdict::Right, _) => out += &format!("{student} is right\n"),
            (Verdict::Unfinished, _) => {
                out += &format!("{student} is right up to the stage \"{}\"\n", grade.stage.name());
            }
            (Verdict::Mistaken, Some(mistake)) => {
                out += &format!("{student} has a mistake: {}\n{}\n", mistake.name(), mistake.meaning());
            }
            _ => {
                out += &format!(
                    "{student} differs from the scene, and no known mistake explains it; the stage \"{}\" is nearest\n",
                    grade.stage.name()
                );
            }
        }
        if let Some(finding) = &grade.finding {
            out += &format!("found      {}\n", finding.words);
            out += &format!("look       {}\n", finding.look.trim_start_matches("look at "));
        }
        for remark in &grade.remarks {
            let about = grade.filter.filter(|_| *remark == Remark::OtherFilter);
            let about = about.map(|filter| format!(", about {filter}")).unwrap_or_default();
            out += &format!("remark     {}{about}\n", remark.meaning());
        }
        for mistake in &grade.also {
            out += &format!("or         {}: {}\n", mistake.name(), mistake.meaning());
        }
        for stage in self.missing() {
            out += &format!("missing    {}: {}\n", stage.name(), stage.meaning().trim_start_matches("+ "));
        }
        if self.size != self.own_size {
            let [[w, h], [own_w, own_h]] = [self.size, self.own_size];
            out += &format!("size       {w} x {h} in place of the scene's {own_w} x {own_h}; graded as {w} x {h}\n");
        }
        out += &format!(
            "error      {} steps of 8 bits against the right picture, mean of {}\n",
            short(grade.error),
            plural(grade.compared as u64, "pixel")
        );
        if grade.verdict != Verdict::Right && !grade.left_out.is_empty() {
            out += &format!("left out   {}; mistakes may be missed\n", grade.left_out.join(", "));
        }
        for region in &grade.regions {
            out += &format!("wrong      {}\n", region_words(region));
        }
        for region in &grade.left_over {
            out += &format!("left over  {}\n", region_words(region));
        }
        for pixel in &grade.evidence {
            out += &format!("pixel      {}\n", pixel_words(pixel));
        }
        if grade.verdict != Verdict::Right {
            out += "explanations, by their errors\n";
            let mut listed: Vec<String> = Vec::new();
            for guess in &grade.hypotheses {
                // Forms of one mistake have one name.
                let words = guess_words(guess);
                if listed.len() < OTHERS && !listed.contains(&words) {
                    out += &format!("  {:>9.4}  {words}\n", guess.error);
                    listed.push(words);
                }
            }
        }
        if let Some(pixel) = grade.evidence.first() {
            out += &format!("see        {}\n", self.explain_command(pixel));
        }
        out
    }

    /// The command that explains what is right at a pixel.
    fn explain_command(&self, pixel: &EvidencePixel) -> String {
        let (flags, [x, y]) = (self.flags, pixel.pixel);
        let mut words = vec!["canaletto".into(), "explain".into(), self.scene.clone()];
        let mut flag = |name: &str, value: String| words.extend([name.to_owned(), value]);
        if flags.picture.size.is_some() || self.size != self.own_size {
            flag("--size", format!("{}x{}", self.size[0], self.size[1]));
        }
        flags.source.set.iter().for_each(|set| flag("--set", set.clone()));
        flags.source.staging.given().into_iter().for_each(|(name, value)| flag(&format!("--{name}"), value));
        flags.picture.camera.iter().for_each(|camera| flag("--camera", camera.clone()));
        flags.frame.iter().for_each(|frame| flag("--frame", frame.to_string()));
        flags.picture.stage.iter().for_each(|stage| flag("--stage", stage.name().into()));
        flag("--pixel", format!("{x},{y}"));
        words.iter().map(|word| quoted(word)).collect::<Vec<_>>().join(" ")
    }

    pub(super) fn json(&self) -> Value {
        let grade = &self.grade;
        let evidence = grade.evidence.iter().map(|pixel| {
            json!({
                "pixel": pixel.pixel,
                "object": pixel.object,
                "student": pixel.student.map(byte),
                "right": pixel.right.map(byte),
                "mistaken": pixel.mistaken.map(byte),
            })
        });
        let hypotheses = grade.hypotheses.iter().map(|guess| {
            json!({
                "stage": guess.stage.name(),
                "mistake": guess.mistake.map(|mistake| mistake.name()),
                "error": guess.error,
            })
        });
        json!({
            "version": JSON_VERSION,
            "scene": self.scene,
            "camera": self.camera,
            "picture": self.flags.student,
            "size": self.size,
            "scene_size": self.own_size,
            "verdict": verdict_name(grade.verdict),
            "stage": grade.stage.name(),
            "missing": self.missing().iter().map(|stage| stage.name()).collect::<Vec<_>>(),
            "mistake": grade.mistake.map(|mistake| mistake.name()),
            "also": grade.also.iter().map(|mistake| mistake.name()).collect::<Vec<_>>(),
            "meaning": grade.mistake.map(|mistake| mistake.meaning()),
            "finding": grade.finding.as_ref().map(|finding| json!({
                "subject": finding.subject,
                "words": finding.words,
                "look": finding.look,
                "expected": finding.expected,
                "found": finding.found,
                "factor": finding.factor,
            })),
            "remarks": grade.remarks.iter().map(|remark| remark.name()).collect::<Vec<_>>(),
            "filter": grade.filter.map(|filter| filter.to_string()),
            "regions": grade.regions.iter().map(region_json).collect::<Vec<_>>(),
            "left_over": grade.left_over.iter().map(region_json).collect::<Vec<_>>(),
            "error": grade.error,
            "compared": grade.compared,
            "left_out": grade.left_out,
            "evidence": evidence.collect::<Vec<_>>(),
            "hypotheses": hypotheses.collect::<Vec<_>>(),
        })
    }
}

fn region_json(region: &WrongRegion) -> Value {
    json!({
        "object": region.object,
        "pixels": region.pixels,
        "difference": region.difference,
        "worst": region.worst,
    })
}

/// Where and how a picture differs from the right one.
fn region_words(region: &WrongRegion) -> String {
    let object = region.object.as_deref().unwrap_or("the background");
    let [r, g, b] = region.difference.map(|v| v.round());
    let how = match (r + g + b).partial_cmp(&0.0) {
        _ if r.abs().max(g.abs()).max(b.abs()) > 2.0 * (r + g + b).abs() => "of another colour",
        Some(Ordering::Greater) => "too bright",
        _ => "too dark",
    };
    let [x, y] = region.worst;
    format!(
        "{} of {object} are {how}: by {r} {g} {b} steps in the mean, most at {x},{y}",
        plural(region.pixels as u64, "connected pixel")
    )
}

fn byte(v: f32) -> f32 {
    (v * 255.0).round()
}

fn guess_words(guess: &Hypothesis) -> String {
    let stage = guess.stage.name();
    guess.mistake.map_or_else(|| format!("stage {stage}"), |mistake| format!("stage {stage} with {}", mistake.name()))
}

fn pixel_words(pixel: &EvidencePixel) -> String {
    let words = |v: [f32; 3]| v.map(|v| byte(v).to_string()).join(" ");
    let ([x, y], object) = (pixel.pixel, pixel.object.as_deref().unwrap_or("the background"));
    format!(
        "{x},{y} on {object}: {} is right, the picture has {}, the explanation {}",
        words(pixel.right),
        words(pixel.student),
        words(pixel.mistaken)
    )
}
