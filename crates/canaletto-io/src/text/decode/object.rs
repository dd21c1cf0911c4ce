//! Decoding of objects and groups.

use super::Decoder;
use super::fields::Fields;
use crate::import::is_flat;
use crate::text::report::Message;
use crate::text::schema::{self, DEFAULT_CAPS, DEFAULT_TOP_RADIUS};
use crate::text::syntax::Node;
use canaletto::scene::{self, Content};
use canaletto::shape::{Cone, Cuboid, Cylinder, Disk, Plane, Shape, Sphere, Torus, Triangle};
use glam::DVec3;

/// The fields of points, in the order in which the points of a shape or light are stored.
const POINTS: [&str; 12] =
    ["center", "min", "max", "a", "b", "c", "point", "base", "top", "position", "target", "corner"];

/// The points of a shape or light in double precision.
pub(super) fn exact_points(fields: &Fields) -> Vec<DVec3> {
    POINTS.iter().filter_map(|word| fields.dvec(word)).collect()
}

impl Decoder<'_> {
    /// Decodes an object or light with its children. `None` for prototypes, and after a mistake.
    pub(super) fn object(&mut self, node: &Node) -> Option<scene::Node> {
        let decoded = if &*node.name == "light" { self.light(node) } else { self.placed(node) };
        self.valid &= decoded.is_some();
        let decoded = decoded?;
        let Some(slot) = self.names.slot_of(node) else { return Some(decoded) };
        // The object is instanced: it becomes a prototype, and an instance replaces it.
        let name = decoded.name.clone();
        self.scene.prototypes[slot as usize] = decoded;
        if &*node.name == "prototype" {
            return None;
        }
        Some(scene::Node { name, ..scene::Node::new(Content::Instance(slot)) })
    }

    fn placed(&mut self, node: &Node) -> Option<scene::Node> {
        let words = schema::node(&node.name)?;
        let fields = self.validator.fields(node, words, words.name);
        let material = self.material(&fields);
        let (transform, motion) = self.placed_in_time(&fields);
        let content = match words.name {
            "group" | "prototype" => Some(Content::Group(self.group(&fields))),
            "instance" => self.instance(&fields),
            "mesh" => self.mesh(&fields, material),
            "spheres" => self.spheres(&fields),
            "cylinders" => self.cylinders(&fields),
            _ => self.shape(&fields),
        };
        let name = fields.text("name").map(Into::into);
        self.valid &= fields.valid;
        let (transform, motion) = (transform.into(), motion.into());
        let node = scene::Node { name, material, transform, motion, ..scene::Node::new(content?) };
        Some(node.with_points(&exact_points(&fields)))
    }

    fn group(&mut self, fields: &Fields) -> Vec<scene::Node> {
        let mut nodes = Vec::with_capacity(fields.objects.len());
        for node in &fields.objects {
            let valid = self.valid;
            match self.object(node) {
                Some(node) => nodes.push(node),
                // A prototype itself isn't visible.
                None if &*node.name == "prototype" => self.valid &= valid,
                None => {}
            }
        }
        nodes
    }

    fn instance(&mut self, fields: &Fields) -> Option<Content> {
        let of = fields.text("of")?;
        let slot = self.names.slot(of);
        if slot.is_none() {
            let known = self.names.iter();
            self.validator.unknown_name("object", of, fields.span("of"), known);
        }
        slot.map(Content::Instance)
    }

    /// The material that the object names.
    fn material(&mut self, fields: &Fields) -> Option<u32> {
        let name = fields.text("material")?;
        let Some(index) = self.materials.get(name).copied() else {
            self.validator.unknown_name("material", name, fields.span("material"), self.materials.keys().copied());
            self.valid = false;
            return None;
        };
        self.used[index as usize] = true;
        Some(index)
    }

    fn shape(&mut self, f: &Fields) -> Option<Content> {
        let caps = f.flag("caps").unwrap_or(DEFAULT_CAPS);
        let shape = match &*f.node.name {
            "sphere" => Shape::Sphere(Sphere { center: f.vec("center")?, radius: f.real("radius")? }),
            "box" => Shape::Box(Cuboid { min: f.vec("min")?, max: f.vec("max")? }),
            "triangle" => Shape::Triangle(Triangle {
                a: f.vec("a")?,
                b: f.vec("b")?,
                c: f.vec("c")?,
                one_sided: f.flag("one-sided").unwrap_or(false),
            }),
            "plane" => Shape::Plane(Plane { point: f.vec("point")?, normal: f.vec("normal")? }),
            "disk" => {
                Shape::Disk(Disk { center: f.vec("center")?, normal: f.vec("normal")?, radius: f.real("radius")? })
            }
            "cylinder" => {
                Shape::Cylinder(Cylinder { base: f.vec("base")?, top: f.vec("top")?, radius: f.real("radius")?, caps })
            }
            "cone" => Shape::Cone(Cone {
                base: f.vec("base")?,
                top: f.vec("top")?,
                radius: f.real("radius")?,
                top_radius: f.real("top-radius").unwrap_or(DEFAULT_TOP_RADIUS),
                caps,
            }),
            "torus" => Shape::Torus(Torus {
                center: f.vec("center")?,
                axis: f.vec("axis")?,
                radius: f.real("radius")?,
                tube: f.real("tube")?,
            }),
            _ => return None,
        };
        // Far from the origin, rounding may make a valid shape degenerate.
        let near = scene::Node::from(shape).with_points(&exact_points(f)).shape_relative_to_first_point();
        if f.valid
            && near.is_none_or(|near| near.check().is_err())
            && let Err(problem) = shape.check()
        {
            self.out_of_range(f, &problem);
        }
        if let Some(Shape::Triangle(Triangle { a, b, c, .. })) = near
            && is_flat([a, b, c])
        {
            let message = "the triangle has no area: its corners lie on a line or at one place";
            self.validator.report.push(Message::warning(Some(f.node.name_span), message));
        }
        Some(Content::Shape(shape))
    }
}
