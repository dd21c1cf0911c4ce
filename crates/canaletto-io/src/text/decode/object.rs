//! Decoding of objects: their places in space and time, and their contents by the readers of their nodes.

use super::Decoder;
use crate::import::is_flat;
use crate::text::arithmetic::Copies;
use crate::text::nodes::{self, CASTS_SHADOW, LIGHT, MATERIAL, NAME, ObjectReader, PROTOTYPE};
use crate::text::reader::Fields;
use crate::text::report::Message;
use crate::text::syntax::{Node, Span};
use canaletto::scene::{self, Content};
use canaletto::shape::{Shape, Triangle};

impl Decoder<'_> {
    /// Decodes an object, or all copies of a repeat.
    pub(crate) fn objects(&mut self, node: &Node, decoded: &mut Vec<scene::Node>) {
        let Some(mut copies) = Copies::of(node) else {
            decoded.extend(self.object(node));
            return;
        };
        loop {
            match copies.next(&mut self.numbers, self.validator.files, &mut self.copies) {
                Ok(true) => {}
                Ok(false) => break,
                Err(message) => {
                    self.validator.report.push(message);
                    self.valid = false;
                    break;
                }
            }
            let messages = self.validator.report.count();
            for node in copies.nodes() {
                self.objects(node, decoded);
            }
            // The copies have the same mistakes.
            if !self.valid && self.validator.report.count() > messages {
                break;
            }
        }
        copies.end(&mut self.numbers);
    }

    /// Decodes an object or light with its children. `None` for prototypes, and after a mistake.
    pub(crate) fn object(&mut self, node: &Node) -> Option<scene::Node> {
        let decoded = if &*node.name == LIGHT { self.light(node) } else { self.placed(node) };
        self.valid &= decoded.is_some();
        let decoded = decoded?;
        let Some(slot) = self.names.slot_of(node) else { return Some(decoded) };
        // The object is instanced: it becomes a prototype, and an instance replaces it.
        let name = decoded.name.clone();
        self.scene.prototypes[slot as usize] = decoded;
        if *node.name == *PROTOTYPE.schema.name {
            return None;
        }
        Some(scene::Node { name, ..scene::Node::new(Content::Instance(slot)) })
    }

    fn placed(&mut self, node: &Node) -> Option<scene::Node> {
        let object = nodes::object(&node.name)?;
        let fields = self.validator.fields(node, &object.schema, object.schema.name);
        let material = self.material(&fields);
        let (transform, motion) = self.placed_in_time(&fields);
        let content = match object.read {
            ObjectReader::Shape(read) => read(&fields).map(|shape| self.shape(&fields, shape)),
            ObjectReader::Content(read) => read(self, &fields, material),
        };
        let name = fields.text(&NAME).map(Into::into);
        let casts_shadow = fields.get(&CASTS_SHADOW).unwrap_or(true);
        self.valid &= fields.valid;
        let (transform, motion) = (transform.into(), motion.into());
        let node = scene::Node { name, material, casts_shadow, transform, motion, ..scene::Node::new(content?) };
        Some(node.with_points(&fields.places()))
    }

    /// The material that the object names.
    fn material(&mut self, fields: &Fields) -> Option<u32> {
        self.named_material(fields.text(&MATERIAL)?, fields.span(&MATERIAL))
    }

    /// The material of this name.
    pub(crate) fn named_material(&mut self, name: &str, span: Span) -> Option<u32> {
        let Some(index) = self.materials.get(name).copied() else {
            self.validator.unknown_name("material", name, span, self.materials.keys().copied());
            self.valid = false;
            return None;
        };
        self.used[index as usize] = true;
        Some(index)
    }

    /// A shape, whose ranges are checked.
    fn shape(&mut self, f: &Fields, shape: Shape) -> Content {
        // Far from the origin, rounding may make a valid shape degenerate.
        let near = scene::Node::from(shape).with_points(&f.places()).shape_relative_to_first_point();
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
        Content::Shape(shape)
    }
}
