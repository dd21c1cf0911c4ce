//! Why the pictures of two integrators differ: the cause of each differing pixel, found in the trees of its rays.
//!
//! Both pixels are explained by the recorder of [`mod@crate::explain`]. `terms` splits their difference into one part
//! for each cause, term by term. The cause of a pixel is the part that alone closes most of the difference as a display
//! shows it.

mod pixel;
mod places;
mod terms;

use crate::explain::{ExplainError, ExplainWorker};
use crate::film::{Developer, Picture};
use crate::integrator::TaskQueue;
use crate::integrator::radiosity::RadiositySolution;
use crate::job::{Job, JobError, Observer, Progress};
use crate::math::Rgb;
use crate::named;
use crate::render::{Preparation, Session, stack_of};
use crate::world::World;
use canaletto_bvh::with_stack;
use pixel::{Judge, PixelCause};
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::sync::{Arc, Mutex, PoisonError};

/// The cause of a difference between the pixels of two integrators.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum Cause {
    /// The ray meets something in front of the near plane or beyond the far plane, which a z-buffer doesn't draw.
    NearFar,
    /// The pixel has an edge, and the methods see different surfaces in it.
    Edge,
    /// Triangles stand for a curved surface: normals or colours are interpolated between their corners.
    Tessellation,
    /// The samples have other places in the pixel, on the lens or in time.
    Sampling,
    /// Textures are read with other footprints.
    TextureFilter,
    /// Another share of a light arrives at the surface.
    Shadow,
    /// A reflected ray is missing.
    Mirror,
    /// A refracted ray is missing, or the light through a half-covered surface.
    Refraction,
    /// Light that comes from other surfaces, for which ambient light stands.
    IndirectLight,
    /// No cause alone explains the difference.
    Several,
    /// The terms of the trees don't explain the difference.
    Unexplained,
}

named!(Cause {
    NearFar => "near/far": "In front of the near plane or beyond the far plane",
    Edge => "edge": "Other surfaces are seen in the pixel",
    Tessellation => "tessellation": "Triangles stand for a curved surface",
    Sampling => "sampling": "The samples have other places",
    TextureFilter => "texture filter": "Textures are read with other footprints",
    Shadow => "shadow": "Another share of a light arrives",
    Mirror => "mirror": "A reflected ray is missing",
    Refraction => "refraction": "A refracted ray is missing",
    IndirectLight => "indirect light": "Light from other surfaces, or ambient light",
    Several => "several": "No cause alone explains the difference",
    Unexplained => "unexplained": "The terms of the trees don't explain it",
});

impl Cause {
    /// The number of causes that a term of the trees can have.
    const OF_TERMS: usize = Cause::Several as usize;
}

/// The picture of one method.
#[derive(Clone, Copy, Debug)]
pub struct MethodPicture<'a> {
    /// The job that made it.
    pub job: &'a Job,
    /// The picture, complete.
    pub picture: &'a Picture,
    /// The solution of radiosity that it shows, if that is kept.
    pub solution: Option<&'a Arc<RadiositySolution>>,
}

/// A pixel that is an example of a cause.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct WorstPixel {
    /// The cause.
    pub cause: Cause,
    /// Column and row from the top left of the whole picture.
    pub pixel: [u32; 2],
    /// The largest difference of a component, in steps of 8 bits.
    pub steps: f64,
    /// The causes that close most of the difference, each with the share that it closes alone, largest first.
    pub shares: Vec<(Cause, f64)>,
    /// The object where the difference arises, as the reference sees it; none for the background.
    pub object: Option<String>,
    /// The object that the other method shows there.
    pub other_object: Option<String>,
    /// The light whose share differs most, for shadows.
    pub light: Option<String>,
}

