//! Scenes for Mitsuba 3 (PyPI's `mitsuba`) in its own XML, rendered by a small Python script.
//!
//! Mitsuba has no Whitted integrator and no Phong model. Scenes with mirrors or transparent bodies use its path tracer
//! with an equal maximum depth. The others use its direct integrator, with as many light samples as lights. Surfaces
//! are diffuse or rough plastic, blended with a mirror and with glass. Point lights have inverse-square falloff; their
//! intensity matches Canaletto's at the centre of the view. There is no ambient light, and the background is black: an
//! environment would be one more light to sample.
//!
//! Many spheres, and cylinders, are curves of one segment with round ends; one shape has millions of segments. A
//! sphere's segment is a 500th of its radius long. A plugin for each sphere takes twice the time for thousands, and
//! much more for many more. `ellipsoids` has artefacts for small, distant spheres (in version 3.9). Few spheres are
//! sphere plugins.

use std::fmt::{Display, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use canaletto::integrator::describe;
use canaletto::material::Phong;
use canaletto::math::Rgb;
use glam::Vec3;
use serde_json::Value;

use super::plain::{Form, Plain, joined};
use super::stages::write_ply;
use super::statistics::{Clock, Times};

/// The command that installs Mitsuba.
pub(super) const INSTALL: &str = "pip install mitsuba (and CANALETTO_PYTHON=…/bin/python if that isn't python3's)";
/// The command that installs the library for the faster variants.
pub(super) const INSTALL_LLVM: &str = "apt-get install libllvm19, and DRJIT_LIBLLVM_PATH=/usr/lib/x86_64-linux-gnu/libLLVM.so.19.1 if another version is found first";

/// The variants without spectral rendering and its derivatives: compiled for the scene, and by templates.
pub(super) const VARIANTS: [(&str, &str); 2] = [("mi-llvm", "llvm_ad_rgb"), ("mi-scalar", "scalar_rgb")];

/// The largest number of spheres of one material that become sphere plugins.
const FEW: usize = 64;

/// A Python interpreter with Mitsuba.
pub(super) struct Python {
    program: std::ffi::OsString,
    script: PathBuf,
}

impl Python {
    /// The interpreter that `CANALETTO_PYTHON` names, or `python3`, if it has Mitsuba. The script is written to
    /// `folder`.
    pub(super) fn find(folder: &Path) -> Result<Option<Self>, String> {
        let program = std::env::var_os("CANALETTO_PYTHON").unwrap_or("python3".into());
        let script = folder.join("mitsuba-peer.py");
        write(&script, include_str!("mitsuba.py"))?;
        let found = succeeds(Command::new(&program).args(["-c", "import mitsuba"]));
        Ok(found.then_some(Self { program, script }))
    }

    /// Whether a variant works on this machine.
    pub(super) fn has(&self, variant: &str) -> bool {
        succeeds(Command::new(&self.program).arg(&self.script).arg(variant))
    }

    /// The command that renders `file` to `picture` and writes the durations of its parts to `seconds`.
    pub(super) fn command(&self, variant: &str, threads: usize, [file, picture, seconds]: [&Path; 3]) -> Command {
        let mut command = Command::new(&self.program);
        command.arg(&self.script).arg(variant).arg(threads.to_string()).args([file, picture, seconds]);
        command
    }
}

fn succeeds(command: &mut Command) -> bool {
    let quiet = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    quiet.status().is_ok_and(|status| status.success())
}

/// The durations of the parts, as reported by the processes.
#[derive(Default)]
pub(super) struct Told {
    version: String,
    parts: [Times; 4],
}

impl Told {
    /// Adds the report of the last process.
    pub(super) fn add(&mut self, file: &Path, clock: Clock) -> Result<(), String> {
        let text = std::fs::read_to_string(file).map_err(|e| format!("{}: {e}", file.display()))?;
        let told: Value = serde_json::from_str(&text).map_err(|e| format!("{}: {e}", file.display()))?;
        self.version = told["version"].as_str().unwrap_or_default().into();
        let column = usize::from(clock == Clock::Cpu);
        for (name, times) in PARTS.iter().zip(&mut self.parts) {
            times.0.push(told["seconds"][name][column].as_f64().unwrap_or(f64::NAN));
        }
        Ok(())
    }

    /// The durations of each part in all rounds.
    pub(super) fn json(&self) -> Value {
        PARTS.iter().zip(&self.parts).map(|(name, times)| (name.to_string(), Value::from(times.0.clone()))).collect()
    }
}

const PARTS: [&str; 4] = ["start", "load", "render", "write"];

impl Display for Told {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Mitsuba {} itself:", self.version)?;
        // The wall clock has no start time of the interpreter.
        let parts = PARTS.iter().zip(&self.parts).filter(|(_, times)| times.median() > 0.0);
        for (i, (name, times)) in parts.enumerate() {
            write!(f, "{} {name} {:.3}", if i == 0 { "" } else { "," }, times.median())?;
        }
        Ok(())
    }
}

