//! Where a picture differs from a hypothesis: connected pixels of one object. A mean over all pixels would forgive a
//! small highlight that is wrong.

use super::display::srgb_decode;
use super::filter::PictureFilter;
use super::finding::WrongRegion;
use super::left_out::means;
use super::seen::Seen;
use super::tracer::{Tracer, TracerSettings};
use super::{Grader, Guess, PLACES};
use crate::scene::Transfer;
use canaletto_parallel::prelude::*;
use glam::DVec3;
use std::cell::Cell;

/// The most pixels of a picture that is searched.
const MOST_PIXELS: usize = 2_000_000;
/// The largest difference in steps of 8 bits of equal colours: rounding up or down.
const ROUNDED: f64 = 1.6;
/// As [`ROUNDED`], for means over pixels that were compressed with losses. Hues lose most.
const COMPRESSED: f64 = 10.0;
/// As [`ROUNDED`], for textures, which other programs filter otherwise.
const TEXTURED: f64 = 12.0;
/// The difference between neighbours in steps of 8 bits from which on other filters smear the colours around.
const JUMP: f64 = 16.0;
/// The share of a jump by which a filter may go beyond it.
const OVERSHOOT: f64 = 0.15;
/// The fewest pixels of a small highlight that no filter makes of its neighbours.
const FEWEST_BEYOND: usize = 4;
/// The most regions that are listed.
const MOST_REGIONS: usize = 4;
/// The share of the colours' range around a pixel by which a filter that fits best is off.
const INEXACT: f64 = 0.06;
/// As [`INEXACT`], for the sum of light over 5 × 5 pixels.
const SUM_INEXACT: f64 = 0.25;
/// The least mean difference of a small highlight in steps of 8 bits.
const LEAST_MEAN: f64 = 0.5;
/// The largest difference of a pixel in steps of 8 bits that doesn't count in a sum: rounding down.
const SUM_ROUNDED: f64 = 1.1;
/// The sum of differences of light in steps of 8 bits that is none.
const FEWEST_STEPS: f64 = 12.0;
/// The most wrong pixels of which each is looked at for what is smaller than a pixel.
const MOST_FOUND: usize = 400;
/// The largest error of a pixel in steps of 8 bits.
const MOST_ERROR: f64 = 40.0;
/// How many standard deviations of the noise by random places of rays are no difference.
const DEVIATIONS: f64 = 3.0;

/// What a picture is found to be against a hypothesis.
pub(super) struct Judgement {
    /// Where it differs.
    pub(super) regions: Vec<WrongRegion>,
    /// The mean difference in steps of 8 bits beyond the noise, under the filter that fits best; none if no filter was
    /// looked for.
    pub(super) error: Option<f64>,
    /// The picture's filter, if it is clearly another one than the pixel's mean.
    pub(super) filter: Option<PictureFilter>,
}

/// A hypothesis beside the student's picture, in display values.
#[derive(Clone, Copy)]
struct Compared<'a> {
    shown: &'a [DVec3],
    student: &'a [DVec3],
    /// The differences that are none.
    slack: &'a [DVec3],
    /// The standard deviation by random places of rays.
    noise: &'a [DVec3],
}

impl Compared<'_> {
    /// The difference of a pixel in steps of 8 bits.
    fn difference(&self, i: usize) -> DVec3 {
        (self.student[i] - self.shown[i]) * 255.0
    }

    fn is_different(&self, i: usize) -> bool {
        self.is_beyond([self.shown[i]; 2], i)
    }

    /// Whether a pixel of the student is beyond a range.
    fn is_beyond(&self, [low, high]: [DVec3; 2], i: usize) -> bool {
        (self.student[i].cmpgt(high + self.slack[i]) | self.student[i].cmplt(low - self.slack[i])).any()
    }
}

/// A rule that takes a region or not, by its pixels and by whether a column and a row belong to it.
type RegionRule<'a> = &'a dyn Fn(&[usize], &dyn Fn(i64, i64) -> bool) -> bool;

