//! The nodes of lights. The word right after `light` selects the schema and its reader.

use super::kind_of;
use super::mesh::FILE;
use crate::import;
use crate::import::counted;
use crate::text::decode::Decoder;
use crate::text::reader::Fields;
use crate::text::report::Message;
use crate::text::schema::{Field, FieldSchema, NodeSchema, Numbers, Text, flag, numbers, quoted};
use crate::text::syntax::Node;
use canaletto::light::{
    Directional, DiskLight, Emission, Falloff, Light, LightKind, MeshLight, MountedProfile, Omni, RectangleLight,
    SphereLight, Spot,
};
use canaletto::math::{BLACK_BODY_TEMPERATURES, Rgb, Transform, black_body};
use canaletto::scene::{self, Content, Scene};
use canaletto::shape::{Disk, Parallelogram, Sphere};
use canaletto::{Named, OutOfRange, named};
use glam::Vec3;

/// The word of lights.
pub(crate) const LIGHT: &str = "light";

/// A kind of light with its reader.
pub(crate) struct LightNode {
    pub(crate) schema: NodeSchema,
    read: fn(&mut Decoder, &Fields) -> Option<LightKind>,
}

/// The kinds of lights, in the order of the reference.
pub(crate) static LIGHTS: &[&LightNode] =
    &[&OMNI, &DIRECTIONAL, &SPOT, &DISK_LIGHT, &RECTANGLE_LIGHT, &SPHERE_LIGHT, &MESH_LIGHT];

/// The schema of a kind of light.
pub(crate) fn light(kind: &str) -> Option<&'static NodeSchema> {
    LIGHTS.iter().map(|light| &light.schema).find(|schema| kind_of(schema) == kind)
}

/// The default number of points of a disk light, as in the chapter.
const DEFAULT_POINTS: u32 = 16;
/// The default intensity of a light.
const DEFAULT_INTENSITY: f32 = 1.0;
/// The default inner angle of a spotlight.
const DEFAULT_INNER: f32 = 0.0;

const INTENSITY: Field<Rgb> = Field::new("intensity", "l: a surface straight below is lit by l times its kd")
    .or(|| DEFAULT_INTENSITY.to_string());
/// The temperature of a light or of an emission.
pub(super) const TEMPERATURE: Field<f32> = Field::new(
    "temperature",
    "its colour by the temperature of a glowing body, 1000 to 40000 kelvin, times the colour given: a candle has 1900, a \
     lamp 2700, daylight 6500",
);
const SHADOWS: Field<bool> = Field::new("shadows", "whether it casts shadows").or(|| flag(default_light().shadows));
const NAME: Field<Text> = Field::text("name", "its name, for `--set` and explanations");
const LIGHT_FIELDS: &[FieldSchema] = &[INTENSITY.schema, TEMPERATURE.schema, SHADOWS.schema, NAME.schema];

fn default_light() -> Light {
    Light::new(LightKind::Omni(Omni::at(Vec3::ZERO)), Rgb::gray(DEFAULT_INTENSITY))
}

const ATTENUATION: Field<Vec3> = Field::new("attenuation", "c l q: light from distance d is divided by c + l d + q d²")
    .or(|| numbers(default_light().attenuation));
const SAMPLES: Field<u32> = Field::new(
    "samples",
    "how many random points of it shine on each hit, other ones for each ray of a pixel, instead of points (1 to 4096)",
);
const POINTS: Field<u32> = Field::new("points", "how many points, always the same, 1 to 4096; each costs a shadow ray")
    .or(|| DEFAULT_POINTS.to_string());
const EMISSION: Field<Emission> = Field::word(
    "emission",
    "each point shines evenly in all directions; or all shine as a matte surface of radiance l, from its outer side, \
     weaker aslant and from afar",
)
.or(|| quoted(Emission::default().name()));
/// Two ways to say how many points shine.
pub(super) const POINTS_OR_SAMPLES: [&str; 2] = [POINTS.name(), SAMPLES.name()];
const VISIBLE: Field<bool> = Field::new(
    "visible",
    "whether its surface is seen, also in mirrors and through glass: with the colour l, a matte one black from \
     behind; it casts no shadow",
)
.or(|| flag(default_light().visible));
/// The fields of lights with a surface.
const SURFACE: &[FieldSchema] = &[POINTS.schema, SAMPLES.schema, EMISSION.schema, ATTENUATION.schema, VISIBLE.schema];

