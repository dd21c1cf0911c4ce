//! Reading and writing of Canaletto's files: the scene text, models and pictures. Every file that a scene names is
//! opened through [`assets::Assets`].
//!
//! The features `exr`, `gif`, `jpeg`, `ktx2`, `png` and `webp` have a codec each, and are on by default. Without its
//! codec a format is refused by [`codec::CodecOff`], which names the feature. The scene text and models need none of
//! them.
#![forbid(unsafe_code)]
#![cfg_attr(not(test), deny(clippy::disallowed_methods))]
// Helpers of several codecs have no user where those are left out.
#![cfg_attr(
    not(all(feature = "exr", feature = "gif", feature = "jpeg", feature = "ktx2", feature = "png", feature = "webp")),
    allow(dead_code)
)]

mod animation;
pub mod assets;
pub mod codec;
pub mod content;
pub mod diagnostic;
pub mod export;
pub mod file_id;
mod guard;
pub mod image;
pub mod import;
pub mod movie;
pub mod picture;
pub mod scene_file;
pub mod source;
#[cfg(test)]
mod testing;
pub mod text;

/// The programs of the book's page on the library are tests of this crate.
#[cfg(doctest)]
#[doc = include_str!("../../../docs/library.md")]
mod library_page {}
