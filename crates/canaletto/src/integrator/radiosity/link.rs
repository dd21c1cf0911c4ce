//! Links between nodes of the hierarchy, and their refinement by a bound of their error.
//!
//! Refinement takes steps. In each step the exchanges of all waiting pairs are found by all threads. The pairs are
//! then kept or replaced one after the other, so that the result doesn't depend on the number of threads.

use super::RadiosityError;
use super::exchange::{Effort, Exchange};
use super::mesh::PatchMesh;
use crate::job::Observer;
use glam::DVec3;
use rayon::prelude::*;

/// A link: what a receiver gets from a source.
#[derive(Clone, Copy, Debug)]
pub(super) struct Link {
    pub(super) receiver: u32,
    pub(super) source: u32,
    /// The form factor with visibility.
    pub(super) factor: f32,
    pub(super) visibility: f32,
    /// The error of the power that the receiver reflects, for a source of radiance 1.
    error: f32,
    /// The error for a source whose radiance deviates from its mean by 1.
    source_error: f32,
}

impl Link {
    /// The link of an exchange whose error doesn't matter.
    pub(super) fn between(receiver: u32, source: u32, exchange: &Exchange) -> Link {
        let [factor, visibility] = [exchange.factor, exchange.visibility].map(|v| v as f32);
        Link { receiver, source, factor, visibility, error: 0.0, source_error: 0.0 }
    }
}

/// The most pairs whose exchanges are found in one step.
const STEP: usize = 1 << 16;

/// A pair that is refined at once if it is this many times brighter than allowed gets a ray for each cell.
const BRIGHT: f64 = 8.0;

/// A pair of a receiver and a source.
type Pair = (u32, u32);

/// What becomes of a pair.
enum Decision {
    Drop,
    Keep(Link),
    Refine,
}

/// The links of a hierarchy, and the limit of their errors.
pub(super) struct Refinement<'a, 'w> {
    pub(super) mesh: &'a mut PatchMesh<'w>,
    /// The radiance of nodes. Nodes without a value have that of their parents.
    pub(super) radiance: &'a mut Vec<DVec3>,
    /// The deviation of radiance within nodes.
    pub(super) deviation: &'a mut Vec<f64>,
    /// The largest error of a link, as power.
    pub(super) limit: f64,
}

impl Refinement<'_, '_> {
    /// Refines the links whose error exceeds the limit.
    pub(super) fn refine(&mut self, links: Vec<Link>, observer: &dyn Observer) -> Result<Vec<Link>, RadiosityError> {
        let error = |link: &Link| {
            f64::from(link.error) * self.radiance[link.source as usize].max_element()
                + f64::from(link.source_error) * self.deviation[link.source as usize]
        };
        let (bad, mut kept): (Vec<Link>, Vec<Link>) = links.into_iter().partition(|link| error(link) > self.limit);
        let mut waiting = Vec::new();
        let bad: Vec<Pair> = bad.iter().map(|link| (link.receiver, link.source)).collect();
        let whole = self.replace_all(&bad, &mut waiting);
        self.keep_all(&whole, &mut kept);
        self.link_all(waiting, &mut kept, observer)?;
        Ok(kept)
    }

    /// Finds the links between all pairs below a pair.
    pub(super) fn link_all(
        &mut self,
        mut waiting: Vec<Pair>,
        kept: &mut Vec<Link>,
        observer: &dyn Observer,
    ) -> Result<(), RadiosityError> {
        while !waiting.is_empty() {
            if observer.cancelled() {
                return Err(RadiosityError::Cancelled);
            }
            let step = waiting.split_off(waiting.len().saturating_sub(STEP));
            let this = &*self;
            let decisions: Vec<Decision> = step.par_iter().with_min_len(16).map(|&pair| this.decide(pair)).collect();
            let mut refined = Vec::new();
            for (&pair, decision) in step.iter().zip(decisions) {
                match decision {
                    Decision::Drop => {}
                    Decision::Keep(link) => kept.push(link),
                    Decision::Refine => refined.push(pair),
                }
            }
            let whole = self.replace_all(&refined, &mut waiting);
            self.keep_all(&whole, kept);
        }
        Ok(())
    }

    /// Keeps links between pairs that can't be refined any more.
    fn keep_all(&self, pairs: &[Pair], kept: &mut Vec<Link>) {
        let link = |&pair: &Pair| self.link(pair, self.exchange(pair, Effort::All)?);
        kept.extend(pairs.par_iter().filter_map(link).collect::<Vec<Link>>());
    }

