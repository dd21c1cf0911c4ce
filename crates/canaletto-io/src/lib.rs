//! Reading and writing of Canaletto's files: the scene text, models and pictures. Every file that a scene names is
//! opened through [`assets::Assets`].
#![forbid(unsafe_code)]
#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

mod animation;
pub mod assets;
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
