//! Keys: `key TIME VALUES…`, with `ease` and `turn` beside them.

use super::{Animator, MOST_TURN, POSES, STILL};
use crate::animation::{Curve, Ease, Key, axis_angle, quaternion, turned};
use crate::text::report::Message;
use crate::text::schema::{EASE, TURN, Takes, Word};
use crate::text::syntax::{Node, Span, Value, ValueKind};

/// A key as it is written.
struct Written {
    time: f64,
    values: Vec<Value>,
    span: Span,
    ease: Option<Ease>,
}

impl Animator<'_> {
    /// Replaces a word's keys by the value that they make now. After a mistake the first key's values stay, so that
    /// nothing is missed that isn't missing.
    pub(super) fn keys(&mut self, node: &mut Node, word: &'static Word) {
        let name = node.name.to_string();
        let is_motion = |child: &Node| matches!(&*child.name, "key" | "ease" | "turn");
        let motion: Vec<Node> = node.children.extract_if(.., |child| is_motion(child)).collect();
        let keys: Vec<&Node> = motion.iter().filter(|child| &*child.name == "key").collect();
        node.broken |= keys.iter().any(|key| key.broken);
        let fixed = STILL.contains(&word.name) || matches!(word.takes, Takes::Word([_]));
        if fixed || (matches!(word.takes, Takes::Text) && *node.name != *word.name) {
            let what = if *node.name == *word.name { name } else { format!("the {} of {name}", word.name) };
            self.judge.report.error(keys[0].name_span, format!("{what} is the same in all frames, so it has no keys"));
            node.broken = true;
            return;
        }
        if let Some(value) = node.values.first() {
            let message = Message::error(value.span, format!("{name} has both a value and keys"));
            self.judge.report.push(message.help("leave out one of them; a key at the first frame says how it starts"));
            node.broken = true;
            return;
        }
        let before = self.judge.report.count();
        let ease = self.beside(&motion, "ease", &EASE).and_then(|(text, span)| Some((Ease::from_name(&text)?, span)));
        let turn = self.beside(&motion, "turn", &TURN);
        let written = self.written(&keys, &name, word);
        if let Some(first) = written.first() {
            node.values = first.values.clone();
        }
        if self.judge.report.count() > before || written.is_empty() {
            node.broken = true;
            return;
        }
        let numbers =
            matches!(word.takes, Takes::Numbers(_) | Takes::Rgb | Takes::Many(_) | Takes::Count | Takes::Counts(_))
                && word.name != "matrix";
        if !numbers {
            if let Some((text, span)) = &turn {
                self.judge.report.error(*span, format!("turn \"{text}\" is for rotations"));
                node.broken = true;
            }
            self.jump(node, word, &written, ease);
            return;
        }
        let ease = ease.map_or(Ease::default(), |(ease, _)| ease);
        let curve = |values: &dyn Fn(&Written) -> Vec<f64>| {
            let key = |k: &Written| Key { time: k.time, values: values(k), ease: k.ease.unwrap_or(ease) };
            Curve::new(written.iter().map(key).collect())
        };
        let plain = curve(&|k| k.values.iter().filter_map(Value::as_number).collect());
        let shortest = match (word.name, &turn) {
            ("rotate-x" | "rotate-y" | "rotate-z" | "rotate", Some((text, _))) => Some(text == "shortest"),
            ("rotate-x" | "rotate-y" | "rotate-z", None) => Some(false),
            ("rotate", None) => None,
            (_, None) => Some(false),
            (_, Some((text, span))) => {
                let message = Message::error(*span, format!("turn \"{text}\" is for rotations"));
                self.judge.report.push(message.help("rotate, rotate-x, rotate-y and rotate-z have it"));
                node.broken = true;
                Some(false)
            }
        };
        let mut short = shortest == Some(true);
        let moment: Box<dyn Fn(f64) -> Vec<f64>> = if word.name == "rotate" {
            let axes = plain.keys().windows(2).all(|k| k[0].values[..3] == k[1].values[..3]);
            if shortest == Some(false) && !axes {
                let span = turn.map_or(keys[0].span, |(_, span)| span);
                let message = Message::error(span, "turn \"angle\" needs the same axis in every key");
                self.judge.report.push(message.help("turn \"shortest\" goes between any two rotations"));
                node.broken = true;
                return;
            }
            short = shortest.unwrap_or(!axes);
            if short {
                let turns = |k: &Written| {
                    let n: Vec<f64> = k.values.iter().filter_map(Value::as_number).collect();
                    let q = <[f64; 4]>::try_from(n).ok().and_then(quaternion);
                    q.map_or(Vec::new(), |q| q.to_array().into())
                };
                if let Some(wrong) = written.iter().find(|k| turns(k).is_empty()) {
                    self.judge.report.error(wrong.span, "rotate needs an axis with a direction");
                    node.broken = true;
                    return;
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
        } else if matches!(word.takes, Takes::Count | Takes::Counts(_)) {
            Box::new(move |time| plain.at(time).into_iter().map(libm::round).collect())
        } else {
            Box::new(move |time| plain.at(time))
        };
        // What is wrong with a value is wrong with the key before it.
        let values = |time: f64| -> Vec<Value> {
            let span = written.iter().rev().find(|key| key.time <= time).unwrap_or(&written[0]).span;
            moment(time).into_iter().map(|n| Value { kind: ValueKind::Number(n), span }).collect()
        };
        node.values = values(self.time);
        let moving: Vec<Vec<Value>> = self.shutter.iter().map(|time| values(*time)).collect();
        // Where an angle counts it is the last number; the short way between rotations is never as far.
        let angle = |values: &[Value]| values.last().and_then(Value::as_number).unwrap_or(0.0);
        let counts = word.name.starts_with("rotate-") || (word.name == "rotate" && !short);
        if let Some(fast) = moving.windows(2).find(|two| counts && (angle(&two[1]) - angle(&two[0])).abs() > MOST_TURN)
        {
            let message = format!(
                "{name} turns by {:.0} degrees while the shutter is open; it can be followed up to {:.0}",
                (angle(&fast[1]) - angle(&fast[0])).abs() * (POSES - 1) as f64,
                MOST_TURN * (POSES - 1) as f64
            );
            self.judge.report.error(fast[0].first().map_or(keys[0].span, |value| value.span), message);
            node.broken = true;
            return;
        }
        // What stays for as long as the shutter is open costs nothing more.
        if moving.windows(2).any(|two| two[0].iter().zip(&two[1]).any(|(a, b)| a.kind != b.kind)) {
            node.moving = moving;
        }
    }

    /// What isn't made of numbers holds until the next key.
    fn jump(&mut self, node: &mut Node, word: &Word, written: &[Written], ease: Option<(Ease, Span)>) {
        let beside = ease.filter(|(ease, _)| *ease != Ease::Step).map(|(_, span)| span);
        let own = written.iter().find(|k| k.ease.is_some_and(|ease| ease != Ease::Step)).map(|k| k.span);
        if let Some(span) = beside.or(own) {
            let message =
                format!("{} changes at once, from one key to the next: its ease can only be \"step\"", word.name);
            let message = Message::error(span, message);
            self.judge.report.push(if word.name == "matrix" {
                message.help("translate, rotate and scale move smoothly")
            } else {
                message
            });
            node.broken = true;
            return;
        }
        let now = written.iter().rev().find(|key| key.time <= self.time).or(written.first());
        node.values = now.map_or(Vec::new(), |key| key.values.clone());
    }

    /// The one text of a word beside keys.
    fn beside(&mut self, motion: &[Node], name: &str, word: &'static Word) -> Option<(String, Span)> {
        let mut all = motion.iter().filter(|child| &*child.name == name);
        let node = all.next()?;
        if let Some(second) = all.next() {
            let place = self.judge.files.first(node.name_span, second.name_span);
            let message = Message::error(second.name_span, format!("there are two words {name}"));
            self.judge.report.push(message.label(place));
        }
        let good = !node.broken && self.judge.plain(node) && self.judge.values(name, word, &node.values, node);
        good.then(|| node.values.first()?.as_text().map(|text| (text.to_owned(), node.span))).flatten()
    }

    /// Reads the keys; reports what is wrong with each.
    fn written(&mut self, keys: &[&Node], name: &str, word: &'static Word) -> Vec<Written> {
        let mut written: Vec<Written> = Vec::with_capacity(keys.len());
        for key in keys.iter().filter(|key| !key.broken) {
            let Some(key) = self.key(key, name, word) else { continue };
            let Some(last) = written.last() else {
                written.push(key);
                continue;
            };
            let first = &written[0];
            if key.values.len() != first.values.len() && !matches!(word.takes, Takes::Flag) {
                let (n, of) = (key.values.len(), first.values.len());
                let message = match n {
                    1 => format!("this key of {name} has 1 value, the first one {of}"),
                    _ => format!("this key of {name} has {n} values, the first one {of}"),
                };
                let place = self.judge.files.first(first.span, key.span);
                let message = Message::error(key.span, message).label(place);
                self.judge.report.push(message.help("all keys of a word have as many"));
            } else if key.time == last.time {
                let message = Message::error(key.span, format!("{name} has two keys at {}", key.time));
                self.judge.report.push(message.label(self.judge.files.first(last.span, key.span)));
            } else if key.time < last.time {
                let message = format!("the key at {} comes after the one at {}", key.time, last.time);
                let message = Message::error(key.span, message);
                self.judge.report.push(message.help("keys stand in the order of time"));
            } else {
                written.push(key);
            }
        }
        written
    }

    fn key(&mut self, node: &Node, name: &str, word: &'static Word) -> Option<Written> {
        let Some(first) = node.values.first() else {
            let message = Message::error(node.span, "key needs its time, and then the value");
            self.judge.report.push(message.help(format!("for example: {name} {{ key 1  …; key 50  … }}")));
            return None;
        };
        let Some(time) = first.as_number() else {
            let message = Message::error(first.span, "key takes its time first, as a number");
            self.judge.report.push(message.help("frames, or seconds with animation { keys \"seconds\" }"));
            return None;
        };
        if !(-1e9..=1e9).contains(&time) {
            let what =
                if time.is_nan() { "#nan, which is no number".into() } else { format!("{time:e}; it goes up to 1e9") };
            self.judge.report.error(first.span, format!("the time of this key is {what}"));
            return None;
        }
        let mut ease = None;
        for property in &node.properties {
            if &*property.key != "ease" {
                let message = Message::error(property.key_span, format!("key has no \"{}\"", property.key));
                self.judge.report.push(message.help("possible here: ease"));
                return None;
            }
            let values = std::slice::from_ref(&property.value);
            if !self.judge.values("ease", &EASE, values, node) {
                return None;
            }
            ease = property.value.as_text().and_then(Ease::from_name);
        }
        if let Some(child) = node.children.first() {
            self.judge.report.error(child.name_span, "key takes nothing but its time and values");
            return None;
        }
        let values = &node.values[1..];
        self.judge.values(name, word, values, node).then(|| Written {
            time,
            values: values.to_vec(),
            span: node.span,
            ease,
        })
    }
}

/// The same angles, each within half a turn of the one before.
fn nearest_turns(curve: Curve) -> Curve {
    let mut keys = curve.keys().to_vec();
    for i in 1..keys.len() {
        let last = keys[i - 1].values[0];
        let turn = (keys[i].values[0] - last) / 360.0;
        keys[i].values[0] -= 360.0 * libm::rint(turn);
    }
    Curve::new(keys)
}
