//! Animations: the values of a clip's channels at a time (glTF 2.0, 3.11 and appendix C, and KHR_animation_pointer).

use super::accessor::Accessors;
use super::fault::{Fault, named};
use super::schema::{Animation, AnimationSampler, Document, Index};
use glam::DQuat;
use serde_json::Value;

/// The value that a channel gives a place of the document.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Animated {
    /// The place as a JSON pointer.
    pub(super) pointer: String,
    pub(super) value: Vec<f64>,
}

/// The clip of this name, or the first one.
///
/// # Errors
/// There is no such clip, or none at all.
pub(super) fn clip<'a>(document: &'a Document, name: Option<&str>) -> Result<(usize, &'a Animation), Fault> {
    let named = |(i, clip): (usize, &'a Animation)| (clip_name(i, clip), i, clip);
    let all: Vec<(String, usize, &Animation)> = document.animations.iter().enumerate().map(named).collect();
    let wanted = match name {
        Some(name) => all.iter().find(|(own, ..)| own == name),
        None => all.first(),
    };
    wanted.map(|(_, i, clip)| (*i, *clip)).ok_or_else(|| {
        let names: Vec<&str> = all.iter().map(|(name, ..)| name.as_str()).collect();
        match name.filter(|_| !names.is_empty()) {
            Some(name) => {
                Fault::new(format!("it has no clip \"{name}\"")).help(format!("its clips are {}", names.join(", ")))
            }
            None => Fault::new("it has no animation"),
        }
    })
}

fn clip_name(i: usize, clip: &Animation) -> String {
    clip.name.clone().filter(|name| !name.is_empty()).unwrap_or_else(|| i.to_string())
}

/// The length of a clip in seconds.
pub(super) fn duration(accessors: &Accessors, clip: (usize, &Animation)) -> Result<f64, Fault> {
    let (number, clip) = clip;
    let mut last = 0.0f64;
    for (k, sampler) in clip.samplers.iter().enumerate() {
        let place = format!("/animations/{number}/samplers/{k}");
        let times = times(accessors, sampler).map_err(|fault| fault.at_if_relative(&place))?;
        last = last.max(times.last().copied().unwrap_or(0.0).into());
    }
    Ok(last)
}

/// The values of all channels of a clip at a time in seconds. Before its first key and after its last one a channel has
/// their values.
pub(super) fn sample(accessors: &Accessors, clip: (usize, &Animation), time: f64) -> Result<Vec<Animated>, Fault> {
    let (number, clip) = clip;
    let mut all = Vec::new();
    for (k, channel) in clip.channels.iter().enumerate() {
        let place = format!("/animations/{number}/channels/{k}");
        let one = || -> Result<Option<Animated>, Fault> {
            let sampler = named(&clip.samplers, channel.sampler, "sampler").map_err(|fault| fault.at("/sampler"))?;
            let pointer = match (channel.target.path.as_str(), channel.target.node) {
                ("pointer", _) => match &channel.target.extensions.pointer {
                    Some(pointer) => pointer.pointer.clone(),
                    None => return Err(Fault::new("it has no pointer").at("/target")),
                },
                // A channel without a node is left out (3.11).
                (_, None) => return Ok(None),
                (path @ ("translation" | "rotation" | "scale" | "weights"), Some(node)) => {
                    format!("/nodes/{node}/{path}")
                }
                (other, _) => {
                    let message = format!("is {other:?}; it must be translation, rotation, scale, weights or pointer");
                    return Err(Fault::new(message).at("/target/path"));
                }
            };
            let is_turn = pointer.starts_with("/nodes/") && pointer.ends_with("/rotation");
            let value = value(accessors, sampler, time, is_turn)?;
            Ok(Some(Animated { pointer, value }))
        };
        all.extend(one().map_err(|fault| fault.at_if_relative(&place))?);
    }
    Ok(all)
}

fn times(accessors: &Accessors, sampler: &AnimationSampler) -> Result<Vec<f32>, Fault> {
    let times = accessors.numbers::<1>(sampler.input).map_err(|fault| fault.at_if_relative("/input"))?;
    let times: Vec<f32> = times.into_iter().flatten().collect();
    let is_rising = times.iter().all(|t| t.is_finite()) && times.windows(2).all(|pair| pair[0] < pair[1]);
    match is_rising {
        true => Ok(times),
        false => Err(Fault::new("the times of its keys aren't finite and rising").at("/input")),
    }
}

/// The value of a sampler at a time.
fn value(accessors: &Accessors, sampler: &AnimationSampler, time: f64, is_turn: bool) -> Result<Vec<f64>, Fault> {
    let times = times(accessors, sampler)?;
    let all = numbers(accessors, sampler.output).map_err(|fault| fault.at_if_relative("/output"))?;
    let interpolation = sampler.interpolation.as_deref().unwrap_or("LINEAR");
    let per_key = match interpolation {
        "LINEAR" | "STEP" => 1,
        "CUBICSPLINE" => 3,
        other => {
            let message = format!("is {other:?}; it must be LINEAR, STEP or CUBICSPLINE");
            return Err(Fault::new(message).at("/interpolation"));
        }
    };
    let width = all.len() / (times.len() * per_key);
    if width == 0 || all.len() != width * times.len() * per_key {
        let message = format!("it has {} numbers, which {} keys can't share", all.len(), times.len());
        return Err(Fault::new(message).at("/output"));
    }
    // The parts of a key: its value, or the tangent before it, the value and the tangent after it.
    let part = |key: usize, part: usize| &all[(key * per_key + part) * width..][..width];
    let own = |key: usize| part(key, per_key / 2).to_vec();
    let next = times.partition_point(|t| f64::from(*t) <= time);
    let value = match next {
        0 => own(0),
        _ if next == times.len() => own(next - 1),
        _ if interpolation == "STEP" => own(next - 1),
        _ => {
            let [start, end] = [times[next - 1], times[next]].map(f64::from);
            let (step, s) = (end - start, (time - start) / (end - start));
            let (a, b) = (own(next - 1), own(next));
            if per_key == 3 {
                let (s2, s3) = (s * s, s * s * s);
                let (leave, arrive) = (part(next - 1, 2), part(next, 0));
                let cubic = |i: usize| {
                    (2.0 * s3 - 3.0 * s2 + 1.0) * a[i]
                        + step * (s3 - 2.0 * s2 + s) * leave[i]
                        + (3.0 * s2 - 2.0 * s3) * b[i]
                        + step * (s3 - s2) * arrive[i]
                };
                (0..width).map(cubic).collect()
            } else if is_turn && width == 4 {
                let [a, b] = [&a, &b].map(|q| DQuat::from_xyzw(q[0], q[1], q[2], q[3]).normalize());
                slerp(a, b, s).to_array().to_vec()
            } else {
                a.iter().zip(&b).map(|(a, b)| a + (b - a) * s).collect()
            }
        }
    };
    match value.iter().all(|v| v.is_finite()) {
        true => Ok(value),
        false => Err(Fault::new("a number of its keys isn't finite").at("/output")),
    }
}

/// Spherical linear interpolation on the shorter way (appendix C.4), with functions that are equal on every machine.
fn slerp(a: DQuat, b: DQuat, s: f64) -> DQuat {
    let dot = a.dot(b);
    let (b, cos) = if dot < 0.0 { (-b, -dot) } else { (b, dot) };
    let angle = libm::acos(cos.min(1.0));
    let sin = libm::sin(angle);
    if sin < 1e-9 {
        return (a + (b - a) * s).normalize();
    }
    a * (libm::sin(angle * (1.0 - s)) / sin) + b * (libm::sin(angle * s) / sin)
}

/// All numbers of an accessor, element after element.
fn numbers(accessors: &Accessors, index: Index) -> Result<Vec<f64>, Fault> {
    fn flat<const N: usize>(elements: Vec<[f32; N]>) -> Vec<f64> {
        elements.into_iter().flatten().map(f64::from).collect()
    }
    Ok(match accessors.width(index)? {
        1 => flat(accessors.numbers::<1>(index)?),
        2 => flat(accessors.numbers::<2>(index)?),
        3 => flat(accessors.numbers::<3>(index)?),
        4 => flat(accessors.numbers::<4>(index)?),
        _ => flat(accessors.numbers::<16>(index)?),
    })
}

/// Sets a value of the JSON: a number, a truth value or a list, which is made where it is missing. Returns whether the
/// place above exists.
pub(super) fn set(json: &mut Value, animated: &Animated) -> bool {
    let Animated { pointer, value } = animated;
    let Some((above, key)) = pointer.rsplit_once('/') else { return false };
    let key = key.replace("~1", "/").replace("~0", "~");
    let made = match value[..] {
        // Weights are a list, also of one.
        [one] if key == "visible" => Value::from(one != 0.0),
        [one] if key != "weights" => Value::from(one),
        _ => Value::from(value.clone()),
    };
    match json.pointer_mut(above) {
        Some(Value::Object(object)) => {
            object.insert(key, made);
            true
        }
        Some(Value::Array(list)) => match key.parse::<usize>().ok().and_then(|i| list.get_mut(i)) {
            Some(slot) => {
                *slot = made;
                true
            }
            None => false,
        },
        _ => false,
    }
}