const fn light_node(
    kind: &'static [&'static str],
    doc: &'static str,
    words: &'static [&'static [FieldSchema]],
    example: &'static str,
    read: fn(&mut Decoder, &Fields) -> Option<LightKind>,
) -> LightNode {
    let kind = Field::kind(kind, "the kind of light").needed();
    LightNode { schema: NodeSchema::new(LIGHT, doc, words).argument(kind.schema).transforms().example(example), read }
}

fn points(f: &Fields) -> u32 {
    f.get(&POINTS).unwrap_or(DEFAULT_POINTS)
}

const OMNI_POSITION: Field<Numbers> = Field::numbers(
    "position",
    &[3, 4],
    "where it is; with a fourth number w at x/w y/w z/w, with w = 0 infinitely far in the direction x y z",
)
.needed()
.places();

const IES: Field<Text> = Field::text(
    "ies",
    "a file of its light by direction, from the lamp's maker (IESNA LM-63); intensity is that of the brightest \
     direction",
);
const IES_AXIS: Field<Vec3> = Field::new("axis", "where the profile's angle 0 looks").or(|| numbers([0.0, -1.0, 0.0]));
const IES_FRONT: Field<Vec3> =
    Field::new("front", "where the profile's horizontal angle 0 looks").or(|| numbers([0.0, 0.0, 1.0]));

static OMNI: LightNode = light_node(
    &["omni"],
    "Light from a point in all directions.",
    &[
        &[OMNI_POSITION.schema, ATTENUATION.schema, RANGE.schema, IES.schema, IES_AXIS.schema, IES_FRONT.schema],
        LIGHT_FIELDS,
    ],
    "light \"omni\" { position 40 120 0; intensity 0.8 }",
    |_, f| {
        let numbers = f.numbers::<4>(&OMNI_POSITION).map(|p| p.map(|v| v as f32));
        let at = || f.numbers(&OMNI_POSITION).map(|p| Omni::at(Vec3::from_array(p.map(|v| v as f32))));
        let omni = numbers.map(|position| Omni { position, range: 0.0 }).or_else(at)?;
        Some(LightKind::Omni(Omni { range: range(f), ..omni }))
    },
);

const DIRECTION: Field<Vec3> = Field::new("direction", "where the light goes").needed();
const BEAM_AXIS: Field<Vec3> = Field::new("axis", "a point on the axis of the beam; goes with radius").places();
const BEAM_RADIUS: Field<f32> = Field::new("radius", "the beam's radius; goes with axis");

static DIRECTIONAL: LightNode = light_node(
    &["directional"],
    "Parallel light, everywhere or in a round beam.",
    &[&[DIRECTION.schema, BEAM_AXIS.schema, BEAM_RADIUS.schema], LIGHT_FIELDS],
    "light \"directional\" { direction -0.2 -1 -0.1; axis 0 20 0; radius 45 }",
    |decoder, f| Some(LightKind::Directional(Directional { towards: f.get(&DIRECTION)?, beam: decoder.beam(f) })),
);

const SPOT_POSITION: Field<Vec3> = Field::new("position", "where it is").needed().places();
const SPOT_TARGET: Field<Vec3> = Field::new("target", "a point that it shines at").needed().places();
const OUTER: Field<f32> = Field::new("outer", "no light from this angle to the axis on, in degrees, 0 to 90").needed();
const INNER: Field<f32> = Field::new("inner", "full light up to this angle").or(|| DEFAULT_INNER.to_string());
const EXPONENT: Field<f32> = Field::new("exponent", "the power of the cosine, instead of inner");

/// The falloff between the two angles of a spotlight.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum ConeEdge {
    /// s² (3 − 2s).
    #[default]
    Smooth,
    /// s².
    Squared,
}

named!(ConeEdge {
    Smooth => "smooth",
    Squared => "squared",
});

