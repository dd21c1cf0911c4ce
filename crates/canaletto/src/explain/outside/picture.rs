//! The faint picture of a scene from outside: colours by materials, shaded by the angle to the viewer, so that scenes
//! without light are seen, too.

use super::SIZE;
use super::choice::ViewAxes;
use crate::film::srgb_encode;
use crate::math::{DRay, offset_origin};
use crate::world::{Hit, World};
use canaletto_parallel::prelude::*;
use glam::{DVec2, DVec3};

/// A picture of display values with alpha.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct OutsidePicture {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Red, green, blue and alpha from 0 to 1, the top row first. Colours aren't multiplied by alpha.
    pub pixels: Vec<[f32; 4]>,
}

/// The rays of a pixel in each direction.
const RAYS: u32 = 2;
/// The most clear surfaces that a ray passes.
const MOST_LAYERS: usize = 6;
/// The alpha of opaque surfaces, and of clear ones.
const ALPHA: [f64; 2] = [0.5, 0.16];

impl OutsidePicture {
    pub(super) fn new(world: &World, time: f32, axes: &ViewAxes) -> OutsidePicture {
        let [width, height] = SIZE.map(|side| side as u32);
        let pixel = |index: u32| {
            let (x, y) = (index % width, index / width);
            let (mut colors, mut alphas) = (DVec3::ZERO, 0.0);
            for ray in 0..RAYS * RAYS {
                let offset = DVec2::new(f64::from(ray % RAYS), f64::from(ray / RAYS));
                let place = DVec2::new(x.into(), y.into()) + (offset + 0.5) / f64::from(RAYS);
                let (color, alpha) = seen(world, time, axes, place);
                (colors, alphas) = (colors + color, alphas + alpha);
            }
            let [r, g, b] = (colors / alphas.max(f64::MIN_POSITIVE)).as_vec3().to_array();
            [r, g, b, (alphas / f64::from(RAYS * RAYS)) as f32]
        };
        OutsidePicture { width, height, pixels: (0..width * height).into_par_iter().map(pixel).collect() }
    }
}

/// The display values at a place, multiplied by alpha, and alpha.
fn seen(world: &World, time: f32, axes: &ViewAxes, place: DVec2) -> (DVec3, f64) {
    let mut line = DRay { origin: axes.start(place), direction: -axes.back };
    let mut ray = line.rounded();
    let (mut color, mut alpha) = (DVec3::ZERO, 0.0);
    for _ in 0..MOST_LAYERS {
        let Some(hit) = world.intersect_at(&ray, f32::INFINITY, time) else { break };
        let surface = world.surface(line, &hit);
        let (own, is_clear) = shade(world, line, &hit, axes.back);
        let share = (1.0 - alpha) * ALPHA[usize::from(is_clear)];
        (color, alpha) = (color + own * share, alpha + share);
        if !is_clear {
            break;
        }
        line.origin = surface.exact;
        ray = line.from_origin(offset_origin(surface.point, surface.error, surface.normal, line.direction));
    }
    (color, alpha)
}

/// The display values of a hit, and whether its material is clear.
fn shade(world: &World, line: DRay, hit: &Hit, back: DVec3) -> (DVec3, bool) {
    let mut surface = world.surface(line, hit);
    let material = world.material(hit);
    let point = world.material_point(material, (line, hit), &mut surface, Some([DVec3::ZERO; 2]), &mut ());
    let phong = &point.classic;
    let (overlay, share) = point.overlay;
    let kd = overlay * share + phong.kd * (1.0 - share);
    // Mirrors and lamps have little kd, so that what they send stands for it.
    let sent = (kd + phong.k * 0.5 + phong.emission).to_array();
    let shown = DVec3::from(sent.map(|v| f64::from(srgb_encode(v.clamp(0.0, 1.0)))));
    let cosine = surface.shading_normal.dot(back).abs();
    (shown * (0.45 + 0.55 * cosine), point.is_clear() || point.coverage < 0.5)
}
