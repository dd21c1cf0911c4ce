//! What no rendering predicts pixel by pixel: another place of rays, and shadow acne.

use super::display::error;
use super::mistake::Mistake;
use super::remark::Remark;
use super::tracer::TracerSettings;
use super::{Grader, Guess, MOST_PIXELS, PLACES, Shown, thinned};
use crate::scene::Stage;
use glam::DVec3;

impl Grader<'_> {
    /// Finds where in their pixels the rays go, by the edges of the picture. Edges of pictures with several rays for
    /// each pixel are at no place.
    pub(super) fn find_place(&mut self) -> Option<Remark> {
        const FEWEST: usize = 30;
        const MOST: usize = 4_000;
        const SHARP: f64 = 0.8;
        let edges: Vec<u32> = (0u32..).zip(&self.edges).filter(|(_, edge)| **edge).map(|(index, _)| index).collect();
        let pixels = thinned(&edges, MOST);
        if pixels.len() < FEWEST {
            return None;
        }
        let settings = self.settings(self.whitted.stage, None);
        let mean = |place: [f64; 2]| {
            let shown = self.shown_at(&self.seen, settings, &pixels, place, false);
            let errors = self.errors(&shown.iter().map(|v| [*v; 2]).collect::<Vec<_>>(), &pixels);
            errors.iter().sum::<f64>() / pixels.len() as f64
        };
        let own = mean(self.place);
        let others = PLACES.into_iter().map(|place| (mean(place), place));
        let (least, place) = others.min_by(|a, b| a.0.total_cmp(&b.0))?;
        // One ray for each pixel, at a known place: edges are as exact as all else.
        self.is_sharp = !self.student.is_compressed() && least < SHARP;
        if place == self.place || !(own > 0.5 && least < 0.8 * own) {
            return None;
        }
        let remark = match (self.place, place) {
            (_, [0.5, 0.5]) => Remark::Centers,
            ([0.5, 0.5], [0.0, 0.0]) => Remark::Corners,
            _ => Remark::OtherCorners,
        };
        self.place = place;
        (least < 0.25 * own).then_some(remark)
    }

    /// [`Mistake::ShadowAcne`], if lit pixels are dark as in shadow here and there. Where acne is cannot be predicted.
    /// Each pixel may therefore have either colour.
    pub(super) fn acne<'s>(&self, stages: &[(Stage, Vec<Shown>)]) -> Option<Guess<'s>> {
        let [_, _, width, height] = self.job.window();
        // Whole rows, so that neighbours are known.
        let rows = (MOST_PIXELS / width as usize).clamp(1, height as usize) as u32;
        let first = (height - rows) / 2;
        let pixels: Vec<u32> = (first * width..(first + rows) * width).collect();
        let place = self.place;
        for (stage, _) in stages.iter().filter(|(stage, _)| *stage >= Stage::Shadow) {
            let settings = self.settings(*stage, None);
            let [lit, dark] = [false, true].map(|blocked| self.shown_at(&self.seen, settings, &pixels, place, blocked));
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
                return Some(Guess::new(settings, either / count));
            }
        }
        None
    }
}
