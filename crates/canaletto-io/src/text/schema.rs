//! The schema of nodes and fields: what the scene text allows, and what messages and the reference say about it. The
//! tables stand in [`super::nodes`], each above its reader.

use super::reader::FieldValue;
use canaletto::Named;
use std::marker::PhantomData;

/// The type of a field's values.
#[derive(Clone, Copy)]
pub(crate) enum ValueType {
    /// Numbers; the slice lists the allowed counts.
    Numbers(&'static [usize]),
    /// A colour: 1 number (gray) or 3, after names of colours were replaced.
    Rgb,
    /// A non-negative integer.
    Count,
    /// Non-negative integers, this many.
    Counts(usize),
    /// `#true` or `#false`; no value means `#true`.
    Flag,
    /// A number or one of these keywords.
    NumberOrKeyword(&'static [&'static str]),
    /// A flag or one of these keywords.
    FlagOrKeyword(&'static [&'static str]),
    /// Any text.
    Text,
    /// One of these keywords.
    Keyword(&'static [&'static str]),
    /// Any number of numbers, in multiples of this count.
    Many(usize),
    /// A block with a schema of its own.
    Node(&'static NodeSchema),
}

impl ValueType {
    /// Whether the values are numbers.
    pub(crate) fn is_of_numbers(&self) -> bool {
        match self {
            ValueType::Numbers(_) | ValueType::Rgb | ValueType::Count | ValueType::Counts(_) | ValueType::Many(_) => {
                true
            }
            ValueType::NumberOrKeyword(_) => true,
            ValueType::Flag | ValueType::FlagOrKeyword(_) | ValueType::Text | ValueType::Keyword(_) => false,
            ValueType::Node(words) => words.argument.is_some_and(|argument| argument.value_type.is_of_numbers()),
        }
    }
}

/// A single number.
pub(crate) const NUMBER: ValueType = ValueType::Numbers(&[1]);
/// A point or direction.
pub(crate) const POINT: ValueType = ValueType::Numbers(&[3]);

/// A field of a node: a property, a child, or the node's own values.
#[derive(Clone, Copy)]
pub(crate) struct FieldSchema {
    pub(crate) name: &'static str,
    pub(crate) value_type: ValueType,
    /// Whether the field is required.
    pub(crate) needed: bool,
    /// Whether the field may occur more than once.
    pub(crate) many: bool,
    /// Whether it places its object, so that the object keeps the point in double precision.
    pub(crate) places: bool,
    /// Whether colours may stand among its numbers.
    pub(crate) colors: bool,
    /// The default value as text, computed from the code that uses it.
    pub(crate) default: fn() -> String,
    pub(crate) doc: &'static str,
}

/// A field with the type of its value. The field's word is spelled here only: the schema of its node and the node's
/// reader refer to the field.
pub(crate) struct Field<T> {
    pub(crate) schema: FieldSchema,
    value: PhantomData<fn() -> T>,
}

/// The value of a field of text.
pub(crate) struct Text;
/// The values of a field that takes several counts of numbers.
pub(crate) struct Numbers;
/// The content of a field that takes a block.
pub(crate) struct Block;

/// The schema of a node.
pub(crate) struct NodeSchema {
    /// The name of the node; lights add their kind.
    pub(crate) name: &'static str,
    pub(crate) doc: &'static str,
    /// The values right after the node's name.
    pub(crate) argument: Option<FieldSchema>,
    /// The fields, in groups that nodes share.
    pub(crate) words: &'static [&'static [FieldSchema]],
    /// Whether transforms are allowed in it.
    pub(crate) transforms: bool,
    /// Whether objects and lights are allowed in it.
    pub(crate) objects: bool,
    pub(crate) example: &'static str,
}

impl FieldSchema {
    const fn new(name: &'static str, value_type: ValueType, doc: &'static str) -> FieldSchema {
        FieldSchema {
            name,
            value_type,
            needed: false,
            many: false,
            places: false,
            colors: false,
            default: String::new,
            doc,
        }
    }
}

impl<T> Field<T> {
    const fn of_type(name: &'static str, value_type: ValueType, doc: &'static str) -> Field<T> {
        Field { schema: FieldSchema::new(name, value_type, doc), value: PhantomData }
    }

    pub(crate) const fn needed(mut self) -> Field<T> {
        self.schema.needed = true;
        self
    }

    pub(crate) const fn many(mut self) -> Field<T> {
        self.schema.many = true;
        self
    }

    pub(crate) const fn places(mut self) -> Field<T> {
        self.schema.places = true;
        self
    }

    pub(crate) const fn colors(mut self) -> Field<T> {
        self.schema.colors = true;
        self
    }

    pub(crate) const fn or(mut self, default: fn() -> String) -> Field<T> {
        self.schema.default = default;
        self
    }

    pub(crate) const fn name(&self) -> &'static str {
        self.schema.name
    }
}

impl<T: FieldValue> Field<T> {
    pub(crate) const fn new(name: &'static str, doc: &'static str) -> Field<T> {
        Field::of_type(name, T::TYPE, doc)
    }
}

impl<T: Named> Field<T> {
    /// A field of one of the words of a closed set.
    pub(crate) const fn word(name: &'static str, doc: &'static str) -> Field<T> {
        Field::of_type(name, ValueType::Keyword(T::NAMES), doc)
    }

