//! Reading and writing files for Canaletto: the scene text, models, pictures. All opening of files goes through
//! [`assets::Assets`].
#![forbid(unsafe_code)]
#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

mod animation;
pub mod assets;
pub mod content;
pub mod diagnostic;
mod guard;
pub mod image;
pub mod import;
pub mod movie;
pub mod picture;
pub mod text;
