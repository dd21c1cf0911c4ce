//! The choice of a view in which a tree's rays are seen well.

use super::{Contents, SIZE};
use crate::camera::Camera;
use crate::world::{OccluderCache, World};
use canaletto_bvh::Ray;
use glam::{DVec2, DVec3};

/// A parallel view.
pub(super) struct ViewAxes {
    /// The unit axes: to the right, upwards, and towards the viewer.
    pub(super) right: DVec3,
    pub(super) up: DVec3,
    pub(super) back: DVec3,
    /// The point in the middle.
    pub(super) center: DVec3,
    /// The radius of the circle around the middle that the view contains.
    pub(super) radius: f64,
    /// The distance of the plane, towards the viewer from the middle, beyond which the scene is cut away.
    pub(super) cut: f64,
}

/// The number of directions around the upward axis, and their heights in degrees.
const AZIMUTHS: usize = 24;
const ELEVATIONS: [f64; 4] = [12.0, 28.0, 42.0, 56.0];

/// The margin around all that is contained, as a factor.
const MARGIN: f64 = 1.18;

/// The share of the view's size at which two hits are far enough from each other.
const APART: f64 = 0.12;

impl ViewAxes {
    pub(super) fn choose(world: &World, camera: &Camera, time: f32, contents: &Contents) -> ViewAxes {
        let up = upward(camera);
        let side = up.any_orthonormal_vector();
        let other = up.cross(side);
        let mut best: Option<(f64, ViewAxes)> = None;
        for azimuth in 0..AZIMUTHS {
            let (sin, cos) = libm::sincos(std::f64::consts::TAU * azimuth as f64 / AZIMUTHS as f64);
            for elevation in ELEVATIONS {
                let (high, flat) = libm::sincos(elevation.to_radians());
                let back = (side * cos + other * sin) * flat + up * high;
                for is_cut in [false, true] {
                    let axes = ViewAxes::new(world, up, back, contents, is_cut);
                    let score = axes.score(world, time, contents) - if is_cut { 0.4 } else { 0.0 };
                    if best.as_ref().is_none_or(|(most, _)| score > *most) {
                        best = Some((score, axes));
                    }
                }
            }
        }
        best.map_or_else(|| ViewAxes::new(world, up, side, contents, false), |(_, axes)| axes)
    }

    fn new(world: &World, up: DVec3, back: DVec3, contents: &Contents, is_cut: bool) -> ViewAxes {
        let right = up.cross(back).normalize();
        let up = back.cross(right);
        let mut low = DVec2::INFINITY;
        let mut high = DVec2::NEG_INFINITY;
        let mut nearest = f64::NEG_INFINITY;
        let mut middle_depth = 0.0;
        for p in &contents.framed {
            let at = DVec2::new(p.dot(right), p.dot(up));
            (low, high) = (low.min(at), high.max(at));
            nearest = nearest.max(p.dot(back));
            middle_depth += p.dot(back) / contents.framed.len() as f64;
        }
        let middle = (low + high) / 2.0;
        let center = right * middle.x + up * middle.y + back * middle_depth;
        let half = (high - low) / 2.0;
        let aspect = SIZE[0] / SIZE[1];
        let radius = (MARGIN * half.y.max(half.x / aspect)).max(f64::from(f32::MIN_POSITIVE));
        let nearest = nearest - center.dot(back);
        let cut = if is_cut {
            nearest + 0.02 * radius
        } else {
            // In front of the scene's bounds, or far away if they are far.
            let bounds = world.bounds();
            let corner = |is_max: [bool; 3]| {
                let [x, y, z] = [0, 1, 2].map(|axis| if is_max[axis] { bounds.max[axis] } else { bounds.min[axis] });
                DVec3::new(x.into(), y.into(), z.into()) - world.origin() - center
            };
            let farthest = corner(back.to_array().map(|v| v > 0.0)).dot(back);
            let least = nearest + radius;
            if farthest.is_finite() {
                (farthest + 0.01 * radius).clamp(least, 100.0 * least.abs().max(radius))
            } else {
                least
            }
        };
        ViewAxes { right, up, back, center, radius, cut }
    }

    /// The place of a point in pixels from the upper left corner.
    pub(super) fn seen(&self, p: DVec3) -> DVec2 {
        let [width, height] = SIZE;
        let from_center = p - self.center;
        let scale = height / (2.0 * self.radius);
        DVec2::new(width / 2.0 + scale * from_center.dot(self.right), height / 2.0 - scale * from_center.dot(self.up))
    }

    /// The point in front of the scene that is seen at a place in pixels.
    pub(super) fn start(&self, place: DVec2) -> DVec3 {
        let [width, height] = SIZE;
        let scale = 2.0 * self.radius / height;
        let (x, y) = ((place.x - width / 2.0) * scale, (height / 2.0 - place.y) * scale);
        self.center + self.right * x + self.up * y + self.back * self.cut
    }

    /// How well rays and hits are seen.
    fn score(&self, world: &World, time: f32, contents: &Contents) -> f64 {
        // The share of their lengths in which rays are seen.
        let mut seen = 0.0;
        for segment in &contents.segments {
            let along = segment.to.map_or_else(|direction| direction, |to| (to - segment.from).normalize_or_zero());
            seen += (1.0 - along.dot(self.back) * along.dot(self.back)).max(0.0).sqrt();
        }
        let seen = seen / contents.segments.len().max(1) as f64;
        let places: Vec<DVec2> = contents.hits.iter().map(|(_, at, _)| self.seen(*at)).collect();
        let enough = APART * SIZE[1];
        let (mut apart, mut pairs) = (0.0, 0.0);
        for (index, a) in places.iter().enumerate() {
            for b in &places[..index] {
                apart += (a.distance(*b) / enough).min(1.0);
                pairs += 1.0;
            }
        }
        let apart = if pairs > 0.0 { apart / pairs } else { 1.0 };
        let visible: f64 = contents.hits.iter().map(|(_, at, _)| self.visibility(world, time, *at)).sum();
        let visible = visible / contents.hits.len().max(1) as f64;
        1.5 * visible + seen + apart
    }

    /// The share of light that goes from a point to the viewer.
    fn visibility(&self, world: &World, time: f32, at: DVec3) -> f64 {
        let length = self.cut - (at - self.center).dot(self.back);
        if length <= 0.0 {
            return 0.0;
        }
        let start = at + self.back * length;
        // The last bit before the point is left out, since the point lies on a surface.
        let ray = Ray::new(start.as_vec3(), (self.back * -length).as_vec3());
        let mut last = OccluderCache::NONE;
        f64::from(world.transmittance(&ray, 1.0 - 1e-3, time, None, &mut last, &mut ()))
    }
}

/// The axis of the scene's coordinates that is nearest to the camera's upward one.
fn upward(camera: &Camera) -> DVec3 {
    let [_, y, _] = camera.axes();
    let axes = [DVec3::X, DVec3::Y, DVec3::Z];
    let nearest = axes.into_iter().max_by(|a, b| y.dot(*a).abs().total_cmp(&y.dot(*b).abs())).unwrap_or(DVec3::Y);
    nearest * y.dot(nearest).signum()
}