const EDGE: Field<ConeEdge> = Field::word(
    "edge",
    "how the light falls off from `inner` to `outer`: by s² (3 - 2s), or by s² as in glTF, with s linear in the cosine",
)
.or(|| quoted(ConeEdge::default().name()));
const RANGE: Field<f32> =
    Field::new("range", "the distance at which the light has ended: it is multiplied by 1 - (d / range)⁴")
        .or(|| "no end".into());

/// The range of a light, 0 for no end.
fn range(f: &Fields) -> f32 {
    f.get(&RANGE).unwrap_or(0.0)
}

/// Two ways in which a spotlight falls off.
pub(super) const INNER_OR_EXPONENT: [&str; 2] = [INNER.name(), EXPONENT.name()];

static SPOT: LightNode = light_node(
    &["spot"],
    "A cone of light. It ends smoothly between two angles, or falls off with a power of the cosine.",
    &[
        &[
            SPOT_POSITION.schema,
            SPOT_TARGET.schema,
            OUTER.schema,
            INNER.schema,
            EXPONENT.schema,
            EDGE.schema,
            ATTENUATION.schema,
            RANGE.schema,
        ],
        &[IES.schema, IES_FRONT.schema],
        LIGHT_FIELDS,
    ],
    "light \"spot\" { position 0 50 0; target 0 0 0; inner 20; outer 30 }",
    |decoder, f| {
        let (position, target) = (f.get(&SPOT_POSITION)?, f.get(&SPOT_TARGET)?);
        Some(Spot { position, target, falloff: decoder.falloff(f)?, range: range(f) }.into())
    },
);

const DISK_POSITION: Field<Vec3> = Field::new("position", "the disk's centre").needed().places();
const DISK_NORMAL: Field<Vec3> = Field::new("normal", "the disk's axis").needed();
const DISK_RADIUS: Field<f32> = Field::new("radius", "the disk's radius, more than 0").needed();

static DISK_LIGHT: LightNode = light_node(
    &["disk"],
    "Light spread over a disk, for soft shadows.",
    &[&[DISK_POSITION.schema, DISK_NORMAL.schema, DISK_RADIUS.schema], SURFACE, LIGHT_FIELDS],
    "light \"disk\" { position 40 120 0; normal 0 -1 0; radius 10; intensity 0.8; points 16 }",
    |_, f| {
        Some(LightKind::Disk(DiskLight {
            disk: Disk { center: f.get(&DISK_POSITION)?, normal: f.get(&DISK_NORMAL)?, radius: f.get(&DISK_RADIUS)? },
            points: points(f),
        }))
    },
);

pub(super) const CORNER: Field<Vec3> = Field::new("corner", "a corner").needed().places();
pub(super) const U: Field<Vec3> = Field::new("u", "an edge from there").needed();
pub(super) const V: Field<Vec3> =
    Field::new("v", "the other edge from there; u × v looks out of its outer side").needed();

static RECTANGLE_LIGHT: LightNode = light_node(
    &["rectangle"],
    "Light spread over a rectangle, or any parallelogram, for soft shadows.",
    &[&[CORNER.schema, U.schema, V.schema], SURFACE, LIGHT_FIELDS],
    "light \"rectangle\" { corner -1 5 -1; u 2 0 0; v 0 0 2; samples 1; emission \"matte\"; intensity 8 }",
    |_, f| {
        Some(LightKind::Rectangle(Box::new(RectangleLight {
            parallelogram: Parallelogram { corner: f.get(&CORNER)?, u: f.get(&U)?, v: f.get(&V)? },
            points: points(f),
        })))
    },
);

const CENTER: Field<Vec3> = Field::new("center", "its centre").needed().places();
const RADIUS: Field<f32> = Field::new("radius", "its radius, more than 0").needed();

static SPHERE_LIGHT: LightNode = light_node(
    &["sphere"],
    "Light spread over a sphere, for soft shadows.",
    &[&[CENTER.schema, RADIUS.schema], SURFACE, LIGHT_FIELDS],
    "light \"sphere\" { center 0 5 0; radius 0.5; points 32 }",
    |_, f| {
        let sphere = Sphere { center: f.get(&CENTER)?, radius: f.get(&RADIUS)? };
        Some(LightKind::Sphere(SphereLight { sphere, points: points(f) }))
    },
);

