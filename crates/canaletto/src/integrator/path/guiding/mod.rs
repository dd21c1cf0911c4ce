//! Path guiding: paths go where light was found before (Vorba et al., *On-line Learning of Parametric Mixture Models
//! for Light Transport Simulation*, 2014).
//!
//! A [`GuidingField`] divides the space around surfaces into cells. Each cell has a [`Mixture`], which follows the
//! radiance that arrives there. A vertex of a path in a cell follows that density with the cell's guiding probability,
//! and its scattering otherwise. The density of the direction is that of both together, so that pictures have no bias.
//!
//! The field is learnt before the picture by paths of their own. It doesn't depend on the picture's samples, which so
//! stay independent of each other.
//!
//! Deviations: Each round makes its cells and mixtures anew from the records of that round, which all lie in memory.
//! The guiding probability is the one of a few that would have given the records the least second moment.

mod file;
mod mixture;
mod recorder;

pub(crate) use recorder::{GuidingRecord, GuidingRecorder};

use canaletto_parallel::prelude::*;
use glam::{DVec3, Vec3};
use mixture::{LocalMixture, Mixture, RadianceSample};

/// The most records of a cell that isn't divided.
const RECORDS_PER_CELL: usize = 4096;

/// The fewest records on each side of a division.
const FEWEST_RECORDS: usize = 512;

/// The fewest records with light that a mixture is learnt from.
const FEWEST_BRIGHT: usize = 16;

/// The probability with which paths of the training follow the field.
const TRAINING_PROBABILITY: f64 = 0.5;

/// The guiding probabilities that a cell can have.
const PROBABILITIES: [f64; 3] = [0.0, 0.25, 0.5];

/// The density of directions at each point of space, which path guiding learnt. One without cells guides nowhere.
#[derive(Debug, Default)]
pub struct GuidingField {
    /// The nodes of a tree of divisions, the root first.
    nodes: Vec<Node>,
    leaves: Vec<GuidingLeaf>,
    benefit: Benefit,
}

/// What guiding may bring.
///
/// The noise of a cell is the second moment of the light that directions bring there, over the square of the mean of
/// all light that leaves its vertices. So it is small where most light comes from lamps that are asked for it. Mirrors
/// don't count, as they aren't guided.
#[derive(Clone, Copy, Debug, Default)]
struct Benefit {
    records: f64,
    /// The sums of noise over records, without guiding and with it.
    noise: f64,
    guided_noise: f64,
}

#[derive(Debug)]
enum Node {
    /// Points below `at` on the axis are in the next node, others in node `above`.
    Division { axis: u8, at: f32, above: u32 },
    /// A leaf; none where no light was found.
    Cell(Option<u32>),
}

/// The density of directions in a cell.
#[derive(Debug)]
pub(crate) struct GuidingLeaf {
    /// The probability with which a path follows the density.
    probability: f64,
    mixture: Mixture,
}

/// The density of directions at a vertex.
#[derive(Debug, Clone)]
pub(crate) struct GuidedVertex {
    /// The probability with which the path follows the density.
    pub(super) probability: f64,
    mixture: LocalMixture,
}

/// The density of a direction by a guiding field and by scattering together.
#[inline(always)]
pub(super) fn pdf_of_both(probability: f64, pdf_guide: f64, pdf_scattering: f64) -> f64 {
    probability * pdf_guide + (1.0 - probability) * pdf_scattering
}

impl GuidedVertex {
    /// The number in [0, 1) by which the surface chooses its lobe, of a number for which it isn't guided.
    #[inline]
    pub(super) fn u_of_surface(&self, u_lobe: f64) -> f64 {
        ((u_lobe - self.probability) / (1.0 - self.probability)).min(1.0 - f64::EPSILON)
    }

    /// A random unit direction for `u` of the unit square.
    pub(super) fn sample(&self, u: [f64; 2]) -> DVec3 {
        self.mixture.sample(u)
    }

    /// The density of a unit direction per unit of solid angle.
    pub(super) fn pdf(&self, direction: DVec3) -> f64 {
        self.mixture.pdf(direction)
    }
}

impl GuidingField {
    /// The field of records, for further training, or for the picture if it `is_final`.
    pub(crate) fn new(mut records: Vec<GuidingRecord>, is_final: bool) -> GuidingField {
        let mut field = GuidingField { nodes: Vec::new(), leaves: Vec::new(), benefit: Benefit::default() };
        let mut cells = Vec::new();
        field.divide(&mut records, &mut cells);
        // Each cell is learnt by itself, and they are gathered in their order.
        let learnt: Vec<_> = cells.par_iter().map(|(_, records)| learn(records, is_final)).collect();
        for ((node, _), (leaf, benefit)) in cells.iter().zip(learnt) {
            field.benefit.add(benefit);
            if let Some(leaf) = leaf {
                field.nodes[*node] = Node::Cell(Some(field.leaves.len() as u32));
                field.leaves.push(leaf);
            }
        }
        field
    }

    /// How rare the directions are that bring light, by records of paths that weren't guided.
    pub(crate) fn rarity(mut records: Vec<GuidingRecord>) -> f64 {
        let mut field = GuidingField { nodes: Vec::new(), leaves: Vec::new(), benefit: Benefit::default() };
        let mut cells = Vec::new();
        field.divide(&mut records, &mut cells);
        cells.iter().for_each(|(_, records)| field.benefit.add(Benefit::of(records, 0.0)));
        field.benefit.noise / field.benefit.records.max(1.0)
    }

