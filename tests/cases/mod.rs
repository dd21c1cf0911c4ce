//! Inputs that people ran into with other renderers: each gives the picture, or the message, that it should.
//!
//! The input files lie beside these modules; each test states the right value and where it comes from.

mod analytic;
mod media;
mod models;
mod points;
mod precision;