static MESH_LIGHT: LightNode = light_node(
    &["mesh"],
    "Light spread over the triangles of a file, evenly by their area.",
    &[&[FILE.schema], SURFACE, LIGHT_FIELDS],
    "light \"mesh\" file=\"bunny.obj\" { scale 0.1; translate 0 5 0; samples 4; intensity 0.8 }",
    |decoder, f| {
        let meshes = match &decoder.mesh(f, None, None, (None, Vec::new()))? {
            Content::Mesh(index) => vec![*index],
            Content::Group(parts) => {
                let mut meshes = Vec::new();
                parts.iter().for_each(|part| light_meshes(&mut decoder.scene, part, &Transform::IDENTITY, &mut meshes));
                meshes
            }
            _ => Vec::new(),
        };
        Some(LightKind::Mesh(Box::new(MeshLight { meshes, transform: Transform::IDENTITY, points: points(f) })))
    },
);

/// Finds the meshes of a part of a model. A mesh that its node moves becomes another one at that place.
fn light_meshes(scene: &mut Scene, part: &scene::Node, around: &Transform, found: &mut Vec<u32>) {
    let place = around.after(&part.transform);
    match &part.content {
        Content::Group(children) => children.iter().for_each(|child| light_meshes(scene, child, &place, found)),
        Content::Mesh(index) if place.is_identity() => found.push(*index),
        Content::Mesh(index) => {
            let Some(mut mesh) = scene.meshes.get(*index as usize).cloned() else { return };
            let exact = mesh.positions.iter().map(|p| place.point(p.as_dvec3() + mesh.origin));
            (mesh.origin, mesh.positions) = counted(exact);
            if place.matrix().matrix3.determinant() < 0.0 {
                mesh.triangles.iter_mut().for_each(|corners| corners.swap(1, 2));
            }
            scene.meshes.push(mesh);
            found.push(scene.meshes.len() as u32 - 1);
        }
        _ => {}
    }
}