/// Writes the scene, with long data in files beside it.
pub(super) fn write_scene(plain: &Plain<'_>, [width, height]: [u32; 2], path: &Path) -> Result<(), String> {
    let Plain { scene, view, .. } = plain;
    let depth = describe(&scene.integrator).max_depth();
    let [eye, center, up] = [view.extrinsics.eye, view.extrinsics.center, view.extrinsics.up];
    let far = (center - eye).length();
    let mut out = String::from("<scene version=\"3.0.0\">\n");
    let mut put = |text: String| {
        out += &text;
        out.push('\n');
    };
    put(if scene.materials.iter().any(|m| !m.classic().k.is_black() || m.classic().opacity < 1.0) {
        // Canaletto counts eye rays as level 1. Mitsuba's level 1 is emission seen directly.
        format!("<integrator type=\"path\">{}</integrator>", number("integer", "max_depth", depth.saturating_add(1)))
    } else {
        let [lights, others] = [("emitter_samples", plain.lights.len().max(1)), ("bsdf_samples", 0)];
        let counts = [lights, others].map(|(name, value)| number("integer", name, value));
        format!("<integrator type=\"direct\">{}</integrator>", counts.concat())
    });
    let [eye_text, center_text, up_text] = [eye, center, up].map(|v| joined(v, ","));
    put(format!(
        "<sensor type=\"perspective\">{}<string name=\"fov_axis\" value=\"y\"/>{}{}<transform name=\"to_world\">\
         <lookat origin=\"{eye_text}\" target=\"{center_text}\" up=\"{up_text}\"/></transform>\
         <sampler type=\"independent\">{}</sampler><film type=\"hdrfilm\">{}{}<rfilter type=\"box\"/></film></sensor>",
        number("float", "fov", view.intrinsics.fovy),
        number("float", "near_clip", far * 1e-4),
        number("float", "far_clip", far * 1e4),
        number("integer", "sample_count", 1),
        number("integer", "width", width),
        number("integer", "height", height),
    ));
    for &(position, intensity) in &plain.lights {
        let distance = (position.as_dvec3() - center).length().max(f64::MIN_POSITIVE);
        let factor = (std::f64::consts::PI * distance * distance) as f32;
        let (at, color) = (joined(position, ","), color("intensity", intensity * Rgb::gray(factor)));
        put(format!("<emitter type=\"point\"><point name=\"position\" value=\"{at}\"/>{color}</emitter>"));
    }
    for (index, material) in scene.materials.iter().enumerate() {
        put(bsdf(&material.classic(), &format!(" id=\"M{index}\"")));
    }
    for (index, thing) in plain.things.iter().enumerate() {
        let (beside, stem) = (path.with_extension(format!("{index}.data")), path.file_stem().unwrap_or_default());
        let file = format!("<string name=\"filename\" value=\"{}.{index}.data\"/>", stem.to_string_lossy());
        let material = format!("<ref id=\"M{}\"/>", thing.material);
        let clear = scene.materials[thing.material as usize].classic().opacity < 1.0;
        match &thing.form {
            Form::Mesh(mesh) => {
                let written = write_ply(&mesh.positions, &mesh.triangles, &beside);
                written.map_err(|e| format!("{}: {e}", beside.display()))?;
                let flat = "<boolean name=\"face_normals\" value=\"true\"/>";
                put(format!("<shape type=\"ply\">{file}{flat}{material}</shape>"));
            }
            Form::Spheres(spheres) if clear || spheres.len() <= FEW => {
                for &(center, radius) in spheres {
                    let at = joined(center, ",");
                    let radius = number("float", "radius", radius);
                    put(format!(
                        "<shape type=\"sphere\"><point name=\"center\" value=\"{at}\"/>{radius}{material}</shape>"
                    ));
                }
            }
            Form::Spheres(spheres) => {
                let short = |&(c, r): &(Vec3, f32)| ([c - Vec3::Z * (1e-3 * r), c + Vec3::Z * (1e-3 * r)], r);
                write(&beside, &curves(spheres.iter().map(short)))?;
                put(format!("<shape type=\"linearcurve\">{file}{material}</shape>"));
            }
            Form::Cylinders(cylinders) => {
                write(&beside, &curves(cylinders.iter().copied()))?;
                put(format!("<shape type=\"linearcurve\">{file}{material}</shape>"));
            }
        }
    }
    put("</scene>".into());
    write(path, &out)
}

/// Curves of one segment each: one line for each end, and an empty line.
fn curves(segments: impl Iterator<Item = ([Vec3; 2], f32)>) -> String {
    let mut out = String::new();
    for (ends, radius) in segments {
        let [a, b] = ends.map(|end| joined(end, " "));
        let _ = write!(out, "{a} {radius}\n{b} {radius}\n\n");
    }
    out
}

