//! A tile of a progressive picture: the samples of its pixels as blocks that add up.

use super::noise::NoiseEstimate;
use crate::film::{BlockMean, Picture, SampleBlocks, SampleStatistics, TileBuffer, block_sizes};
use crate::integrator::{Counts, IntegratorWorker, TileBlock};
use crate::job::{Aov, Job, in_squares};
use std::ops::ControlFlow;

/// What is known of the pixels of a tile.
pub(super) struct SampleTile {
    /// x and y from the picture's upper left corner, width and height, in pixels.
    pub(super) area: [u32; 4],
    pub(super) blocks: SampleBlocks,
    /// The layers of geometry; none without such layers.
    layers: Option<TileBuffer>,
    has_layers: bool,
    /// The sum of each pixel's alphas, and the number of samples in it; empty if nobody asks for alpha.
    alphas: Vec<(f64, u32)>,
    pub(super) statistics: SampleStatistics,
    /// The pixels, [in squares](in_squares).
    places: Vec<[u32; 2]>,
}

/// Whether a layer is made by each pixel's first sample. The others come from all samples.
fn is_of_first_sample(aov: Aov) -> bool {
    !aov.is_of_samples() && aov != Aov::Alpha
}

/// The layers that are made by each pixel's first sample.
pub(super) fn layers_of_first_sample(job: &Job) -> Vec<Aov> {
    job.aovs.iter().copied().filter(|aov| is_of_first_sample(*aov)).collect()
}

impl SampleTile {
    /// A tile without samples.
    pub(super) fn new(job: &Job, area: [u32; 4]) -> SampleTile {
        let [_, _, width, height] = area;
        let first_hits = layers_of_first_sample(job);
        let rules = first_hits.iter().map(|aov| (aov.channels().len(), aov.accumulation()));
        let keeps_halves = job.noise.is_some() || job.aovs.iter().any(|aov| aov.is_half());
        SampleTile {
            area,
            blocks: SampleBlocks::new([width, height], job.first_sample, keeps_halves),
            layers: (!first_hits.is_empty()).then(|| TileBuffer::new(area, rules)),
            has_layers: false,
            alphas: if job.has_alpha() { vec![(0.0, 0); (width * height) as usize] } else { Vec::new() },
            statistics: SampleStatistics::default(),
            places: in_squares([width, height]),
        }
    }

    /// Adds samples up to number `end` to the pixels that need them. Returns how many it added, and what was counted.
    /// If it breaks, whole blocks are kept.
    pub(super) fn add(
        &mut self,
        job: &Job,
        worker: &mut dyn IntegratorWorker,
        end: u32,
        needs: impl Fn([u32; 2]) -> bool,
    ) -> ControlFlow<(), (u64, Counts)> {
        if let Some(layers) = self.layers.as_mut().filter(|_| !self.has_layers) {
            worker.first_hits(&layers_of_first_sample(job), layers)?;
            self.has_layers = true;
        }
        let [x0, y0, width, _] = self.area;
        let first = self.blocks.first();
        let number = |[x, y]: [u32; 2]| (y * width + x) as usize;
        let mut samples = 0;
        loop {
            // Pixels with the fewest samples are first, so that all have equally many in the end.
            let counts = self.blocks.counts();
            let wanting = self.places.iter().filter(|place| first + counts[number(**place)] < end && needs(**place));
            let Some(count) = wanting.map(|place| counts[number(*place)]).min() else { break };
            let start = first + count;
            let Some(size) = block_sizes(start, end).next() else { break };
            let places = self.places.iter().filter(|place| counts[number(**place)] == count && needs(**place));
            let places: Vec<[u32; 2]> = places.copied().collect();
            let block = TileBlock { area: self.area, places: &places, first: start, size };
            let SampleTile { blocks, statistics, .. } = self;
            worker.block(&block, &mut |index, colors| {
                let [x, y] = places[index];
                statistics.check(colors, job.clamp, [x0 + x, y0 + y], start);
                blocks.push(number([x, y]), size, BlockMean::of_samples(colors));
            })?;
            samples += places.len() as u64 * u64::from(size);
        }
        self.add_alphas(worker)?;
        ControlFlow::Continue((samples, worker.take_counts()))
    }

