//! Keys: `key TIME VALUES…`, with optional `ease` and `turn` beside them.
//!
//! The keys of a word are validated once, at the first frame that uses them. The time of a film is therefore
//! proportional to the number of keys, not to its square. Each frame evaluates the curve between two keys.

use super::{Animator, MOST_TURN, NOT_ANIMATED, POSES};
use crate::animation::{Curve, Ease, Key, axis_angle, quaternion, turned};
use crate::text::decode::TransformReader;
use crate::text::nodes::{EASE, KEY, MATRIX, TRANSFORMS, TURN};
use crate::text::report::{Message, Report};
use crate::text::schema::{Field, FieldSchema, ValueType};
use crate::text::syntax::{Node, Span, Value, ValueKind};
use canaletto::{Named, named};
use std::fmt;
use std::sync::{Arc, OnceLock};

/// The keys of a word, with `ease` and `turn`.
pub(crate) struct Keys {
    children: Vec<Node>,
    ready: OnceLock<Ready>,
}

impl Keys {
    /// The nodes of the keys, and of `ease` and `turn`, as written.
    pub(crate) fn nodes(&self) -> &[Node] {
        &self.children
    }
}

impl fmt::Debug for Keys {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.children.fmt(f)
    }
}

/// Validated keys.
struct Ready {
    /// The value over time; `None` after a mistake.
    track: Option<Track>,
    /// The values of the first key, which are used after a mistake.
    first: Vec<Value>,
    /// Whether the word keeps its own values.
    untouched: bool,
    messages: Report,
}

/// A value as a function of time.
type Evaluator = Box<dyn Fn(f64) -> Vec<f64> + Send + Sync>;

/// The change of a word's values over time.
enum Track {
    /// A step function: values hold until the next key.
    Jump(Vec<Written>),
    /// Numbers that are interpolated from key to key.
    Curve {
        moment: Evaluator,
        /// The time and the span of each key.
        places: Vec<(f64, Span)>,
        /// Whether the last number is an angle whose change per pose is limited.
        turns: bool,
    },
}

/// The index of the last key at or before `time`, or 0 if `time` is before all keys.
fn place<T>(keys: &[T], time: f64, time_of: impl Fn(&T) -> f64) -> usize {
    keys.partition_point(|key| time_of(key) <= time).saturating_sub(1)
}

/// A key as written.
struct Written {
    time: f64,
    values: Vec<Value>,
    span: Span,
    ease: Option<Ease>,
}

/// The way of a rotation from key to key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Turn {
    /// The degrees count.
    Angle,
    /// The shorter way round.
    Shortest,
}

named!(Turn {
    Angle => "angle",
    Shortest => "shortest",
});

