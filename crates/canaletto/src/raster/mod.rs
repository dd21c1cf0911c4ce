//! A rasteriser: triangles projected into tiles, clipped, and tested for what is nearest at each sample.
//!
//! [`geometry`] projects all triangles of a world into the tiles of a screen. [`coverage`] finds the nearest triangle
//! at each sample of a tile. Curved shapes are tessellated within a tolerance in pixels ([`facets`]). The z-buffer
//! shades what is seen; [`item_buffer`] only says which object it is, as hemicubes need.

pub(crate) mod clip;
pub(crate) mod coverage;
pub(crate) mod depth_range;
pub(crate) mod facets;
pub(crate) mod geometry;
pub(crate) mod item_buffer;
pub(crate) mod projection;
pub(crate) mod triangle_hits;
pub(crate) mod triangle_setup;
pub(crate) mod unshaded_view;
pub(crate) mod visible_triangle;
