//! Lookups in the environment as text.

use super::text_writer::TextWriter;
use crate::Named;
use crate::light::environment::{EnvironmentLookup, Footprint, Part, Place};

/// Writes what a ray that meets nothing sees of the environment.
pub(super) fn write_sighting(w: &mut TextWriter, seen: &EnvironmentLookup, indent: &str) {
    let (d, local) = (seen.direction, seen.local);
    writeln!(w, "{indent}  meets nothing: environment \"{}\" {}", seen.kind, w.rgb(seen.radiance));
    write!(w, "{indent}    direction {}", w.vector(d.to_array()));
    if (local - d).length() > 1e-12 {
        write!(w, ", in the environment's own coordinates {}", w.vector(local.to_array()));
    }
    writeln!(w);
    match seen.place {
        Place::Face { face, uv: [u, v] } => {
            writeln!(
                w,
                "{indent}    face {}, u = {}, v = {} from its upper left corner  (fig. 5.35)",
                face.name(),
                w.number(u),
                w.number(v)
            );
        }
        Place::Panorama { uv: [u, v] } => {
            writeln!(w, "{indent}    panorama u = {}, v = {} from its upper left corner", w.number(u), w.number(v));
        }
        Place::Height(height) => writeln!(w, "{indent}    {} degrees above the horizon", w.number(height)),
        Place::Sky(part) => {
            let part = match part {
                Part::Air => "the sky",
                Part::Sun => "the sun's disk",
                Part::Ground => "the ground below the horizon",
            };
            writeln!(w, "{indent}    {part}");
        }
    }
    match seen.footprint {
        Some(Footprint { level, looks }) if level > 0.0 || looks > 1 => {
            writeln!(w, "{indent}    mean of {looks} lookups at pyramid level {}", w.number(level));
        }
        _ => {}
    }
    if seen.value != seen.radiance {
        writeln!(w, "{indent}    = value {} * the environment's intensity", w.rgb(seen.value));
    }
}
