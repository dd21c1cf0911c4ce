//! Motion: numbers, rotations and places as functions of time.
//!
//! This module is independent of files. The scene text builds a [`Curve`] from keys and a [`Path`] from points, and
//! evaluates them at a frame; a `Scene` holds the results. All arithmetic is `f64` with `sqrt` and `libm`, so that a
//! frame is identical on every machine.

mod curve;
mod path;
mod turn;

pub(crate) use curve::{Curve, Ease, Key};
pub(crate) use path::{Path, PathCurve};
pub(crate) use turn::{axis_angle, quaternion, turned};
