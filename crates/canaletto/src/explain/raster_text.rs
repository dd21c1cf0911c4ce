//! What a z-buffer shows as text.

use super::text_writer::TextWriter;
use crate::integrator::{RasterNode, RasterTriangle, RivalFate};

/// The most hidden triangles that are written if the text is folded.
const MOST_RIVALS: usize = 4;

/// Writes the triangle that a z-buffer shows, and what it hides.
pub(super) fn write_raster(w: &mut TextWriter, raster: &RasterNode) {
    let RasterNode { triangle, samples, rivals, more_rivals } = raster;
    if let Some(RasterTriangle { object, primitive, facet, corners, weights, depth, z }) = triangle {
        match facet {
            Some(facet) => writeln!(w, "triangle {facet} of the tessellation of {object} (primitive {primitive})"),
            None => writeln!(w, "triangle {primitive} of {object}"),
        }
        let corner = |[x, y]: [f64; 2]| format!("({}, {})", w.number(x), w.number(y));
        writeln!(w, "  on the screen {}", corners.map(corner).join(", "));
        let [a, b, c] = weights.map(|weight| w.number(weight));
        writeln!(w, "  weights of the corners {a} {b} {c}");
        writeln!(w, "  depth 1/z = {}, z = {}", w.number(*depth), w.number(*z));
    } else {
        writeln!(w, "no triangle is visible");
    }
    if samples[1] > 1 {
        writeln!(w, "  seen by {} of the pixel's {} samples", samples[0], samples[1]);
    }
    let most = if w.is_full { rivals.len() } else { MOST_RIVALS.min(rivals.len()) };
    for rival in &rivals[..most] {
        let fate = match rival.fate {
            RivalFate::Farther => "is farther",
            RivalFate::Equal => "is as near, but comes later in the scene or in its mesh",
            RivalFate::BeyondFar => "lies beyond the far plane",
            RivalFate::BeforeNear => "lies in front of the near plane",
            RivalFate::Hole => "has a hole here",
        };
        let (depth, z) = (w.number(rival.depth), w.number(rival.z));
        writeln!(w, "  hidden: {}, 1/z = {depth}, z = {z}: {fate}", rival.object);
    }
    let more = more_rivals + rivals.len() - most;
    if more > 0 {
        writeln!(w, "  hidden: {more} more triangles, farther than these");
    }
}
