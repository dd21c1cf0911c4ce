//! Scenes for POV-Ray (Debian's `povray`), with the same numbers: Phong's model without ambient but the scene's, brilliance 1,
//! no falloff, no adaptive cut-off, linear light, one ray in the centre of each pixel.

use std::fmt::Write;
use std::path::Path;
use std::process::Command;

use canaletto::camera::Camera;
use canaletto::light::LightKind;
use canaletto::math::Rgb;
use canaletto::scene::{Content, Node, Scene};
use canaletto::shape::Shape;
use glam::{DVec3, Vec3};

/// How to get it.
pub(super) const INSTALL: &str = "apt-get install povray";

/// The command that makes `picture` of the scene in `file`.
pub(super) fn command(file: &Path, picture: &Path, [width, height]: [u32; 2], threads: usize) -> Command {
    let mut command = Command::new("povray");
    command.arg(format!("+I{}", file.display())).arg(format!("+O{}", picture.display()));
    command.args([format!("+W{width}"), format!("+H{height}"), format!("+WT{threads}")]);
    command.args(["-D", "-A", "+Q9", "File_Gamma=srgb"]);
    command
}

/// The scene in POV-Ray's language, vectors of the camera spelled out so that its handedness doesn't matter.
pub(super) fn scene(scene: &Scene, [width, height]: [u32; 2]) -> Result<String, String> {
    let view = &scene.views[0];
    let camera = Camera::new(&view.intrinsics, &view.extrinsics).map_err(|e| e.to_string())?;
    let [x, y, z] = camera.axes();
    let distance = 0.5 / (view.intrinsics.fovy.to_radians() / 2.0).tan();
    let aspect = f64::from(width) / f64::from(height);
    let mut out = String::new();
    let depth = scene.integrator.max_depth;
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
        let p = &material.phong;
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
    for node in &scene.nodes {
        write_node(&mut out, scene, node)?;
    }
    Ok(out)
}

fn write_node(out: &mut String, scene: &Scene, node: &Node) -> Result<(), String> {
    match &node.content {
        Content::Light(light) => {
            let LightKind::Omni(omni) = &light.kind else {
                return Err("only omni lights are written for POV-Ray".into());
            };
            let _ = writeln!(out, "light_source {{ {} {} }}", vector(omni.position.truncate()), color(light.intensity));
        }
        Content::Shape(Shape::Sphere(s)) => {
            let m = node.material.unwrap_or_default();
            let _ = writeln!(out, "sphere {{ {}, {} material {{ M{m} }} }}", vector(s.center), s.radius);
        }
        Content::Mesh(index) => {
            let mesh = &scene.meshes[*index as usize];
            let m = node.material.or(mesh.materials.first().copied()).unwrap_or_default();
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
            let _ = writeln!(out, "material {{ M{m} }} }}");
        }
        Content::Spheres(index) => {
            let (cloud, m) = (&scene.spheres[*index as usize], node.material.unwrap_or_default());
            for (i, &center) in cloud.centers.iter().enumerate() {
                let _ = writeln!(out, "sphere {{ {}, {} material {{ M{m} }} }}", vector(center), cloud.radius(i));
            }
        }
        Content::Cylinders(index) => {
            let (cloud, m) = (&scene.cylinders[*index as usize], node.material.unwrap_or_default());
            for (i, &axis) in cloud.axes.iter().enumerate() {
                let [a, b] = axis.map(vector);
                let _ = writeln!(out, "cylinder {{ {a}, {b}, {} material {{ M{m} }} }}", cloud.radius(i));
            }
        }
        _ => return Err("only spheres, meshes, clouds and omni lights are written for POV-Ray".into()),
    }
    Ok(())
}

fn color(c: Rgb) -> String {
    format!("rgb <{}, {}, {}>", c.r, c.g, c.b)
}

fn vector(v: Vec3) -> String {
    format!("<{}, {}, {}>", v.x, v.y, v.z)
}

fn point(v: DVec3) -> String {
    format!("<{}, {}, {}>", v.x, v.y, v.z)
}
