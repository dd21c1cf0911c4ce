//! The meshes, generated from formulas and seeds, and their views.

use glam::Vec3;

use super::rays::View;
use super::{atrium, field, statue};

/// A triangle mesh with a view.
pub struct Mesh {
    /// The name on the command line.
    pub name: &'static str,
    /// The vertices.
    pub positions: Vec<Vec3>,
    /// The vertex indices of each triangle.
    pub triangles: Vec<[u32; 3]>,
    /// The eye.
    pub eye: Vec3,
    /// The point in the centre of the view.
    pub target: Vec3,
    /// The vertical field of view in degrees.
    pub fovy: f32,
    /// The position of a point light.
    pub light: Vec3,
}

/// The generator of one mesh.
#[derive(Clone, Copy)]
pub struct Recipe {
    /// The name on the command line.
    pub name: &'static str,
    /// A description of the mesh.
    pub about: &'static str,
    make: fn() -> Mesh,
}

/// All meshes, the small ones first.
pub const RECIPES: [Recipe; 5] = [
    Recipe {
        name: "statue",
        about: "69k triangles, a smooth body with folds, like a small scan",
        make: statue::statue,
    },
    Recipe { name: "atrium", about: "304k triangles, architecture with many long and thin ones", make: atrium::atrium },
    Recipe { name: "serpent", about: "400k triangles, a scaly body wound around itself", make: || statue::serpent(1) },
    Recipe { name: "serpent4", about: "1.6M triangles, the same in finer scales", make: || statue::serpent(2) },
    Recipe { name: "field", about: "7.9M triangles, blades of grass on hills", make: field::field },
];

impl Recipe {
    /// Generates the mesh.
    pub fn make(&self) -> Mesh {
        let mesh = (self.make)();
        debug_assert!(mesh.triangles.iter().flatten().all(|&i| (i as usize) < mesh.positions.len()));
        mesh
    }
}

impl Mesh {
    pub(super) fn new(name: &'static str) -> Self {
        Self {
            name,
            positions: Vec::new(),
            triangles: Vec::new(),
            eye: Vec3::ZERO,
            target: Vec3::ZERO,
            fovy: 40.0,
            light: Vec3::ZERO,
        }
    }

    /// The corners of a triangle.
    pub fn corners(&self, triangle: usize) -> [Vec3; 3] {
        let [a, b, c] = self.triangles[triangle];
        [self.positions[a as usize], self.positions[b as usize], self.positions[c as usize]]
    }

    /// The largest absolute coordinate.
    pub fn extent(&self) -> f32 {
        self.positions.iter().fold(0.0, |m: f32, p| m.max(p.abs().max_element()))
    }

    /// The view of the mesh.
    pub fn view(&self) -> View {
        let &Self { eye, target, fovy, light, .. } = self;
        View { eye, target, fovy, light, extent: self.extent() }
    }

    /// The normal of a triangle, of any length.
    pub fn normal(&self, triangle: u32) -> Vec3 {
        let [a, b, c] = self.corners(triangle as usize);
        (b - a).cross(c - a)
    }

    pub(super) fn point(&mut self, p: Vec3) -> u32 {
        self.positions.push(p);
        self.positions.len() as u32 - 1
    }

    pub(super) fn quad(&mut self, corners: [Vec3; 4]) {
        let [a, b, c, d] = corners.map(|p| self.point(p));
        self.triangles.extend([[a, b, c], [a, c, d]]);
    }

    /// Adds a grid of `columns` × `rows` squares; `at` gives its vertices.
    pub(super) fn grid(&mut self, columns: u32, rows: u32, at: impl Fn(u32, u32) -> Vec3) {
        let first = self.positions.len() as u32;
        self.positions.extend((0..=rows).flat_map(|j| (0..=columns).map(move |i| (i, j))).map(|(i, j)| at(i, j)));
        for j in 0..rows {
            for i in 0..columns {
                let a = first + j * (columns + 1) + i;
                let (b, c, d) = (a + 1, a + columns + 2, a + columns + 1);
                self.triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn meshes_are_of_the_size_they_say_and_sound() {
        // The test skips the two largest meshes, which differ from the others only in fineness and number.
        for (recipe, count) in RECIPES[..3].iter().zip([69_314, 304_000, 400_002]) {
            let mesh = recipe.make();
            assert!(mesh.triangles.len().abs_diff(count) < 5000, "{}: {}", mesh.name, mesh.triangles.len());
            assert!(mesh.triangles.iter().flatten().all(|&i| (i as usize) < mesh.positions.len()));
            assert!(mesh.positions.iter().all(|p| p.is_finite()));
            assert_eq!(mesh.name, recipe.name);
        }
    }
}
