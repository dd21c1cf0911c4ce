//! What a z-buffer shows, as lines.

use super::term::{Line, line, of_ray};
use crate::integrator::{RasterNode, RivalFate};

/// The most hidden triangles that are written if the text is folded.
const MOST_RIVALS: usize = 4;

/// Whether a depth is 1/z, and not −z of an orthographic camera.
fn is_of_perspective(depth: f32) -> bool {
    depth > 0.0
}

impl RasterNode {
    /// The triangle that a z-buffer shows, and what it hides.
    pub(super) fn lines(&self, is_full: bool) -> Vec<Line<'_>> {
        let mut lines = Vec::new();
        if let Some(triangle) = &self.triangle {
            let (object, primitive) = (&triangle.object, of_ray(triangle.primitive));
            lines.push(match triangle.facet {
                Some(facet) => {
                    let start =
                        line!("triangle {} of the tessellation of {object of the visible triangle}", facet, object);
                    start.and(line!(" (primitive {primitive of the triangle})", primitive))
                }
                None => {
                    line!("triangle {primitive of the triangle} of {object of the visible triangle}", primitive, object)
                }
            });
            let ([p1, p2, p3], [a, b, c]) = (triangle.corners, triangle.weights);
            lines.push(line!("  on the screen {corner 1}, {corner 2}, {corner 3}", p1, p2, p3).of_ray());
            lines.push(line!("  weights of the corners {} {} {}", a, b, c));
            let depth = match is_of_perspective(triangle.depth) {
                true => line!("  depth 1/z = {}, z = {z}", triangle.depth, triangle.z),
                false => line!("  depth -z = {}, z = {z}", triangle.depth, triangle.z),
            };
            lines.push(depth.of_ray());
        } else {
            lines.push(line!("no triangle is visible"));
        }
        let [seen, samples] = self.samples;
        lines.push(line!("  seen by {} of the pixel's {} samples", seen, samples).written_if(samples > 1));
        let most = if is_full { self.rivals.len() } else { MOST_RIVALS.min(self.rivals.len()) };
        lines.extend(self.rivals[..most].iter().map(|rival| {
            let fate = match rival.fate {
                RivalFate::Farther => "is farther",
                RivalFate::Equal => "is as near, but comes later in the scene or in its mesh",
                RivalFate::BeyondFar => "lies beyond the far plane",
                RivalFate::BeforeNear => "lies in front of the near plane",
                RivalFate::Hole => "has a hole here",
            };
            match is_of_perspective(rival.depth) {
                true => line!("  hidden: {}, 1/z = {}, z = {}: {}", &rival.object, rival.depth, rival.z, fate),
                false => line!("  hidden: {}, -z = {}, z = {}: {}", &rival.object, rival.depth, rival.z, fate),
            }
        }));
        let more = self.more_rivals + self.rivals.len() - most;
        if more > 0 {
            lines.push(line!("  hidden: {} more triangles, farther than these", more));
        }
        lines
    }
}