impl Grader<'_> {
    /// The connected pixels of one object that differ from a hypothesis, the largest regions first. Thin lines don't
    /// count, since edges depend on where exactly rays go.
    pub(super) fn judged(&self, guess: &Guess<'_>) -> Judgement {
        let [_, _, width, height] = self.job.window();
        let (w, h) = (width as usize, height as usize);
        if w * h > MOST_PIXELS {
            return Judgement { regions: Vec::new(), error: None, filter: None };
        }
        let seen = self.seen_of(guess);
        let all: Vec<u32> = (0..width * height).collect();
        let filtered = self.filtered(guess);
        let filter = filtered.as_ref().filter(|filtered| filtered.is_other).map(|filtered| filtered.filter);
        let reach = filtered.as_ref().map(|filtered| filtered.reach);
        let (shown, noise) = match filtered {
            Some(filtered) => (filtered.shown, filtered.noise),
            None => (self.shown_at(seen, guess.settings, &all, self.place, false), vec![DVec3::ZERO; w * h]),
        };
        let compressed = self.student.is_compressed();
        let student: Vec<DVec3> = if compressed {
            means(&self.student.pixels, w, 2)
        } else {
            self.student.pixels.iter().map(|c| DVec3::from(c.map(f64::from))).collect()
        };
        let around = |at: usize, by: usize, side: usize| at.saturating_sub(by)..(at + by + 1).min(side);
        let range = |index: usize, by: usize| {
            let mut range = [DVec3::INFINITY, DVec3::NEG_INFINITY];
            for y in around(index / w, by, h) {
                for x in around(index % w, by, w) {
                    range = [range[0].min(shown[y * w + x]), range[1].max(shown[y * w + x])];
                }
            }
            range
        };
        let limit = if compressed { COMPRESSED } else { ROUNDED + 3.0 * self.noise() };
        let slack_of = |index: usize, steps: f64| DVec3::splat(steps / 255.0) + DEVIATIONS * noise[index];
        let beyond = |[low, high]: [DVec3; 2], index: usize, slack: f64| {
            let (v, slack) = (student[index], slack_of(index, slack));
            let over = (v - high - slack).max(DVec3::ZERO) - (low - slack - v).max(DVec3::ZERO);
            over * 255.0
        };
        let clear: Vec<bool> = if compressed {
            let mut clear = vec![false; w * h];
            self.student.compared().iter().for_each(|index| clear[*index as usize] = true);
            clear
        } else {
            vec![true; w * h]
        };
        let differs = |index: &u32| {
            let i = *index as usize;
            let by = if compressed { 3 } else { 1 };
            let own = range(i, by);
            if !clear[i] || beyond(own, i, limit).abs().max_element() == 0.0 {
                return None;
            }
            // Where colours jump nearby, filters smear.
            let wide = range(i, by + 1);
            let jump = (wide[1] - wide[0]).max_element() * 255.0;
            let near = if jump > JUMP { wide } else { own };
            let slack = limit + if jump > JUMP { OVERSHOOT * jump } else { 0.0 };
            if beyond(near, i, slack).abs().max_element() == 0.0 {
                return None;
            }
            Some(*index)
        };
        let mut wrong: Vec<u32> = all.par_iter().filter_map(differs).collect();
        // What is smaller than a pixel shows at some of its places.
        let places: Vec<(u32, [f64; 2])> =
            wrong.iter().flat_map(|index| PLACES.iter().map(|place| (*index, *place))).collect();
        let finer = self.displayed_at(seen, guess.settings, &places, false);
        let still = |(i, index): (usize, &u32)| {
            let own = range(*index as usize, 1);
            let finer = &finer[i * PLACES.len()..(i + 1) * PLACES.len()];
            let [low, high] = finer.iter().fold(own, |[low, high], v| [low.min(*v), high.max(*v)]);
            (beyond([low, high], *index as usize, limit).abs().max_element() > 0.0).then_some(*index)
        };
        wrong = wrong.iter().enumerate().filter_map(still).collect();
        let mut object = vec![u32::MAX; w * h];
        for index in &wrong {
            let hit = self.first_hit(seen, *index);
            let (id, textured) = hit.map_or((0, seen.world().environment.is_some()), |hit| {
                (seen.world().object_id(&hit), !seen.world().material(&hit).is_plain())
            });
            let slack = if textured { TEXTURED } else { 0.0 };
            let i = *index as usize;
            if beyond(range(i, 1), i, limit + slack).abs().max_element() > 0.0 {
                object[i] = id;
            }
        }
        let slack: Vec<DVec3> = (0..w * h).map(|i| slack_of(i, limit)).collect();
        let both = Compared { shown: &shown, student: &student, slack: &slack, noise: &noise };
        let mut found = self.connected(seen, both, &object, &|region, is_own| {
            // Thin lines are edges.
            region.iter().any(|i| {
                let (x, y) = ((*i % w) as i64, (*i / w) as i64);
                (-1..=1).all(|dy| (-1..=1).all(|dx| is_own(x + dx, y + dy)))
            })
        });
        if !compressed {
            found.extend(match reach {
                Some(reach) => self.filtered_highlights(seen, guess.settings, both, reach),
                None => self.highlights(seen, guess.settings, both),
            });
        }
        // The same pixels are told once.
        let mut told: Vec<WrongRegion> = Vec::new();
        found.sort_by(|a, b| b.pixels.cmp(&a.pixels).then(a.worst.cmp(&b.worst)));
        for region in found {
            if told.iter().all(|other| other.worst != region.worst || other.object != region.object) {
                told.push(region);
            }
        }
        told.truncate(MOST_REGIONS);
        let error = |i: usize| {
            let d = (student[i] - shown[i]).abs() - DEVIATIONS * noise[i];
            (d.max_element() * 255.0 - self.student.tolerance).clamp(0.0, MOST_ERROR)
        };
        let error = reach.map(|_| (0..w * h).map(error).sum::<f64>() / (w * h).max(1) as f64);
        Judgement { regions: told, error, filter }
    }

    /// The noise of the picture in steps of 8 bits: the median difference of a pixel from the mean of its neighbours,
    /// less that by rounding. Some programs splat few samples with wide filters.
    fn noise(&self) -> f64 {
        const BY_ROUNDING: f64 = 0.6;
        let [_, _, width, _] = self.job.window();
        let steps = |i: usize| DVec3::from(self.student.pixels[i].map(|v| f64::from(v) * 255.0));
        let is_inner = |i: usize| {
            let column = i % width as usize;
            column > 0 && column + 1 < width as usize && !self.edges[i]
        };
        let off = |i: usize| (steps(i) - (steps(i - 1) + steps(i + 1)) * 0.5).abs().max_element();
        let mut all: Vec<f64> = (0..self.edges.len()).filter(|i| is_inner(*i)).map(off).filter(|v| *v > 0.0).collect();
        if all.is_empty() {
            return 0.0;
        }
        let middle = all.len() / 2;
        let (_, median, _) = all.select_nth_unstable_by(middle, f64::total_cmp);
        (*median - BY_ROUNDING).max(0.0)
    }

    /// Small highlights that are wrong. They lie where colours are smooth, and most of their pixels differ to one side.
    /// Filters and other places of rays keep the sum of a highlight.
    fn highlights(&self, seen: &Seen<'_>, settings: TracerSettings, both: Compared<'_>) -> Vec<WrongRegion> {
        let Compared { shown, student, .. } = both;
        let [_, _, width, height] = self.job.window();
        let (w, h) = (width as usize, height as usize);
        let met = self.met(seen, settings);
        let (by, off) = if self.is_sharp { (1, 0.1) } else { (2, 0.5) };
        let around = |at: usize, by: usize, side: usize| at.saturating_sub(by)..(at + by + 1).min(side);
        let is_smooth = |index: &u32| {
            let i = *index as usize;
            around(i / w, by, h).all(|y| around(i % w, by, w).all(|x| met[y * w + x] == met[i]))
        };
        let pixels: Vec<u32> =
            (0..width * height).filter(|index| both.is_different(*index as usize)).filter(is_smooth).collect();
        let near = |place: &[f64; 2]| {
            let middle = if self.is_sharp { self.place } else { [0.5; 2] };
            [0, 1].map(|axis| middle[axis] + (place[axis] - 0.5) * 2.0 * off)
        };
        let places: Vec<(u32, [f64; 2])> =
            pixels.iter().flat_map(|index| PLACES.iter().map(|place| (*index, near(place)))).collect();
        let finer = self.displayed_at(seen, settings, &places, false);
        let mut object = vec![u32::MAX; w * h];
        for (n, index) in pixels.iter().enumerate() {
            let i = *index as usize;
            let finer = &finer[n * PLACES.len()..(n + 1) * PLACES.len()];
            let ends = finer.iter().fold([shown[i]; 2], |[low, high], v| [low.min(*v), high.max(*v)]);
            if let Some(hit) = self.first_hit(seen, *index)
                && both.is_beyond(ends, i)
                && seen.world().material(&hit).is_plain()
            {
                object[i] = seen.world().object_id(&hit);
            }
        }
        self.connected(seen, both, &object, &|region, _| {
            // A highlight that is smeared or moved by less than a pixel lies on both sides of the region.
            let mut nearby: Vec<usize> = region.to_vec();
            if !self.is_sharp {
                for i in region {
                    for y in around(i / w, 3, h) {
                        nearby.extend(around(i % w, 3, w).map(|x| y * w + x));
                    }
                }
                nearby.sort_unstable();
                nearby.dedup();
                nearby.retain(|i| met[*i] == met[region[0]] && both.is_different(*i));
            }
            let (mut sum, mut all) = (DVec3::ZERO, DVec3::ZERO);
            for i in &nearby {
                let d = (self.light(student[*i]) - self.light(shown[*i])) * 255.0;
                (sum, all) = (sum + d, all + d.abs());
            }
            let least = if region.len() > 1 { 12.0 } else { 40.0 };
            let is_beyond = |i: &&usize| {
                let mut range = [DVec3::INFINITY, DVec3::NEG_INFINITY];
                for y in around(**i / w, 1, h) {
                    for x in around(**i % w, 1, w) {
                        range = [range[0].min(shown[y * w + x]), range[1].max(shown[y * w + x])];
                    }
                }
                both.is_beyond(range, **i)
            };
            let beyond = region.iter().filter(is_beyond).count();
            let one_sided = (0..3).any(|c| sum[c].abs() >= least && sum[c].abs() >= 0.5 * all[c]);
            one_sided || beyond >= FEWEST_BEYOND || self.is_sharp && all.max_element() >= least
        })
    }

    /// As [`Self::highlights`], of a hypothesis under the picture's filter. Two pixels beyond the noise side by side
    /// are wrong, and so is a sum of light beyond the noise of sums.
    fn filtered_highlights(
        &self,
        seen: &Seen<'_>,
        settings: TracerSettings,
        both: Compared<'_>,
        reach: f64,
    ) -> Vec<WrongRegion> {
        let Compared { shown, student, noise, .. } = both;
        let [_, _, width, height] = self.job.window();
        let (w, h) = (width as usize, height as usize);
        let met = self.met(seen, settings);
        let square = |i: usize, by: usize| {
            let around = move |at: usize, side: usize| at.saturating_sub(by)..(at + by + 1).min(side);
            around(i / w, h).flat_map(move |y| around(i % w, w).map(move |x| y * w + x))
        };
        let rounded = DVec3::splat(SUM_ROUNDED / 255.0);
        // Whether a pixel is wrong, and whether a sum is.
        let look = |index: u32| {
            let i = index as usize;
            if square(i, 2).any(|j| met[j] != met[i]) {
                return [false; 2];
            }
            let ends = |[low, high]: [DVec3; 2], j: usize| [low.min(shown[j]), high.max(shown[j])];
            let [low, high] = square(i, 2).fold([shown[i]; 2], ends);
            let inexact = INEXACT * (high - low);
            let is_wrong = both.is_beyond([shown[i] - inexact, shown[i] + inexact], i);
            let [mut sum, mut variance] = [DVec3::ZERO; 2];
            for j in square(i, 2) {
                let light = self.light(shown[j]);
                // The difference beyond rounding.
                let v = student[j].clamp(shown[j] - rounded, shown[j] + rounded);
                sum += self.light(student[j]) - self.light(v);
                let off = self.light(shown[j] + noise[j]) - light;
                variance += off * off;
            }
            let deviation = DVec3::from(variance.to_array().map(f64::sqrt)) * f64::sqrt(reach);
            let inexact = SUM_INEXACT * (self.light(high) - self.light(low));
            let most = DVec3::splat(FEWEST_STEPS / 255.0) + DEVIATIONS * deviation + inexact;
            // A pixel at the square's border may have a part of what is beside it.
            let is_inner = square(i, 3).all(|j| met[j] == met[i]);
            [is_wrong, is_inner && sum.abs().cmpgt(most).any()]
        };
        let looked: Vec<[bool; 2]> = (0..width * height).into_par_iter().map(look).collect();
        let found: Vec<u32> = (0..width * height).filter(|index| looked[*index as usize] != [false; 2]).collect();
        // What is smaller than a pixel isn't smooth, though all pixels around show the same at their own places.
        let is_smooth = |index: &u32| {
            let places = (0..16).map(|k| [k % 4, k / 4].map(|k| (f64::from(k) + 0.5) / 4.0));
            let i = *index as usize;
            square(i, 1).all(|j| places.clone().all(|place| self.met_at(seen, settings, j as u32, place) == met[i]))
        };
        let mut object = vec![u32::MAX; w * h];
        let few = found.len() <= MOST_FOUND;
        let smooth: Vec<u32> = found.into_par_iter().filter(|index| !few || is_smooth(index)).collect();
        for index in smooth {
            if let Some(hit) = self.first_hit(seen, index)
                && seen.world().material(&hit).is_plain()
            {
                object[index as usize] = seen.world().object_id(&hit);
            }
        }
        self.connected(seen, both, &object, &|region, _| {
            let count = |kind: usize| region.iter().filter(|i| looked[**i][kind]).count();
            // Negative lobes of a filter by random rays make pairs of a darker and a brighter pixel.
            let mean = region.iter().map(|i| both.difference(*i)).sum::<DVec3>() / region.len() as f64;
            (count(0) >= 2 || count(1) > 0) && mean.abs().max_element() >= LEAST_MEAN
        })
    }

    /// The light of display values, whose sums filters keep.
    fn light(&self, v: DVec3) -> DVec3 {
        if self.job.film.transfer == Transfer::Srgb { DVec3::from(v.to_array().map(srgb_decode)) } else { v }
    }

    /// Numbers of what the rays of all pixels meet.
    pub(super) fn met(&self, seen: &Seen<'_>, settings: TracerSettings) -> Vec<u64> {
        let [_, _, width, height] = self.job.window();
        let number = |index: u32| self.met_at(seen, settings, index, self.place);
        (0..width * height).into_par_iter().with_min_len(64).map(number).collect()
    }

    /// The number of what the ray at a place of a pixel meets.
    fn met_at(&self, seen: &Seen<'_>, settings: TracerSettings, index: u32, place: [f64; 2]) -> u64 {
        let [left, top, width, _] = self.job.window();
        let rows = seen.camera.size()[1];
        let met = Cell::new(0);
        let tracer = Tracer {
            world: seen.world(),
            camera: &seen.camera,
            radii: &seen.radii,
            settings,
            all_blocked: false,
            met: Some(&met),
        };
        let (x, y) = (left + index % width, rows - 1 - (top + index / width));
        tracer.pixel(f64::from(x) + place[0], f64::from(y) + place[1]);
        met.get()
    }

    /// The regions of equal numbers, but for [`u32::MAX`], that a rule takes. The rule is given the region's pixels,
    /// and whether a column and a row have its number.
    fn connected(
        &self,
        seen: &Seen<'_>,
        both: Compared<'_>,
        object: &[u32],
        takes: RegionRule<'_>,
    ) -> Vec<WrongRegion> {
        let [left, top, width, height] = self.job.window();
        let (w, h) = (width as usize, height as usize);
        let mut done = vec![false; w * h];
        let mut found = Vec::new();
        let beside = |i: usize| {
            let (x, y) = (i % w, i / w);
            let left = (x > 0).then(|| i - 1);
            let right = (x + 1 < w).then_some(i + 1);
            let up = (y > 0).then(|| i - w);
            let down = (y + 1 < h).then_some(i + w);
            [left, right, up, down].into_iter().flatten()
        };
        for first in 0..w * h {
            if object[first] == u32::MAX || done[first] {
                continue;
            }
            let (mut region, mut next) = (Vec::new(), vec![first]);
            done[first] = true;
            while let Some(i) = next.pop() {
                region.push(i);
                for other in beside(i) {
                    if !done[other] && object[other] == object[first] {
                        done[other] = true;
                        next.push(other);
                    }
                }
            }
            let id = object[first];
            let is_own = |x: i64, y: i64| {
                x >= 0 && y >= 0 && x < w as i64 && y < h as i64 && object[y as usize * w + x as usize] == id
            };
            if !takes(&region, &is_own) {
                continue;
            }
            let sum: DVec3 = region.iter().map(|i| both.difference(*i)).sum();
            let worst = region.iter().copied().max_by(|a, b| {
                let size = |i: usize| both.difference(i).abs().max_element();
                size(*a).total_cmp(&size(*b)).then(b.cmp(a))
            });
            let worst = worst.unwrap_or(first);
            let object = seen.world().object_with_id(id).map(|object| object.name.clone());
            found.push(WrongRegion {
                object,
                pixels: region.len(),
                difference: (sum / region.len() as f64).to_array(),
                worst: [left + (worst % w) as u32, top + (worst / w) as u32],
            });
        }
        found
    }
}