/// The causes of all differences between two pictures.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Causes {
    /// The width and height of the pictures.
    pub size: [u32; 2],
    /// The cause of each pixel, the top row first; none where the pictures are equal.
    pub pixels: Vec<Option<Cause>>,
    /// The pixel with the largest difference for each cause that occurs, in the order of causes.
    pub worst: Vec<WorstPixel>,
    /// For pixels with several causes: the two that close most of the difference, and the number of these pixels.
    pub pairs: Vec<([Cause; 2], u64)>,
    /// Whether all pixels were compared. Not so after a cancellation.
    pub complete: bool,
}

impl Causes {
    fn unfinished(size: [u32; 2]) -> Causes {
        let pixels = vec![None; size[0] as usize * size[1] as usize];
        Causes { size, pixels, worst: Vec::new(), pairs: Vec::new(), complete: false }
    }

    /// The number of pixels with this cause.
    pub fn count(&self, cause: Cause) -> u64 {
        self.pixels.iter().filter(|pixel| **pixel == Some(cause)).count() as u64
    }

    /// The number of pixels that differ.
    pub fn differing(&self) -> u64 {
        self.pixels.iter().flatten().count() as u64
    }
}

/// The largest number of rays of a pixel whose cause is looked for. Beyond it, the cause is [`Cause::Unexplained`].
const MAX_RAYS: u64 = 1 << 18;

/// Finds the cause of each difference between the picture of a reference, whose integrator traces rays, and that of
/// another method. Pixels differ if a component does by more than `tolerance` steps of 8 bits, both developed as the
/// reference. The result is equal for any number of threads.
///
/// # Panics
/// If the jobs' windows or the pictures have different sizes, or if the observer panics.
///
/// # Errors
/// [`JobError`] as from a render of either job.
pub fn find_causes(
    world: &World,
    reference: &MethodPicture,
    other: &MethodPicture,
    tolerance: f64,
    observer: &dyn Observer,
) -> Result<Causes, JobError> {
    let [_, _, width, height] = reference.job.window();
    for method in [reference, other] {
        method.job.check()?;
        method.solution.map_or(Ok(()), |solution| solution.check(world, method.job))?;
        assert_eq!(method.job.window(), reference.job.window(), "both methods show one window");
        assert_eq!([method.picture.width, method.picture.height], [width, height], "pictures have their window's size");
    }
    let stack = [reference, other].map(|method| stack_of(world, method.job)).into_iter().max().unwrap_or_default();
    let developer = Developer::new(reference.picture, &reference.job.developing());
    let judge = Judge {
        developer,
        tolerance,
        camera: &reference.job.camera,
        tolerance_of_other: other.job.description().tolerance(),
    };
    with_stack(stack, || {
        let mut sessions = Vec::new();
        for method in [reference, other] {
            let preparation = Preparation { solution: method.solution, ..Preparation::default() };
            match Session::new(world, method.job, preparation, observer)? {
                ControlFlow::Continue(session) => sessions.push(session),
                ControlFlow::Break(()) => return Ok(Causes::unfinished([width, height])),
            }
        }
        Ok(of_all_tiles([&sessions[0], &sessions[1]], [reference, other], &judge, observer))
    })?
}

