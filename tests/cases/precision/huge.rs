//! Triangles that are huge compared with their visible part give the picture of a box of equal size.

use super::*;

/// A ball on a ground whose top is at 0, with oblique light.
fn on_ground(ground: &str, materials: &str) -> String {
    format!(
        r#"background 0.5 0.6 0.9
ambient 0.2
camera {{ eye 0 1.7 0; center 0 1.6 -10; fovy 60; size 120 80 }}
{materials}
{ground}
sphere {{ center 0 1 -6; radius 1 }}
light "directional" {{ direction -0.5 -1 -0.3 }}
film {{ samples 4 }}
"#
    )
}

fn ground_box(size: f64) -> String {
    format!("box material=\"ground\" {{ min {0} {0} {0}; max {1} 0 {1} }}", -size, size)
}

fn triangle(size: f64) -> String {
    format!("triangle material=\"ground\" {{ a {0} 0 {1}; b {1} 0 {1}; c 0 0 {0} }}", -size, size)
}

/// A square of two triangles.
fn obj(size: f64, normals: bool) -> Vec<u8> {
    let vn = if normals { "//1" } else { "" };
    format!(
        "v {0} 0 {0}\nv {0} 0 {1}\nv {1} 0 {1}\nv {1} 0 {0}\nvn 0 1 0\n\
         f 1{vn} 2{vn} 3{vn}\nf 1{vn} 3{vn} 4{vn}\n",
        -size, size
    )
    .into_bytes()
}

const PLAIN: &str = "material \"ground\" { kd 0.8 }";

#[test]
fn shadows_on_huge_triangles_are_those_on_a_box() {
    for size in [1e5, 1e6, 1e7, 1e8, 1e9] {
        let expected = picture(&on_ground(&ground_box(size), PLAIN));
        same(&format!("triangle {size}"), &picture(&on_ground(&triangle(size), PLAIN)), &expected);
        for normals in [false, true] {
            let files = [("quad.obj", obj(size, normals))];
            let mesh = scene(&on_ground("mesh file=\"quad.obj\" material=\"ground\"", PLAIN), &files);
            same(&format!("mesh {size} {normals}"), &picture_of(mesh), &expected);
            // The copies stay instances.
            let copies = "mesh file=\"quad.obj\" material=\"ground\" { scale 0.5; scale 2 }
                mesh file=\"quad.obj\" material=\"ground\" { translate 0 -5 0; rotate-y 30 }";
            let copies = scene(&on_ground(copies, PLAIN), &files);
            same(&format!("instances {size} {normals}"), &picture_of(copies), &expected);
        }
    }
}

#[test]
fn mirrors_on_huge_triangles_are_those_of_a_box() {
    let mirror = "material \"ground\" { kd 0.3; k 0.6 }";
    for size in [1e6, 1e8] {
        let expected = picture(&on_ground(&ground_box(size), mirror));
        same(&format!("triangle {size}"), &picture(&on_ground(&triangle(size), mirror)), &expected);
    }
}

#[test]
fn textures_on_huge_triangles_are_those_on_a_box() {
    for size in [1e4, 1e6, 1e8] {
        // The squares have sides of one unit.
        let checks = |repeat: f64| {
            format!(
                "texture \"checks\" kind=\"checker\" {{ even 0.1; odd 0.9 }}
                 material \"ground\" {{ kd 0.8; texture \"checks\" mapping=\"uv\" {{ repeat {repeat} }} }}"
            )
        };
        let plane = "plane material=\"ground\" { point 0 0 0; normal 0 1 0 }";
        let expected = picture(&on_ground(plane, &checks(1.0)));
        same(&format!("box {size}"), &picture(&on_ground(&ground_box(size), &checks(2.0 * size))), &expected);
        let text = on_ground("mesh file=\"quad.obj\" material=\"ground\"", &checks(2.0 * size));
        let mut mesh = scene(&text, &[("quad.obj", obj(size, false))]);
        let of = |p: &glam::Vec3| glam::Vec2::new(if p.x > 0.0 { 1.0 } else { 0.0 }, if p.z > 0.0 { 1.0 } else { 0.0 });
        mesh.meshes[0].uvs = mesh.meshes[0].positions.iter().map(of).collect();
        same(&format!("mesh {size}"), &picture_of(mesh), &expected);
    }
}

#[test]
fn a_scaled_scene_with_huge_triangles_has_the_same_bits() {
    let at = |scale: f64| {
        let text = format!(
            "camera {{ eye 0 {0} 0; center 0 {1} {2}; fovy 60; size 60 40 }}
             triangle {{ a {3} 0 {4}; b {4} 0 {4}; c 0 0 {3} }}
             sphere {{ center 0 {5} {6}; radius {5} }}
             light \"directional\" {{ direction -0.5 -1 -0.3 }}",
            1.75 * scale,
            1.5 * scale,
            -10.0 * scale,
            -1e6 * scale,
            1e6 * scale,
            scale,
            -6.0 * scale
        );
        picture(&text)
    };
    assert!(at(1.0) == at(0.125) && at(1.0) == at(1024.0));
}
