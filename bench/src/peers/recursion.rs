//! A plain recursion over Embree's single rays, as a programmer would write it in an afternoon. It has ambient, diffuse
//! and specular terms, one shadow ray per light, mirrors, and refraction in transparent bodies. It computes in `f32`; a
//! fixed offset keeps rays off the surface they leave. Every object blocks light, transparent ones included. There is
//! one sample per pixel.

use std::path::Path;
use std::time::Instant;

use canaletto::film::srgb_encode;
use canaletto::integrator::describe;
use canaletto::material::Phong;
use canaletto::math::Rgb;
use canaletto::scene::{Scene as Description, Transfer};
use canaletto_io::picture::{EncodeSettings, Image, PictureFormat};
use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::embree::{Embree, Part, Quality, Scene, Settings};
use super::plain::{Form, Plain, Thing};
use super::rays::Segment;

struct Recursion<'a> {
    scene: Scene<'a>,
    /// The first primitive and the material of each part.
    materials: Vec<(u32, Phong)>,
    lights: Vec<(Vec3, Rgb)>,
    background: Rgb,
    ambient: Rgb,
    depth: u32,
    offset: f32,
}

/// An object in Embree's layout.
fn part(form: &Form<'_>) -> Part {
    match form {
        Form::Mesh(mesh) => Part::triangles(&mesh.positions, &mesh.triangles),
        Form::Spheres(spheres) => Part::Spheres(spheres.iter().map(|(c, r)| c.extend(*r).to_array()).collect()),
        Form::Cylinders(cylinders) => Part::cylinders(cylinders.iter().copied()),
    }
}

/// Renders the scene and writes a PNG; returns the seconds for building and tracing.
pub fn render(scene: &Description, [width, height]: [u32; 2], threads: usize, out: &Path) -> Result<[f64; 2], String> {
    let embree = Embree::new(threads)?;
    let Plain { view, camera, lights, things, .. } = Plain::new(scene, [width, height])?;
    let parts: Vec<Part> = things.iter().map(|thing| part(&thing.form)).collect();
    let start = Instant::now();
    let built = embree.build(&parts, Settings { quality: Quality::Medium, robust: false, compact: false })?;
    let build = start.elapsed().as_secs_f64();
    let mut first = 0;
    let of_part = |(part, thing): (&Part, &Thing<'_>)| {
        let base = first;
        first += part.len() as u32;
        (base, scene.materials[thing.material as usize].classic())
    };
    let materials = parts.iter().zip(&things).map(of_part).collect();
    let extrinsics = &view.extrinsics;
    let recursion = Recursion {
        scene: built,
        materials,
        lights,
        background: scene.background,
        ambient: scene.ambient,
        depth: describe(&scene.integrator).max_depth(),
        offset: 1e-4 * (extrinsics.eye - extrinsics.center).length() as f32,
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
    let png = PictureFormat::Png
        .encode_image(&image, Transfer::Srgb, &EncodeSettings::default(), &[])
        .map_err(|e| e.to_string())?;
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
