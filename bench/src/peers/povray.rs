//! Scenes for POV-Ray (Debian's `povray`), with equal parameters. The model is Phong's, with only the scene's ambient
//! light, brilliance 1, and no falloff. There is no adaptive cut-off. Light is linear, with one ray in the centre of
//! each pixel.

use std::fmt::Write;
use std::path::Path;
use std::process::Command;

use canaletto::integrator::describe;
use canaletto::math::Rgb;
use glam::{DVec3, Vec3};

use super::plain::{Form, Plain, joined};

/// The command that installs POV-Ray.
pub(super) const INSTALL: &str = "apt-get install povray";

/// The command that renders the scene in `file` to `picture`.
pub(super) fn command(file: &Path, picture: &Path, [width, height]: [u32; 2], threads: usize) -> Command {
    let mut command = Command::new("povray");
    command.arg(format!("+I{}", file.display())).arg(format!("+O{}", picture.display()));
    command.args([format!("+W{width}"), format!("+H{height}"), format!("+WT{threads}")]);
    command.args(["-D", "-A", "+Q9", "File_Gamma=srgb"]);
    command
}

/// The number of camera rays that POV-Ray reports: one in each pixel, and the samples of its anti-aliasing.
pub(super) fn camera_rays(report: &str) -> Option<u64> {
    let number_after =
        |label: &str| report.split_whitespace().skip_while(|word| *word != label).nth(1)?.parse::<u64>().ok();
    Some(number_after("Pixels:")? + number_after("Samples:")?)
}

/// The scene in POV-Ray's language. The camera's vectors are explicit, so that its handedness doesn't matter.
pub(super) fn scene(plain: &Plain<'_>, [width, height]: [u32; 2]) -> String {
    let Plain { scene, camera, distance, .. } = plain;
    let [x, y, z] = camera.axes();
    let aspect = f64::from(width) / f64::from(height);
    let mut out = String::new();
    let depth = describe(&scene.integrator).max_depth();
    let _ = writeln!(out, "#version 3.7;");
    let _ = writeln!(out, "global_settings {{ assumed_gamma 1.0 max_trace_level {depth} adc_bailout 0 }}");
    let _ = writeln!(out, "background {{ {} }}", color(scene.background));
    let _ = writeln!(
        out,
        "camera {{ perspective location {} direction {} up {} right {} }}",
        point(camera.eye()),
        point(-z * distance),
        point(y),
        point(x * aspect)
    );
    for (index, material) in scene.materials.iter().enumerate() {
        let p = material.classic();
        let _ = writeln!(
            out,
            "#declare M{index} = material {{ texture {{ pigment {{ {} transmit {} }} finish {{ ambient {} diffuse 1 phong {} \
             phong_size {} reflection {{ {} }} }} }} interior {{ ior {} }} }}",
            color(p.kd),
            1.0 - p.opacity,
            color(scene.ambient),
            p.ks.max_component(),
            p.n,
            color(p.k),
            p.eta
        );
    }
    for &(position, intensity) in &plain.lights {
        let _ = writeln!(out, "light_source {{ {} {} }}", vector(position), color(intensity));
    }
    for thing in &plain.things {
        write_thing(&mut out, &thing.form, &format!("material {{ M{} }}", thing.material));
    }
    out
}

fn write_thing(out: &mut String, form: &Form<'_>, material: &str) {
    match form {
        Form::Spheres(spheres) => {
            for &(center, radius) in spheres {
                let _ = writeln!(out, "sphere {{ {}, {radius} {material} }}", vector(center));
            }
        }
        Form::Cylinders(cylinders) => {
            for &(axis, radius) in cylinders {
                let [a, b] = axis.map(vector);
                let _ = writeln!(out, "cylinder {{ {a}, {b}, {radius} {material} }}");
            }
        }
        Form::Mesh(mesh) => {
            let _ = writeln!(out, "mesh2 {{");
            let list = |out: &mut String, word: &str, items: &mut dyn Iterator<Item = String>, count: usize| {
                let _ = write!(out, "{word} {{ {count}");
                items.for_each(|item| {
                    let _ = write!(out, ", {item}");
                });
                out.push_str(" }\n");
            };
            list(out, "vertex_vectors", &mut mesh.positions.iter().map(|&p| vector(p)), mesh.positions.len());
            let triangles = mesh.triangles.iter().map(|[a, b, c]| format!("<{a}, {b}, {c}>"));
            list(out, "face_indices", &mut { triangles }, mesh.triangles.len());
            let _ = writeln!(out, "{material} }}");
        }
    }
}

fn color(c: Rgb) -> String {
    format!("rgb <{}>", joined(c.to_array(), ", "))
}

fn vector(v: Vec3) -> String {
    format!("<{}>", joined(v, ", "))
}

fn point(v: DVec3) -> String {
    format!("<{}>", joined(v, ", "))
}
