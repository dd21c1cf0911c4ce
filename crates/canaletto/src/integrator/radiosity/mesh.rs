//! The hierarchy of patches: clusters of roots, roots, and the elements into which roots are subdivided.

use super::cluster::{Cluster, clusters};
use super::outline::{CELLS, Outline};
use super::root::{Root, facets, roots, solids};
use super::{RadiosityError, RadiositySettings};
use crate::job::{Observer, SolvingPhase, SolvingProgress};
use crate::math::Rgb;
use crate::world::{Solids, World};
use canaletto_bvh::Aabb;
use canaletto_parallel::prelude::*;
use glam::{DVec3, Vec3};
use std::cell::Cell;

/// No node.
pub(super) const NONE: u32 = u32::MAX;

/// The largest deviation of facets from curved surfaces, relative to the scene's diagonal times the wanted error.
const TOLERANCE: f64 = 0.2;

/// The area of the smallest element that a contact splits, relative to all area times the squared wanted error.
const CONTACT_AREA: f64 = 0.25;

/// The area of the smallest element at all, relative to all area.
const SMALLEST_AREA: f64 = 1e-9;

/// A root or a part of one: a patch, if it has no parts.
#[derive(Clone, Debug)]
pub(super) struct Element {
    pub(super) root: u32,
    pub(super) outline: Outline,
    pub(super) center: DVec3,
    pub(super) radius: f64,
    /// The area without what is covered.
    pub(super) area: f64,
    /// One bit for each cell whose sample point is bare.
    pub(super) bare: u16,
    /// The origins of rays that leave the cells.
    pub(super) origins: [Vec3; CELLS],
    /// The mean diffuse reflectance, in red, green and blue.
    pub(super) reflectance: DVec3,
    pub(super) emission: DVec3,
    pub(super) parent: u32,
    /// The first of its parts, which have successive numbers.
    pub(super) first_part: u32,
    pub(super) parts: u32,
}

impl Element {
    pub(super) fn is_leaf(&self) -> bool {
        self.parts == 0
    }

    pub(super) fn is_bare(&self, cell: usize) -> bool {
        self.bare >> cell & 1 == 1
    }

    /// The share of the area that is bare.
    pub(super) fn bare_share(&self) -> f64 {
        f64::from(self.bare.count_ones()) / CELLS as f64
    }
}

/// The hierarchy of patches of a world. Its nodes are clusters, then elements. A node's number is larger than its
/// parent's.
pub(super) struct PatchMesh<'w> {
    pub(super) world: &'w World,
    solids: Solids<'w>,
    pub(super) roots: Vec<Root>,
    pub(super) clusters: Vec<Cluster>,
    pub(super) elements: Vec<Element>,
    /// The number of elements without parts.
    pub(super) leaves: usize,
    /// The sum of all areas without what is covered.
    pub(super) area: f64,
    max_patches: usize,
    smallest: f64,
    /// Whether an element stayed whole because of the limit of patches.
    pub(super) limit_reached: bool,
}

