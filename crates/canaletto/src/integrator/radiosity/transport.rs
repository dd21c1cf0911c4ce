//! How light goes from patch to patch: the terms of a patch's equation, found again from the links that solved it.

use super::exchange::Effort;
use super::gathering::Gathering;
use super::hierarchical::Given;
use super::interpolation::VertexPatches;
use super::local_pass::{LocalPass, LocalRadiance, SeenNode};
use super::mesh::{NONE, PatchMesh};
use super::{Balanced, RadiositySolution};
use crate::world::Hit;
use canaletto_parallel::prelude::*;
use glam::DVec3;

/// A solved balance with its links.
pub(crate) struct Transport<'w> {
    mesh: PatchMesh<'w>,
    /// The form factors by receiver; none for shooting, which finds them as it needs them.
    gathering: Option<Gathering>,
    /// For each element the factor of what it receives, and its form factor to itself.
    closure: Vec<(f64, f64)>,
    /// The light of the scene's lights and of the environment, for each node where it was found.
    lit: Vec<DVec3>,
    sky: Vec<DVec3>,
    /// The radiance that each node emits, and that which it reflects.
    emitted: Vec<DVec3>,
    reflected: Vec<DVec3>,
    /// The element of each patch.
    leaves: Vec<u32>,
    /// For each element, whether no direction is open.
    closed: Vec<bool>,
    /// The radiance of nodes that the local pass takes; none without links.
    local_radiance: Option<LocalRadiance>,
}

/// The terms of the light that arrives at a place.
#[derive(Clone, Debug, Default)]
pub(crate) struct LightTerms {
    /// Of the scene's lights without a reflection.
    pub(crate) direct: Vec<PatchLight>,
    /// Straight from emitting surfaces.
    pub(crate) from_emitters: Vec<PatchLight>,
    /// By reflections and from the environment.
    pub(crate) indirect: Vec<PatchLight>,
}

impl LightTerms {
    fn add(&mut self, share: f64, terms: LightTerms) {
        let scaled = |terms: Vec<PatchLight>| terms.into_iter().map(move |term| term.scaled(share));
        self.direct.extend(scaled(terms.direct));
        self.from_emitters.extend(scaled(terms.from_emitters));
        self.indirect.extend(scaled(terms.indirect));
    }
}

/// Where light comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum LightSource {
    /// One of the world's lights, by number.
    Light(u32),
    Environment,
    /// A node of the hierarchy of patches.
    Node(u32),
    /// The patch itself, as a node. In a closed room, the sum of a patch's form factors is 1. It sees itself where
    /// they lack.
    Itself(u32),
}

/// Light that arrives at a patch from one source over one link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PatchLight {
    pub(crate) source: LightSource,
    /// The light, as the radiance of a white surface in it. For nodes it is `form_factor` times `radiance`.
    pub(crate) light: DVec3,
    /// The share of the receiver's view that the node fills.
    pub(crate) form_factor: f64,
    /// The radiance of the node.
    pub(crate) radiance: DVec3,
    /// The area of the linked part of the surface: of the patch, or of an element that contains it.
    pub(crate) receiver_area: f64,
}

impl PatchLight {
    fn scaled(self, share: f64) -> PatchLight {
        let form_factor = self.form_factor * share;
        let light = match self.source {
            LightSource::Light(_) | LightSource::Environment => self.light * share,
            LightSource::Node(_) | LightSource::Itself(_) => self.radiance * form_factor,
        };
        PatchLight { light, form_factor, ..self }
    }
}

