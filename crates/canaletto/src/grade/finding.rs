//! What is said about a mistake: what it is about, what the picture has, and what was expected.

/// A number of the scene that a picture has otherwise.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Finding {
    /// The object, the light, or what else it is about.
    pub subject: String,
    /// What is different, in words.
    pub words: String,
    /// What to look at.
    pub look: String,
    /// The scene's values.
    pub expected: Vec<f64>,
    /// The values that fit the picture.
    pub found: Vec<f64>,
    /// The factor between them, if there is one.
    pub factor: Option<f64>,
}

/// Connected pixels of one object that differ from the right picture.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct WrongRegion {
    /// The object; none for the background.
    pub object: Option<String>,
    /// The number of pixels.
    pub pixels: usize,
    /// The mean difference of the picture's red, green and blue from the right ones, in steps of 8 bits.
    pub difference: [f64; 3],
    /// The pixel that differs most: column and row from the top left.
    pub worst: [u32; 2],
}

/// Numbers with three places, with blanks between them.
pub(super) fn neat_numbers(numbers: &[f64]) -> String {
    numbers.iter().map(|v| neat(*v)).collect::<Vec<_>>().join(" ")
}

fn neat(v: f64) -> String {
    let places = if v.abs() < 0.01 {
        5
    } else if v.abs() < 10.0 {
        3
    } else {
        1
    };
    let text = format!("{v:.places$}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text.is_empty() || text == "-0" { "0".into() } else { text.into() }
}

/// A factor in words.
pub(super) fn times(f: f64) -> String {
    format!("{} times", neat(f))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_no_needless_places() {
        assert_eq!(neat_numbers(&[2.0, 0.5004, -0.0001, 40.0, 0.0012]), "2 0.5 -0.0001 40 0.0012");
    }
}
