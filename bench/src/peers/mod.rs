//! Canaletto beside other ray tracers on one machine, in turn, on the same rays and scenes. See `docs/benchmarks.md`.
//!
//! Peers are looked for at run time; nothing here needs them to build. Meshes and rays come from seeds, so that
//! anyone has the same.

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
