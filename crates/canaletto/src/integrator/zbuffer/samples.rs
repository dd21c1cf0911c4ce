//! The places of a pixel's samples, all together or one by one.

use super::Zbuffer;
use crate::integrator::camera_rays::progressive_spacing;
use crate::job::Job;
use crate::raster::coverage::Sites;
use crate::scene::{Sampling, ZbufferSettings};

/// The places of a pixel's samples, and whether each is shaded by itself. Those of a progressive picture are chosen one
/// by one from the whole pixel.
pub(super) fn sites(job: &Job, settings: &ZbufferSettings) -> (Sites, bool) {
    if draws_sample_by_sample(job) {
        return (Sites::new([[0.0; 2], [1.0; 2]]), true);
    }
    match grid_side(job.film.sampling) {
        Some(n) => {
            let at = move |i: u32| (f64::from(i) + 0.5) / f64::from(n);
            (Sites::new((0..n).flat_map(move |y| (0..n).map(move |x| [at(x), at(y)]))), true)
        }
        None if job.film.sampling == Sampling::Corner => (Sites::pattern(settings.multisampling, [0.0; 2]), false),
        None => (Sites::pattern(settings.multisampling, [0.5; 2]), false),
    }
}

/// Whether the picture is drawn once for each sample: it is the mean of pictures whose samples have equal places in all
/// pixels (Haeberli & Akeley, *The Accumulation Buffer*, 1990).
pub(super) fn draws_sample_by_sample(job: &Job) -> bool {
    job.is_progressive() && job.sample_count() > 1
}

/// The distance in pixels between samples that a z-buffer shades, for the footprints of textures.
pub(crate) fn sample_spacing(job: &Job) -> f64 {
    grid_side(job.film.sampling).map_or(1.0, |n| 1.0 / f64::from(n))
}

/// The side of the grid of samples in a pixel, unless it has a single place.
pub(super) fn grid_side(sampling: Sampling) -> Option<u32> {
    match sampling {
        Sampling::Corner | Sampling::Center | Sampling::Sampled(1) => None,
        Sampling::Regular(n) | Sampling::Jittered(n) | Sampling::Adaptive { n, .. } => Some(n),
        // The grid with at least as many samples, of at most as many as other patterns have.
        Sampling::Sampled(n) => Some((f64::from(n).sqrt().ceil() as u32).min(Sampling::MAX_GRID)),
    }
}

/// The samples of all pixels that are drawn together.
#[derive(Clone)]
pub(super) struct DrawnSamples {
    pub(super) sites: Sites,
    /// The number of the sample whose random numbers fragments have, and the number of all.
    pub(super) index: u32,
    pub(super) count: u32,
    /// The distance between samples in pixels, for the footprints of textures.
    pub(super) spacing: f64,
}

impl DrawnSamples {
    /// All samples, or sample number `index` of a picture that is drawn once for each.
    pub(super) fn of(zbuffer: &Zbuffer, index: u32) -> DrawnSamples {
        let (job, count) = (&zbuffer.job, zbuffer.job.sample_count());
        if !draws_sample_by_sample(job) {
            return DrawnSamples { sites: zbuffer.sites.clone(), index: 0, count: 1, spacing: sample_spacing(job) };
        }
        let place = zbuffer.sampler.pixel([0; 2]).sample(index, count).film();
        DrawnSamples { sites: Sites::new([place]), index, count, spacing: progressive_spacing(count, index) }
    }
}
