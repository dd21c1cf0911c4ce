//! The settings of a scene, in the order of its files.
//!
//! If a node occurs in several files, later files change the fields that they set and keep the others.

use super::Decoder;
use crate::text::nodes::{self, DEFAULT_CAMERA, ENVIRONMENT, FILM, SettingReader};
use crate::text::reader::Fields;
use crate::text::report::Message;
use crate::text::schema::{Block, Field, ValueType};
use crate::text::syntax::{Node, Span};
use canaletto::OutOfRange;
use std::collections::HashMap;

impl Decoder<'_> {
    /// Decodes the settings that aren't read before, in the order of the files.
    pub(super) fn settings(&mut self, nodes: &[Node]) {
        let mut places: HashMap<(&str, &str), Span> = HashMap::new();
        let mut last: Vec<Fields> = Vec::new();
        let mut film_fields = None;
        for node in nodes {
            let setting = nodes::setting(&node.name);
            let name = match setting.map(|setting| &setting.read) {
                Some(SettingReader::Once(_)) => "",
                Some(SettingReader::Camera) => node.values.first().and_then(|v| v.as_text()).unwrap_or(DEFAULT_CAMERA),
                Some(SettingReader::Include) => {
                    let message = Message::error(node.name_span, "include has no place here");
                    self.validator.report.push(message);
                    continue;
                }
                None if &*node.name == ENVIRONMENT => "",
                Some(SettingReader::Before) | None => continue,
            };
            let before = places.insert((&node.name, name), node.name_span);
            let before = before.filter(|first| first.file == node.name_span.file);
            let twice = before.is_some();
            if let Some(first) = before {
                let place = self.validator.files.first(first, node.name_span);
                let what = if name.is_empty() {
                    format!("two {} nodes", node.name)
                } else {
                    format!("two cameras called \"{name}\"")
                };
                let message = Message::error(node.name_span, format!("the file has {what}"));
                self.validator.report.push(message.label(place));
                self.valid = false;
            }
            let Some(setting) = setting else {
                let environment = self.environment(node);
                self.valid &= environment.is_some();
                self.scene.environment = environment;
                continue;
            };
            let title = match node.values.is_empty() || name.is_empty() {
                true => setting.schema.name.into(),
                false => format!("camera \"{name}\""),
            };
            let mut fields = self.validator.fields(node, setting.schema, &title);
            fields.valid &= !twice;
            self.valid &= fields.valid;
            match setting.read {
                SettingReader::Once(read) => {
                    read(self, &fields);
                    if std::ptr::eq(setting.schema, &FILM) {
                        film_fields = Some(fields);
                    }
                }
                SettingReader::Camera => {
                    let index = self.camera(&fields, name);
                    if index < last.len() { last[index] = fields } else { last.push(fields) }
                }
                SettingReader::Include | SettingReader::Before => {}
            }
        }
        self.keep_rolls();
        self.check_views(&last, film_fields.as_ref());
    }

    /// Reports a value that is out of range, at its field or else at the node's name.
    pub(crate) fn out_of_range(&mut self, fields: &Fields, problem: &OutOfRange) {
        let span = problem.field.map_or(fields.node.name_span, |field| fields.span_of(field));
        self.validator.report.error(span, problem.to_string());
        self.valid = false;
    }

    /// Reports two fields that set one property in two forms.
    pub(crate) fn either<A, B>(&mut self, fields: &Fields, one: &Field<A>, other: &Field<B>) {
        if fields.has(one) && fields.has(other) {
            let message = format!("{} has either {} or {}", fields.node.name, one.name(), other.name());
            self.validator.report.error(fields.span(other), message);
            self.valid = false;
        }
    }

    /// The fields in the block of a field; `None` after a mistake in them.
    pub(crate) fn block<'n>(&mut self, fields: &Fields<'n>, field: &Field<Block>) -> Option<Fields<'n>> {
        let ValueType::Node(words) = field.schema.value_type else { return None };
        let Some(node) = fields.raw(field)?.node else {
            let message = Message::error(fields.span(field), format!("{} takes a block", words.name));
            self.validator.report.push(message.help(format!("for example: {}", words.example)));
            self.valid = false;
            return None;
        };
        let inner = self.validator.fields(node, words, words.name);
        self.valid &= inner.valid;
        inner.valid.then_some(inner)
    }

    /// The fields in the block of a field, or else its word: a property has no block.
    pub(crate) fn block_or_word<'n>(
        &mut self,
        fields: &Fields<'n>,
        field: &Field<Block>,
    ) -> Option<Result<Fields<'n>, &'n str>> {
        let ValueType::Node(words) = field.schema.value_type else { return None };
        let entry = fields.raw(field)?;
        let Some(node) = entry.node else { return Some(Err(entry.values.first()?.as_text()?)) };
        let inner = self.validator.fields(node, words, words.name);
        self.valid &= inner.valid;
        Some(Ok(inner))
    }
}