    /// A field of a flag or of one of the words of a closed set.
    pub(crate) const fn flag_or_word(name: &'static str, doc: &'static str) -> Field<T> {
        Field::of_type(name, ValueType::FlagOrKeyword(T::NAMES), doc)
    }

    /// A field of some words of a closed set.
    pub(crate) const fn one_of(name: &'static str, words: &'static [&'static str], doc: &'static str) -> Field<T> {
        Field::of_type(name, ValueType::Keyword(words), doc)
    }
}

impl Field<Text> {
    pub(crate) const fn text(name: &'static str, doc: &'static str) -> Field<Text> {
        Field::of_type(name, ValueType::Text, doc)
    }

    /// A field of one of these words.
    pub(crate) const fn keyword(name: &'static str, words: &'static [&'static str], doc: &'static str) -> Field<Text> {
        Field::of_type(name, ValueType::Keyword(words), doc)
    }

    /// The word that selects the schema of a node, of which this schema allows one.
    pub(crate) const fn kind(words: &'static [&'static str], doc: &'static str) -> Field<Text> {
        Field::of_type("kind", ValueType::Keyword(words), doc)
    }
}

impl Field<Numbers> {
    /// A field that takes one of several counts of numbers.
    pub(crate) const fn numbers(name: &'static str, counts: &'static [usize], doc: &'static str) -> Field<Numbers> {
        Field::of_type(name, ValueType::Numbers(counts), doc)
    }

    /// A field of any number of groups of numbers, `n` in each.
    pub(crate) const fn groups(name: &'static str, n: usize, doc: &'static str) -> Field<Numbers> {
        Field::of_type(name, ValueType::Many(n), doc)
    }
}

impl Field<Block> {
    pub(crate) const fn block(words: &'static NodeSchema, doc: &'static str) -> Field<Block> {
        Field::of_type(words.name, ValueType::Node(words), doc)
    }
}

impl NodeSchema {
    pub(crate) const fn new(
        name: &'static str,
        doc: &'static str,
        words: &'static [&'static [FieldSchema]],
    ) -> NodeSchema {
        NodeSchema { name, doc, argument: None, words, transforms: false, objects: false, example: "" }
    }

    pub(crate) const fn argument(mut self, word: FieldSchema) -> NodeSchema {
        self.argument = Some(word);
        self
    }

    pub(crate) const fn transforms(mut self) -> NodeSchema {
        self.transforms = true;
        self
    }

    pub(crate) const fn objects(mut self) -> NodeSchema {
        self.objects = true;
        self
    }

    pub(crate) const fn example(mut self, text: &'static str) -> NodeSchema {
        self.example = text;
        self
    }

    pub(crate) fn own(&self) -> impl Iterator<Item = &'static FieldSchema> {
        self.words.iter().flat_map(|group| group.iter())
    }

    /// The fields without the one whose values may also stand right after the node's name.
    pub(crate) fn beside_argument(&self) -> impl Iterator<Item = &'static FieldSchema> {
        let argument = self.argument.map(|argument| argument.name);
        self.own().filter(move |word| Some(word.name) != argument)
    }

    pub(crate) fn word(&self, name: &str) -> Option<&'static FieldSchema> {
        self.own().find(|word| word.name == name)
    }
}

/// The description of a value type in messages and in the reference.
impl std::fmt::Display for ValueType {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            ValueType::Numbers([1]) => f.write_str("a number"),
            ValueType::Numbers(counts) => {
                let counts: Vec<String> = counts.iter().map(usize::to_string).collect();
                write!(f, "{} numbers", counts.join(" or "))
            }
            ValueType::Rgb => f.write_str("a colour"),
            ValueType::Count => f.write_str("a whole number"),
            ValueType::Counts(n) => write!(f, "{n} whole numbers"),
            ValueType::Flag => f.write_str("#true or #false"),
            ValueType::NumberOrKeyword(words) => write!(f, "a number or {}", ValueType::Keyword(words)),
            ValueType::FlagOrKeyword(words) => write!(f, "#true, #false, {}", ValueType::Keyword(words)),
            ValueType::Text => f.write_str("a text"),
            ValueType::Keyword(words) => {
                let quoted: Vec<String> = words.iter().map(|word| format!("\"{word}\"")).collect();
                match quoted.as_slice() {
                    [one] => f.write_str(one),
                    [most @ .., last] => write!(f, "{} or {last}", most.join(", ")),
                    [] => Ok(()),
                }
            }
            ValueType::Many(1) => f.write_str("numbers"),
            ValueType::Many(n) => write!(f, "numbers, {n} for each"),
            ValueType::Node(words) => match &words.argument {
                Some(word) => word.value_type.fmt(f),
                None => f.write_str("a block"),
            },
        }
    }
}

/// A colour as scene text.
pub(crate) fn rgb(c: canaletto::math::Rgb) -> String {
    if c == canaletto::math::Rgb::gray(c.r) { c.r.to_string() } else { format!("{} {} {}", c.r, c.g, c.b) }
}

/// Numbers as scene text.
pub(crate) fn numbers<T: ToString, const N: usize>(numbers: [T; N]) -> String {
    numbers.map(|number| number.to_string()).join(" ")
}

/// A word or text as scene text.
pub(crate) fn quoted(word: &str) -> String {
    format!("\"{word}\"")
}

/// A flag as scene text.
pub(crate) fn flag(value: bool) -> String {
    format!("#{value}")
}
