//! A tree of lights: chooses one of many lights for a point, nearly in proportion to the light that arrives from it if
//! nothing lies between (Conty & Kulla, *Importance Sampling of Many Lights with Adaptive Tree Splitting*, 2018).
//!
//! Every node bounds a cluster of lights by a box, a cone of normals and an intensity. A point goes from the root to a
//! light, and at each node into a child with a probability in proportion to the child's importance. The probability of
//! a given light is found from its leaf upwards.
//!
//! Deviations: Nodes have [`ARITY`] children instead of two, since the importance of a small cluster is more exact than
//! that of the two halves of a large one. Clusters aren't split into several lights for a point. Boxes are scored by
//! their diagonals. Near a cluster and within it, the distance is that from its centre, but at least its radius.

mod bounds;
mod build;
#[cfg(test)]
mod tests;

pub(super) use bounds::{ClusterBounds, NormalCone};

use crate::math::{larger, smaller};
use build::{BinaryNode, Content, build};
use canaletto_bvh::{InstructionSet, Kernel};
use glam::{DVec3, Vec3};

/// The number of children of a node.
const ARITY: usize = 8;

/// The least cosine at a lit surface that counts. Light from behind a surface's normal may still count for some
/// materials, and it must be possible to choose it.
const LEAST_COSINE: f64 = 0.02;

/// The least distance that counts, as a share of the tree's extent.
const LEAST_DISTANCE: f32 = 1e-6;

/// The divisor c + l d + q d² of light from distance d.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Falloff(pub(super) [f32; 3]);

/// A point that lights shine on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Receiver {
    pub(super) point: DVec3,
    /// The unit normal; zero in a medium, where the direction of light doesn't matter.
    pub(super) normal: DVec3,
    /// Whether light from behind counts as much.
    pub(super) two_sided: bool,
}

impl Receiver {
    /// A point in a medium.
    pub(super) fn in_medium(point: DVec3) -> Receiver {
        Receiver { point, normal: DVec3::ZERO, two_sided: false }
    }

    /// The least cosine that counts.
    pub(super) fn least_cosine(&self) -> f64 {
        if self.normal == DVec3::ZERO { 1.0 } else { LEAST_COSINE }
    }
}

/// The tree.
#[derive(Debug)]
pub(super) struct LightTree {
    /// The nodes, the root first.
    nodes: Vec<Node>,
    /// For each light its node and its place there.
    places: Vec<[u32; 2]>,
    /// The middle of all lights and half the diagonal of their box: nodes are in units of it.
    center: DVec3,
    extent: f64,
    /// The divisor c + l d + q d² of light in these units. It is 1 at the distance 1.
    falloff: [f32; 3],
    /// The irradiance of a surface that faces all lights from the distance 1. Nodes hold shares of it.
    irradiance: f64,
    /// Whether lights emit by the cosine to their normals, instead of evenly.
    by_cosine: bool,
}

/// A node's children, each number of all of them side by side.
#[derive(Clone, Debug)]
struct Node {
    /// The node above and the place there; the root is its own.
    parent: [u32; 2],
    center: [[f32; ARITY]; 3],
    /// The squared radius of the sphere around the box.
    radius2: [f32; ARITY],
    axis: [[f32; ARITY]; 3],
    /// Cosine and sine of the largest angle between the axis and a normal.
    cos_o: [f32; ARITY],
    sin_o: [f32; ARITY],
    /// The cosine of the largest angle between a normal and a direction of emission.
    cos_e: [f32; ARITY],
    /// The sign of the cosine behind a light: −1 if as much light leaves there.
    behind: [f32; ARITY],
    /// The share of the tree's intensity; 0 where there is no child.
    intensity: [f32; ARITY],
    /// The index of a node, or the number of a light.
    child: [u32; ARITY],
    is_light: [bool; ARITY],
}

/// A receiver in the tree's units.
struct Local {
    point: Vec3,
    normal: Vec3,
    /// The sign of the cosine behind the surface: −1 if light from there counts as much.
    behind: f32,
    least_cosine: f32,
}

impl LightTree {
    /// The tree over these lights, of which each has an intensity above 0. `radius` is that of the scene, the unit of
    /// a tree without an extent.
    pub(super) fn new(lights: &[ClusterBounds], falloff: Falloff, by_cosine: bool, radius: f64) -> LightTree {
        let binary = build(lights);
        let whole = binary.last().map_or(ClusterBounds::NONE, |root| root.bounds);
        let extent = 0.5 * (whole.max - whole.min).length();
        let extent = [extent, radius].into_iter().find(|size| *size > 0.0 && size.is_finite()).unwrap_or(1.0);
        let [c, l, q] = falloff.0.map(f64::from);
        let falloff = [c, l * extent, q * extent * extent];
        let at_one: f64 = falloff.iter().sum();
        let mut tree = LightTree {
            nodes: Vec::with_capacity(lights.len() / (ARITY / 2) + 1),
            places: vec![[0; 2]; lights.len()],
            center: whole.center(),
            extent,
            falloff: falloff.map(|v| (v / at_one) as f32),
            irradiance: whole.intensity / at_one,
            by_cosine,
        };
        if !binary.is_empty() {
            tree.push(&binary, binary.len() as u32 - 1, [0; 2]);
        }
        tree
    }

