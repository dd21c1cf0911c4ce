//! The nodes that hold or repeat objects: groups, prototypes and instances.

use super::{CASTS_SHADOW, MATERIAL, NAME, ObjectNode, ObjectReader};
use crate::text::decode::Decoder;
use crate::text::reader::Fields;
use crate::text::schema::{Field, NodeSchema, Text};
use canaletto::scene::{self, Content};

pub(crate) static GROUP: ObjectNode = ObjectNode {
    schema: NodeSchema::new(
        "group",
        "Objects and lights that move together. Its material holds for what has none of its own.",
        &[&[NAME.schema, MATERIAL.schema, CASTS_SHADOW.schema]],
    )
    .argument(NAME.schema)
    .transforms()
    .objects()
    .example("group \"lamp\" { translate 0 5 0; sphere { center 0 0 0; radius 1 } }"),
    read: ObjectReader::Content(|decoder, f, _| Some(Content::Group(decoder.group(f)))),
};

const PROTOTYPE_NAME: Field<Text> = Field::text("name", "the name that instances refer to").needed();

pub(crate) static PROTOTYPE: ObjectNode = ObjectNode {
    schema: NodeSchema::new(
        "prototype",
        "A group that isn't drawn itself, only by its instances.",
        &[&[PROTOTYPE_NAME.schema, MATERIAL.schema, CASTS_SHADOW.schema]],
    )
    .argument(PROTOTYPE_NAME.schema)
    .transforms()
    .objects()
    .example("prototype \"ball\" { sphere { center 0 0 0; radius 1 } }"),
    read: ObjectReader::Content(|decoder, f, _| Some(Content::Group(decoder.group(f)))),
};

/// The name of what an instance repeats.
pub(crate) const OF: Field<Text> = Field::text("of", "the name of what is repeated").needed();
const PARTS_MATERIAL: Field<Text> =
    Field::text("material", "a material for the parts that have none of their own").or(|| "its group's".into());

pub(crate) static INSTANCE: ObjectNode = ObjectNode {
    schema: NodeSchema::new(
        "instance",
        "One more copy of a named object, group or prototype, with the transforms of the original and then its own. \
         Copies \
         cost next to no memory.",
        &[&[OF.schema], &[NAME.schema, PARTS_MATERIAL.schema, CASTS_SHADOW.schema]],
    )
    .argument(OF.schema)
    .transforms()
    .example("instance \"lamp\" { translate 10 0 0 }"),
    read: ObjectReader::Content(|decoder, f, _| decoder.instance(f)),
};

impl Decoder<'_> {
    fn group(&mut self, fields: &Fields) -> Vec<scene::Node> {
        let mut nodes = Vec::with_capacity(fields.objects.len());
        for node in &fields.objects {
            self.objects(node, &mut nodes);
        }
        nodes
    }

    fn instance(&mut self, fields: &Fields) -> Option<Content> {
        let of = fields.text(&OF)?;
        let slot = self.names.slot(of);
        if slot.is_none() {
            let known = self.names.iter();
            self.validator.unknown_name("object", of, fields.span(&OF), known);
        }
        slot.map(Content::Instance)
    }
}