impl Animator<'_> {
    /// Moves the keys of a word from its children to `Node::keys`.
    pub(super) fn gather(node: &mut Node) {
        let is_motion = |child: &mut Node| [KEY, EASE.name(), TURN.name()].contains(&&*child.name);
        if node.keys.is_none() && node.children.iter().any(|child| &*child.name == KEY) {
            // Where all children are keys, as is usual where there are many, their list is moved as a whole.
            let alone = node.children.iter_mut().all(is_motion);
            let children = if alone {
                std::mem::take(&mut node.children)
            } else {
                node.children.extract_if(.., is_motion).collect()
            };
            node.keys = Some(Arc::new(Keys { children, ready: OnceLock::new() }));
        }
    }

    /// Replaces the keys of a word by its values at the frame. After a mistake the values of the first key are used, so
    /// that no missing value is reported.
    pub(super) fn keys(&mut self, node: &mut Node, word: &'static FieldSchema) {
        let Some(keys) = node.keys.take() else { return };
        let ready = keys.ready.get_or_init(|| self.judged(node, &keys.children, word));
        self.validator.report.repeat(&ready.messages);
        let Some(track) = &ready.track else {
            node.broken = true;
            if !ready.untouched {
                node.values.clone_from(&ready.first);
            }
            return;
        };
        let (moment, places, turns) = match track {
            Track::Jump(written) => {
                node.values.clone_from(&written[place(written, self.time, |key| key.time)].values);
                return;
            }
            Track::Curve { moment, places, turns } => (moment, places, *turns),
        };
        // A message about an interpolated value points at the key before it.
        let values = |time: f64| -> Vec<Value> {
            let span = places[place(places, time, |key| key.0)].1;
            moment(time).into_iter().map(|n| Value { kind: ValueKind::Number(n), span }).collect()
        };
        node.values = values(self.time);
        let moving: Vec<Vec<Value>> = self.shutter.iter().map(|time| values(*time)).collect();
        let angle = |values: &[Value]| values.last().and_then(Value::as_number).unwrap_or(0.0);
        if let Some(fast) = moving.windows(2).find(|two| turns && (angle(&two[1]) - angle(&two[0])).abs() > MOST_TURN) {
            let message = format!(
                "{} turns by {:.0} degrees while the shutter is open; it can be followed up to {:.0}",
                node.name,
                (angle(&fast[1]) - angle(&fast[0])).abs() * (POSES - 1) as f64,
                MOST_TURN * (POSES - 1) as f64
            );
            self.validator.report.error(fast[0].first().map_or(places[0].1, |value| value.span), message);
            node.broken = true;
            return;
        }
        // Values that are constant while the shutter is open need no samples.
        if moving.windows(2).any(|two| two[0].iter().zip(&two[1]).any(|(a, b)| a.kind != b.kind)) {
            node.moving = moving;
        }
    }

    /// Validates the keys of a word.
    fn judged(&mut self, node: &Node, motion: &[Node], word: &'static FieldSchema) -> Ready {
        let outer = std::mem::take(&mut self.validator.report);
        let mut ready = Ready { track: None, first: Vec::new(), untouched: false, messages: Report::default() };
        let broken = motion.iter().any(|child| &*child.name == KEY && child.broken);
        let track = self.track(node, motion, word, &mut ready);
        ready.messages = std::mem::replace(&mut self.validator.report, outer);
        ready.track = track.filter(|_| !broken && !ready.messages.has_errors());
        ready
    }

    /// The track of the keys; `None` after a mistake, which is reported.
    fn track(&mut self, node: &Node, motion: &[Node], word: &'static FieldSchema, ready: &mut Ready) -> Option<Track> {
        let name = node.name.to_string();
        let keys: Vec<&Node> = motion.iter().filter(|child| &*child.name == KEY).collect();
        ready.untouched = true;
        let fixed = NOT_ANIMATED.contains(&word.name) || matches!(word.value_type, ValueType::Keyword([_]));
        if fixed || (matches!(word.value_type, ValueType::Text) && *node.name != *word.name) {
            let what = if *node.name == *word.name { name } else { format!("the {} of {name}", word.name) };
            self.validator
                .report
                .error(keys[0].name_span, format!("{what} is the same in all frames, so it has no keys"));
            return None;
        }
        if let Some(value) = node.values.first() {
            let message = Message::error(value.span, format!("{name} has both a value and keys"));
            self.validator
                .report
                .push(message.help("leave out one of them; a key at the first frame says how it starts"));
            return None;
        }
        ready.untouched = false;
        let ease = self.beside(motion, &EASE);
        let turn = self.beside(motion, &TURN);
        let written = self.written(&keys, &name, word);
        ready.first = written.first().map_or(Vec::new(), |first| first.values.clone());
        if self.validator.report.count() > 0 || written.is_empty() {
            return None;
        }
        let numbers = match word.value_type {
            ValueType::Numbers(_) | ValueType::Rgb | ValueType::Many(_) | ValueType::Count | ValueType::Counts(_) => {
                word.name != MATRIX.name()
            }
            ValueType::NumberOrKeyword(_) => {
                written.iter().flat_map(|key| &key.values).all(|v| v.as_number().is_some())
            }
            _ => false,
        };
        if !numbers {
            if let Some((turn, span)) = &turn {
                self.validator.report.error(*span, format!("turn \"{}\" is for rotations", turn.name()));
            }
            self.may_jump(word, &written, ease);
            return Some(Track::Jump(written));
        }
        let ease = ease.map_or(Ease::default(), |(ease, _)| ease);
        let curve = |values: &dyn Fn(&Written) -> Vec<f64>| {
            let key = |k: &Written| Key { time: k.time, values: values(k), ease: k.ease.unwrap_or(ease) };
            Curve::new(written.iter().map(key).collect())
        };
        let plain = curve(&|k| k.values.iter().filter_map(Value::as_number).collect());
        let transform = TRANSFORMS.iter().find(|transform| transform.schema.name == word.name);
        let (around_axis, axis_angle_keys) = match transform.map(|transform| transform.read) {
            Some(TransformReader::Rotation(_)) => (true, false),
            Some(TransformReader::AxisAngle) => (false, true),
            Some(TransformReader::Translation | TransformReader::Scale | TransformReader::Matrix) | None => {
                (false, false)
            }
        };
        let shortest = match (around_axis || axis_angle_keys, &turn) {
            (true, Some((turn, _))) => Some(*turn == Turn::Shortest),
            (true, None) if axis_angle_keys => None,
            (_, None) => Some(false),
            (_, Some((turn, span))) => {
                let message = Message::error(*span, format!("turn \"{}\" is for rotations", turn.name()));
                self.validator.report.push(message.help("rotate, rotate-x, rotate-y and rotate-z have it"));
                Some(false)
            }
        };
        let mut short = shortest == Some(true);
        let moment: Evaluator = if axis_angle_keys {
            let axes = plain.keys().windows(2).all(|k| k[0].values[..3] == k[1].values[..3]);
            if shortest == Some(false) && !axes {
                let span = turn.map_or(keys[0].span, |(_, span)| span);
                let message = Message::error(span, "turn \"angle\" needs the same axis in every key");
                self.validator.report.push(message.help("turn \"shortest\" goes between any two rotations"));
                return None;
            }
            short = shortest.unwrap_or(!axes);
            if short {
                let turns = |k: &Written| {
                    let n: Vec<f64> = k.values.iter().filter_map(Value::as_number).collect();
                    let q = <[f64; 4]>::try_from(n).ok().and_then(quaternion);
                    q.map_or(Vec::new(), |q| q.to_array().into())
                };
                if let Some(wrong) = written.iter().find(|k| turns(k).is_empty()) {
                    self.validator.report.error(wrong.span, "rotate needs an axis with a direction");
                    return None;
                }
                let curve = curve(&turns);
                Box::new(move |time| match plain.place(time) {
                    (index, 0.0) => plain.keys()[index].values.clone(),
                    _ => axis_angle(turned(&curve, time)).into(),
                })
            } else {
                Box::new(move |time| plain.at(time))
            }
        } else if shortest == Some(true) {
            let curve = nearest_turns(plain);
            Box::new(move |time| curve.at(time))
        } else if matches!(word.value_type, ValueType::Count | ValueType::Counts(_)) {
            Box::new(move |time| plain.at(time).into_iter().map(libm::round).collect())
        } else {
            Box::new(move |time| plain.at(time))
        };
        let places = written.iter().map(|key| (key.time, key.span)).collect();
        // Angles are the last number. The short interpolation between rotations never exceeds the limit.
        let turns = around_axis || (axis_angle_keys && !short);
        Some(Track::Curve { moment, places, turns })
    }

    /// Reports an `ease` beside values that aren't numbers: such values hold until the next key.
    fn may_jump(&mut self, word: &FieldSchema, written: &[Written], ease: Option<(Ease, Span)>) {
        let beside = ease.filter(|(ease, _)| *ease != Ease::Step).map(|(_, span)| span);
        let own = written.iter().find(|k| k.ease.is_some_and(|ease| ease != Ease::Step)).map(|k| k.span);
        let Some(span) = beside.or(own) else { return };
        let message = format!("{} changes at once, from one key to the next: its ease can only be \"step\"", word.name);
        let message = Message::error(span, message);
        self.validator.report.push(if word.name == MATRIX.name() {
            message.help("translate, rotate and scale move smoothly")
        } else {
            message
        });
    }

    /// The value of `ease` or `turn`, which stands beside the keys.
    fn beside<T: Named>(&mut self, motion: &[Node], field: &'static Field<T>) -> Option<(T, Span)> {
        let name = field.name();
        let mut all = motion.iter().filter(|child| &*child.name == name);
        let node = all.next()?;
        if let Some(second) = all.next() {
            let place = self.validator.files.first(node.name_span, second.name_span);
            let message = Message::error(second.name_span, format!("there are two words {name}"));
            self.validator.report.push(message.label(place));
        }
        let good = !node.broken
            && self.validator.plain(node)
            && self.validator.values(name, &field.schema, &node.values, node);
        good.then(|| Some((T::from_name(node.values.first()?.as_text()?)?, node.span))).flatten()
    }

    /// Reads the keys and reports the mistakes in each.
    fn written(&mut self, keys: &[&Node], name: &str, word: &'static FieldSchema) -> Vec<Written> {
        let mut written: Vec<Written> = Vec::with_capacity(keys.len());
        for key in keys.iter().filter(|key| !key.broken) {
            let Some(key) = self.key(key, name, word) else { continue };
            let Some(last) = written.last() else {
                written.push(key);
                continue;
            };
            let first = &written[0];
            if key.values.len() != first.values.len() && !matches!(word.value_type, ValueType::Flag) {
                let (n, of) = (key.values.len(), first.values.len());
                let message = match n {
                    1 => format!("this key of {name} has 1 value, the first one {of}"),
                    _ => format!("this key of {name} has {n} values, the first one {of}"),
                };
                let place = self.validator.files.first(first.span, key.span);
                let message = Message::error(key.span, message).label(place);
                self.validator.report.push(message.help("all keys of a word have as many"));
            } else if key.time == last.time {
                let message = Message::error(key.span, format!("{name} has two keys at {}", key.time));
                self.validator.report.push(message.label(self.validator.files.first(last.span, key.span)));
            } else if key.time < last.time {
                let message = format!("the key at {} comes after the one at {}", key.time, last.time);
                let message = Message::error(key.span, message);
                self.validator.report.push(message.help("keys stand in the order of time"));
            } else {
                written.push(key);
            }
        }
        written
    }

    fn key(&mut self, node: &Node, name: &str, word: &'static FieldSchema) -> Option<Written> {
        let Some(first) = node.values.first() else {
            let message = Message::error(node.span, "key needs its time, and then the value");
            self.validator.report.push(message.help(format!("for example: {name} {{ key 1  …; key 50  … }}")));
            return None;
        };
        let Some(time) = first.as_number() else {
            let message = Message::error(first.span, "key takes its time first, as a number");
            self.validator.report.push(message.help("frames, or seconds with animation { keys \"seconds\" }"));
            return None;
        };
        if !(-1e9..=1e9).contains(&time) {
            let what =
                if time.is_nan() { "#nan, which is no number".into() } else { format!("{time:e}; it goes up to 1e9") };
            self.validator.report.error(first.span, format!("the time of this key is {what}"));
            return None;
        }
        let mut ease = None;
        for property in &node.properties {
            if *property.key != *EASE.name() {
                let message = Message::error(property.key_span, format!("key has no \"{}\"", property.key));
                self.validator.report.push(message.help("possible here: ease"));
                return None;
            }
            let values = std::slice::from_ref(&property.value);
            if !self.validator.values(EASE.name(), &EASE.schema, values, node) {
                return None;
            }
            ease = property.value.as_text().and_then(Ease::from_name);
        }
        if let Some(child) = node.children.first() {
            self.validator.report.error(child.name_span, "key takes nothing but its time and values");
            return None;
        }
        let values = &node.values[1..];
        self.validator.values(name, word, values, node).then(|| Written {
            time,
            values: values.to_vec(),
            span: node.span,
            ease,
        })
    }
}

/// The equivalent angles, each within half a turn of the one before.
fn nearest_turns(curve: Curve) -> Curve {
    let mut keys = curve.keys().to_vec();
    for i in 1..keys.len() {
        let last = keys[i - 1].values[0];
        let turn = (keys[i].values[0] - last) / 360.0;
        keys[i].values[0] -= 360.0 * libm::rint(turn);
    }
    Curve::new(keys)
}