    /// Adds the wide node of a binary node. Returns its index.
    fn push(&mut self, binary: &[BinaryNode], root: u32, parent: [u32; 2]) -> u32 {
        let mut children = vec![root];
        while children.len() < ARITY {
            let pairs = children.iter().enumerate().filter(|(_, child)| binary[**child as usize].count > 1);
            // The first of equals, so that the order is the same on every machine.
            let costs = pairs.map(|(place, child)| {
                let BinaryNode { bounds, count, .. } = &binary[*child as usize];
                (place, bounds.cost(), *count)
            });
            let largest = costs.reduce(|a, b| if (b.1, b.2) > (a.1, a.2) { b } else { a });
            let Some((place, ..)) = largest else { break };
            let Content::Pair([first, second]) = binary[children[place] as usize].content else { break };
            children[place] = first;
            children.insert(place + 1, second);
        }
        let index = self.nodes.len();
        self.nodes.push(Node::new(parent));
        for (place, child) in children.into_iter().enumerate() {
            let BinaryNode { bounds, content, .. } = &binary[child as usize];
            let at = [index as u32, place as u32];
            let (number, is_light) = match *content {
                Content::Light(light) => {
                    self.places[light as usize] = at;
                    (light, true)
                }
                Content::Pair(_) => (self.push(binary, child, at), false),
            };
            let (center, extent) = (self.center, self.extent);
            let share = bounds.intensity / binary[binary.len() - 1].bounds.intensity;
            self.nodes[index].set(place, bounds, (center, extent), share, number, is_light);
        }
        index as u32
    }

    fn local(&self, receiver: &Receiver) -> Local {
        Local {
            point: ((receiver.point - self.center) / self.extent).as_vec3(),
            normal: receiver.normal.as_vec3(),
            behind: if receiver.two_sided { -1.0 } else { 1.0 },
            least_cosine: receiver.least_cosine() as f32,
        }
    }

    /// About the irradiance at a point by all lights.
    pub(super) fn importance(&self, receiver: &Receiver) -> f64 {
        let local = self.local(receiver);
        self.nodes.first().map_or(0.0, |root| sum(&self.importances(root, &local)) * self.irradiance)
    }

    /// The light that `u` of [0, 1) chooses for a point, and its probability. None if no light can shine there.
    pub(super) fn sample(&self, receiver: &Receiver, mut u: f64) -> Option<(u32, f64)> {
        let local = self.local(receiver);
        let (mut node, mut probability) = (self.nodes.first()?, 1.0);
        loop {
            let importances = self.importances(node, &local);
            let total = sum(&importances);
            if total <= 0.0 {
                return None;
            }
            let mut rest = u * total;
            let mut place = None;
            for (i, importance) in importances.iter().map(|v| f64::from(*v)).enumerate() {
                if importance > 0.0 {
                    place = Some(i);
                    if rest < importance {
                        break;
                    }
                    rest -= importance;
                }
            }
            let place = place?;
            let importance = f64::from(importances[place]);
            u = (rest / importance).clamp(0.0, BELOW_ONE);
            probability *= importance / total;
            if node.is_light[place] {
                return Some((node.child[place], probability));
            }
            node = &self.nodes[node.child[place] as usize];
        }
    }

    /// The probability with which [`LightTree::sample`] chooses a light for a point.
    pub(super) fn probability(&self, receiver: &Receiver, light: u32) -> f64 {
        let local = self.local(receiver);
        let [mut index, mut place] = self.places[light as usize];
        let mut probability = 1.0;
        loop {
            let node = &self.nodes[index as usize];
            let importances = self.importances(node, &local);
            let importance = f64::from(importances[place as usize]);
            if importance <= 0.0 {
                return 0.0;
            }
            probability *= importance / sum(&importances);
            if index == 0 {
                return probability;
            }
            [index, place] = node.parent;
        }
    }

    /// The importance of each child of a node.
    #[inline]
    fn importances(&self, node: &Node, to: &Local) -> [f32; ARITY] {
        InstructionSet::run(Importances { node, to, falloff: self.falloff, by_cosine: self.by_cosine })
    }
}

/// Finds the importances of all children of a node side by side.
struct Importances<'a> {
    node: &'a Node,
    to: &'a Local,
    falloff: [f32; 3],
    by_cosine: bool,
}

