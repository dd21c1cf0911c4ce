//! Compares Canaletto with other ray tracers on one machine, in interleaved rounds, on equal rays and scenes. See
//! `docs/benchmarks.md`.
//!
//! Peers are found at run time and are not needed to build. Meshes and rays come from seeds, so they are equal on every
//! machine.

mod atrium;
pub mod build;
pub mod clouds;
pub mod embree;
mod field;
pub mod instances;
pub mod load;
pub mod mesh;
mod mitsuba;
mod noise;
pub mod ours;
pub mod pictures;
mod plain;
mod povray;
pub mod rays;
pub mod recursion;
pub mod stages;
pub mod statistics;
mod statue;
mod tachyon;
pub mod trace;
