//! The film: filters for the places of samples, the sums of a tile, the picture, and its developing into the numbers
//! of a file.

mod checkpoint;
mod develop;
mod exposure;
mod filter;
mod half_buffers;
mod picture;
mod sample_blocks;
mod sample_statistics;
mod shadow;
mod srgb;
mod tile_buffer;
mod tone;

pub use checkpoint::{Checkpoint, Pass};
pub(crate) use develop::display_all;
pub use develop::{Developer, develop, develop_with_alpha, srgb_encode};
pub use exposure::metered_exposure;
pub(crate) use filter::value as filter_value;
pub use filter::{Division, FilterTable, Part};
pub use half_buffers::HalfBuffers;
pub use picture::{Layer, Picture, unpremultiplied};
pub use sample_blocks::{BLOCK_HALF_LAYERS, BLOCK_LAYERS, BlockMean, SampleBlocks, block_count, block_sizes};
pub use sample_statistics::{ClampOutlook, NoiseOutlook, NoisiestPixels, SamplePlace, SampleStatistics, SamplesLeft};
pub(crate) use tile_buffer::{Accumulation, TileBuffer, WeightedSum};
pub use tone::{Agx, PbrNeutral};