impl Kernel for Importances<'_> {
    type Answer = [f32; ARITY];

    #[inline(always)]
    fn run(self) -> [f32; ARITY] {
        let Importances { node, to, falloff: [c, l, q], by_cosine } = self;
        // Numbers instead of conditions, so that the loop is vectorised.
        let even = if by_cosine { 0.0 } else { 1.0 };
        let mut importances = [0.0; ARITY];
        for (i, importance) in importances.iter_mut().enumerate() {
            let d = Vec3::new(node.center[0][i], node.center[1][i], node.center[2][i]) - to.point;
            let (d2, r2) = (d.dot(d), node.radius2[i]);
            let inside = d2 <= r2;
            let far2 = larger(d2, LEAST_DISTANCE * LEAST_DISTANCE);
            let per_distance = 1.0 / far2.sqrt();
            // The angle under which the sphere around the cluster is seen.
            let sin2_b = smaller(r2 / far2, 1.0);
            let (sin_b, cos_b) = (sin2_b.sqrt(), (1.0 - sin2_b).sqrt());
            let axis = Vec3::new(node.axis[0][i], node.axis[1][i], node.axis[2][i]);
            let cos_w = -axis.dot(d) * per_distance;
            let cos_w = larger(cos_w, cos_w * node.behind[i]);
            let (cos_x, sin_x) = less([cos_w, sine(cos_w)], [node.cos_o[i], node.sin_o[i]]);
            let (cos_out, _) = less([cos_x, sin_x], [cos_b, sin_b]);
            let cos_out = if inside { 1.0 } else { cos_out };
            let cos_in = to.normal.dot(d) * per_distance;
            let cos_in = larger(cos_in, cos_in * to.behind);
            let (cos_in, _) = less([cos_in, sine(cos_in)], [cos_b, sin_b]);
            let cos_in = if inside { 1.0 } else { larger(cos_in, to.least_cosine) };
            let far2 = larger(far2, r2);
            let divisor = larger(c + l * far2.sqrt() + q * far2, f32::MIN_POSITIVE);
            let emitted = even + cos_out * (1.0 - even);
            let whole = node.intensity[i] * emitted * cos_in / divisor;
            // A cosine of −1 or less stands for emission in all directions.
            let is_lit = (cos_out > node.cos_e[i]) | (node.cos_e[i] <= -1.0);
            *importance = if is_lit & (whole > 0.0) { smaller(whole, f32::MAX) } else { 0.0 };
        }
        importances
    }
}

/// The largest number below 1.
const BELOW_ONE: f64 = 1.0 - f64::EPSILON / 2.0;

fn sum(importances: &[f32; ARITY]) -> f64 {
    importances.iter().map(|v| f64::from(*v)).sum()
}

#[inline(always)]
fn sine(cos: f32) -> f32 {
    larger(1.0 - cos * cos, 0.0).sqrt()
}

/// Cosine and sine of an angle less another, or of 0 if the other is larger.
#[inline(always)]
fn less([cos_a, sin_a]: [f32; 2], [cos_b, sin_b]: [f32; 2]) -> (f32, f32) {
    if cos_a > cos_b { (1.0, 0.0) } else { (cos_a * cos_b + sin_a * sin_b, sin_a * cos_b - cos_a * sin_b) }
}

impl Node {
    fn new(parent: [u32; 2]) -> Node {
        Node {
            parent,
            center: [[0.0; ARITY]; 3],
            radius2: [0.0; ARITY],
            axis: [[0.0; ARITY]; 3],
            cos_o: [0.0; ARITY],
            sin_o: [0.0; ARITY],
            cos_e: [0.0; ARITY],
            behind: [1.0; ARITY],
            intensity: [0.0; ARITY],
            child: [0; ARITY],
            is_light: [false; ARITY],
        }
    }

    fn set(
        &mut self,
        place: usize,
        bounds: &ClusterBounds,
        (center, extent): (DVec3, f64),
        share: f64,
        child: u32,
        is_light: bool,
    ) {
        let middle = ((bounds.center() - center) / extent).as_vec3();
        let axis = bounds.normals.axis.as_vec3();
        for k in 0..3 {
            (self.center[k][place], self.axis[k][place]) = (middle[k], axis[k]);
        }
        let radius = 0.5 * (bounds.max - bounds.min).length() / extent;
        self.radius2[place] = (radius * radius) as f32;
        let (sin, cos) = libm::sincos(bounds.normals.angle);
        (self.cos_o[place], self.sin_o[place]) = (cos as f32, sin as f32);
        self.cos_e[place] = libm::cos(bounds.emission_angle) as f32;
        self.behind[place] = if bounds.two_sided { -1.0 } else { 1.0 };
        self.intensity[place] = share as f32;
        self.child[place] = child;
        self.is_light[place] = is_light;
    }
}
