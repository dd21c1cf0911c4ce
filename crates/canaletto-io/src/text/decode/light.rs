//! Decoding of lights.

use super::Decoder;
use super::fields::Fields;
use super::object::exact_points;
use crate::text::closest_word::closest_word;
use crate::text::report::Message;
use crate::text::schema::{self, DEFAULT_INNER, DEFAULT_INTENSITY, DEFAULT_POINTS, LIGHTS};
use crate::text::syntax::Node;
use canaletto::OutOfRange;
use canaletto::light::{
    Directional, DiskLight, Emission, Falloff, Light, LightKind, MeshLight, Omni, RectangleLight, SphereLight, Spot,
};
use canaletto::math::{Rgb, Transform};
use canaletto::scene::{self, Content};

impl Decoder<'_> {
    /// Decodes a light with its transform.
    pub(super) fn light(&mut self, node: &Node) -> Option<scene::Node> {
        let kinds: Vec<&str> = LIGHTS.iter().map(|(kind, _)| *kind).collect();
        let kind = self.kind_after(node, "light", &kinds)?;
        let title = format!("light \"{kind}\"");
        let fields = self.validator.fields(node, schema::light(kind)?, &title);
        let (transform, motion) = self.placed_in_time(&fields);
        self.valid &= fields.valid;
        let mut light =
            Light::new(self.kind(kind, &fields)?, fields.rgb("intensity").unwrap_or(Rgb::gray(DEFAULT_INTENSITY)));
        light.name = fields.text("name").map(Into::into);
        light.shadows = fields.flag("shadows").unwrap_or(light.shadows);
        light.emission = fields.named("emission").unwrap_or(light.emission);
        light.samples = fields.count("samples").unwrap_or(light.samples);
        self.either(&fields, "points", "samples");
        if fields.count("samples") == Some(0) {
            self.out_of_range(&fields, &OutOfRange::new("samples", "is 0; it must be between 1 and 4096"));
        }
        light.attenuation = fields.vec("attenuation").map_or(light.attenuation, |v| v.to_array());
        if fields.valid
            && let Err(problem) = light.check()
        {
            self.out_of_range(&fields, &problem);
        }
        // Light that is attenuated by distance may need a high intensity.
        if light.attenuation[1..] == [0.0; 2] && light.emission == Emission::Even {
            self.doubt_light(&fields, "intensity");
        }
        let name = light.name.clone();
        let mut points = exact_points(&fields);
        points.extend(fields.dvec("axis"));
        let (transform, motion) = (transform.into(), motion.into());
        let node = scene::Node { name, transform, motion, ..scene::Node::new(Content::Light(light)) };
        Some(node.with_points(&points))
    }

    /// The word after `light` or `environment`, which selects the schema.
    pub(super) fn kind_after(&mut self, node: &Node, what: &str, kinds: &[&'static str]) -> Option<&'static str> {
        let list: Vec<String> = kinds.iter().map(|kind| format!("\"{kind}\"")).collect();
        let list = format!("inds of {what}: {}", list.join(", "));
        let Some(value) = node.values.first() else {
            if !node.broken {
                let message = Message::error(node.name_span, format!("{what} needs its kind right after the word"));
                self.validator.report.push(message.help(format!("k{list}")));
            }
            return None;
        };
        let text = value.as_text();
        if let Some(kind) = kinds.iter().find(|kind| Some(**kind) == text) {
            return Some(kind);
        }
        let message = match text {
            Some(text) => format!("there is no kind of {what} \"{text}\""),
            None => format!("{what} takes its kind as a text"),
        };
        let same = |text: &str| kinds.iter().copied().find(|kind| schema::SYNONYMS.contains(&(text, *kind)));
        let help = match text.and_then(|text| same(text).or_else(|| closest_word(text, kinds.iter().copied()))) {
            Some(right) => format!("did you mean \"{right}\"? K{list}"),
            None => format!("k{list}"),
        };
        self.validator.report.push(Message::error(value.span, message).help(help));
        None
    }

    fn kind(&mut self, kind: &str, f: &Fields) -> Option<LightKind> {
        let points = f.count("points").unwrap_or(DEFAULT_POINTS);
        Some(match kind {
            "omni" => LightKind::Omni(match f.numbers::<4>("position") {
                Some(p) => Omni { position: p.map(|v| v as f32) },
                None => Omni::at(f.vec("position")?),
            }),
            "directional" => LightKind::Directional(Directional { towards: f.vec("direction")?, beam: self.beam(f) }),
            "spot" => LightKind::Spot(Spot {
                position: f.vec("position")?,
                target: f.vec("target")?,
                falloff: self.falloff(f)?,
            }),
            "disk" => LightKind::Disk(DiskLight {
                position: f.vec("position")?,
                normal: f.vec("normal")?,
                radius: f.real("radius")?,
                points,
            }),
            "rectangle" => LightKind::Rectangle(Box::new(RectangleLight {
                corner: f.vec("corner")?,
                u: f.vec("u")?,
                v: f.vec("v")?,
                points,
            })),
            "sphere" => LightKind::Sphere(SphereLight { center: f.vec("center")?, radius: f.real("radius")?, points }),
            _ => {
                let meshes = match &self.mesh(f, None)? {
                    Content::Mesh(index) => vec![*index],
                    Content::Group(parts) => {
                        let index = |part: &scene::Node| {
                            if let Content::Mesh(index) = part.content { Some(index) } else { None }
                        };
                        parts.iter().filter_map(index).collect()
                    }
                    _ => Vec::new(),
                };
                LightKind::Mesh(Box::new(MeshLight { meshes, transform: Transform::IDENTITY, points }))
            }
        })
    }

    fn beam(&mut self, f: &Fields) -> Option<(glam::Vec3, f32)> {
        for (word, other) in [("axis", "radius"), ("radius", "axis")] {
            if f.has(word) && !f.has(other) {
                let message = format!("a beam needs both axis and radius, but {other} is missing");
                self.validator.report.error(f.span(word), message);
                self.valid = false;
            }
        }
        Some((f.vec("axis")?, f.real("radius")?))
    }

    fn falloff(&mut self, f: &Fields) -> Option<Falloff> {
        let outer = f.real("outer")?;
        if f.has("exponent") && f.has("inner") {
            let message = Message::error(f.span("exponent"), "a spotlight has either inner or exponent");
            self.validator
                .report
                .push(message.help("inner and outer make a smooth edge; exponent falls off from the axis on"));
            self.valid = false;
        }
        self.doubt_degrees(f, "outer");
        Some(match f.real("exponent") {
            Some(exponent) => Falloff::Exponent { exponent, outer },
            None => Falloff::Smooth { inner: f.real("inner").unwrap_or(DEFAULT_INNER), outer },
        })
    }
}
