//! The lights of staged models for the classic integrators.

use super::{Ground, Staging, add_ground, direction_at};
use canaletto::light::{Directional, DiskLight, Light, LightKind};
use canaletto::math::{Rgb, Transform};
use canaletto::scene::{Node, Scene};
use canaletto::shape::Disk;
use glam::DVec3;

/// Adds lights and a ground for objects between `low` and `high`. `None` if the coordinates are too large.
pub(super) fn light(scene: &mut Scene, bounds: [DVec3; 2], staging: &Staging) -> Option<()> {
    let origin = scene.meshes.first().map_or(DVec3::ZERO, |mesh| mesh.origin);
    let [low, high] = bounds.map(|p| p - origin);
    let there = &Transform::translate(origin);
    let middle = (low + high) / 2.0;
    let size = (high - low).length().max(1e-30);
    let floor = match staging.ground {
        Ground::None => None,
        Ground::Shadow => Some(Rgb::gray(0.72)),
        Ground::Color(color) => Some(color),
    };
    if let Some(kd) = floor {
        add_ground(scene, kd, DVec3::new(middle.x, low.y, middle.z).as_vec3(), there);
    }
    // The key light at the left of the camera casts the shadow; the fill light at the right brightens it.
    let key = DiskLight {
        disk: Disk {
            center: (middle + direction_at(-25.0, 50.0) * (3.0 * size)).as_vec3(),
            normal: direction_at(-25.0, 50.0).as_vec3(),
            radius: (0.2 * size) as f32,
        },
        points: 24,
    };
    if !(key.disk.center.is_finite() && key.disk.radius.is_finite()) {
        return None;
    }
    let fill = Directional { towards: -direction_at(85.0, 25.0).as_vec3(), beam: None };
    let light = |name: &str, kind, intensity, shadows| {
        let light = Light { name: Some(name.into()), shadows, ..Light::new(kind, Rgb::gray(intensity)) };
        Node::from(light).with_transform(there).named(name)
    };
    scene.nodes.push(light("key", LightKind::Disk(key), 0.85, true));
    scene.nodes.push(light("fill", LightKind::Directional(fill), 0.2, false));
    (scene.background, scene.ambient) = (staging.background.unwrap_or(Rgb::gray(0.7)), Rgb::gray(0.16));
    Some(())
}
