//! Motion: numbers, turns and places as functions of time.
//!
//! Nothing here knows of files. The scene text makes [`Curve`]s of its keys and a [`Path`] of its points, and asks for
//! their values at a frame; a `Scene` holds what came out. Everything is `f64` arithmetic, `sqrt` and `libm`, so that a
//! frame is the same on every machine.

mod curve;
mod path;
mod turn;

pub(crate) use curve::{Curve, Ease, Key};
pub(crate) use path::Path;
pub(crate) use turn::{axis_angle, quaternion, turned};
