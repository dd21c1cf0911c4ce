//! PLY, binary with the lowest byte first: all triangles as one mesh.

use super::lost::Lost;
use super::triangles::{Placed, color_of, placed};
use super::{Conversion, ConvertedFile, Source, lose_surroundings};
use crate::picture::SOFTWARE;
use canaletto::material::Material;
use canaletto::scene::Scene;

/// The curve of sRGB as a byte.
fn byte(v: f32) -> u8 {
    let v = v.clamp(0.0, 1.0);
    let encoded =
        if v <= 0.003_130_8 { 12.92 * v } else { (1.055 * libm::pow(f64::from(v), 1.0 / 2.4) - 0.055) as f32 };
    (encoded * 255.0).round() as u8
}

/// The file of a scene.
pub(super) fn convert(source: &Source) -> Conversion {
    let scene = source.scene;
    let mut lost = Lost::default();
    lose_surroundings(scene, &mut lost);
    scene.views.iter().for_each(|view| lost.add("cameras", &view.name));
    let meshes = placed(scene, &mut lost);
    for mesh in &meshes {
        for material in mesh.materials.iter().flatten().filter_map(|index| scene.materials.get(*index as usize)) {
            let is_matte = material.textures.is_empty() && material.classic() == plain(material);
            if !is_matte {
                lost.add("all of materials but their diffuse colour", &material.name);
            }
        }
    }
    let bytes = file(scene, &meshes);
    Conversion { files: vec![ConvertedFile { name: format!("{}.ply", source.stem), bytes }], lost: lost.all }
}

/// The material with its diffuse colour alone.
fn plain(material: &Material) -> canaletto::material::Phong {
    canaletto::material::Phong { kd: material.classic().kd, ..Default::default() }
}

/// Vertices of a mesh that triangles of a slot use, each with its number in the file.
struct Vertices {
    places: Vec<u32>,
}

const NONE: u32 = u32::MAX;

fn file(scene: &Scene, meshes: &[Placed]) -> Vec<u8> {
    let all = |has: fn(&Placed) -> bool| !meshes.is_empty() && meshes.iter().all(has);
    let has_normals = all(|placed| !placed.mesh.normals.is_empty());
    let has_uvs = all(|placed| !placed.mesh.uvs.is_empty());
    let is_far = meshes.iter().any(|placed| placed.mesh.origin != glam::DVec3::ZERO);
    let is_plain = |placed: &Placed| placed.mesh.colors.is_empty() && placed.materials.iter().all(Option::is_none);
    let has_colors = !meshes.iter().all(is_plain);
    let (mut rows, mut faces) = (Vec::new(), Vec::new());
    let (mut count, mut triangles) = (0u32, 0u32);
    for placed in meshes {
        let positions: Vec<_> = placed.positions().collect();
        let normals: Vec<_> = placed.normals().collect();
        let uvs: Vec<_> = placed.uvs().collect();
        for (slot, material) in placed.materials.iter().enumerate() {
            let color = color_of(scene, *material);
            let mut used = Vertices { places: vec![NONE; positions.len()] };
            for corners in placed.triangles(slot as u32) {
                faces.push(3);
                for v in corners {
                    let place = &mut used.places[v as usize];
                    if *place == NONE {
                        *place = count;
                        count += 1;
                        let v = v as usize;
                        match is_far {
                            true => rows.extend(positions[v].to_array().iter().flat_map(|x| x.to_le_bytes())),
                            false => {
                                rows.extend(positions[v].as_vec3().to_array().iter().flat_map(|x| x.to_le_bytes()))
                            }
                        }
                        if has_normals {
                            rows.extend(normals[v].to_array().iter().flat_map(|x| x.to_le_bytes()));
                        }
                        if has_uvs {
                            rows.extend(uvs[v].to_array().iter().flat_map(|x| x.to_le_bytes()));
                        }
                        if has_colors {
                            let own = placed.mesh.colors.get(v).copied().unwrap_or(color);
                            rows.extend(own.to_array().map(byte));
                        }
                    }
                    faces.extend(place.to_le_bytes());
                }
                triangles += 1;
            }
        }
    }
    let real = if is_far { "double" } else { "float" };
    let mut header = format!("ply\nformat binary_little_endian 1.0\ncomment {SOFTWARE}\nelement vertex {count}\n");
    let mut add = |kind: &str, names: &[&str]| {
        names.iter().for_each(|name| header += &format!("property {kind} {name}\n"));
    };
    add(real, &["x", "y", "z"]);
    if has_normals {
        add("float", &["nx", "ny", "nz"]);
    }
    if has_uvs {
        add("float", &["s", "t"]);
    }
    if has_colors {
        add("uchar", &["red", "green", "blue"]);
    }
    header += &format!("element face {triangles}\nproperty list uchar uint vertex_indices\nend_header\n");
    [header.into_bytes(), rows, faces].concat()
}
