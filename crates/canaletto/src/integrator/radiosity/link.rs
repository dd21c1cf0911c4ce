//! Links between nodes of the hierarchy, and their refinement by a bound of their error.
//!
//! Refinement takes steps. In each step the exchanges of all waiting pairs are found by all threads. The pairs are
//! then kept or replaced one after the other, so that the result doesn't depend on the number of threads.

use super::RadiosityError;
use super::exchange::{Effort, Exchange};
use super::mesh::PatchMesh;
use crate::job::{Observer, SolvingPhase};
use canaletto_parallel::prelude::*;
use glam::DVec3;

/// A link between two nodes that get light from each other.
#[derive(Clone, Copy, Debug)]
pub(super) struct Link {
    pub(super) nodes: [u32; 2],
    /// The form factor from the first node to the second with visibility. Links of clusters leave it to their members.
    pub(super) factor: f32,
    pub(super) visibility: f32,
    /// The errors of the powers that both nodes reflect, for a source of radiance 1.
    errors: [f32; 2],
    /// The errors for a source whose radiance deviates from its mean by 1.
    source_errors: [f32; 2],
}

impl Link {
    /// The link of an exchange whose error doesn't matter.
    pub(super) fn between(nodes: [u32; 2], exchange: &Exchange) -> Link {
        let [factor, visibility] = [exchange.factor, exchange.visibility].map(|v| v as f32);
        Link { nodes, factor, visibility, errors: [0.0; 2], source_errors: [0.0; 2] }
    }
}

/// The most pairs whose exchanges are found in one step.
const STEP: usize = 1 << 16;

/// A pair that is refined at once if it is this many times brighter than allowed gets a ray for each cell.
const BRIGHT: f64 = 8.0;

/// A pair of nodes that may get light from each other.
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
    /// The round, for observers.
    pub(super) phase: SolvingPhase,
}

impl Refinement<'_, '_> {
    /// Refines the links whose error exceeds the limit.
    pub(super) fn refine(&mut self, links: Vec<Link>, observer: &dyn Observer) -> Result<Vec<Link>, RadiosityError> {
        let error = |link: &Link| self.error(link);
        let (bad, mut kept): (Vec<Link>, Vec<Link>) = links.into_iter().partition(|link| error(link) > self.limit);
        let mut waiting = Vec::new();
        let bad: Vec<Pair> = bad.iter().map(|link| link.nodes.into()).collect();
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
            self.mesh.tell(observer, self.phase, kept.len());
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
        kept.extend(pairs.par_iter().filter_map(link).collect());
    }

    /// The exchange of a pair; none if it must be refined.
    fn exchange(&self, (p, q): Pair, effort: Effort) -> Option<Exchange> {
        match (self.mesh.element_of(p), self.mesh.element_of(q)) {
            (Some(p), Some(q)) => Some(self.mesh.between(p, q, effort)),
            _ if p == q => None,
            _ => self.mesh.between_clusters(p, q, effort),
        }
    }

    /// The link of an exchange, if light may pass.
    fn link(&self, (p, q): Pair, exchange: Exchange) -> Option<Link> {
        let power = [p, q].map(|node| self.mesh.reflectance_of(node).max_element() * self.mesh.area_of(node));
        let errors = |spreads: [f64; 2]| [0, 1].map(|i| (spreads[i] * power[i]) as f32);
        // A pair without light may get some after a refinement, when one of them is brighter.
        (exchange.spreads != [0.0; 2]).then(|| Link {
            errors: errors(exchange.spreads),
            source_errors: errors(exchange.source_spreads),
            ..Link::between([p, q], &exchange)
        })
    }

    /// The larger error of the powers that both nodes of a link reflect.
    fn error(&self, link: &Link) -> f64 {
        let of = |receiver: usize| {
            let source = link.nodes[1 - receiver] as usize;
            f64::from(link.errors[receiver]) * self.radiance[source].max_element()
                + f64::from(link.source_errors[receiver]) * self.deviation[source]
        };
        of(0).max(of(1))
    }

    fn decide(&self, pair: Pair) -> Decision {
        if self.mesh.area_of(pair.0) == 0.0 || self.mesh.area_of(pair.1) == 0.0 {
            return Decision::Drop;
        }
        let Some(exchange) = self.exchange(pair, Effort::Few) else { return Decision::Refine };
        let Some(mut link) = self.link(pair, exchange) else { return Decision::Drop };
        // A few rays that agree are too few for a bright pair.
        if (self.limit..self.limit * BRIGHT).contains(&self.error(&link))
            && let Some(exchange) = self.exchange(pair, Effort::All)
        {
            link = self.link(pair, exchange).unwrap_or(link);
        }
        if self.error(&link) > self.limit && self.divided(pair).is_some() {
            return Decision::Refine;
        }
        Decision::Keep(link)
    }

    /// Which node of a pair is replaced by its parts: the first (true) or the second.
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
                _ if p == q => {
                    waiting
                        .extend(parts.iter().enumerate().flat_map(|(i, &a)| parts[i..].iter().map(move |&b| (a, b))));
                }
                Some(true) => waiting.extend(parts.into_iter().map(|part| (part, q))),
                _ => waiting.extend(parts.into_iter().map(|part| (p, part))),
            }
        }
        whole
    }
}
