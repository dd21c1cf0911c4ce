//! Wavefront OBJ with a material library. Its one set of texture coordinates is that of the light map.

use super::{Export, LIGHT};
use crate::picture::{PictureError, SOFTWARE};
use glam::{DVec3, Vec3};
use std::fmt::Write;

/// The content of each file: the model, its library, the colours and the irradiance.
pub(super) fn files(export: &Export) -> Result<Vec<Vec<u8>>, PictureError> {
    let texts = [model(export), library(export)].map(String::into_bytes);
    Ok(texts.into_iter().chain([export.color_png()?, export.light_exr()?]).collect())
}

/// The name of a material in the file, which ends at the first blank.
fn name_of(export: &Export, material: u32) -> String {
    let name = &export.materials[material as usize].name;
    let word: String = name.chars().map(|c| if c.is_whitespace() || c.is_control() { '_' } else { c }).collect();
    if word.is_empty() { format!("material{material}") } else { word }
}

fn line_of(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}

fn model(export: &Export) -> String {
    let mut text = format!("# {SOFTWARE}\nmtllib {}.mtl\n", line_of(export.stem));
    let mut next = 1;
    for mesh in &export.baked.meshes {
        let _ = writeln!(text, "o {}", line_of(&mesh.name));
        for part in &mesh.parts {
            let _ = writeln!(text, "usemtl {}", name_of(export, part.material));
            for vertex in &part.vertices {
                let p = export.point(export.origin + vertex.position.as_dvec3());
                if export.origin == DVec3::ZERO {
                    let Vec3 { x, y, z } = p.as_vec3();
                    let _ = writeln!(text, "v {x} {y} {z}");
                } else {
                    let _ = writeln!(text, "v {} {} {}", p.x, p.y, p.z);
                }
            }
            for vertex in &part.vertices {
                let _ = writeln!(text, "vt {} {}", vertex.light_uv.x, 1.0 - vertex.light_uv.y);
            }
            for vertex in &part.vertices {
                let Vec3 { x, y, z } = export.position(vertex.normal);
                let _ = writeln!(text, "vn {x} {y} {z}");
            }
            for triangle in &part.triangles {
                let [a, b, c] = triangle.map(|vertex| u64::from(vertex) + next);
                let _ = writeln!(text, "f {a}/{a}/{a} {b}/{b}/{b} {c}/{c}/{c}");
            }
            next += part.vertices.len() as u64;
        }
    }
    text
}

fn library(export: &Export) -> String {
    let stem = line_of(export.stem);
    let mut text = format!("# {SOFTWARE}\n# The irradiance alone is in {stem}{LIGHT}.\n");
    let mut used: Vec<u32> =
        export.baked.meshes.iter().flat_map(|mesh| &mesh.parts).map(|part| part.material).collect();
    used.sort_unstable();
    used.dedup();
    for material in used {
        // The colours have their light already: illum 0 shows them as they are.
        let name = name_of(export, material);
        let _ = writeln!(text, "\nnewmtl {name}\nKa 0 0 0\nKd 1 1 1\nKs 0 0 0\nillum 0\nmap_Kd {stem}.png");
        if !export.is_opaque(material) {
            let _ = writeln!(text, "map_d -imfchan m {stem}.png");
        }
    }
    text
}
