//! Decoding of textures on materials.

use super::Decoder;
use super::fields::{Entry, Fields};
use crate::text::report::Message;
use crate::text::schema::{GreenAxis, SURFACE_TEXTURE};
use canaletto::Named;
use canaletto::material::{Mapping, Projection, Repeat, Space, Target, TextureUse};
use canaletto::math::Transform;

impl Decoder<'_> {
    /// The textures of a material, in their order.
    pub(super) fn surface_textures(&mut self, material: &Fields) -> Vec<TextureUse> {
        material.every("texture").filter_map(|got| self.surface_texture(got)).collect()
    }

    fn surface_texture(&mut self, got: &Entry) -> Option<TextureUse> {
        let Some(node) = got.node else {
            // As a property, it is only the texture's name.
            let name = got.values.first()?.as_text()?;
            let texture = self.named_texture(name, got.span)?;
            return Some(TextureUse { mapping: self.mapping_of(texture), ..TextureUse::new(texture, Target::Diffuse) });
        };
        let name = node.values.first().and_then(|v| v.as_text());
        let title = name.map_or("texture".into(), |n| format!("texture \"{n}\""));
        let f = self.validator.fields(node, &SURFACE_TEXTURE, &title);
        self.valid &= f.valid;
        let target = f.named("use").unwrap_or(Target::Diffuse);
        let texture = self.named_texture(f.text("texture")?, f.span("texture"))?;
        let mut used = TextureUse { mapping: self.mapping(&f, texture), ..TextureUse::new(texture, target) };
        self.only_for(&f, target);
        used.channel = f.named("channel").unwrap_or(used.channel);
        used.range = f.numbers("range").map_or(used.range, |[low, high]: [f64; 2]| [low as f32, high as f32]);
        match &mut used.target {
            Target::Bump | Target::Displace { .. } => {
                if let Target::Displace { detail } = &mut used.target {
                    *detail = f.real("detail").unwrap_or(*detail);
                }
                if let Some(height) = f.real("height") {
                    used.range = [0.0, height];
                } else if f.valid && !f.has("range") {
                    let message =
                        Message::error(f.node.name_span, format!("{title} needs height for {:?}", target.name()));
                    let help = "for example: height=0.1, in the units of the object's own space";
                    self.validator.report.push(message.help(help));
                    self.valid = false;
                }
            }
            Target::Normal { strength, down } => {
                *strength = f.real("strength").unwrap_or(*strength);
                *down = f.named("y") == Some(GreenAxis::Down);
            }
            _ => {}
        }
        if f.valid
            && let Err(problem) = used.check()
        {
            self.out_of_range(&f, &problem);
        }
        Some(used)
    }

    /// The texture of this name.
    fn named_texture(&mut self, name: &str, span: crate::text::syntax::Span) -> Option<u32> {
        let found = self.textures.get(name).copied();
        if found.is_none() {
            self.validator.unknown_name("texture", name, span, self.textures.keys().copied());
            self.valid = false;
        }
        found
    }

    /// The default mapping of a texture.
    fn mapping_of(&self, texture: u32) -> Mapping {
        let kind = self.scene.textures.get(texture as usize).map(|texture| &texture.kind);
        kind.map_or_else(Mapping::default, Mapping::usual)
    }

    fn mapping(&mut self, f: &Fields, texture: u32) -> Mapping {
        let usual = self.mapping_of(texture);
        let projection = f.named("mapping").unwrap_or(usual.projection);
        let space = match projection {
            Projection::Solid if usual.projection == Projection::Solid => usual.space,
            Projection::Triplanar | Projection::Solid => Space::Object,
            _ => Space::Bounds,
        };
        let repeat = match f.numbers("repeat") {
            Some([both]) => [both; 2],
            None => f.numbers("repeat").unwrap_or([1.0; 2]),
        };
        for (word, wrong, why) in [
            ("space", projection == Projection::Uv, "the surface's own coordinates are the same in every space"),
            ("repeat", projection == Projection::Solid, "scale makes the pattern smaller or larger"),
        ] {
            if wrong && f.valid && f.has(word) {
                let mapping = projection.name();
                let message = Message::error(f.span(word), format!("{word} has no meaning for mapping \"{mapping}\""));
                self.validator.report.push(message.help(why));
                self.valid = false;
            }
        }
        let space = f.named("space").unwrap_or(space);
        let usual = if projection == usual.projection { usual.transform } else { Transform::IDENTITY };
        Mapping { projection, space, transform: self.transform(f).after(&usual), repeat: Repeat(repeat) }
    }

    /// Reports fields that don't apply to this use.
    fn only_for(&mut self, f: &Fields, target: Target) {
        let normal = matches!(target, Target::Normal { .. });
        let heights = matches!(target, Target::Bump | Target::Displace { .. });
        let one = !target.takes_color() && !normal;
        for (word, meant) in [
            ("height", heights),
            ("detail", matches!(target, Target::Displace { .. })),
            ("strength", normal),
            ("y", normal),
            ("channel", one),
            ("range", !(normal || heights && f.has("height"))),
        ] {
            if !meant && f.valid && f.has(word) {
                let with = if word == "range" && !normal { "height or range" } else { target.name() };
                let message = match word {
                    "range" if !normal => format!("{:?} has either {with}", target.name()),
                    _ => format!("{word} has no meaning for the use \"{with}\""),
                };
                self.validator.report.error(f.span(word), message);
                self.valid = false;
            }
        }
    }
}
