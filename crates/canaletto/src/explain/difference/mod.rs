//! The first term in which two explanations differ. Both trees are walked in step: camera, rays, hits, materials, each
//! light's terms, child rays, patches, tone and bytes.

mod light;
mod path;
mod ray;
mod text;
mod walk;

use super::patch::RadiosityTerms;
use super::ray_tree::RayTree;
use super::term::{TermValue, line};
use super::tree::{PixelTree, SampleNode};
use crate::math::Rgb;
use serde::Serialize;
use walk::{Walk, sample_name};

/// The difference of two explanations: A, and B after it.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct TreeDifference {
    /// The first term that differs; none if all terms are equal.
    pub first: Option<TermDifference>,
    /// The number of equal terms before it.
    pub equal_terms: usize,
    /// The summands of the colour that differ, those that change the pixel most.
    pub following: Vec<TermDifference>,
    /// The number of further summands that differ.
    pub more_following: usize,
    /// Both colours in linear light.
    pub colors: [Rgb; 2],
    /// The bytes of both pixels in a file; none for rays, and where the whole picture decides.
    pub bytes: [Option<[u8; 3]>; 2],
}

/// A term of the equation that differs.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct TermDifference {
    /// The way to the term from the pixel, such as `camera ray`, `ball`, `reflected ray`, `floor`.
    pub place: Vec<String>,
    /// The term as explanations name it.
    pub term: String,
    /// The equation of the chapter.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub equation: Option<&'static str>,
    /// Both values.
    pub values: [TermValue; 2],
    /// What leads to each value, if the trees tell it.
    pub reasons: [Option<String>; 2],
    /// B's share of the pixel in linear light less that of A, for a summand of the colour.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub change: Option<Rgb>,
}

/// The most summands that are listed.
const MOST_FOLLOWING: usize = 8;

impl PixelTree {
    /// The difference from this tree to another one. Numbers are equal if all their bits are, or if their first
    /// `digits` significant digits are.
    ///
    /// Trees of two different pixels have different rays. What follows from a ray alone, such as points, normals and
    /// the directions to lights, is not compared then: the first difference is one of what rays meet, of materials and
    /// of shadows, else the summand that changes most. Of several samples, those nearest to both colours are compared.
    /// Both trees have steps, or neither has.
    pub fn difference(&self, other: &PixelTree, digits: Option<u8>) -> TreeDifference {
        let trees = [self, other];
        let mut walk = Walk::new(trees.map(|tree| &tree.radiosity), self.pixel == other.pixel, digits);
        if walk.is_one_ray {
            walk.camera(trees);
        }
        let [a, b] = trees.map(|tree| &tree.samples[..]);
        if !walk.is_one_ray {
            let chosen = trees.map(|tree| tree.samples.get(tree.nearest_to_mean()));
            if let [Some(a), Some(b)] = chosen {
                walk.sample([a, b], 1.0);
            }
        } else if a.len() == b.len() {
            // A single sample is the pixel, whatever its weight.
            let total: f64 = b.iter().map(|sample| sample.weight).sum();
            let share = |sample: &SampleNode| if b.len() == 1 { 1.0 } else { sample.weight / total };
            for (index, (a, b)) in a.iter().zip(b).enumerate() {
                let name = (self.samples.len() > 1).then(|| sample_name(index));
                walk.below(name, |walk| walk.sample([a, b], share(b)));
            }
        } else {
            walk.lines([a, b].map(|samples| [line!("{number of samples}", samples.len())]));
        }
        walk.lines(trees.map(|tree| tree.developed.lines(tree.color)));
        walk.finished([self.color, other.color], trees.map(|tree| tree.developed.values.map(|values| values.bytes)))
    }
}

impl RayTree {
    /// The difference from this tree to another one, as [`PixelTree::difference`]. Both are compared as one ray.
    pub fn difference(&self, other: &RayTree, digits: Option<u8>) -> TreeDifference {
        let trees: [&RayTree; 2] = [self, other];
        let terms: [&RadiosityTerms; 2] = trees.map(|tree| &tree.radiosity);
        let mut walk = Walk::new(terms, true, digits);
        walk.ray(trees.map(|tree| &tree.ray));
        walk.finished([self.color, other.color], [None; 2])
    }
}
