//! Lights of points by KHR_lights_punctual.

use super::Writer;
use crate::export::convert::triangles::span_of_scene;
use canaletto::light::{Directional, Falloff, Light, LightKind, Omni, Spot};
use glam::{DMat3, DQuat, DVec3, Vec3};
use serde_json::{Value, json};
use std::f32::consts::PI;

/// The extension.
pub(super) const PUNCTUAL: &str = "KHR_lights_punctual";

impl Writer<'_> {
    /// The node of a light, which looks along −z. None if glTF has no such light.
    pub(super) fn light(&mut self, light: &Light, name: &str) -> Option<Value> {
        if !light.shadows {
            self.lost.add("lights that cast no shadows", name);
        }
        if light.profile.is_some() {
            self.lost.add("profiles of lamps", name);
        }
        let (mut made, place, ahead) = match &light.kind {
            LightKind::Omni(Omni { position: [x, y, z, w], range }) if *w != 0.0 => {
                let position = Vec3::new(*x, *y, *z) / *w;
                (with_range(json!({ "type": "point" }), *range), position, None)
            }
            LightKind::Omni(Omni { position: [x, y, z, _], .. }) => {
                (json!({ "type": "directional" }), Vec3::ZERO, Some(-Vec3::new(*x, *y, *z)))
            }
            LightKind::Directional(Directional { towards, beam }) => {
                if beam.is_some() {
                    self.lost.add("beams of parallel light, which has no edge there", name);
                }
                (json!({ "type": "directional" }), Vec3::ZERO, Some(*towards))
            }
            LightKind::Spot(spot) => {
                let Spot { position, target, falloff, range } = &**spot;
                let [inner, outer] = match falloff {
                    Falloff::Squared { inner, outer } => [*inner, *outer],
                    Falloff::Smooth { inner, outer } => {
                        self.lost.add("edges of spotlights, which fall off differently", name);
                        [*inner, *outer]
                    }
                    Falloff::Exponent { outer, .. } => {
                        self.lost.add("edges of spotlights, which fall off differently", name);
                        [0.0, *outer]
                    }
                    _ => [0.0, 45.0],
                };
                let outer = f64::from(outer).to_radians().min(std::f64::consts::FRAC_PI_2);
                let inner = f64::from(inner).to_radians().min(outer * 0.999_999);
                let spot = json!({ "innerConeAngle": inner, "outerConeAngle": outer });
                let made = with_range(json!({ "type": "spot", "spot": spot }), *range);
                (made, *position, Some(*target - *position))
            }
            _ => {
                self.lost.add("lights with a surface", name);
                return None;
            }
        };
        let is_parallel = made["type"] == "directional";
        let [constant, linear, square] = light.attenuation;
        let by_distance = match [constant, linear] == [0.0, 0.0] {
            _ if is_parallel => 1.0,
            true => 1.0 / square,
            false => {
                self.lost.add("the attenuation of lights, which falls off with the square of the distance", name);
                // The light is right in the middle of the scene.
                let [low, high] = span_of_scene(self.scene);
                let middle = if low.is_finite() { (low + high) / 2.0 } else { DVec3::ZERO };
                let distance = (middle - place.as_dvec3()).length().max(1e-6) as f32;
                distance * distance / (constant + linear * distance + square * distance * distance)
            }
        };
        // A light of intensity l gives l kd cos θ; that of I candela gives I (ρ / π) cos θ / d².
        let color = light.intensity * (PI * by_distance);
        let most = color.max_component();
        if most > 0.0 && color != canaletto::math::Rgb::gray(most) {
            made["color"] = json!((color * (1.0 / most)).to_array());
        }
        made["intensity"] = json!(most);
        if let Some(name) = &light.name {
            made["name"] = json!(name);
        }
        self.lights.push(made);
        let mut node = json!({ "extensions": { PUNCTUAL: { "light": self.lights.len() - 1 } } });
        if place != Vec3::ZERO {
            node["translation"] = json!(place.as_dvec3().to_array());
        }
        if let Some(ahead) = ahead.and_then(|ahead| ahead.as_dvec3().try_normalize()) {
            let rotation = looking(ahead);
            if rotation != DQuat::IDENTITY {
                node["rotation"] = json!(rotation.to_array());
                // A rotation needs a place of its own, too, beside the node's transform.
                node["translation"] = json!(place.as_dvec3().to_array());
            }
        }
        Some(node)
    }
}

fn with_range(mut light: Value, range: f32) -> Value {
    if range > 0.0 {
        light["range"] = json!(range);
    }
    light
}

/// The rotation that turns −z to a unit direction.
fn looking(ahead: DVec3) -> DQuat {
    let z = -ahead;
    if z == DVec3::Z {
        return DQuat::IDENTITY;
    }
    let aside = if z.y.abs() < 0.99 { DVec3::Y } else { DVec3::X };
    let x = aside.cross(z).normalize();
    DQuat::from_mat3(&DMat3::from_cols(x, z.cross(x), z)).normalize()
}
