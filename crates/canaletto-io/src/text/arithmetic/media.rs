//! Media by name: their coefficients of refraction.

use crate::diagnostic::closest_word;

/// The field of the coefficient of refraction.
pub(crate) const ETA: &str = "eta";
/// The field of a clear body by its coefficient of refraction.
pub(crate) const DIELECTRIC: &str = "dielectric";

/// Whether a field takes media by name.
pub(crate) fn takes_media(field: &str) -> bool {
    field == ETA || field == DIELECTRIC
}

/// Names with η, and what the number is. The first three are those of the chapter's box 5.7, which prints 1.3 for
/// water. The others are measured values for yellow light (589 nm) at room temperature, to two digits.
pub(crate) const MEDIA: [(&str, f64, &str); 16] = [
    ("air", 1.0, "box 5.7"),
    ("glass", 1.5, "box 5.7"),
    ("water", 1.33, "box 5.7, where it is rounded to 1.3"),
    ("acrylic", 1.49, "PMMA"),
    ("alcohol", 1.36, "ethanol"),
    ("amber", 1.54, "a resin"),
    ("crown-glass", 1.52, "BK7, of windows and lenses"),
    ("diamond", 2.42, "a crystal"),
    ("flint-glass", 1.62, "F2, of lenses and cut glass"),
    ("fused-silica", 1.46, "a glass"),
    ("glycerol", 1.47, "a liquid"),
    ("ice", 1.31, "frozen water"),
    ("olive-oil", 1.47, "a liquid"),
    ("polycarbonate", 1.59, "of spectacles and discs"),
    ("salt", 1.54, "rock salt"),
    ("sapphire", 1.77, "ruby is the same crystal"),
];

/// The coefficient of refraction of a medium.
pub(crate) fn eta_of(name: &str) -> Option<f64> {
    MEDIA.iter().find(|(known, ..)| *known == name).map(|(_, eta, _)| *eta)
}

/// The name of a medium that is nearest to a misspelled one.
pub(crate) fn closest_medium(name: &str) -> Option<&'static str> {
    closest_word(name, MEDIA.iter().map(|(name, ..)| *name))
}
