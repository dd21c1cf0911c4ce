//! A plain recursion over Embree's single rays: what somebody writes in an afternoon. Ambient, diffuse and specular terms,
//! one shadow ray per light, mirrors, clear bodies that refract; in `f32`, with a fixed distance that keeps rays off the
//! surface they leave. Everything blocks light, clear bodies too. One sample per pixel.

use std::path::Path;
use std::time::Instant;

use canaletto::camera::Camera;
use canaletto::film::srgb_encode;
use canaletto::light::LightKind;
use canaletto::material::Phong;
use canaletto::math::Rgb;
use canaletto::scene::{Content, Scene as Description, Transfer};
use canaletto::shape::Shape;
use canaletto_io::picture::{Depth, Image, encode_png};
use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::embree::{Embree, Part, Quality, Scene, Settings};
use super::rays::Segment;

struct Recursion<'a> {
    scene: Scene<'a>,
    /// Each part's first primitive and material.
    materials: Vec<(u32, Phong)>,
    lights: Vec<(Vec3, Rgb)>,
    background: Rgb,
    ambient: Rgb,
    depth: u32,
    offset: f32,
}

/// Embree's parts of a scene, each with its material.
pub(super) fn parts(scene: &Description) -> Result<(Vec<Part>, Vec<u32>), String> {
    let (mut parts, mut materials) = (Vec::new(), Vec::new());
    let mut loose: Vec<(u32, Vec<[f32; 4]>)> = Vec::new();
    for node in &scene.nodes {
        let material = node.material.unwrap_or_default();
        let part = match &node.content {
            Content::Light(_) => continue,
            Content::Shape(Shape::Sphere(s)) => {
                let sphere = s.center.extend(s.radius).to_array();
                match loose.iter_mut().find(|group| group.0 == material) {
                    Some(group) => group.1.push(sphere),
                    None => loose.push((material, vec![sphere])),
                }
                continue;
            }
            Content::Mesh(index) => {
                let mesh = &scene.meshes[*index as usize];
                materials.push(node.material.or(mesh.materials.first().copied()).unwrap_or_default());
                parts.push(Part::triangles(&mesh.positions, &mesh.triangles));
                continue;
            }
            Content::Spheres(index) => {
                let cloud = &scene.spheres[*index as usize];
                let sphere = |(i, c): (usize, &Vec3)| c.extend(cloud.radius(i)).to_array();
                Part::Spheres(cloud.centers.iter().enumerate().map(sphere).collect())
            }
            Content::Cylinders(index) => {
                let cloud = &scene.cylinders[*index as usize];
                Part::cylinders(cloud.axes.iter().enumerate().map(|(i, &axis)| (axis, cloud.radius(i))))
            }
            _ => return Err("only spheres, meshes and clouds are given to Embree".into()),
        };
        parts.push(part);
        materials.push(material);
    }
    for (material, spheres) in loose {
        parts.push(Part::Spheres(spheres));
        materials.push(material);
    }
    Ok((parts, materials))
}

