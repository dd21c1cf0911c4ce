//! Scenes for Tachyon (Debian's `tachyon`) in its own language, with the same numbers as far as it has them: its materials
//! have one colour and numbers for how much of it is ambient, diffuse, mirrored and clear; clear bodies don't refract.
//! Its pictures are mirrored.

use std::fmt::Write;
use std::path::Path;
use std::process::Command;

use canaletto::camera::Camera;
use canaletto::light::LightKind;
use canaletto::material::Phong;
use canaletto::scene::{Content, Node, Scene};
use canaletto::shape::Shape;
use glam::{DVec3, Vec3};

/// How to get it.
pub(super) const INSTALL: &str = "apt-get install tachyon";

/// The command that makes `picture` of the scene in `file`.
pub(super) fn command(file: &Path, picture: &Path, [width, height]: [u32; 2], threads: usize) -> Command {
    let mut command = Command::new("tachyon");
    command.arg(file).arg("-o").arg(picture).args(["-format", "TARGA", "-numthreads", &threads.to_string()]);
    command.args(["-res", &width.to_string(), &height.to_string(), "-aasamples", "0", "-fullshade", "-shade_phong"]);
    command
}

/// The scene in Tachyon's language.
pub(super) fn scene(scene: &Scene, [width, height]: [u32; 2]) -> Result<String, String> {
    let view = &scene.views[0];
    let camera = Camera::new(&view.intrinsics, &view.extrinsics).map_err(|e| e.to_string())?;
    let [_, y, z] = camera.axes();
    // At a distance of 1 its picture is 1 / zoom high.
    let zoom = 0.5 / (view.intrinsics.fovy.to_radians() / 2.0).tan();
    let mut out = String::new();
    let _ = writeln!(out, "BEGIN_SCENE\nRESOLUTION {width} {height}\nCAMERA\nPROJECTION PERSPECTIVE\nZOOM {zoom}");
    let _ = writeln!(out, "ASPECTRATIO 1\nANTIALIASING 0\nRAYDEPTH {}", scene.integrator.max_depth);
    let _ = writeln!(out, "CENTER {}\nVIEWDIR {}\nUPDIR {}\nEND_CAMERA", point(camera.eye()), point(-z), point(y));
    let [r, g, b] = scene.background.to_array();
    let _ = writeln!(out, "BACKGROUND {r} {g} {b}");
    for (index, material) in scene.materials.iter().enumerate() {
        let Phong { kd, ks, n, k, opacity, .. } = material.phong;
        let [r, g, b] = kd.to_array();
        let _ = writeln!(
            out,
            "TEXDEF M{index} AMBIENT {} DIFFUSE 1 SPECULAR {} OPACITY {opacity} PHONG PLASTIC {} PHONG_SIZE {n} COLOR {r} {g} {b} TEXFUNC 0",
            scene.ambient.max_component(),
            k.max_component(),
            ks.max_component()
        );
    }
    for node in &scene.nodes {
        write_node(&mut out, scene, node)?;
    }
    out.push_str("END_SCENE\n");
    Ok(out)
}

fn write_node(out: &mut String, scene: &Scene, node: &Node) -> Result<(), String> {
    let m = node.material.unwrap_or_default();
    let sphere = |out: &mut String, center, radius| {
        let _ = writeln!(out, "SPHERE CENTER {} RAD {radius} M{m}", vector(center));
    };
    match &node.content {
        Content::Light(light) => {
            let LightKind::Omni(omni) = &light.kind else {
                return Err("only omni lights are written for Tachyon".into());
            };
            let [r, g, b] = light.intensity.to_array();
            let _ = writeln!(out, "LIGHT CENTER {} RAD 0.001 COLOR {r} {g} {b}", vector(omni.position.truncate()));
        }
        Content::Shape(Shape::Sphere(s)) => sphere(out, s.center, s.radius),
        Content::Mesh(index) => {
            let mesh = &scene.meshes[*index as usize];
            let m = node.material.or(mesh.materials.first().copied()).unwrap_or_default();
            for i in 0..mesh.triangles.len() {
                let [a, b, c] = mesh.corners(i).map(vector);
                let _ = writeln!(out, "TRI V0 {a} V1 {b} V2 {c} M{m}");
            }
        }
        Content::Spheres(index) => {
            let cloud = &scene.spheres[*index as usize];
            cloud.centers.iter().enumerate().for_each(|(i, &center)| sphere(out, center, cloud.radius(i)));
        }
        Content::Cylinders(index) => {
            let cloud = &scene.cylinders[*index as usize];
            for (i, &axis) in cloud.axes.iter().enumerate() {
                let [a, b] = axis.map(vector);
                let _ = writeln!(out, "FCYLINDER BASE {a} APEX {b} RAD {} M{m}", cloud.radius(i));
            }
        }
        _ => return Err("only spheres, meshes, clouds and omni lights are written for Tachyon".into()),
    }
    Ok(())
}

fn vector(v: Vec3) -> String {
    format!("{} {} {}", v.x, v.y, v.z)
}

fn point(v: DVec3) -> String {
    format!("{} {} {}", v.x, v.y, v.z)
}
