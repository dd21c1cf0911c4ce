//! Spelling suggestions: the valid word that is nearest to an unknown one.

/// The candidate with the fewest typing mistakes relative to `word`, if they are few enough for its length.
pub fn closest_word<'a>(word: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let word: Vec<char> = word.chars().take(64).collect();
    let limit = match word.len() {
        0 => return None,
        1..=4 => 1,
        5..=8 => 2,
        _ => 3,
    };
    let mut best = None;
    for candidate in candidates {
        let letters: Vec<char> = candidate.chars().take(64).collect();
        // A word of one or two letters is no suggestion for a word with which it shares no letter.
        if letters.len().abs_diff(word.len()) > limit || letters.iter().all(|c| !word.contains(c)) {
            continue;
        }
        let mistakes = distance(&word, &letters);
        if mistakes <= limit && best.is_none_or(|(least, _)| mistakes < least) {
            best = Some((mistakes, candidate));
        }
    }
    best.map(|(_, candidate)| candidate)
}

/// The number of letters to insert, delete, replace or swap with a neighbour (Damerau 1964, restricted form). Case is
/// ignored.
fn distance(a: &[char], b: &[char]) -> usize {
    let same = |x: char, y: char| x == y || x.to_lowercase().eq(y.to_lowercase());
    let mut before: Vec<usize> = vec![0; b.len() + 1];
    let mut last: Vec<usize> = (0..=b.len()).collect();
    for i in 1..=a.len() {
        let mut row = vec![i; b.len() + 1];
        for j in 1..=b.len() {
            let replace = last[j - 1] + usize::from(!same(a[i - 1], b[j - 1]));
            row[j] = replace.min(last[j] + 1).min(row[j - 1] + 1);
            if i > 1 && j > 1 && same(a[i - 1], b[j - 2]) && same(a[i - 2], b[j - 1]) {
                row[j] = row[j].min(before[j - 2] + 1);
            }
        }
        before = std::mem::replace(&mut last, row);
    }
    last[b.len()]
}

#[cfg(test)]
mod tests {
    use super::closest_word;

    #[test]
    fn small_mistakes_find_their_word() {
        let words = ["sphere", "spheres", "box", "radius", "center", "kd", "ks", "k", "n"];
        for (wrong, right) in [("spere", "sphere"), ("Sphere", "sphere"), ("raduis", "radius"), ("centre", "center")] {
            assert_eq!(closest_word(wrong, words), Some(right), "{wrong}");
        }
        assert_eq!(closest_word("elephant", words), None);
        assert_eq!(closest_word("", words), None);
        assert_eq!(closest_word("q", words), None);
    }
}
