//! Warnings about pictures that will be black, white or empty, and about meshes that look odd.

use crate::format::{plural, short};
use canaletto::diagnose::{Finding, MeshFinding, Reason, diagnose};
use canaletto::glam::DVec3;
use canaletto::render::Job;
use canaletto::scene::Scene;
use canaletto::world::World;
use canaletto_io::diagnostic::{Diagnostic, Diagnostics};

/// Warnings about the meshes of a scene. `name` is the name of the scene.
pub(crate) fn doubt_meshes(name: &str, scene: &Scene) -> Diagnostics {
    let mut all = Diagnostics::new();
    for finding in canaletto::diagnose::doubt_meshes(scene) {
        all.push(match finding {
            MeshFinding::InsideOut { mesh } => Diagnostic::warning(
                name,
                format!(
                    "mesh \"{mesh}\" is inside out: its faces turn inwards, and its material shows from outside only"
                ),
            )
            .help("turn its faces round in a modeller, or mirror it with a negative scale"),
            MeshFinding::Doubled { mesh, faces } => {
                let faces = plural(faces as u64, "face");
                let message =
                    format!("mesh \"{mesh}\" has {faces} with the same corners as others, which are seen instead");
                Diagnostic::warning(name, message)
                    .help("a modeller removes double faces; glass with both has no inside")
            }
            MeshFinding::SamePlace { objects: [first, second], count } => {
                let others = match count {
                    1 => String::new(),
                    _ => format!(", and {} more", plural(count as u64 - 1, "such pair")),
                };
                let message = format!("\"{second}\" lies exactly on \"{first}\"{others}; chance decides which is seen");
                Diagnostic::warning(name, message).help("delete one of them, or move it")
            }
            _ => continue,
        });
    }
    all
}

/// Warnings about a picture that will show little or nothing. `name` is the name of the scene, and `camera` that of the
/// camera if there are several.
pub(crate) fn doubt_picture(name: &str, camera: Option<&String>, world: &World, job: &Job) -> Diagnostics {
    let of = camera.map_or_else(String::new, |camera| format!("camera \"{camera}\": "));
    let mut all = Diagnostics::new();
    for finding in diagnose(world, job) {
        let (message, help) = match finding {
            Finding::NothingInView { bounds, behind } => {
                let [x, y, z] = job.camera.at(0.0).axes().map(|axis| axis.to_array())[2].map(|v| decimal(-v));
                let place = if behind {
                    format!("everything lies behind the eye, which looks along {x} {y} {z}")
                } else {
                    format!("no camera ray meets anything; the eye looks along {x} {y} {z}")
                };
                let help = match bounds {
                    Some([low, high]) => {
                        let [low, middle, high] = [low, (low + high) / 2.0, high].map(point);
                        format!("the scene lies between {low} and {high}; for example: center {middle}")
                    }
                    None => "turn the camera, for example down towards an unbounded plane".into(),
                };
                (format!("the picture will be empty: {place}"), help)
            }
            Finding::EyeInside { object } => (
                format!("the picture will be dark: the eye is inside {object}, which is opaque, and no light is there"),
                "move eye out of it, put a light inside, or give it an opacity below 1".into(),
            ),
            Finding::Black { ref reasons } => (finding.to_string(), cure(reasons).into()),
            Finding::White { least } => (
                format!("everything in view is white: its light is {} or more, and 1 is white", short(least.into())),
                "lower ambient, or the intensity of the lights".into(),
            ),
            Finding::LightInside { light, object } => (
                format!("{light} is inside {object}, which is opaque; nothing outside gets its light"),
                "move the light out of it, or write shadows #false in the light".into(),
            ),
            other => (other.to_string(), "look at what the camera and the lights stand in".into()),
        };
        all.push(Diagnostic::warning(name, format!("{of}{message}")).help(help));
    }
    all
}

/// Advice against the first reason. An ambient light helps against most reasons.
fn cure(reasons: &[Reason]) -> &'static str {
    match reasons.first() {
        Some(Reason::BlackMaterial(_)) => "give it a kd, the share of light that it scatters: kd 0.8 0.8 0.8",
        Some(Reason::EmitsOutwards(_)) => "write two-sided #true in the material, or turn its surfaces round",
        Some(Reason::NotFollowed) => "integrator \"whitted\" { max-depth 6 }",
        Some(Reason::LightOff(_)) => "1 is full strength: intensity 1 1 1",
        Some(Reason::LightDoesNotReach(_)) => "look at the light's cone, region, attenuation and intensity",
        _ => "move the light to where the camera looks, or write ambient 0.2 0.2 0.2",
    }
}

/// A component of a unit vector with six decimals, which is 0 where only rounding makes it another number.
fn decimal(v: f64) -> f64 {
    // The addition removes the sign of a zero.
    (v * 1e6).round() / 1e6 + 0.0
}

/// The coordinates of a point, formatted as in a scene.
fn point(p: DVec3) -> String {
    let number = |v: f64| match short(v) {
        v if v != 0.0 && !(1e-4..1e16).contains(&v.abs()) => format!("{v:e}"),
        v => v.to_string(),
    };
    p.to_array().map(number).join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_have_no_noise() {
        assert_eq!(
            [-7.1e-15, -0.0, 0.5f64.sqrt(), -1.0].map(decimal).map(|v| v.to_string()),
            ["0", "0", "0.707107", "-1"]
        );
    }
}
