//! Fits of the scene's own numbers to a picture, by the method of Levenberg and Marquardt with weights that bound what
//! single pixels count (Press et al., *Numerical Recipes*, 15.5 and 15.7).

use super::numbers::{Number, Subject};
use super::seen::Seen;
use super::tracer::TracerSettings;
use super::{Grader, Guess, NOTHING, choose};
use crate::scene::Stage;
use canaletto_parallel::prelude::*;
use glam::DVec3;
use std::sync::Arc;

/// Other values of a number.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Fitted {
    pub(super) number: Number,
    pub(super) values: Vec<f64>,
}

/// The pixels that a fit looks at first, and at last.
const FEW: usize = 160;
const MANY: usize = 700;
/// How many numbers are fitted to many pixels.
const MOST_REFINED: usize = 6;
/// How many of them are fitted closely, and the cost in parts of that without a fit up to which they are.
const MOST_POLISHED: usize = 3;
const PROMISING: f64 = 0.4;
/// The most steps of a close fit.
const MOST_TRIES: usize = 60;
/// How many beginnings of a fit are followed.
const FOLLOWED: usize = 3;
/// The largest difference in steps of 8 bits that a pixel counts with.
const MOST: f64 = 40.0;
/// The difference from which on its weight falls.
const ROBUST: f64 = 8.0;
/// The cost of a first fit, in parts of that without one, from which on it isn't refined.
const HOPELESS: f64 = 0.6;

/// Pixels with their weights, and the student's values in steps of 8 bits.
struct Probe {
    pixels: Vec<u32>,
    weights: Vec<f64>,
    student: Vec<DVec3>,
}

/// A number that is fitted, and how a picture with it is made.
struct Task<'a> {
    number: &'a Number,
    settings: TracerSettings,
    probe: &'a Probe,
    scale: f64,
}

