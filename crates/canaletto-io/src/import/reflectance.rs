//! The reflection of dielectrics at right angles and their indices of refraction: F0 = ((n − 1) / (n + 1))².

/// The index of refraction of a dielectric that reflects nearly all light at right angles.
pub(super) const ALL_REFLECTING: f32 = 1e6;

/// The reflection of an index at right angles.
pub(super) fn reflection(ior: f32) -> f32 {
    let amplitude = (ior - 1.0) / (ior + 1.0);
    amplitude * amplitude
}

/// The index with this reflection at right angles.
pub(super) fn index_of(reflection: f32) -> f32 {
    let amplitude = reflection.sqrt();
    if amplitude < 1.0 { ((1.0 + amplitude) / (1.0 - amplitude)).min(ALL_REFLECTING) } else { ALL_REFLECTING }
}