/// The causes in all tiles of the other method, since a z-buffer draws tiles.
fn of_all_tiles(
    sessions: [&Session; 2],
    methods: [&MethodPicture; 2],
    judge: &Judge,
    observer: &dyn Observer,
) -> Causes {
    let [left, top, width, height] = methods[0].job.window();
    let all = methods[1].job.tiles();
    let queue = TaskQueue::new(observer);
    let stops = |rays| rays > MAX_RAYS || queue.is_stopped();
    let done = Mutex::new(Progress { pixels_done: 0, pixels: u64::from(width) * u64::from(height), rays: 0 });
    let new_workers = || sessions.map(|session| ExplainWorker::new(session, MAX_RAYS, &stops));
    let tiles = queue.collect(all.count(), new_workers, |workers, number| {
        let area @ [x0, y0, across, down] = all.area(number);
        let before = workers[0].rays + workers[1].rays;
        let mut tile = TileCauses::default();
        for pixel @ [x, y] in (y0..y0 + down).flat_map(|y| (x0..x0 + across).map(move |x| [x, y])) {
            let place = [x - left, y - top];
            let colors = methods.map(|method| method.picture.pixel(place[0], place[1]));
            let Some(steps) = judge.difference(colors) else { continue };
            if tile.pixels.is_empty() {
                workers.iter_mut().for_each(|worker| worker.begin_area(area));
            }
            match cause_of(workers, judge, pixel, colors, steps) {
                Ok(found) if !queue.is_stopped() => {
                    tile.pixels.push((place, found.cause));
                    tile.tally.add(pixel, found);
                }
                _ => return ControlFlow::Break(()),
            }
        }
        let mut done = done.lock().unwrap_or_else(PoisonError::into_inner);
        done.pixels_done += u64::from(across * down);
        done.rays += workers[0].rays + workers[1].rays - before;
        observer.progress(&done);
        ControlFlow::Continue(tile)
    });
    let mut causes = Causes::unfinished([width, height]);
    let ControlFlow::Continue(tiles) = tiles else { return causes };
    let mut tally = Tally::default();
    for tile in tiles {
        tile.pixels.iter().for_each(|([x, y], cause)| causes.pixels[(y * width + x) as usize] = Some(*cause));
        tally.merge(tile.tally);
    }
    causes.complete = true;
    causes.worst = tally.worst.into_values().collect();
    causes.pairs = tally.pairs.into_iter().collect();
    causes.pairs.sort_by_key(|(_, pixels)| std::cmp::Reverse(*pixels));
    causes
}

/// The pixels of a tile that differ, from the top left of the window.
#[derive(Default)]
struct TileCauses {
    pixels: Vec<([u32; 2], Cause)>,
    tally: Tally,
}

/// Examples of causes, and pairs of causes. Tiles come in a fixed order; of equal differences the first stays.
#[derive(Default)]
struct Tally {
    worst: BTreeMap<Cause, WorstPixel>,
    pairs: BTreeMap<[Cause; 2], u64>,
}

impl Tally {
    fn add(&mut self, pixel: [u32; 2], found: PixelCause) {
        if let (Cause::Several, [first, second, ..]) = (found.cause, &found.shares[..]) {
            *self.pairs.entry([first.0, second.0]).or_default() += 1;
        }
        let PixelCause { cause, steps, shares, object, other_object, light } = found;
        self.add_worst(WorstPixel { cause, pixel, steps, shares, object, other_object, light });
    }

    fn add_worst(&mut self, worst: WorstPixel) {
        if self.worst.get(&worst.cause).is_none_or(|before| before.steps < worst.steps) {
            self.worst.insert(worst.cause, worst);
        }
    }

    fn merge(&mut self, other: Tally) {
        other.worst.into_values().for_each(|worst| self.add_worst(worst));
        other.pairs.into_iter().for_each(|(pair, pixels)| *self.pairs.entry(pair).or_default() += pixels);
    }
}

/// The cause of one pixel's difference.
///
/// # Errors
/// [`ExplainError`] if cancelled.
fn cause_of(
    workers: &mut [ExplainWorker; 2],
    judge: &Judge,
    pixel: [u32; 2],
    colors: [Rgb; 2],
    steps: f64,
) -> Result<PixelCause, ExplainError> {
    let [reference_worker, other_worker] = workers;
    let trees = reference_worker.pixel(pixel).and_then(|tree| {
        let other = other_worker.pixel(pixel)?;
        let at_places = match places::of_raster(&other) {
            Some(places) if !places::are_of(&places, &tree) => reference_worker.at_places(pixel, &places)?,
            _ => None,
        };
        Ok((tree, at_places, other))
    });
    match trees {
        Ok((tree, at_places, other)) => {
            Ok(judge.cause([&tree, at_places.as_ref().unwrap_or(&tree), &other], colors, steps))
        }
        Err(ExplainError::TooManyRays) => Ok(PixelCause::unexplained(steps)),
        Err(error) => Err(error),
    }
}