/// Renders the scene and writes a PNG; tells seconds for building and tracing.
pub fn render(scene: &Description, [width, height]: [u32; 2], threads: usize, out: &Path) -> Result<[f64; 2], String> {
    let embree = Embree::new(threads)?;
    let (parts, materials) = parts(scene)?;
    let start = Instant::now();
    let built = embree.build(&parts, Settings { quality: Quality::Medium, robust: false, compact: false })?;
    let build = start.elapsed().as_secs_f64();
    let mut first = 0;
    let of_part = |(part, &material): (&Part, &u32)| {
        let base = first;
        first += part.len() as u32;
        (base, scene.materials[material as usize].phong)
    };
    let materials = parts.iter().zip(&materials).map(of_part).collect();
    let lights = scene.nodes.iter().filter_map(|node| match &node.content {
        Content::Light(light) => match &light.kind {
            LightKind::Omni(omni) => Some((omni.position.truncate(), light.intensity)),
            _ => None,
        },
        _ => None,
    });
    let view = &scene.views[0];
    let intrinsics = canaletto::scene::Intrinsics { width, height, ..view.intrinsics };
    let camera = Camera::new(&intrinsics, &view.extrinsics).map_err(|e| e.to_string())?;
    let recursion = Recursion {
        scene: built,
        materials,
        lights: lights.collect(),
        background: scene.background,
        ambient: scene.ambient,
        depth: scene.integrator.max_depth,
        offset: 1e-4 * (view.extrinsics.eye - view.extrinsics.center).length() as f32,
    };
    let pool = super::trace::pool(threads)?;
    let start = Instant::now();
    let mut pixels = vec![Rgb::BLACK; (width * height) as usize];
    pool.install(|| {
        pixels.par_chunks_mut(width as usize).enumerate().for_each(|(row, pixels)| {
            for (column, pixel) in pixels.iter_mut().enumerate() {
                let line = camera.line(column as f64 + 0.5, f64::from(height) - row as f64 - 0.5);
                let direction: DVec3 = line.direction.normalize();
                *pixel = recursion.trace(line.origin.as_vec3(), direction.as_vec3(), 1);
            }
        });
    });
    let trace = start.elapsed().as_secs_f64();
    let encode = |c: &Rgb| c.to_array().map(|v| srgb_encode(v.clamp(0.0, 1.0)));
    let shown: Vec<[f32; 3]> = pool.install(|| pixels.par_iter().map(encode).collect());
    let image = Image::from_rgb(width, height, shown.iter().copied());
    let png = encode_png(&image, Depth::Eight, Transfer::Srgb, &[]).map_err(|e| e.to_string())?;
    std::fs::write(out, png).map_err(|e| format!("{}: {e}", out.display()))?;
    Ok([build, trace])
}

impl Recursion<'_> {
    fn trace(&self, origin: Vec3, direction: Vec3, depth: u32) -> Rgb {
        let Some(hit) = self.scene.nearest(&Segment { origin, t_max: f32::INFINITY, direction }) else {
            return self.background;
        };
        let phong = &self.materials[self.materials.partition_point(|m| m.0 <= hit.id) - 1].1;
        let normal = hit.normal.normalize();
        let outside = normal.dot(direction) < 0.0;
        let normal = if outside { normal } else { -normal };
        let point = origin + hit.t * direction;
        let mirrored = direction - normal * (2.0 * normal.dot(direction));
        let mut color = self.ambient * phong.kd;
        for &(light, intensity) in &self.lights {
            let from = point + normal * self.offset;
            let way = light - from;
            let to_light = way.normalize();
            let n_dot_l = normal.dot(to_light);
            if n_dot_l <= 0.0
                || self.scene.occluded(&Segment { origin: from, t_max: way.length(), direction: to_light })
            {
                continue;
            }
            color += intensity * phong.kd * n_dot_l;
            let r_dot_l = mirrored.dot(to_light);
            if !phong.ks.is_black() && r_dot_l > 0.0 {
                color += intensity * phong.ks * r_dot_l.powf(phong.n);
            }
        }
        if depth >= self.depth {
            return color;
        }
        if !phong.k.is_black() {
            color += self.trace(point + normal * self.offset, mirrored, depth + 1) * phong.k;
        }
        if phong.opacity < 1.0 {
            let eta = if outside { 1.0 / phong.eta } else { phong.eta };
            let cosine = -normal.dot(direction);
            let rest = 1.0 - eta * eta * (1.0 - cosine * cosine);
            let (from, way) = if rest < 0.0 {
                (point + normal * self.offset, mirrored)
            } else {
                (point - normal * self.offset, direction * eta + normal * (eta * cosine - rest.sqrt()))
            };
            color += self.trace(from, way, depth + 1) * Rgb::gray(1.0 - phong.opacity);
        }
        color
    }
}