impl Decoder<'_> {
    /// Decodes a light with its transform.
    pub(crate) fn light(&mut self, node: &Node) -> Option<scene::Node> {
        let kinds: Vec<&str> = LIGHTS.iter().map(|light| kind_of(&light.schema)).collect();
        let index = self.kind_after(node, LIGHT, &kinds)?;
        let LightNode { schema, read } = LIGHTS[index];
        let fields = self.validator.fields(node, schema, &format!("light \"{}\"", kinds[index]));
        let (transform, motion) = self.placed_in_time(&fields);
        self.valid &= fields.valid;
        let mut light =
            Light::new(read(self, &fields)?, fields.get(&INTENSITY).unwrap_or(Rgb::gray(DEFAULT_INTENSITY)));
        light.name = fields.text(&NAME).map(Into::into);
        light.intensity = light.intensity * self.glow(&fields, &TEMPERATURE);
        light.shadows = fields.get(&SHADOWS).unwrap_or(light.shadows);
        // Not all kinds have a surface, an attenuation or a profile.
        if schema.word(SAMPLES.name()).is_some() {
            self.light_of_surface(&fields, &mut light);
        }
        if schema.word(ATTENUATION.name()).is_some() {
            light.attenuation = fields.get(&ATTENUATION).map_or(light.attenuation, |v| v.to_array());
        }
        if schema.word(IES.name()).is_some() {
            light.profile = self.profile(&fields, &light.kind);
        }
        if fields.valid
            && let Err(problem) = light.check()
        {
            self.out_of_range(&fields, &problem);
        }
        // Light that is attenuated by distance may need a high intensity.
        if light.attenuation[1..] == [0.0; 2] && light.emission == Emission::Even {
            self.doubt_light(&fields, &INTENSITY);
        }
        let name = light.name.clone();
        let (transform, motion) = (transform.into(), motion.into());
        let node = scene::Node { name, transform, motion, ..scene::Node::new(Content::Light(light)) };
        Some(node.with_points(&fields.places()))
    }

    /// The colour of a temperature; white without one.
    pub(super) fn glow(&mut self, fields: &Fields, field: &Field<f32>) -> Rgb {
        let Some(kelvin) = fields.get(field).map(f64::from) else { return Rgb::WHITE };
        if !BLACK_BODY_TEMPERATURES.contains(&kelvin) {
            let problem = format!("is {kelvin}; it must be between 1000 and 40000 kelvin");
            self.out_of_range(fields, &OutOfRange::new(field.name(), problem));
        }
        black_body(kelvin)
    }

    /// The distribution of a light over directions, from its file.
    fn profile(&mut self, fields: &Fields, kind: &LightKind) -> Option<Box<MountedProfile>> {
        // A spotlight looks at its target.
        let (axis, aim) = match kind {
            LightKind::Spot(spot) => (None, spot.target - spot.position),
            _ => (fields.get(&IES_AXIS), Vec3::NEG_Y),
        };
        let front = fields.get(&IES_FRONT);
        let Some(file) = fields.text(&IES) else {
            for (name, given) in [(IES_AXIS.name(), axis.is_some()), (IES_FRONT.name(), front.is_some())] {
                if given {
                    self.out_of_range(fields, &OutOfRange::new(name, "turns a profile, but ies is missing"));
                }
            }
            return None;
        };
        let from = self.validator.files.get(fields.span(&IES).file)?.path.clone();
        match import::read_ies(file, self.assets, &from) {
            Ok((profile, warning)) => {
                if let Some(warning) = warning {
                    self.validator.report.append(warning.into());
                }
                let axis = axis.unwrap_or(aim);
                // Where the profile looks along z, x is aside.
                let aside = |v: &Vec3| v.cross(axis).length() > 1e-6 * axis.length();
                let front = front.unwrap_or(if aside(&Vec3::Z) { Vec3::Z } else { Vec3::X });
                Some(Box::new(MountedProfile { profile, axis, front }))
            }
            Err(errors) => {
                self.file_failed(file, fields.span(&IES), errors);
                None
            }
        }
    }

    fn light_of_surface(&mut self, fields: &Fields, light: &mut Light) {
        light.emission = fields.word(&EMISSION).unwrap_or(light.emission);
        light.samples = fields.get(&SAMPLES).unwrap_or(light.samples);
        light.visible = fields.get(&VISIBLE).unwrap_or(light.visible);
        self.either(fields, &POINTS, &SAMPLES);
        if fields.get(&SAMPLES) == Some(0) {
            self.out_of_range(fields, &OutOfRange::new(SAMPLES.name(), "is 0; it must be between 1 and 4096"));
        }
    }

    fn beam(&mut self, f: &Fields) -> Option<(Vec3, f32)> {
        let [axis, radius] = [(BEAM_AXIS.name(), f.has(&BEAM_AXIS)), (BEAM_RADIUS.name(), f.has(&BEAM_RADIUS))];
        for ((word, given), (other, other_given)) in [(axis, radius), (radius, axis)] {
            if given && !other_given {
                let message = format!("a beam needs both axis and radius, but {other} is missing");
                self.validator.report.error(f.span_of(word), message);
                self.valid = false;
            }
        }
        Some((f.get(&BEAM_AXIS)?, f.get(&BEAM_RADIUS)?))
    }

    fn falloff(&mut self, f: &Fields) -> Option<Falloff> {
        let outer = f.get(&OUTER)?;
        if f.has(&EXPONENT) && f.has(&INNER) {
            let message = Message::error(f.span(&EXPONENT), "a spotlight has either inner or exponent");
            self.validator
                .report
                .push(message.help("inner and outer make a smooth edge; exponent falls off from the axis on"));
            self.valid = false;
        }
        if f.has(&EXPONENT) && f.has(&EDGE) {
            let message = "edge has no meaning beside exponent, by which the light falls off from the axis on";
            self.validator.report.error(f.span(&EDGE), message);
            self.valid = false;
        }
        self.doubt_degrees(f, &OUTER);
        let inner = f.get(&INNER).unwrap_or(DEFAULT_INNER);
        Some(match (f.get(&EXPONENT), f.word(&EDGE).unwrap_or_default()) {
            (Some(exponent), _) => Falloff::Exponent { exponent, outer },
            (None, ConeEdge::Smooth) => Falloff::Smooth { inner, outer },
            (None, ConeEdge::Squared) => Falloff::Squared { inner, outer },
        })
    }
}
