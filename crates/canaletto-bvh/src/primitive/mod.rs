//! Primitives and their intersection tests: first four or more side by side in f32 with error bounds, then one exactly
//! in f64. Read the files in this order:
//!
//! 1. `triangle`: the exact test of one triangle, and the proof that no hit is lost. It uses `difference_of_products`
//!    for edge functions of the right sign.
//! 2. `edge_error`: the error bound of the f32 edge functions.
//! 3. `triangle4`: a block of four triangles (Embree's `Triangle4v`), its f32 tests, and the pending hit of a ray
//!    (`Search`).
//! 4. `exact4`: the exact test of a block's four triangles side by side.
//! 5. `primitive4`: a block of four spheres, cylinders or user primitives.
//! 6. `sphere` and `cylinder4`: the f32 culling of four shapes, and the exact tests of spheres.

pub(crate) mod cull;
pub(crate) mod cylinder4;
pub(crate) mod difference_of_products;
pub(crate) mod edge_error;
mod exact4;
pub(crate) mod primitive4;
pub mod sphere;
pub mod triangle;
pub(crate) mod triangle4;