impl<'w> Transport<'w> {
    pub(super) fn new(mesh: PatchMesh<'w>, balanced: Balanced, local_radiance: Option<LocalRadiance>) -> Transport<'w> {
        let Balanced { given, light, gathering, .. } = balanced;
        let closure = match &gathering {
            Some(gathering) => gathering.closure(&mesh, &given.closed),
            None => vec![(1.0, 0.0); mesh.elements.len()],
        };
        let emitted = light.sent_emission;
        let reflected = light.sent.iter().zip(&emitted).map(|(&sent, &emitted)| sent - emitted).collect();
        let leaves = mesh.leaf_elements();
        let Given { lit, sky, closed } = given;
        Transport { gathering, closure, lit, sky, emitted, reflected, leaves, closed, local_radiance, mesh }
    }

    /// The mean light on a patch.
    pub(crate) fn of_patch(&self, patch: usize) -> LightTerms {
        let mut indirect = self.sent_by_nodes(patch, &self.reflected);
        indirect.extend(self.sky(patch));
        LightTerms { direct: self.direct(patch), from_emitters: self.sent_by_nodes(patch, &self.emitted), indirect }
    }

    /// The light at the centre of a patch.
    pub(crate) fn at_center(&self, patch: usize) -> LightTerms {
        match self.seen_at(patch, self.mesh.elements[self.leaves[patch] as usize].center) {
            Some([from_emitters, mut indirect]) => {
                indirect.extend(self.sky(patch));
                LightTerms { direct: self.direct(patch), from_emitters, indirect }
            }
            None => self.of_patch(patch),
        }
    }

    /// The light at a vertex of a solution's interpolation.
    pub(crate) fn at_vertex(&self, solution: &RadiositySolution, vertex: u32) -> LightTerms {
        let point = solution.interpolation.points[vertex as usize];
        let leaf = |patch: u32| &self.mesh.elements[self.leaves[patch as usize] as usize];
        let mut around = solution.interpolation.around(vertex);
        around.retain(|&patch| leaf(patch).area > 0.0);
        let VertexPatches { shares, planes } = VertexPatches::new(&self.mesh, leaf, &around, point);
        let mut terms = LightTerms::default();
        for (patch, share) in shares {
            let patch = patch as usize;
            let mean = match self.local_radiance {
                None => self.of_patch(patch),
                Some(_) => {
                    let indirect = self.sky(patch).collect();
                    LightTerms { direct: self.direct(patch), from_emitters: Vec::new(), indirect }
                }
            };
            terms.add(share, mean);
        }
        let share = 1.0 / planes.len() as f64;
        for seen in planes.into_iter().filter_map(|patch| self.seen_at(patch as usize, point)) {
            let [from_emitters, indirect] = seen;
            terms.add(share, LightTerms { direct: Vec::new(), from_emitters, indirect });
        }
        terms
    }

    /// The light that a point of a patch gets from nodes by emission and by reflections, as the local pass finds it.
    /// None without a local pass.
    fn seen_at(&self, patch: usize, point: DVec3) -> Option<[Vec<PatchLight>; 2]> {
        let (gathering, local_radiance) = self.gathering.as_ref().zip(self.local_radiance.as_ref())?;
        let local = LocalPass::again(&self.mesh, gathering, &self.closed, local_radiance);
        let own = self.leaves[patch];
        let mut seen = Vec::new();
        let (scale, missing) = local.visit_seen(own, point, |node| seen.push(node));
        let LocalRadiance { emission, reflection } = local_radiance;
        Some([emission, reflection].map(|radiance| {
            let node = |seen: &SeenNode| {
                let source = LightSource::Node(seen.node);
                self.sent(source, seen.node, radiance, seen.form_factor * scale, seen.receiver)
            };
            let own_node = self.mesh.node(own);
            let itself = self.sent(LightSource::Itself(own_node), own_node, radiance, missing, own);
            seen.iter().map(node).chain([itself]).filter(|light| light.light != DVec3::ZERO).collect()
        }))
    }

    /// The light of the scene's lights that arrives at a patch without a reflection.
    fn direct(&self, patch: usize) -> Vec<PatchLight> {
        let is_lit = |element: &u32| self.lit[self.mesh.node(*element) as usize] != DVec3::ZERO;
        let of = |element: u32, light: u32| {
            self.without_a_node(LightSource::Light(light), self.mesh.lit_by(light, element), element)
        };
        let lights = 0..self.mesh.world.lights.len() as u32;
        let lit = self.elements_around(patch).filter(is_lit);
        let all = lit.flat_map(|element| lights.clone().map(move |light| of(element, light)));
        all.filter(|light| light.light != DVec3::ZERO).collect()
    }

    /// The light of the environment that arrives at a patch.
    fn sky(&self, patch: usize) -> impl Iterator<Item = PatchLight> {
        let sky = |element: u32| {
            self.without_a_node(LightSource::Environment, self.sky[self.mesh.node(element) as usize], element)
        };
        self.elements_around(patch).map(sky).filter(|sky| sky.light != DVec3::ZERO)
    }

    /// The light that arrives at a patch from nodes of these radiances.
    fn sent_by_nodes(&self, patch: usize, radiance: &[DVec3]) -> Vec<PatchLight> {
        let own = self.leaves[patch];
        let (scale, missing) = self.closure[own as usize];
        let linked = |node: u32, form_factor: f64, receiver: u32| {
            self.sent(LightSource::Node(node), node, radiance, form_factor, receiver)
        };
        let mut found: Vec<PatchLight> = match &self.gathering {
            Some(gathering) => self
                .elements_around(patch)
                .flat_map(|element| {
                    let factors = gathering.of(self.mesh.node(element) as usize).iter();
                    factors.map(move |factor| linked(factor.source, f64::from(factor.factor) * scale, element))
                })
                .collect(),
            None => {
                let from = |&element: &u32| {
                    linked(self.mesh.node(element), self.mesh.between(own, element, Effort::Few).factor, own)
                };
                self.leaves.par_iter().map(from).collect()
            }
        };
        let own_node = self.mesh.node(own);
        found.push(self.sent(LightSource::Itself(own_node), own_node, radiance, missing, own));
        found.retain(|light| light.light != DVec3::ZERO);
        found
    }

    /// The light that a node of one of these radiances sends to an element.
    fn sent(&self, source: LightSource, node: u32, radiance: &[DVec3], form_factor: f64, receiver: u32) -> PatchLight {
        let radiance = radiance[node as usize];
        let receiver_area = self.mesh.elements[receiver as usize].area;
        PatchLight { source, light: radiance * form_factor, form_factor, radiance, receiver_area }
    }

    fn without_a_node(&self, source: LightSource, light: DVec3, receiver: u32) -> PatchLight {
        PatchLight {
            source,
            light,
            form_factor: 0.0,
            radiance: DVec3::ZERO,
            receiver_area: self.mesh.elements[receiver as usize].area,
        }
    }

    /// The element of a patch and those that contain it, from the inside out.
    fn elements_around(&self, patch: usize) -> impl Iterator<Item = u32> {
        let parent = |&element: &u32| match self.mesh.elements[element as usize].parent {
            NONE => None,
            parent => self.mesh.element_of(parent),
        };
        std::iter::successors(Some(self.leaves[patch]), parent)
    }

    /// The centre and the area of a node.
    pub(crate) fn place_of(&self, node: u32) -> (DVec3, f64) {
        (self.mesh.ball(node).0, self.mesh.area_of(node))
    }

    /// A hit of the surface of a node, with the number of its material. None for clusters.
    pub(crate) fn surface_of(&self, node: u32) -> Option<(Hit, u32)> {
        let element = self.mesh.element_of(node)?;
        Some((self.hit_of(element), self.mesh.roots[self.mesh.elements[element as usize].root as usize].material))
    }

    /// Hits of the surfaces in a cluster, one for each.
    pub(crate) fn members_of(&self, cluster: u32) -> impl Iterator<Item = Hit> {
        self.mesh.clusters[cluster as usize].elements.clone().map(|element| self.hit_of(element))
    }

    fn hit_of(&self, element: u32) -> Hit {
        let element = &self.mesh.elements[element as usize];
        let root = &self.mesh.roots[element.root as usize];
        let primitive = root.primitive_at(element.center);
        Hit { t: 0.0, instance: root.instance, primitive, part: root.part, uv: [0.0; 2], time: 0.0 }
    }
}