    /// Adds the alphas of samples that have none, one after the other, so that the sum is the same in any passes.
    fn add_alphas(&mut self, worker: &mut dyn IntegratorWorker) -> ControlFlow<()> {
        let SampleTile { area, blocks, alphas, .. } = self;
        let places: Vec<[u32; 2]> = (0..alphas.len() as u32).map(|pixel| [pixel % area[2], pixel / area[2]]).collect();
        loop {
            // Pixels with equally many alphas and samples go together.
            let lacking = (0..alphas.len()).filter(|pixel| alphas[*pixel].1 < blocks.counts()[*pixel]);
            let key = |pixel: usize, alphas: &[(f64, u32)]| (alphas[pixel].1, blocks.counts()[pixel]);
            let Some((begun, count)) = lacking.map(|pixel| key(pixel, alphas)).min() else {
                return ControlFlow::Continue(());
            };
            let pixels: Vec<usize> = (0..alphas.len()).filter(|pixel| key(*pixel, alphas) == (begun, count)).collect();
            let own: Vec<[u32; 2]> = pixels.iter().map(|pixel| places[*pixel]).collect();
            let block = TileBlock { area: *area, places: &own, first: blocks.first() + begun, size: count - begun };
            worker.alphas(&block, &mut |number, alpha| alphas[pixels[number]].0 += alpha)?;
            pixels.iter().for_each(|pixel| alphas[*pixel].1 = count);
        }
    }

    /// The mean alpha of a pixel.
    fn alpha(&self, pixel: usize) -> f32 {
        let (sum, count) = self.alphas[pixel];
        if count == 0 { 0.0 } else { (sum / f64::from(count)) as f32 }
    }

    /// Writes what is known into the picture of the job's window, and into the estimate of its noise.
    pub(super) fn write(&self, job: &Job, picture: &mut Picture, mut noise: Option<&mut NoiseEstimate>) {
        let [left, top, ..] = job.window();
        let [x, y, width, height] = self.area;
        for row in 0..height {
            let to = (y - top + row) as usize * picture.width as usize + (x - left) as usize;
            for column in 0..width as usize {
                let pixel = row as usize * width as usize + column;
                picture.pixels[to + column] = self.blocks.mean(pixel);
                if let Some(alpha) = picture.alpha.get_mut(to + column) {
                    *alpha = self.alpha(pixel);
                }
                if let (Some(noise), Some(halves)) = (noise.as_deref_mut(), self.blocks.half_means(pixel)) {
                    noise.set(to + column, picture.pixels[to + column], halves);
                }
            }
        }
        let mut first_hits = 0;
        for (aov, layer) in job.aovs.iter().zip(&mut picture.layers) {
            if let (true, Some(buffer)) = (is_of_first_sample(*aov), &self.layers) {
                buffer.write_layer(first_hits, layer, picture.width, [left, top]);
                first_hits += 1;
                continue;
            }
            for row in 0..height {
                let to = (y - top + row) as usize * picture.width as usize + (x - left) as usize;
                for column in 0..width as usize {
                    let pixel = row as usize * width as usize + column;
                    let halves = || self.blocks.half_means(pixel).unwrap_or_default();
                    match aov {
                        Aov::HalfA => layer.data[(to + column) * 3..][..3].copy_from_slice(&halves()[0].to_array()),
                        Aov::HalfB => layer.data[(to + column) * 3..][..3].copy_from_slice(&halves()[1].to_array()),
                        Aov::Alpha => layer.data[to + column] = self.alpha(pixel),
                        _ => layer.data[to + column] = self.blocks.counts()[pixel] as f32,
                    }
                }
            }
        }
    }
}
