//! How a picture was developed, as the texts of its file tell.

use canaletto::Named;
use canaletto::scene::{Exposure, Tone, Transfer};

/// The text entry of a picture's file for the stops that `auto` became.
pub(crate) const METERED_EXPOSURE: &str = "auto-exposure";
/// The text entry of the exposure that was asked for.
pub(crate) const EXPOSURE: &str = "exposure";
/// The text entry of the tone mapping.
pub(crate) const TONE: &str = "tone";
/// The text entry of the transfer curve.
pub(crate) const TRANSFER: &str = "transfer";

/// What the texts of a picture's file tell of its developing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct ToldDeveloping {
    /// The stops that `auto` became, or those that were given.
    pub exposure: Option<Exposure>,
    /// The tone mapping.
    pub tone: Option<Tone>,
    /// The transfer curve.
    pub transfer: Option<Transfer>,
}

impl ToldDeveloping {
    /// Reads the texts. Those of a picture name no exposure if it is 0.
    pub(crate) fn of_texts(texts: &[(String, String)]) -> ToldDeveloping {
        let tone = text(texts, TONE).and_then(Tone::from_name);
        let exposure = exposure_text(texts).and_then(|text| text.parse().ok());
        ToldDeveloping {
            exposure: exposure.or(tone.map(|_| Exposure::default())),
            tone,
            transfer: text(texts, TRANSFER).and_then(Transfer::from_name),
        }
    }
}

/// The exposure that the texts of a picture's file name: the stops that `auto` became, or those that were given.
pub(crate) fn exposure_text(texts: &[(String, String)]) -> Option<&str> {
    text(texts, METERED_EXPOSURE).or(text(texts, EXPOSURE))
}

fn text<'a>(texts: &'a [(String, String)], key: &str) -> Option<&'a str> {
    texts.iter().find(|(own, _)| own == key).map(|(_, text)| text.as_str())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_tell_of_developing() {
        let told = |texts: &[(&str, &str)]| {
            let texts: Vec<_> = texts.iter().map(|(key, text)| ((*key).to_owned(), (*text).to_owned())).collect();
            ToldDeveloping::of_texts(&texts)
        };
        assert_eq!(told(&[]), ToldDeveloping::default());
        let all = [(EXPOSURE, "auto"), (TONE, "agx"), (TRANSFER, "srgb"), (METERED_EXPOSURE, "1.25")];
        let stops = |stops| Some(Exposure::Stops(stops));
        let expected = ToldDeveloping { exposure: stops(1.25), tone: Some(Tone::Agx), transfer: Some(Transfer::Srgb) };
        assert_eq!(told(&all), expected);
        assert_eq!(told(&all[1..3]), ToldDeveloping { exposure: stops(0.0), ..expected });
        assert_eq!(told(&all[..3]).exposure, Some(Exposure::Auto));
        assert_eq!(told(&[(EXPOSURE, "-2"), (TONE, "unknown")]).exposure, stops(-2.0));
    }
}
