//! The film: filters for the places of samples, the sums of a tile, the picture, and its developing into the numbers
//! of a file.

mod develop;
mod filter;
mod picture;
mod srgb;
mod tile_buffer;

pub(crate) use develop::display_all;
pub use develop::{Developer, develop, srgb_encode};
pub use filter::{Division, FilterTable, Part};
pub use picture::{Layer, Picture};
pub(crate) use tile_buffer::{Accumulation, TileBuffer, WeightedSum};
