//! What a long render by paths tells of its noise: how long it will be, which pixels hold the noise, and what a clamp
//! would take away.

use crate::format::{count, duration};
use canaletto::film::{NoiseOutlook, SampleStatistics};
use canaletto::render::Job;
use canaletto::world::World;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::time::Duration;

/// An outlook with what a run knows besides.
#[derive(Clone, Debug)]
pub(crate) struct Outlook {
    noise: NoiseOutlook,
    /// The noise that is asked for, and the present one.
    asked: Option<(f32, f32)>,
    /// The objects in the noisiest pixels with their shares of the noise in them, in falling order.
    objects: Vec<(String, f64)>,
    /// The most samples that a pixel gets.
    most_samples: u32,
}

impl Outlook {
    pub(crate) fn new(noise: NoiseOutlook, asked: Option<(f32, f32)>, world: &World, job: &Job) -> Outlook {
        let places = noise.noisiest.as_ref().map_or(&[][..], |noisiest| &noisiest.places);
        let all: f64 = places.iter().map(|(_, share)| share).sum();
        let mut shares: BTreeMap<String, f64> = BTreeMap::new();
        for (place, share) in places {
            *shares.entry(object_at(world, job, *place)).or_default() += share / all;
        }
        let mut objects: Vec<(String, f64)> = shares.into_iter().collect();
        objects.sort_by(|a, b| b.1.total_cmp(&a.1));
        Outlook { noise, asked, objects, most_samples: job.film.sampling.count() }
    }

    /// The seconds that are left by noise, after `seconds` for the samples beyond the first `made_before`.
    pub(crate) fn seconds_left(&self, seconds: f64, made_before: f64) -> Option<f64> {
        let left = self.noise.left.filter(|left| left.made > made_before)?;
        Some(seconds * left.left / (left.made - made_before))
    }

    /// How long it will be, in words.
    pub(crate) fn time_words(&self, seconds_left: f64) -> String {
        let time = duration(Duration::from_secs_f64(seconds_left.clamp(0.0, 1e9)));
        let (Some((asked, noise)), Some(left)) = (self.asked, self.noise.left) else {
            return format!("about {time} left");
        };
        let samples = count(left.most.min(1e15) as u64);
        let noise = if noise.is_finite() { format!("the noise is {noise:.3}; ") } else { String::new() };
        if left.is_out_of_reach {
            let most = count(self.most_samples.into());
            let end = if seconds_left > 0.0 { format!(", in about {time}") } else { String::new() };
            return format!(
                "{noise}{asked} would take about {samples} samples in the noisiest pixels, and they get {most}{end}"
            );
        }
        format!("{noise}{asked} takes about {time} more, and {samples} samples in the noisiest pixels")
    }

    /// Where the noise is, and what a clamp would take away, in words.
    pub(crate) fn noise_words(&self) -> Vec<String> {
        let mut words = Vec::new();
        if let Some(noisiest) = &self.noise.noisiest
            && let Some(([x, y], _)) = noisiest.places.first()
        {
            let objects: Vec<String> = self
                .objects
                .iter()
                .take(2)
                .filter(|(_, share)| *share >= 0.1)
                .map(|(name, share)| match *share {
                    share if share > 0.995 => name.clone(),
                    share => format!("{:.0}% of it {name}", share * 100.0),
                })
                .collect();
            let objects = if objects.is_empty() { "many objects".to_owned() } else { objects.join(", ") };
            words.push(format!(
                "{} of the pixels hold {} of the noise, the noisiest at {x},{y}: {objects}",
                percent(noisiest.pixels),
                percent(noisiest.noise)
            ));
        }
        if let Some(clamp) = self.noise.clamp {
            let limit = SampleStatistics::TRIED_CLAMP;
            words.push(match clamp.light > 0.0 {
                true => format!(
                    "--clamp {limit} would take away {} of the light and {} of the noise",
                    percent(clamp.light),
                    percent(clamp.noise)
                ),
                false => format!("--clamp {limit} would take away nothing"),
            });
        }
        words
    }

    /// The fields of an event.
    pub(crate) fn json(&self) -> Value {
        let noisiest = self.noise.noisiest.as_ref().map(|noisiest| {
            let objects = self
                .objects
                .iter()
                .take(8)
                .map(|(name, share)| json!({ "object": name.trim_matches('"'), "share": share }));
            json!({
                "pixels": noisiest.pixels, "noise": noisiest.noise,
                "pixel": noisiest.places.first().map(|(place, _)| place), "objects": objects.collect::<Vec<_>>(),
            })
        });
        let clamp = self
            .noise
            .clamp
            .map(|clamp| json!({ "clamp": SampleStatistics::TRIED_CLAMP, "light": clamp.light, "noise": clamp.noise }));
        json!({
            "samples_needed": self.noise.left.map(|left| left.most), "out_of_reach": self.noise.left.map(|left| left.is_out_of_reach),
            "noisiest": noisiest, "clamp": clamp,
        })
    }
}

/// A share in per cent, with as many digits as tell something.
fn percent(share: f64) -> String {
    match share * 100.0 {
        zero if zero <= 0.0 => "0%".into(),
        small if small < 0.01 => "less than 0.01%".into(),
        some if some < 0.1 => format!("{some:.2}%"),
        more if more < 10.0 => format!("{more:.1}%"),
        much => format!("{much:.0}%"),
    }
}

/// The name of the object that a pixel's centre shows.
fn object_at(world: &World, job: &Job, [x, y]: [u32; 2]) -> String {
    let [_, height] = job.camera.size();
    let ray = job.camera.ray(f64::from(x) + 0.5, f64::from(height) - f64::from(y) - 0.5, [0.5; 2], 0.0, None);
    let hit = world.intersect(&ray.line.rounded(), f32::INFINITY);
    hit.map_or_else(|| "the background".to_owned(), |hit| format!("\"{}\"", world.object(&hit).name))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_have_digits_that_tell_something() {
        let told: Vec<String> = [0.0, 1e-5, 0.0005, 0.0024, 0.05, 0.6].map(percent).into();
        assert_eq!(told, ["0%", "less than 0.01%", "0.05%", "0.2%", "5.0%", "60%"]);
    }
}
