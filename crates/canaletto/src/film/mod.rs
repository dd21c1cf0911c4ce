//! From rays to pixels to numbers in a file: where samples lie, how they are weighted, how light is developed.

mod develop;
mod filter;
mod picture;
mod srgb;

pub(crate) use develop::display_all;
pub use develop::{Developer, develop, srgb_encode};
pub use filter::{Division, FilterTable, Part};
pub use picture::{Layer, Picture};
