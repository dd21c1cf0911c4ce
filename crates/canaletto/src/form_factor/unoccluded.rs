//! The form factor between objects of few triangles as if nothing were in between.

use super::full_view::{is_full_view, overlap};
use super::polygon::area_vector;
use super::polygon_to_polygon::{AnalyticFormFactor, polygon_to_polygon};
use super::sampled::Side;
use crate::world::{ObjectSurface, World};
use glam::DVec3;

/// The most pairs of triangles.
const MAX_PAIRS: usize = 1024;
/// The most bodies near the triangles that are looked at, times the pairs of triangles.
const MAX_TESTS: usize = 1 << 20;

/// What the triangles of two surfaces exchange without all that is in between.
#[derive(Clone, Debug)]
pub(super) struct Unoccluded {
    /// The form factor. A line that crosses several of the receiver's triangles counts for each of them.
    pub(super) factor: AnalyticFormFactor,
    /// Whether nothing is in between, so that this is the true factor.
    pub(super) is_full_view: bool,
    /// The receiver's triangles, counter-clockwise seen from the sides that count.
    receivers: Vec<[DVec3; 3]>,
}

impl Unoccluded {
    /// `None` if the surfaces aren't flat piece by piece, or have too many triangles.
    pub(super) fn between(
        world: &World,
        from: (&ObjectSurface, Side),
        to: (&ObjectSurface, Side),
    ) -> Option<Unoccluded> {
        let triangles =
            |(surface, side): (&ObjectSurface, Side)| Some(sided(world.flat_triangles(surface, MAX_PAIRS)?, side));
        let (senders, receivers) = (triangles(from)?, triangles(to)?);
        if senders.len() * receivers.len() > MAX_PAIRS {
            return None;
        }
        let bounds = from.0.bounds().union(to.0.bounds());
        let bodies = world.bodies_within(&bounds, MAX_TESTS / (senders.len() * receivers.len()).max(1));
        // Where the receiver lies on itself, light arrives once, but each triangle has a factor.
        let lies_on_itself = (0..receivers.len()).any(|k| receivers[..k].iter().any(|one| overlap(one, &receivers[k])));
        let mut is_full = bodies.is_some() && !lies_on_itself;
        let (mut exchange, mut error, mut area) = (0.0, 0.0, 0.0);
        for sender in &senders {
            let own = area_vector(sender).length();
            area += own;
            for receiver in &receivers {
                let Some(factor) = polygon_to_polygon(sender, receiver) else { continue };
                exchange += own * factor.value;
                error += own * factor.error;
                is_full &=
                    factor.value == 0.0 || bodies.as_ref().is_some_and(|bodies| is_full_view(sender, receiver, bodies));
            }
        }
        let factor = AnalyticFormFactor { value: exchange / area, error: error / area };
        (area > 0.0).then_some(Unoccluded { factor, is_full_view: is_full, receivers })
    }

    /// The number of the receiver's triangles that a ray crosses from their front.
    pub(super) fn crossings(&self, origin: DVec3, direction: DVec3) -> u32 {
        let crosses = |corners: &&[DVec3; 3]| {
            let [a, b, c] = corners.map(|corner| corner - origin);
            // The ray passes each edge on the same side, and the point where it meets the plane lies ahead.
            let sides = [b.cross(a), c.cross(b), a.cross(c)].map(|n| n.dot(direction));
            sides.iter().all(|side| *side > 0.0) && a.dot((b - a).cross(c - a)) < 0.0
        };
        self.receivers.iter().filter(crosses).count() as u32
    }
}

/// The triangles seen from the sides that count: each once or, turned, twice.
fn sided(mut triangles: Vec<[DVec3; 3]>, side: Side) -> Vec<[DVec3; 3]> {
    let turned = |&[a, b, c]: &[DVec3; 3]| [a, c, b];
    match side {
        Side::Front => triangles,
        Side::Back => triangles.iter().map(turned).collect(),
        Side::Both => {
            let backs: Vec<_> = triangles.iter().map(turned).collect();
            triangles.extend(backs);
            triangles
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_cross_fronts() {
        let triangle = [DVec3::new(0.0, 0.0, 2.0), DVec3::new(0.0, 1.0, 2.0), DVec3::new(1.0, 0.0, 2.0)];
        let count = |side: Side, origin: [f64; 3], direction: [f64; 3]| {
            let receivers = sided(vec![triangle], side);
            let factor = AnalyticFormFactor { value: 0.0, error: 0.0 };
            Unoccluded { factor, is_full_view: false, receivers }.crossings(origin.into(), direction.into())
        };
        // Its front is below.
        assert_eq!(count(Side::Front, [0.2, 0.2, 0.0], [0.0, 0.0, 1.0]), 1);
        assert_eq!(count(Side::Front, [0.2, 0.2, 3.0], [0.0, 0.0, 1.0]), 0);
        assert_eq!(count(Side::Front, [0.2, 0.2, 3.0], [0.0, 0.0, -1.0]), 0);
        assert_eq!(count(Side::Back, [0.2, 0.2, 3.0], [0.0, 0.0, -1.0]), 1);
        assert_eq!(count(Side::Back, [0.2, 0.2, 0.0], [0.0, 0.0, 1.0]), 0);
        for origin in [[0.2, 0.2, 0.0], [0.2, 0.2, 3.0]] {
            let direction = if origin[2] < 2.0 { 1.0 } else { -1.0 };
            assert_eq!(count(Side::Both, origin, [0.0, 0.0, direction]), 1);
            assert_eq!(count(Side::Both, origin, [0.0, 0.0, -direction]), 0);
            assert_eq!(count(Side::Both, origin, [1.0, 1.0, direction]), 0);
        }
    }
}