impl Grader<'_> {
    fn probe(&self, compared: &[u32], errors: &[f64], most: usize) -> Probe {
        // Colours beside edges depend on where exactly rays go.
        let inner: Vec<usize> = (0..compared.len()).filter(|i| !self.is_jump(compared[*i])).collect();
        let all: Vec<usize> = if inner.len() * 4 > compared.len() { inner } else { (0..compared.len()).collect() };
        let (pixels, errors): (Vec<u32>, Vec<f64>) = all.into_iter().map(|i| (compared[i], errors[i])).unzip();
        let chosen = choose(&pixels, &errors, most);
        let student = chosen.pixels.iter().map(|pixel| self.steps(*pixel)).collect();
        Probe { pixels: chosen.pixels, weights: chosen.weights, student }
    }

    fn steps(&self, pixel: u32) -> DVec3 {
        DVec3::from(self.student.pixels[pixel as usize].map(|v| f64::from(v) * 255.0))
    }

    /// The differences between the picture with these values and the student's.
    fn differences(&self, subject: &Subject<'_>, task: &Task<'_>, x: &[f64]) -> Option<Vec<DVec3>> {
        let seen = subject.seen(&self.seen, task.number, x)?;
        self.tell_fit();
        Some(self.differences_of(&seen, task))
    }

    fn differences_of(&self, seen: &Seen<'_>, task: &Task<'_>) -> Vec<DVec3> {
        let shown = self.shown_at(seen, task.settings, &task.probe.pixels, self.place, false);
        shown.iter().zip(&task.probe.student).map(|(v, student)| *v * 255.0 - *student).collect()
    }

    /// The weighted mean of the largest differences.
    fn cost(&self, task: &Task<'_>, differences: &[DVec3]) -> f64 {
        let slack = 0.4 * self.student.tolerance;
        let one = |d: &DVec3| {
            let d = d.abs().max_element();
            if d.is_nan() { MOST } else { (d - slack).clamp(0.0, MOST) }
        };
        differences.iter().zip(&task.probe.weights).map(|(d, weight)| one(d) * weight).sum()
    }

    /// The best values that a number can have for the picture's sake.
    pub(super) fn fits<'s>(
        &'s self,
        subject: &'s Subject<'s>,
        stage: Stage,
        compared: &[u32],
        errors: &[f64],
    ) -> Vec<Guess<'s>> {
        let few = self.probe(compared, errors, FEW);
        let many = self.probe(compared, errors, MANY);
        let settings = self.settings(stage, None);
        let numbers = subject.numbers(stage);
        let (soft, hard): (Vec<Number>, Vec<Number>) = numbers.into_iter().partition(|number| !number.is_hard());
        let mut found: Vec<Guess<'s>> = Vec::new();
        for numbers in [soft, hard] {
            if self.observer.cancelled() {
                break;
            }
            let mut first: Vec<(f64, Number, Vec<f64>)> = numbers
                .into_par_iter()
                .filter_map(|number| {
                    let task = Task { number: &number, settings, probe: &few, scale: subject.scale(&number) };
                    let without = self.cost(&task, &self.differences_of(&self.seen, &task));
                    let (cost, x) = self.search(subject, &task)?;
                    (cost < HOPELESS * without).then_some((cost, number, x))
                })
                .collect();
            first.sort_by(|a, b| a.0.total_cmp(&b.0));
            first.truncate(MOST_REFINED);
            let mut refined: Vec<(f64, Number, Vec<f64>)> = first
                .into_par_iter()
                .filter_map(|(_, number, x)| {
                    let task = Task { number: &number, settings, probe: &many, scale: subject.scale(&number) };
                    let without = self.cost(&task, &self.differences_of(&self.seen, &task));
                    let (cost, x) = self.descend(subject, &task, x, 6, 0.05)?;
                    (cost < PROMISING * without).then_some((cost, number, x))
                })
                .collect();
            refined.sort_by(|a, b| a.0.total_cmp(&b.0));
            refined.truncate(MOST_POLISHED);
            let guess = |(cost, number, x): (f64, Number, Vec<f64>)| {
                let task = Task { number: &number, settings, probe: &many, scale: subject.scale(&number) };
                let (cost, x) = self.polished(subject, &task, x, cost);
                let x = self.rounded(subject, &task, x, cost);
                let seen = subject.seen(&self.seen, &number, &x)?;
                let settings = TracerSettings { mistake: Some((number.mistake(), FITTED)), ..settings };
                let fitted = Fitted { number, values: x };
                let mut guess =
                    Guess { settings, error: 0.0, seen: Some(Arc::new(seen)), fitted: Some(Arc::new(fitted)) };
                let errors = self.errors(&self.shown(&guess, compared), compared);
                guess.error = errors.iter().sum::<f64>() / errors.len().max(1) as f64;
                Some(guess)
            };
            found.extend(refined.into_par_iter().filter_map(guess).collect());
            if found.iter().any(|guess| guess.error <= NOTHING) {
                break;
            }
        }
        found
    }

    /// The best of the fits from all beginnings.
    fn search(&self, subject: &Subject<'_>, task: &Task<'_>) -> Option<(f64, Vec<f64>)> {
        let own = subject.own(task.number);
        if own.is_empty() {
            let cost = self.cost(task, &self.differences(subject, task, &own)?);
            return Some((cost, own));
        }
        if task.number.is_local() && !self.reaches(subject, task, &own) {
            return None;
        }
        let mut starts: Vec<(f64, Vec<f64>)> = Vec::new();
        for start in std::iter::once(own).chain(subject.starts(task.number)) {
            if let Some(differences) = self.differences(subject, task, &start) {
                starts.push((self.cost(task, &differences), start));
            }
        }
        // The scene's own values always begin.
        if starts.len() > 1 {
            starts[1..].sort_by(|a, b| a.0.total_cmp(&b.0));
        }
        starts.truncate(FOLLOWED);
        let fits = starts.into_iter().filter_map(|(_, start)| self.descend(subject, task, start, 7, 0.2));
        fits.min_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// Whether other values change pixels that hold most of the cost.
    fn reaches(&self, subject: &Subject<'_>, task: &Task<'_>, own: &[f64]) -> bool {
        let Some(now) = self.differences(subject, task, own) else { return false };
        let other: Vec<f64> = own.iter().map(|v| v + 0.4 * task.scale).collect();
        let less: Vec<f64> = own.iter().map(|v| (v - 0.4 * task.scale).max(0.0)).collect();
        let others = [other, less].map(|x| self.differences(subject, task, &x));
        let is_reached = |i: usize| others.iter().flatten().any(|there| (there[i] - now[i]).abs().max_element() > 0.05);
        let reached: Vec<DVec3> = (0..now.len()).map(|i| if is_reached(i) { DVec3::ZERO } else { now[i] }).collect();
        self.cost(task, &reached) < HOPELESS * self.cost(task, &now)
    }

    /// Steps down from a start. `step` is that of the first differences in parts of the scale.
    fn descend(
        &self,
        subject: &Subject<'_>,
        task: &Task<'_>,
        mut x: Vec<f64>,
        iterations: u32,
        step: f64,
    ) -> Option<(f64, Vec<f64>)> {
        let mut now = self.differences(subject, task, &x)?;
        let mut cost = self.cost(task, &now);
        let mut h = step * task.scale;
        if x.is_empty() {
            return Some((cost, x));
        }
        for _ in 0..iterations {
            if cost <= 0.2 * NOTHING || self.observer.cancelled() {
                break;
            }
            let mut columns: Vec<Vec<DVec3>> = Vec::new();
            for k in 0..x.len() {
                let moved = |sign: f64| {
                    let mut y = x.clone();
                    y[k] += sign * h;
                    let there = self.differences(subject, task, &y)?;
                    Some(there.iter().zip(&now).map(|(a, b)| (*a - *b) / (sign * h)).collect())
                };
                columns.push(moved(1.0).or_else(|| moved(-1.0))?);
            }
            let mut better: Option<(f64, Vec<f64>, Vec<DVec3>)> = None;
            for damping in [1e-3, 0.3, 3.0] {
                let Some(delta) = self.step(task, &columns, &now, damping) else { continue };
                let longest = delta.iter().fold(0.0f64, |a, d| a.max(d.abs()));
                let shorten = (task.scale / longest.max(1e-300)).min(1.0);
                let y: Vec<f64> = x.iter().zip(&delta).map(|(x, d)| x + d * shorten).collect();
                let Some(there) = self.differences(subject, task, &y) else { continue };
                let cost = self.cost(task, &there);
                if better.as_ref().is_none_or(|(best, ..)| cost < *best) {
                    better = Some((cost, y, there));
                }
            }
            match better {
                Some((less, y, there)) if less < cost => {
                    (cost, x, now) = (less, y, there);
                    h *= 0.5;
                }
                _ => h *= 0.2,
            }
            h = h.max(1e-4 * task.scale);
        }
        Some((cost, x))
    }

    /// The step of Levenberg and Marquardt.
    fn step(&self, task: &Task<'_>, columns: &[Vec<DVec3>], now: &[DVec3], damping: f64) -> Option<Vec<f64>> {
        let count = columns.len();
        let mut normal = vec![vec![0.0; count + 1]; count];
        for (i, difference) in now.iter().enumerate() {
            let largest = difference.abs().max_element();
            let weight = task.probe.weights[i] * if largest > ROBUST { ROBUST / largest } else { 1.0 };
            if !weight.is_finite() {
                continue;
            }
            for (a, row) in normal.iter_mut().enumerate() {
                for (sum, other) in row.iter_mut().zip(columns) {
                    *sum += weight * columns[a][i].dot(other[i]);
                }
                row[count] -= weight * columns[a][i].dot(*difference);
            }
        }
        let largest = (0..count).map(|a| normal[a][a]).fold(0.0, f64::max);
        for (a, row) in normal.iter_mut().enumerate() {
            row[a] += damping * row[a] + 1e-9 * largest;
        }
        solved(normal)
    }

    /// The best values nearby, by steps along each of them. Where edges cross single pixels, differences mislead.
    fn polished(&self, subject: &Subject<'_>, task: &Task<'_>, mut x: Vec<f64>, mut cost: f64) -> (f64, Vec<f64>) {
        let mut step = 0.04 * task.scale;
        let mut tries = 0;
        while step > 2e-4 * task.scale && cost > NOTHING && tries < MOST_TRIES {
            let mut is_better = false;
            for k in 0..x.len() {
                for sign in [-1.0, 1.0] {
                    let mut y = x.clone();
                    y[k] += sign * step;
                    tries += 1;
                    if let Some(there) = self.differences(subject, task, &y)
                        && self.cost(task, &there) < cost
                    {
                        (cost, x, is_better) = (self.cost(task, &there), y, true);
                    }
                }
            }
            if !is_better {
                step *= 0.5;
            }
        }
        (cost, x)
    }

    /// The values with as few digits as fit as well, or better. People write round numbers.
    fn rounded(&self, subject: &Subject<'_>, task: &Task<'_>, x: Vec<f64>, cost: f64) -> Vec<f64> {
        let most = 1.1 * cost + 0.5 * NOTHING;
        for unit in [100.0, 10.0, 5.0, 1.0, 0.5, 0.1, 0.05, 0.01, 0.001, 1e-4] {
            if unit > 0.7 * task.scale {
                continue;
            }
            let mut best: Option<(f64, Vec<f64>)> = None;
            let count = 3usize.pow(x.len() as u32);
            for number in 0..count {
                let mut rest = number;
                let near = |v: &f64| {
                    let off = [0.0, -1.0, 1.0][rest % 3];
                    rest /= 3;
                    ((v / unit).round() + off) * unit
                };
                let y: Vec<f64> = x.iter().map(near).collect();
                let Some(there) = self.differences(subject, task, &y) else { continue };
                let cost = self.cost(task, &there);
                if best.as_ref().is_none_or(|(least, _)| cost < *least) {
                    best = Some((cost, y));
                }
                if cost <= 0.2 * NOTHING {
                    break;
                }
            }
            if let Some((least, y)) = best
                && least <= most
            {
                return y;
            }
        }
        x
    }
}

/// The amount of mistakes that are fitted.
pub(super) const FITTED: f64 = -1.0;

/// Solves linear equations, each with its right side at its end.
fn solved(mut rows: Vec<Vec<f64>>) -> Option<Vec<f64>> {
    let count = rows.len();
    for k in 0..count {
        let largest = (k..count).max_by(|a, b| rows[*a][k].abs().total_cmp(&rows[*b][k].abs()))?;
        rows.swap(k, largest);
        let pivot = rows[k].clone();
        if pivot[k].is_nan() || pivot[k].abs() <= 1e-300 {
            return None;
        }
        for (i, row) in rows.iter_mut().enumerate() {
            let f = row[k] / pivot[k];
            if i != k {
                row.iter_mut().zip(&pivot).for_each(|(v, p)| *v -= f * p);
            }
        }
    }
    Some((0..count).map(|k| rows[k][count] / rows[k][k]).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equations_are_solved() {
        let x = solved(vec![vec![0.0, 2.0, 4.0], vec![3.0, 1.0, 5.0]]).unwrap();
        assert!((x[0] - 1.0).abs() < 1e-12 && (x[1] - 2.0).abs() < 1e-12);
        assert_eq!(solved(vec![vec![0.0, 1.0]]), None);
    }
}
