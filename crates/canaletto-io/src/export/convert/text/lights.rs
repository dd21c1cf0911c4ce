//! Lights.

use super::Writer;
use super::line::{Line, flag, quoted};
use super::number::{color, place, single, singles, vector};
use canaletto::Named;
use canaletto::light::{
    Directional, DiskLight, Emission, Falloff, Light, LightKind, MeshLight, Omni, RectangleLight, SphereLight, Spot,
};
use canaletto::math::Rgb;
use canaletto::scene::Node;
use glam::Vec3;

/// The default number of points of a light.
const POINTS: u32 = 16;

impl Writer<'_> {
    /// The line of a light without its name and its transforms. None if the text can't say it.
    pub(super) fn light(&mut self, node: &Node, light: &Light, name: &str) -> Option<Line> {
        let Light { name: _, intensity, shadows, attenuation, samples, emission, visible, profile, kind } = light;
        let rest = *node.rest;
        let line = Line::named("light", light.kind_name());
        let (line, points) = match kind {
            LightKind::Omni(omni) => (omni_line(line, omni, rest[0]), None),
            LightKind::Directional(light) => (directional_line(line, light, rest[0]), None),
            LightKind::Spot(spot) => (spot_line(line, spot, rest), None),
            LightKind::Disk(DiskLight { disk, points }) => {
                let line = line
                    .child(Line::of("position", place(disk.center, rest[0])))
                    .child(Line::of("normal", vector(disk.normal)))
                    .child(Line::of("radius", single(disk.radius)));
                (line, Some(*points))
            }
            LightKind::Rectangle(light) => {
                let RectangleLight { parallelogram, points } = **light;
                let line = line
                    .child(Line::of("corner", place(parallelogram.corner, rest[0])))
                    .child(Line::of("u", vector(parallelogram.u)))
                    .child(Line::of("v", vector(parallelogram.v)));
                (line, Some(points))
            }
            LightKind::Sphere(SphereLight { sphere, points }) => {
                let line = line
                    .child(Line::of("center", place(sphere.center, rest[0])))
                    .child(Line::of("radius", single(sphere.radius)));
                (line, Some(*points))
            }
            LightKind::Mesh(light) => {
                let MeshLight { meshes, transform, points } = &**light;
                if !transform.is_identity() {
                    self.lost.add("lights of meshes that are placed twice", name);
                    return None;
                }
                let file = self.mesh_files(meshes)?;
                (line.property("file", quoted(&file)), Some(*points))
            }
            _ => {
                self.lost.add("lights", name);
                return None;
            }
        };
        let is_point = !matches!(kind, LightKind::Directional(_));
        let line = line
            .child_if("attenuation", (is_point && *attenuation != [1.0, 0.0, 0.0]).then(|| singles(attenuation)))
            .child_if("intensity", (*intensity != Rgb::WHITE).then(|| color(*intensity)));
        let line = match points {
            Some(_) if *samples > 0 => line.child(Line::of("samples", samples.to_string())),
            Some(points) => line.child_if("points", (points != POINTS).then(|| points.to_string())),
            None => line,
        };
        let line = match points {
            Some(_) => line
                .child_if("emission", (*emission != Emission::default()).then(|| quoted(emission.name())))
                .child_if("visible", visible.then(|| flag(true))),
            None => line,
        };
        let line = match profile {
            Some(profile) => match self.profile_file(&profile.profile) {
                Some(file) => {
                    let is_spot = matches!(kind, LightKind::Spot(_));
                    line.child(Line::named("ies", &file))
                        .child_if("axis", (!is_spot).then(|| vector(profile.axis)))
                        .child(Line::of("front", vector(profile.front)))
                }
                None => {
                    self.lost.add("profiles of lamps", name);
                    line
                }
            },
            None => line,
        };
        Some(line.child_if("shadows", (!shadows).then(|| flag(false))))
    }
}

fn omni_line(line: Line, omni: &Omni, rest: Vec3) -> Line {
    let Omni { position: [x, y, z, w], range } = *omni;
    let text = if w == 1.0 { place(Vec3::new(x, y, z), rest) } else { singles(&[x, y, z, w]) };
    line.child(Line::of("position", text)).child_if("range", (range > 0.0).then(|| single(range)))
}

fn directional_line(line: Line, light: &Directional, rest: Vec3) -> Line {
    let line = line.child(Line::of("direction", vector(light.towards)));
    match light.beam {
        Some((axis, radius)) => {
            line.child(Line::of("axis", place(axis, rest))).child(Line::of("radius", single(radius)))
        }
        None => line,
    }
}

fn spot_line(line: Line, spot: &Spot, rest: [Vec3; 3]) -> Line {
    let Spot { position, target, falloff, range } = spot;
    let line = line.child(Line::of("position", place(*position, rest[0])));
    let line = line.child(Line::of("target", place(*target, rest[1])));
    let inner = |inner: f32| (inner != 0.0).then(|| single(inner));
    let line = match falloff {
        Falloff::Exponent { exponent, outer } => {
            line.child(Line::of("outer", single(*outer))).child(Line::of("exponent", single(*exponent)))
        }
        Falloff::Smooth { inner: from, outer } => {
            line.child_if("inner", inner(*from)).child(Line::of("outer", single(*outer)))
        }
        Falloff::Squared { inner: from, outer } => line
            .child_if("inner", inner(*from))
            .child(Line::of("outer", single(*outer)))
            .child(Line::named("edge", "squared")),
        _ => line,
    };
    line.child_if("range", (*range > 0.0).then(|| single(*range)))
}