    /// Adds the node of records. `cells` are the nodes of cells with their records.
    fn divide<'r>(&mut self, records: &'r mut [GuidingRecord], cells: &mut Vec<(usize, &'r [GuidingRecord])>) {
        let number = self.nodes.len();
        self.nodes.push(Node::Cell(None));
        let Some((axis, at, count)) = division(records) else { return cells.push((number, records)) };
        // The order of records decides on sums, so it stays.
        let (below, above): (Vec<GuidingRecord>, Vec<GuidingRecord>) =
            records.iter().partition(|record| record.position[axis] < at);
        records[..count].copy_from_slice(&below);
        records[count..].copy_from_slice(&above);
        drop((below, above));
        let (below, above) = records.split_at_mut(count);
        self.divide(below, cells);
        self.nodes[number] = Node::Division { axis: axis as u8, at, above: self.nodes.len() as u32 };
        self.divide(above, cells);
    }

    /// The density of directions at a point; none if it isn't guided. An opaque surface has a normal.
    pub(crate) fn at(&self, point: DVec3, normal: Option<DVec3>) -> Option<GuidedVertex> {
        let near = point.as_vec3();
        let mut number = 0;
        loop {
            match self.nodes[number] {
                Node::Division { axis, at, above } => {
                    number = if near[usize::from(axis)] < at { number + 1 } else { above as usize };
                }
                Node::Cell(leaf) => {
                    let GuidingLeaf { probability, mixture } = &self.leaves[leaf? as usize];
                    return Some(GuidedVertex { probability: *probability, mixture: mixture.at(point, normal) });
                }
            }
        }
    }

    /// The number of cells that guide.
    pub fn cell_count(&self) -> usize {
        self.leaves.len()
    }

    /// The noise of directions with guiding, over that without, by records of paths that were guided.
    pub(crate) fn noise_ratio(&self) -> f64 {
        let Benefit { noise, guided_noise, .. } = self.benefit;
        if noise > 0.0 { guided_noise / noise } else { 1.0 }
    }
}

impl Benefit {
    /// The benefit in a cell with this guiding probability.
    fn of(records: &[GuidingRecord], probability: f64) -> Benefit {
        let scattered = || records.iter().filter(|record| record.radiance.is_some());
        let leaving: f64 = scattered().map(|record| record.leaving).sum();
        if leaving <= 0.0 {
            return Benefit::default();
        }
        let count = scattered().count() as f64;
        let noise = |probability| second_moment(scattered(), probability) * (count / leaving) * (count / leaving);
        Benefit { records: count, noise: noise(0.0), guided_noise: noise(probability) }
    }

    fn add(&mut self, other: Benefit) {
        self.records += other.records;
        self.noise += other.noise;
        self.guided_noise += other.guided_noise;
    }
}

/// The density of a cell's records, and what guiding brings there.
fn learn(records: &[GuidingRecord], is_final: bool) -> (Option<GuidingLeaf>, Benefit) {
    let samples: Vec<RadianceSample> = records.iter().filter_map(|record| record.radiance).collect();
    let middle = records.iter().map(|record| Vec3::from(record.position).as_dvec3()).sum::<DVec3>();
    let mixture = Mixture::new(&samples, middle / records.len().max(1) as f64, FEWEST_BRIGHT);
    let moments = PROBABILITIES.map(|probability| second_moment(records.iter(), probability));
    let mut best = 0;
    for (i, moment) in moments.iter().enumerate().filter(|_| mixture.is_some()) {
        if *moment < moments[best] {
            best = i;
        }
    }
    let probability = if is_final { PROBABILITIES[best] } else { TRAINING_PROBABILITY };
    let leaf = mixture.filter(|_| probability > 0.0).map(|mixture| GuidingLeaf { probability, mixture });
    (leaf, Benefit::of(records, PROBABILITIES[best]))
}

/// The second moment of the light of records, had their directions been sampled with this guiding probability.
fn second_moment<'r>(records: impl Iterator<Item = &'r GuidingRecord>, probability: f64) -> f64 {
    let of_one = |record: &GuidingRecord| {
        let pdf = pdf_of_both(probability, record.pdf_guide, record.pdf_scattering);
        if pdf > 0.0 { record.light * record.light * record.pdf / pdf } else { 0.0 }
    };
    records.map(of_one).sum()
}

/// The axis and place where records are divided, with the number of records below. None if they form a cell.
fn division(records: &[GuidingRecord]) -> Option<(usize, f32, usize)> {
    if records.len() <= RECORDS_PER_CELL {
        return None;
    }
    let positions = || records.iter().map(|record| Vec3::from(record.position));
    let min = positions().fold(Vec3::INFINITY, Vec3::min);
    let max = positions().fold(Vec3::NEG_INFINITY, Vec3::max);
    let size = max - min;
    let mut axes = [0, 1, 2];
    axes.sort_by(|a, b| size[*b].total_cmp(&size[*a]));
    axes.into_iter().find_map(|axis| {
        let at = min[axis] * 0.5 + max[axis] * 0.5;
        let count = records.iter().filter(|record| record.position[axis] < at).count();
        let enough = FEWEST_RECORDS..=records.len() - FEWEST_RECORDS;
        enough.contains(&count).then_some((axis, at, count))
    })
}
