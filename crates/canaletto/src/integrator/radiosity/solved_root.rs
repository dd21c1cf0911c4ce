//! Roots of a solution: one side of each surface before it was subdivided, for methods that visit all light.

use super::mesh::{Element, PatchMesh};
use super::root::Root;
use super::{ArrivingLight, Patch, RadiosityError, RadiositySettings, RadiositySolution};
use crate::math::DRay;
use crate::world::World;
use glam::DVec3;

/// One side of a flat surface, or of a facet of a curved one, of which some part is bare.
#[derive(Clone, Debug)]
pub(crate) struct SolvedRoot {
    root: Root,
    /// The element of the whole root.
    element: u32,
}

impl SolvedRoot {
    /// The roots of a solution, in the order of the mesh. World and settings are those that it was solved with; `None`
    /// if they aren't.
    ///
    /// # Errors
    /// As solving.
    pub(crate) fn all(
        world: &World,
        settings: &RadiositySettings,
        solution: &RadiositySolution,
    ) -> Result<Option<Vec<SolvedRoot>>, RadiosityError> {
        // A solution keeps no roots. The same world and settings make the same mesh again, before refinement.
        let mut mesh = PatchMesh::new(world, settings)?;
        let is_root = |element: &Element| mesh.element_of(element.parent).is_none();
        let elements = mesh.elements.iter().enumerate().filter(|(_, element)| is_root(element));
        let elements: Vec<(u32, u32)> = elements.map(|(number, element)| (number as u32, element.root)).collect();
        let is_solved = |&(number, _): &(u32, u32)| {
            let solved = solution.elements.get(number as usize);
            solved.is_some_and(|solved| solved.outline == mesh.elements[number as usize].outline)
        };
        if elements.is_empty() || !elements.iter().all(is_solved) {
            return Ok(None);
        }
        for root in &mut mesh.roots {
            root.contacts = Vec::new();
        }
        let root = |&(element, root): &(u32, u32)| SolvedRoot { root: mesh.roots[root as usize].clone(), element };
        Ok(Some(elements.iter().map(root).collect()))
    }

    /// The corners, three or those of a parallelogram, counter-clockwise when seen from this side.
    pub(crate) fn corners(&self) -> &[DVec3] {
        self.root.outline.corners()
    }

    /// The centre.
    pub(crate) fn center(&self) -> DVec3 {
        self.root.outline.center()
    }

    /// The unit normal of this side.
    pub(crate) fn normal(&self) -> DVec3 {
        self.root.normal
    }

    /// The instance, as in [`Hit::instance`](crate::world::Hit::instance).
    pub(crate) fn instance(&self) -> u32 {
        self.root.instance
    }

    /// The index of the material.
    pub(crate) fn material(&self) -> u32 {
        self.root.material
    }

    /// Whether this is the outer side of the surface.
    pub(crate) fn is_outer(&self) -> bool {
        self.root.is_outer
    }

    /// The primitive at a point of the root.
    pub(crate) fn primitive_at(&self, point: DVec3) -> u32 {
        self.root.primitive_at(point)
    }

    /// A line through the surface near a point of the root, from this side. It ends at the parameter 1.
    pub(crate) fn line_through(&self, point: DVec3) -> DRay {
        self.root.line_through(point)
    }

    /// The distance within which points count as equal.
    pub(crate) fn tolerance(&self) -> f64 {
        self.root.tolerance
    }

    /// Whether a point lies on a segment along which another surface touches this one.
    pub(crate) fn is_contact(&self, point: DVec3) -> bool {
        self.root.cuts.iter().any(|&[from, to]| {
            let way = to - from;
            let along = ((point - from).dot(way) / way.length_squared()).clamp(0.0, 1.0);
            (from + way * along).distance(point) <= 4.0 * self.root.tolerance
        })
    }
}

impl RadiositySolution {
    /// Whether no light arrives anywhere on a root.
    pub(crate) fn is_dark(&self, root: &SolvedRoot) -> bool {
        let mut waiting = vec![root.element];
        while let Some(element) = waiting.pop() {
            let element = &self.elements[element as usize];
            if element.parts == 0 {
                let patch = &self.patches()[element.patch as usize];
                if patch.arriving().sum() != DVec3::ZERO {
                    return false;
                }
            }
            waiting.extend((0..element.parts).map(|part| element.first + part));
        }
        true
    }

    /// The patch at a point of a root, and the light there, interpolated between patches. None where the root is
    /// covered.
    pub(crate) fn light_on(&self, root: &SolvedRoot, point: DVec3) -> Option<(&Patch, ArrivingLight)> {
        let number = self.elements[self.leaf_of(root.element, point) as usize].patch as usize;
        let patch = &self.patches()[number];
        (patch.area > 0.0).then(|| (patch, self.interpolated(number, point)))
    }
}