/// The closest BSDF to Phong's model: a blend of diffuse or plastic, of a mirror, and of clear glass.
fn bsdf(phong: &Phong, id: &str) -> String {
    let base = if phong.ks.is_black() {
        format!("<bsdf type=\"diffuse\">{}</bsdf>", color("reflectance", phong.kd))
    } else {
        // The roughness whose highlights are as wide as those of cosⁿ.
        let alpha = number("float", "alpha", (2.0 / (phong.n + 2.0)).sqrt().clamp(0.01, 1.0));
        let colors = [color("diffuse_reflectance", phong.kd), color("specular_reflectance", phong.ks)].concat();
        format!("<bsdf type=\"roughplastic\">{colors}{alpha}</bsdf>")
    };
    let share = |share: f32, one: &str, other: &str| {
        let weight = number("float", "weight", share.clamp(0.0, 1.0));
        format!("<bsdf type=\"blendbsdf\">{weight}{one}{other}</bsdf>")
    };
    let mirror = "<bsdf type=\"conductor\"/>";
    let solid = if phong.k.is_black() { base } else { share(phong.k.max_component(), &base, mirror) };
    if phong.opacity < 1.0 {
        let glass = format!(
            "<bsdf type=\"dielectric\">{}{}</bsdf>",
            number("float", "int_ior", phong.eta),
            number("float", "ext_ior", 1)
        );
        let both = share(1.0 - phong.opacity, &format!("<bsdf type=\"twosided\">{solid}</bsdf>"), &glass);
        return both.replacen("<bsdf", &format!("<bsdf{id}"), 1);
    }
    format!("<bsdf type=\"twosided\"{id}>{solid}</bsdf>")
}

fn number(kind: &str, name: &str, value: impl Display) -> String {
    format!("<{kind} name=\"{name}\" value=\"{value}\"/>")
}

fn color(name: &str, c: Rgb) -> String {
    format!("<rgb name=\"{name}\" value=\"{}\"/>", joined(c.to_array(), ","))
}

/// Writes a text to a file.
pub(super) fn write(path: &Path, text: &str) -> Result<(), String> {
    std::fs::write(path, text).map_err(|e| format!("{}: {e}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::super::stages::Folder;
    use super::*;
    use canaletto_io::assets::MemoryAssets;
    use canaletto_io::text;

    fn written(scene: &str) -> String {
        let (scene, _) = text::read_scene("scene.kdl", &MemoryAssets::new().with("scene.kdl", scene)).unwrap();
        let folder = Folder::new().unwrap();
        let path = folder.0.join("scene-mitsuba.xml");
        write_scene(&Plain::new(&scene, [8, 6]).unwrap(), [8, 6], &path).unwrap();
        std::fs::read_to_string(path).unwrap()
    }

    #[test]
    fn only_scenes_with_mirrors_or_glass_need_paths() {
        let scene = |k: f32| {
            format!(
                "camera {{ eye 0 0 9; center 0 0 0; up 0 1 0; fovy 40 }}\nintegrator \"whitted\" {{ max-depth 4 }}\nmaterial \"m\" {{ kd 1 0 0; k {k} }}\n\
                 sphere material=\"m\" {{ center 0 0 0; radius 1 }}\n\
                 light \"omni\" {{ position 0 3 4; intensity 1 1 1 }}\nlight \"omni\" {{ position 0 0 9; intensity 1 1 1 }}\n"
            )
        };
        let [matte, mirror] = [0.0, 0.5].map(|k| written(&scene(k)));
        assert!(matte.contains("type=\"direct\"><integer name=\"emitter_samples\" value=\"2\"/>"), "{matte}");
        assert!(mirror.contains("type=\"path\"><integer name=\"max_depth\" value=\"5\"/>"), "{mirror}");
        assert!(matte.contains("<shape type=\"sphere\">"), "{matte}");
        // One camera ray for each pixel, as all others trace.
        assert!(matte.contains("name=\"sample_count\" value=\"1\""), "{matte}");
        // The intensity is π · 5² for the distance to the centre of the view.
        assert!(matte.contains("<rgb name=\"intensity\" value=\"78.53"), "{matte}");
    }

    #[test]
    fn materials_have_their_shares_and_one_name() {
        let phong = Phong { kd: Rgb::gray(0.5), k: Rgb::gray(0.25), eta: 1.5, opacity: 0.1, ..Phong::default() };
        let [glass, mirror] = [phong, Phong { opacity: 1.0, ..phong }].map(|phong| bsdf(&phong, " id=\"M7\""));
        for text in [&glass, &mirror] {
            assert_eq!(text.matches("id=\"M7\"").count(), 1, "{text}");
            assert_eq!(
                text.matches("<bsdf").count(),
                text.matches("</bsdf>").count() + text.matches("/>").count() - parameters(text)
            );
        }
        assert!(glass.contains("value=\"0.9\"") && glass.contains("dielectric"), "{glass}");
        assert!(mirror.contains("value=\"0.25\"") && !mirror.contains("dielectric"), "{mirror}");
    }

    /// The number of tags of numbers and colours.
    fn parameters(text: &str) -> usize {
        ["<float", "<rgb"].map(|tag| text.matches(tag).count()).iter().sum()
    }

    #[test]
    fn many_spheres_are_short_curves() {
        let text = curves([([Vec3::ZERO, Vec3::X], 0.5)].into_iter());
        assert_eq!(text, "0 0 0 0.5\n1 0 0 0.5\n\n");
    }
}