    /// The exchange of a pair; none if it must be refined.
    fn exchange(&self, (p, q): Pair, effort: Effort) -> Option<Exchange> {
        match (self.mesh.element_of(p), self.mesh.element_of(q)) {
            (Some(p), Some(q)) => Some(self.mesh.between(p, q, effort)),
            _ if p == q => None,
            _ => self.mesh.between_clusters(p, q, effort),
        }
    }

    fn link(&self, (receiver, source): Pair, exchange: Exchange) -> Option<Link> {
        let reflectance = self.mesh.reflectance_of(receiver).max_element();
        let power = reflectance * self.mesh.area_of(receiver);
        let [error, source_error] = [exchange.spread, exchange.source_spread].map(|spread| (spread * power) as f32);
        // A pair without light may get some after a refinement, when its source is brighter.
        (exchange.factor > 0.0 || exchange.spread > 0.0).then_some(Link {
            receiver,
            source,
            factor: exchange.factor as f32,
            visibility: exchange.visibility as f32,
            error,
            source_error,
        })
    }

    fn decide(&self, pair: Pair) -> Decision {
        let (p, q) = pair;
        let [area_p, area_q] = [p, q].map(|node| self.mesh.area_of(node));
        if area_p == 0.0 || area_q == 0.0 {
            return Decision::Drop;
        }
        let brightness = self.radiance[q as usize].max_element();
        let power = self.mesh.reflectance_of(p).max_element() * area_p;
        let error = |exchange: &Exchange| {
            power * (exchange.spread * brightness + exchange.source_spread * self.deviation[q as usize])
        };
        let Some(mut exchange) = self.exchange(pair, Effort::Few) else { return Decision::Refine };
        // A few rays that agree are too few for a bright pair.
        if (self.limit..self.limit * BRIGHT).contains(&error(&exchange)) {
            exchange = self.exchange(pair, Effort::All).unwrap_or(exchange);
        }
        if exchange.spread == 0.0 {
            return Decision::Drop;
        }
        if error(&exchange) > self.limit && self.divided(pair).is_some() {
            return Decision::Refine;
        }
        self.link(pair, exchange).map_or(Decision::Drop, Decision::Keep)
    }

    /// Which node of a pair is replaced by its parts: the receiver (true) or the source.
    fn divided(&self, (p, q): Pair) -> Option<bool> {
        let can = |node: u32| match self.mesh.element_of(node) {
            None => true,
            Some(element) => {
                let limited = self.mesh.limit_reached && self.mesh.elements[element as usize].is_leaf();
                !limited && self.mesh.is_divisible(element)
            }
        };
        let [(center_p, radius_p), (center_q, radius_q)] = [p, q].map(|node| self.mesh.ball(node));
        let overlap = center_p.distance(center_q) <= radius_p + radius_q;
        let is_cluster = |node: u32| self.mesh.element_of(node).is_none();
        // Clusters that overlap the other node have no exchange.
        let first = match (overlap, is_cluster(p), is_cluster(q)) {
            (true, true, false) => true,
            (true, false, true) => false,
            _ => radius_p >= radius_q,
        };
        match (can(p), can(q)) {
            (true, true) => Some(first),
            (true, false) => Some(true),
            (false, true) => Some(false),
            (false, false) => None,
        }
    }

    /// Replaces pairs by pairs of parts. Elements are subdivided where they have no parts. Returns the pairs that can't
    /// be replaced.
    fn replace_all(&mut self, pairs: &[Pair], waiting: &mut Vec<Pair>) -> Vec<Pair> {
        let chosen: Vec<Option<bool>> = pairs.iter().map(|&pair| self.divided(pair)).collect();
        let mut leaves: Vec<u32> = pairs
            .iter()
            .zip(&chosen)
            .filter_map(|(&(p, q), chosen)| self.mesh.element_of(if (*chosen)? { p } else { q }))
            .filter(|&element| self.mesh.elements[element as usize].is_leaf())
            .collect();
        leaves.sort_unstable();
        leaves.dedup();
        self.mesh.subdivide(&leaves);
        self.mesh.inherit(self.radiance);
        self.mesh.inherit(self.deviation);
        let mut whole = Vec::new();
        for (&(p, q), chosen) in pairs.iter().zip(chosen) {
            let parts = chosen.map_or(Vec::new(), |first| self.mesh.children(if first { p } else { q }));
            match chosen {
                _ if parts.is_empty() => whole.push((p, q)),
                _ if p == q => waiting.extend(parts.iter().flat_map(|&a| parts.iter().map(move |&b| (a, b)))),
                Some(true) => waiting.extend(parts.into_iter().map(|part| (part, q))),
                _ => waiting.extend(parts.into_iter().map(|part| (p, part))),
            }
        }
        whole
    }
}
