//! Mistakes that no rendering predicts pixel by pixel: another place of rays, and shadow acne.

use super::display::error;
use super::mistake::Mistake;
use super::tracer::TracerSettings;
use super::{Grader, Guess, MOST_PIXELS, Shown, thinned};
use crate::scene::Stage;
use glam::DVec3;

impl Grader<'_> {
    /// [`Mistake::RayPlace`], if the edges are those of rays through the other place of the pixels. Edges of pictures
    /// with several rays for each pixel are neither.
    pub(super) fn ray_place(&self, settings: TracerSettings) -> Option<Guess> {
        const FEWEST: usize = 30;
        let edges: Vec<u32> = (0u32..).zip(&self.edges).filter(|(_, edge)| **edge).map(|(index, _)| index).collect();
        let pixels = thinned(&edges, MOST_PIXELS);
        if pixels.len() < FEWEST || self.student.is_compressed() {
            return None;
        }
        let mean = |place| {
            let shown = self.shown_at(settings, &pixels, place, false);
            let errors = self.errors(&shown.iter().map(|v| [*v; 2]).collect::<Vec<_>>(), &pixels);
            errors.iter().sum::<f64>() / pixels.len() as f64
        };
        let own = self.own_place();
        let other = own.map(|v| 0.5 - v);
        let (own, other) = (mean(own), mean(other));
        let settings = TracerSettings { mistake: Some((Mistake::RayPlace, 0.0)), ..settings };
        (own > 0.5 && other < 0.25 * own).then_some(Guess { settings, error: other })
    }

    /// [`Mistake::ShadowAcne`], if lit pixels are dark as in shadow here and there. Where acne is cannot be predicted.
    /// Each pixel may therefore have either colour.
    pub(super) fn acne(&self, stages: &[(Stage, Vec<Shown>)]) -> Option<Guess> {
        let [_, _, width, height] = self.job.window();
        // Whole rows, so that neighbours are known.
        let rows = (MOST_PIXELS / width as usize).clamp(1, height as usize) as u32;
        let first = (height - rows) / 2;
        let pixels: Vec<u32> = (first * width..(first + rows) * width).collect();
        let place = self.own_place();
        for (stage, _) in stages.iter().filter(|(stage, _)| *stage >= Stage::Shadow) {
            let settings = self.settings(*stage, None);
            let [lit, dark] = [false, true].map(|blocked| self.shown_at(settings, &pixels, place, blocked));
            let error_at = |shown: DVec3, pixel: u32| {
                error([shown; 2], self.student.pixels[pixel as usize], self.student.tolerance)
            };
            let errors: Vec<[f64; 2]> =
                (0..pixels.len()).map(|i| [error_at(lit[i], pixels[i]), error_at(dark[i], pixels[i])]).collect();
            let is_dark: Vec<bool> = errors.iter().map(|[lit, dark]| *lit > 3.0 && *dark <= 1.0).collect();
            let is_lit = |i: usize| errors[i][0] <= 1.0 && (lit[i] - dark[i]).abs().max_element() * 255.0 > 8.0;
            let dark_count = is_dark.iter().filter(|dark| **dark).count();
            let w = width as usize;
            let beside = |i: usize| {
                let column = i % w;
                (column > 0 && is_lit(i - 1)) || (column + 1 < w && is_lit(i + 1))
            };
            let scattered = (0..pixels.len()).filter(|i| is_dark[*i] && beside(*i)).count();
            let (mut right, mut either) = (0.0, 0.0);
            for [lit, dark] in &errors {
                right += lit;
                either += lit.min(*dark);
            }
            let count = pixels.len() as f64;
            if dark_count as f64 > 0.005 * count && scattered * 3 > dark_count && either < 0.35 * right {
                let settings = TracerSettings { mistake: Some((Mistake::ShadowAcne, 0.0)), ..settings };
                return Some(Guess { settings, error: either / count });
            }
        }
        None
    }
}
