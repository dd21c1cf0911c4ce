//! The frames of an animation.

use canaletto_io::diagnostic::Diagnostic;
use canaletto_io::source::Timeline;

/// The value of --frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum FramesFlag {
    /// The frames of the scene's own animation.
    All,
    /// The given frames.
    These(Frames),
}

/// Every n-th frame from a first to a last one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Frames {
    pub first: u32,
    pub last: u32,
    pub step: u32,
}

/// The maximum number of frames of one run. The name of each frame is checked before the first is rendered.
const MAX_FRAMES: u64 = 1_000_000;

impl FramesFlag {
    /// Parses "all", "7", "1-100" or "1-100x2".
    pub(crate) fn parse(text: &str) -> Result<FramesFlag, String> {
        if text == "all" { Ok(FramesFlag::All) } else { Frames::parse(text).map(FramesFlag::These) }
    }
}

impl Frames {
    /// The warning that all frames are equal. `has_keys` says whether the scene has keys.
    pub(crate) fn all_the_same(self, scene: &str, has_keys: bool) -> Diagnostic {
        let why = if has_keys { "no key changes anything in them" } else { "nothing in the scene has keys" };
        let help = "keys stand in the braces of what moves: translate { key 1  0 0 0; key 50  10 0 0 }";
        Diagnostic::warning(scene, format!("frames {self} all show the same: {why}")).help(help)
    }

    /// A single frame.
    pub(crate) fn one(frame: u32) -> Frames {
        Frames { first: frame, last: frame, step: 1 }
    }

    /// The frames from `first` to `last`, every `step`-th of them.
    pub(crate) fn new(first: u32, last: u32, step: u32) -> Result<Frames, String> {
        if first > last {
            return Err(format!("the first frame, {first}, comes after the last, {last}"));
        }
        let frames = Frames { first, last: last - (last - first) % step.max(1), step: step.max(1) };
        if frames.count() > MAX_FRAMES {
            return Err(format!("the most frames of one run are {MAX_FRAMES}"));
        }
        Ok(frames)
    }

    fn parse(text: &str) -> Result<Frames, String> {
        let number = |text: &str| {
            text.trim().parse::<u32>().map_err(|_| {
                "write a number or two with - between, such as 1-100, or 1-100x2 for every second one".to_owned()
            })
        };
        let (range, step) = match text.split_once('x') {
            Some((range, step)) => (range, number(step)?),
            None => (text, 1),
        };
        if step == 0 {
            return Err("the step after x must be at least 1".into());
        }
        let (first, last) = range.split_once('-').unwrap_or((range, range));
        Frames::new(number(first)?, number(last)?, step)
    }

    pub(crate) fn iter(self) -> impl Iterator<Item = u32> + Clone {
        (self.first..=self.last).step_by(self.step as usize)
    }

    pub(crate) fn count(self) -> u64 {
        (u64::from(self.last) - u64::from(self.first)) / u64::from(self.step) + 1
    }

    /// The frames next to a key, on both sides. If they can be rendered, all frames between can be, unless a value
    /// overshoots its keys by far.
    pub(crate) fn next_to(self, keys: &[f64]) -> Vec<u32> {
        let (first, step) = (f64::from(self.first), f64::from(self.step));
        let most = (self.count() - 1) as f64;
        let mut frames: Vec<u32> = keys
            .iter()
            .map(|key| (key - first) / step)
            .flat_map(|index| [index.floor(), index.ceil()])
            .map(|index| self.first + index.clamp(0.0, most) as u32 * self.step)
            .collect();
        frames.push(self.first);
        frames.sort_unstable();
        frames.dedup();
        frames
    }
}

impl std::fmt::Display for Frames {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}-{}", self.first, self.last)?;
        if self.step > 1 { write!(f, "x{}", self.step) } else { Ok(()) }
    }
}

/// Parses the value of --fps.
pub(crate) fn fps(text: &str) -> Result<f64, String> {
    let range = Timeline::FPS;
    match text.parse::<f64>() {
        Ok(fps) if range.contains(&fps) => Ok(fps),
        Ok(_) => Err(format!("it must be between {} and {}", range.start(), range.end())),
        Err(_) => Err("write a number, such as 25 or 23.976".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_a_range() {
        let of = |text| match FramesFlag::parse(text) {
            Ok(FramesFlag::These(frames)) => Some(frames),
            _ => None,
        };
        assert_eq!(of("1-100"), Some(Frames { first: 1, last: 100, step: 1 }));
        assert_eq!(of("7").map(Frames::count), Some(1));
        assert_eq!(of("1-10x4").map(|f| f.iter().collect()), Some(vec![1, 5, 9]));
        assert_eq!(of("1-10x4").map(|f| (f.last, f.count(), f.to_string())), Some((9, 3, "1-9x4".into())));
        for wrong in ["5-3", "a-b", "-3", "1-9x0", "1-9x", "x2", "", "0-1000000", "4294967296"] {
            assert_eq!(of(wrong), None, "{wrong}");
        }
        assert!(of("0-999999").is_some() && of("0-4294967295x5000").is_some());
        assert_eq!(FramesFlag::parse("all"), Ok(FramesFlag::All));
    }

    #[test]
    fn frames_next_to_keys() {
        let frames = Frames::new(10, 30, 5).unwrap();
        assert_eq!(frames.next_to(&[-4.0, 12.0, 25.0, 99.0]), [10, 15, 25, 30]);
        assert_eq!(frames.next_to(&[]), [10]);
    }
}
