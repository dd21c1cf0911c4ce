//! Paths in step.

use super::TreeDifference;
use super::walk::{Walk, sample_name};
use crate::explain::patch::RadiosityTerms;
use crate::explain::path::{PathRay, PathSample, PathTree};
use crate::explain::ray_text::kind_name;
use crate::explain::term::line;
use glam::DVec3;

impl PathTree {
    /// The difference from this tree to another one, as [of rays](crate::explain::PixelTree::difference). Paths are
    /// compared ray by ray.
    pub fn difference(&self, other: &PathTree, digits: Option<u8>) -> TreeDifference {
        let (terms, trees) = (RadiosityTerms::default(), [self, other]);
        let mut walk = Walk::new([&terms; 2], self.pixel == other.pixel, digits);
        walk.lines(trees.map(|tree| {
            let (size, samples) = (tree.size.map(f64::from), tree.samples.len());
            [line!("{size of the picture}{number of samples}", size, samples)]
        }));
        let chosen = trees.map(|tree| tree.samples.get(tree.nearest_to_mean()?));
        match chosen {
            [Some(a), Some(b)] if !walk.is_one_ray => walk.path([a, b], 1.0),
            _ => {
                let total: f64 = other.samples.iter().map(|sample| sample.weight).sum();
                for (index, (a, b)) in self.samples.iter().zip(&other.samples).enumerate() {
                    walk.below(Some(sample_name(index)), |walk| walk.path([a, b], b.weight / total));
                }
            }
        }
        walk.lines(trees.map(|tree| tree.developed.lines(tree.color)));
        walk.finished([self.color, other.color], trees.map(|tree| tree.developed.values.map(|values| values.bytes)))
    }
}

impl Walk<'_> {
    /// Compares paths, ray by ray. The share is that of B's path in the pixel.
    fn path(&mut self, samples: [&PathSample; 2], share: f64) {
        self.lines(samples.map(PathSample::start_lines));
        self.weight = DVec3::splat(share);
        for index in 0..samples[0].rays.len().max(samples[1].rays.len()) {
            let rays = samples.map(|sample| sample.rays.get(index));
            let name = rays[1].or(rays[0]).map(|ray| format!("{} to vertex {}", kind_name(ray.kind), ray.depth));
            self.below(name, |walk| walk.lines(rays.map(|ray| ray.map_or_else(Vec::new, PathRay::lines))));
        }
    }
}
