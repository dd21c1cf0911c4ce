//! Names that differ from each other, in texts and as files.

use std::collections::{HashMap, HashSet};

/// Names that are taken.
#[derive(Clone, Debug, Default)]
pub(super) struct Names {
    taken: HashSet<String>,
    /// The number that a name was given last.
    last: HashMap<String, u32>,
}

impl Names {
    /// The name, or the name with a number if it is taken. An empty name becomes `or`.
    pub(super) fn unique(&mut self, name: &str, or: &str) -> String {
        let name = if name.is_empty() { or } else { name };
        let made = |number: Option<u32>| match number {
            Some(number) => format!("{name} ({number})"),
            None => name.to_owned(),
        };
        self.numbered(name, made, str::to_owned)
    }

    /// The name if it is free, which it isn't any more then.
    pub(super) fn take(&mut self, name: &str) -> Option<String> {
        self.taken.insert(name.to_owned()).then(|| name.to_owned())
    }

    /// The name of a file, with an extension. Capitals make no difference to some systems.
    pub(super) fn file(&mut self, name: &str, or: &str, extension: &str) -> String {
        let stem = file_stem(name, or);
        let made = |number: Option<u32>| match number {
            Some(number) => format!("{stem}-{number}.{extension}"),
            None => format!("{stem}.{extension}"),
        };
        self.numbered(&stem.to_lowercase(), made, str::to_lowercase)
    }

    /// The first free name of those without a number and with one. Names of equal `folded` form are one.
    fn numbered(&mut self, key: &str, name: impl Fn(Option<u32>) -> String, folded: fn(&str) -> String) -> String {
        let last = self.last.entry(key.to_owned()).or_insert(0);
        loop {
            let made = name((*last > 0).then(|| *last + 1));
            *last += 1;
            if self.taken.insert(folded(&made)) {
                return made;
            }
        }
    }
}

/// The most characters of a file's name before its extension.
const LONGEST: usize = 60;

/// A name as one of a file, without its folders and its extension: letters, digits, `-`, `_` and points.
fn file_stem(name: &str, or: &str) -> String {
    let last = name.rsplit(['/', '\\']).next().unwrap_or_default();
    let stem = match last.rsplit_once('.') {
        Some((stem, extension)) if is_extension(extension) => stem,
        _ => last,
    };
    let word: String = stem
        .chars()
        .map(|c| if c.is_alphanumeric() || matches!(c, '-' | '_' | '.') { c } else { '_' })
        .take(LONGEST)
        .collect();
    let word = word.trim_matches(['.', '_']);
    if word.is_empty() { or.to_owned() } else { word.to_owned() }
}

fn is_extension(text: &str) -> bool {
    (1..=5).contains(&text.len()) && text.bytes().all(|byte| byte.is_ascii_alphanumeric())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_differ() {
        let mut names = Names::default();
        assert_eq!(["a", "a", "", ""].map(|name| names.unique(name, "mesh")), ["a", "a (2)", "mesh", "mesh (2)"]);
        let mut files = Names::default();
        let made = ["Wood.PNG", "wood.jpg", "a/b c.png", "..", "größe"].map(|name| files.file(name, "picture", "png"));
        assert_eq!(made, ["Wood.png", "wood-2.png", "b_c.png", "picture.png", "größe.png"]);
    }
}
