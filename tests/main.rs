//! What crosses crates, one module for each promise: see README.md. One program holds all of them, since linking a program takes longer than most of them
//! run.

mod agreement;
mod animation;
mod area_lights;
mod bundles;
mod cases;
mod chapter;
mod determinism;
mod distributed;
mod environment;
mod figures;
mod footprints;
mod limits;
mod scale;
mod textures;
mod watertight;
