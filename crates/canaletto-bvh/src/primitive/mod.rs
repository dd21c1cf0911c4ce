//! Primitives and the tests of rays against them: first four or more side by side in f32, then one exactly.

pub(crate) mod cylinder4;
pub(crate) mod difference_of_products;
pub(crate) mod edge_error;
mod exact4;
pub(crate) mod primitive4;
pub mod sphere;
pub(crate) mod sphere8;
pub mod triangle;
pub(crate) mod triangle4;