impl<'w> PatchMesh<'w> {
    /// The roots of a world, split where other bodies touch them, and their clusters.
    pub(super) fn new(world: &'w World, settings: &RadiositySettings) -> Result<PatchMesh<'w>, RadiosityError> {
        let max_patches = settings.max_patches as usize;
        let error = f64::from(settings.error);
        let bounds = world.inner_bounds();
        let diagonal = if bounds.is_empty() { 1.0 } else { f64::from((bounds.max - bounds.min).length()) };
        let tolerance = diagonal * error * TOLERANCE;
        let facets = facets(world, tolerance, error, max_patches)?;
        let solids = solids(world, &facets)?;
        let roots = roots(world, &solids, &facets, tolerance, max_patches)?;
        let mut mesh = PatchMesh {
            world,
            solids,
            roots,
            clusters: Vec::new(),
            elements: Vec::new(),
            leaves: 0,
            area: 0.0,
            max_patches,
            smallest: 0.0,
            limit_reached: false,
        };
        let whole: f64 = mesh.roots.iter().map(|root| root.outline.area()).sum();
        mesh.smallest = whole * SMALLEST_AREA;
        let numbers: Vec<u32> = (0..mesh.roots.len() as u32).collect();
        let mut elements: Vec<Element> =
            numbers.par_iter().map(|&number| mesh.element(number, mesh.roots[number as usize].outline, NONE)).collect();
        elements.retain(|element| element.bare != 0);
        let order;
        (mesh.clusters, order) = clusters(&elements, &mesh.roots);
        mesh.elements =
            order.iter().map(|&(index, parent)| Element { parent, ..elements[index as usize].clone() }).collect();
        mesh.leaves = mesh.elements.len();
        mesh.split_at_contacts(whole * error * error * CONTACT_AREA);
        mesh.area = mesh.elements.iter().filter(|element| element.is_leaf()).map(|element| element.area).sum();
        mesh.sum_clusters();
        Ok(mesh)
    }

    /// The element of an outline within a root.
    fn element(&self, root: u32, outline: Outline, parent: u32) -> Element {
        let side = &self.roots[root as usize];
        let origins = std::array::from_fn(|i| side.ray_origin(self.world, outline.cell(i)));
        let is_covered = |i: usize| {
            let point = outline.cell(i);
            let inside = |at: &Aabb| {
                let p = point.as_vec3();
                p.cmpge(at.min).all() && p.cmple(at.max).all()
            };
            side.contacts.iter().any(inside)
                && self.solids.covers(side.instance, side.primitive_at(point), point, side.normal)
        };
        let bare = (0..CELLS).filter(|&i| !is_covered(i)).fold(0, |bare, i| bare | 1 << i);
        let mut element = Element {
            root,
            outline,
            center: outline.center(),
            radius: outline.radius(),
            area: 0.0,
            bare,
            origins,
            reflectance: DVec3::ZERO,
            emission: DVec3::ZERO,
            parent,
            first_part: NONE,
            parts: 0,
        };
        element.area = outline.area() * element.bare_share();
        (element.reflectance, element.emission) = self.material_of(&element);
        element
    }

    /// The mean reflectance and the mean emission of an element.
    fn material_of(&self, element: &Element) -> (DVec3, DVec3) {
        let root = &self.roots[element.root as usize];
        let material = &self.world.materials()[root.material as usize];
        let has_own_color = Cell::new(false);
        let at_cell = |cell: usize| {
            let point = root.within_rim(self.world, element.outline.cell(cell));
            let line = root.line_through(point);
            let met = self.world.surface_of(root.instance, root.primitive_at(point), line);
            let at = match met {
                Some((hit, mut surface)) => {
                    has_own_color.set(has_own_color.get() || surface.color.is_some());
                    self.world.material_point(material, (line, &hit), &mut surface, None, &mut ())
                }
                None => *material.plain(),
            };
            let seen = f64::from(at.coverage * (1.0 - at.overlay.1));
            [at.classic.kd, at.emitted(root.is_outer)].map(|color| vector(color) * seen)
        };
        let cells: Vec<usize> = (0..CELLS).filter(|&cell| element.is_bare(cell)).collect();
        let mean = |cells: &[usize]| {
            let sum = cells.iter().map(|&cell| at_cell(cell)).fold([DVec3::ZERO; 2], |[a, b], [c, d]| [a + c, b + d]);
            sum.map(|sum| sum / cells.len().max(1) as f64)
        };
        let first = mean(&cells[..cells.len().min(1)]);
        let [reflectance, emission] = if material.is_plain() && !has_own_color.get() { first } else { mean(&cells) };
        (reflectance, emission)
    }

    /// Splits the elements that a contact crosses until they are bare, covered or no larger than an area.
    fn split_at_contacts(&mut self, smallest: f64) {
        let mut waiting: Vec<u32> = (0..self.elements.len() as u32).collect();
        while !waiting.is_empty() {
            waiting.retain(|&element| {
                self.is_crossed(element) && self.elements[element as usize].outline.area() > smallest
            });
            let from = self.elements.len() as u32;
            self.subdivide(&waiting);
            waiting = (from..self.elements.len() as u32).collect();
        }
    }

    /// Whether a contact may cross an element.
    fn is_crossed(&self, element: u32) -> bool {
        let element = &self.elements[element as usize];
        if element.bare.count_ones() as usize != CELLS {
            return element.bare != 0;
        }
        // A body that stands between the sample points.
        let here = Aabb::from_points(element.outline.corners().iter().map(|p| p.as_vec3()));
        let cell = (here.max - here.min) * 0.25;
        self.roots[element.root as usize].contacts.iter().any(|contact| {
            let both = contact.intersection(&here);
            let size = both.max - both.min;
            !both.is_empty() && size.cmple(cell * 1.5).all() && size.cmpgt(cell * 1e-3).any()
        })
    }

    /// Tells an observer about a phase of solving with this number of links.
    pub(super) fn tell(&self, observer: &dyn Observer, phase: SolvingPhase, links: usize) {
        observer.solving(&SolvingProgress { phase, patches: self.leaves as u64, links: links as u64 });
    }

    /// The elements without parts, in order.
    pub(super) fn leaf_elements(&self) -> Vec<u32> {
        (0..self.elements.len() as u32).filter(|&element| self.elements[element as usize].is_leaf()).collect()
    }

    /// The number of a node for an element.
    pub(super) fn node(&self, element: u32) -> u32 {
        self.clusters.len() as u32 + element
    }

    /// The element of a node, if it isn't a cluster.
    pub(super) fn element_of(&self, node: u32) -> Option<u32> {
        node.checked_sub(self.clusters.len() as u32)
    }

    pub(super) fn nodes(&self) -> usize {
        self.clusters.len() + self.elements.len()
    }

    /// Whether a leaf may still be subdivided.
    pub(super) fn is_divisible(&self, element: u32) -> bool {
        self.elements[element as usize].outline.area() > self.smallest
    }

    /// Subdivides leaves, as far as the limit of patches allows. Others are skipped.
    pub(super) fn subdivide(&mut self, leaves: &[u32]) {
        let mut chosen = Vec::with_capacity(leaves.len());
        let mut count = self.leaves;
        for &leaf in leaves {
            if !self.elements[leaf as usize].is_leaf() {
                continue;
            }
            if count + 3 > self.max_patches {
                self.limit_reached = true;
                break;
            }
            count += 3;
            chosen.push(leaf);
        }
        let this = &*self;
        let parts: Vec<Vec<Element>> = chosen
            .par_iter()
            .map(|&leaf| {
                let element = &this.elements[leaf as usize];
                let outlines = element.outline.parts();
                let part = |outline| this.element(element.root, outline, this.node(leaf));
                outlines.into_iter().map(part).collect()
            })
            .collect();
        for (leaf, parts) in chosen.into_iter().zip(parts) {
            let first = self.elements.len() as u32;
            let area = parts.iter().map(|part| part.area).sum();
            self.leaves += parts.len() - 1;
            let whole = &mut self.elements[leaf as usize];
            (whole.first_part, whole.parts) = (first, parts.len() as u32);
            self.elements.extend(parts);
            self.set_area(leaf, area);
        }
    }

    /// Sets the bare area that the parts of an element found, in all that contain it.
    fn set_area(&mut self, mut element: u32, area: f64) {
        let change = area - self.elements[element as usize].area;
        loop {
            self.elements[element as usize].area += change;
            match self.element_of(self.elements[element as usize].parent) {
                Some(parent) if self.elements[element as usize].parent != NONE => element = parent,
                _ => return,
            }
        }
    }

    /// Computes what clusters hold from their members.
    fn sum_clusters(&mut self) {
        for index in (0..self.clusters.len()).rev() {
            let members: Vec<u32> = self.clusters[index].children.clone();
            let mut sum = super::cluster::Sums::ZERO;
            for member in members {
                match self.element_of(member) {
                    Some(element) => {
                        let element = &self.elements[element as usize];
                        sum.add(element.area, element.reflectance, self.roots[element.root as usize].normal);
                    }
                    None => sum.add_all(&self.clusters[member as usize].sums),
                }
            }
            self.clusters[index].sums = sum;
        }
    }

    /// The nodes below a node.
    pub(super) fn children(&self, node: u32) -> Vec<u32> {
        match self.element_of(node) {
            None => self.clusters[node as usize].children.clone(),
            Some(element) => {
                let element = &self.elements[element as usize];
                (0..element.parts).map(|i| self.node(element.first_part + i)).collect()
            }
        }
    }

    pub(super) fn parent(&self, node: u32) -> u32 {
        match self.element_of(node) {
            None => self.clusters[node as usize].parent,
            Some(element) => self.elements[element as usize].parent,
        }
    }

    /// Gives nodes without a value that of their parents.
    pub(super) fn inherit<T: Copy>(&self, values: &mut Vec<T>) {
        for node in values.len() as u32..self.nodes() as u32 {
            values.push(values[self.parent(node) as usize]);
        }
    }

    /// The bare area of a node.
    pub(super) fn area_of(&self, node: u32) -> f64 {
        match self.element_of(node) {
            None => self.clusters[node as usize].sums.area,
            Some(element) => self.elements[element as usize].area,
        }
    }

    /// The mean reflectance of a node.
    pub(super) fn reflectance_of(&self, node: u32) -> DVec3 {
        match self.element_of(node) {
            None => self.clusters[node as usize].sums.mean_reflectance(),
            Some(element) => self.elements[element as usize].reflectance,
        }
    }

    /// The error of light without an end, with the material that absorbs least.
    pub(super) fn endless(&self) -> RadiosityError {
        let reflectance = |element: &&Element| element.reflectance.max_element();
        let brightest = self.elements.iter().max_by(|a, b| reflectance(a).total_cmp(&reflectance(b)));
        let material = |element: &Element| {
            self.world.materials()[self.roots[element.root as usize].material as usize].name.clone()
        };
        RadiosityError::Endless {
            material: brightest.map_or_else(String::new, material),
            reflectance: brightest.map_or(0.0, |element| reflectance(&element)),
        }
    }

    /// The ball around a node.
    pub(super) fn ball(&self, node: u32) -> (DVec3, f64) {
        match self.element_of(node) {
            None => (self.clusters[node as usize].center, self.clusters[node as usize].radius),
            Some(element) => {
                let element = &self.elements[element as usize];
                (element.center, element.radius)
            }
        }
    }

    pub(super) fn normal_of(&self, element: u32) -> DVec3 {
        self.roots[self.elements[element as usize].root as usize].normal
    }
}

pub(super) fn vector(color: Rgb) -> DVec3 {
    DVec3::from_array(color.to_array().map(f64::from))
}
