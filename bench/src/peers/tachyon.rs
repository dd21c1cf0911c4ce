//! Scenes for Tachyon (Debian's `tachyon`) in its own language, with equal parameters where they exist. Its materials
//! have one colour, and factors for ambient, diffuse, mirrored and transparent light. Transparent bodies don't refract.
//! Its pictures are mirrored.

use std::fmt::Write;
use std::path::Path;
use std::process::Command;

use canaletto::integrator::describe;
use canaletto::material::Phong;
use glam::{DVec3, Vec3};

use super::plain::{Form, Plain, joined};

/// The command that installs Tachyon.
pub(super) const INSTALL: &str = "apt-get install tachyon";

/// The command that renders the scene in `file` to `picture`.
pub(super) fn command(file: &Path, picture: &Path, [width, height]: [u32; 2], threads: usize) -> Command {
    let mut command = Command::new("tachyon");
    command.arg(file).arg("-o").arg(picture).args(["-format", "TARGA", "-numthreads", &threads.to_string()]);
    command.args(["-res", &width.to_string(), &height.to_string(), "-aasamples", "0", "-fullshade", "-shade_phong"]);
    command
}

/// The scene in Tachyon's language.
pub(super) fn scene(plain: &Plain<'_>, [width, height]: [u32; 2]) -> String {
    // At a distance of 1 Tachyon's picture is 1 / zoom high.
    let Plain { scene, camera, distance: zoom, .. } = plain;
    let [_, y, z] = camera.axes();
    let mut out = String::new();
    let _ = writeln!(out, "BEGIN_SCENE\nRESOLUTION {width} {height}\nCAMERA\nPROJECTION PERSPECTIVE\nZOOM {zoom}");
    let _ = writeln!(out, "ASPECTRATIO 1\nANTIALIASING 0\nRAYDEPTH {}", describe(&scene.integrator).max_depth());
    let _ = writeln!(out, "CENTER {}\nVIEWDIR {}\nUPDIR {}\nEND_CAMERA", point(camera.eye()), point(-z), point(y));
    let _ = writeln!(out, "BACKGROUND {}", joined(scene.background.to_array(), " "));
    for (index, material) in scene.materials.iter().enumerate() {
        let Phong { kd, ks, n, k, opacity, .. } = material.classic();
        let _ = writeln!(
            out,
            "TEXDEF M{index} AMBIENT {} DIFFUSE 1 SPECULAR {} OPACITY {opacity} PHONG PLASTIC {} PHONG_SIZE {n} COLOR {} TEXFUNC 0",
            scene.ambient.max_component(),
            k.max_component(),
            ks.max_component(),
            joined(kd.to_array(), " ")
        );
    }
    for &(position, intensity) in &plain.lights {
        let (at, color) = (vector(position), joined(intensity.to_array(), " "));
        let _ = writeln!(out, "LIGHT CENTER {at} RAD 0.001 COLOR {color}");
    }
    for thing in &plain.things {
        write_thing(&mut out, &thing.form, thing.material);
    }
    out.push_str("END_SCENE\n");
    out
}

fn write_thing(out: &mut String, form: &Form<'_>, m: u32) {
    match form {
        Form::Spheres(spheres) => {
            for &(center, radius) in spheres {
                let _ = writeln!(out, "SPHERE CENTER {} RAD {radius} M{m}", vector(center));
            }
        }
        Form::Cylinders(cylinders) => {
            for &(axis, radius) in cylinders {
                let [a, b] = axis.map(vector);
                let _ = writeln!(out, "FCYLINDER BASE {a} APEX {b} RAD {radius} M{m}");
            }
        }
        Form::Mesh(mesh) => {
            for i in 0..mesh.triangles.len() {
                let [a, b, c] = mesh.corners(i).map(vector);
                let _ = writeln!(out, "TRI V0 {a} V1 {b} V2 {c} M{m}");
            }
        }
    }
}

fn vector(v: Vec3) -> String {
    joined(v, " ")
}

fn point(v: DVec3) -> String {
    joined(v, " ")
}
