//! What integrators share to shade surfaces: light that is known without rays, and the places that ask for it.
//!
//! The classic integrator shades with them, for itself, for the second pass of radiosity, and for the z-buffer.

mod diffuse_light;
mod fragment;
mod shadow_lookup;

pub(crate) use diffuse_light::{DiffuseLight, EmitterReceiver};
pub(crate) use fragment::Fragment;
pub(crate) use shadow_lookup::ShadowLookup;

/// The `t_max` of a ray towards a light point at t = 1.
pub(crate) const BEFORE_LIGHT: f32 = 1.0 - f32::EPSILON;
