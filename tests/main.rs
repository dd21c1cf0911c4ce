//! Tests across crates, one module for each promise; see README.md. One program contains all of them, since linking
//! takes longer than most of the tests.

mod agreement;
mod animation;
mod area_lights;
mod book;
mod bundles;
mod bytes;
mod cases;
mod causes;
mod chapter;
mod convert;
mod denoise;
mod determinism;
mod distributed;
mod environment;
mod figures;
mod footprints;
mod grade;
mod guiding;
mod layers;
mod limits;
mod noise;
mod orthographic;
mod passes;
mod path;
mod presets;
mod radiosity_explained;
mod scale;
mod serialised;
mod sessions;
mod shadows;
mod surfaces;
mod textures;
mod watertight;
mod zbuffer;
