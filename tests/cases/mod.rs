//! Inputs that failed in other renderers. Each gives the right picture or the right message.
//!
//! The input files lie beside these modules. Each test states the right value and its source.

mod analytic;
mod media;
mod models;
mod points;
mod precision;
mod staged;
