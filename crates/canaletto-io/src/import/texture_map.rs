//! The pictures that an MTL file names: `map_Kd -s 2 2 1 bricks.png`.
//!
//! | word | what the picture sets |
//! |---|---|
//! | `map_Kd`, `map_Ks`, `map_Ke` | kd, ks (and k of a mirror), emission: its colours times a grey `Kd`, `Ks`, `Ke` |
//! | `map_d` | coverage, or the opacity of glass: its alpha if it has one, else its luminance, times `d` |
//! | `map_Ns` | n, times `Ns` |
//! | `map_Pr`, `map_Pm`, `map_Ps` | roughness, metalness, fuzz of the standard surface, times their numbers |
//! | `map_Pc`, `map_Pcr` | its coat, and the coat's roughness, times their numbers |
//! | `norm` | normals |
//! | `map_Bump`, `bump` | heights of which the slope is seen, or normals if the picture has the colours of normals |
//! | `disp` | heights that raise the surface |
//!
//! A factor of 0 counts as 1, since programs write black beside a picture. The options `-s` and `-o` scale and move
//! texture coordinates: u' = s u + o. `-clamp on` continues the border. `-mm` gives the values of black and white,
//! `-imfchan` a channel of `map_d`, and `-bm` the strength of normals. `-blendu` and `-blendv` select filters of other
//! renderers and change nothing here.

use super::lines::{ImportError, Token, Tokens};
use canaletto::material::Channel;
use canaletto::math::Transform;
use glam::{DAffine3, DVec3};
use std::ops::Range;

/// What a picture sets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum MapKind {
    Diffuse,
    Specular,
    Emission,
    Dissolve,
    Normal,
    Exponent,
    Bump,
    Displacement,
    Roughness,
    Metalness,
    Sheen,
    Coat,
    CoatRoughness,
}

impl MapKind {
    /// The kind of a word in lower case. `None` for words of pictures that aren't supported.
    pub(super) fn of(key: &[u8]) -> Option<MapKind> {
        Some(match key {
            b"map_kd" => MapKind::Diffuse,
            b"map_ks" => MapKind::Specular,
            b"map_ke" => MapKind::Emission,
            b"map_d" => MapKind::Dissolve,
            b"norm" => MapKind::Normal,
            b"map_ns" => MapKind::Exponent,
            b"map_bump" | b"bump" => MapKind::Bump,
            b"disp" | b"map_disp" => MapKind::Displacement,
            b"map_pr" => MapKind::Roughness,
            b"map_pm" => MapKind::Metalness,
            b"map_ps" => MapKind::Sheen,
            b"map_pc" => MapKind::Coat,
            b"map_pcr" => MapKind::CoatRoughness,
            _ => return None,
        })
    }
}

impl MapKind {
    /// Whether the picture's values are colours.
    pub(super) fn is_color(self) -> bool {
        matches!(self, MapKind::Diffuse | MapKind::Specular | MapKind::Emission)
    }

    /// Whether only the standard surface has what the picture sets.
    pub(super) fn is_of_standard(self) -> bool {
        use MapKind as K;
        matches!(self, K::Roughness | K::Metalness | K::Sheen | K::Coat | K::CoatRoughness)
    }
}

/// A picture with its options.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct TextureMap {
    pub kind: MapKind,
    /// The word of the line, for messages.
    pub word: String,
    /// The picture's name as written, and its place in the file.
    pub file: String,
    pub span: Range<usize>,
    scale: [f64; 2],
    offset: [f64; 2],
    /// Whether the border continues outside the picture, instead of the picture being repeated.
    pub clamp: bool,
    /// The numbers that black and white stand for.
    pub range: [f32; 2],
    /// Whether `-mm` gives them.
    pub has_range: bool,
    /// Whether they multiply the material's own colour, instead of taking its place.
    pub multiplies: bool,
    pub channel: Option<Channel>,
    /// The strength of normals.
    pub strength: f32,
}

impl TextureMap {
    /// Reads the words after `word`. `left_out` is called with options that are left out.
    ///
    /// # Errors
    /// A wrong number or a missing name.
    pub(super) fn read<'a>(
        kind: MapKind,
        word: Token<'a>,
        mut words: Tokens<'a>,
        mut left_out: impl FnMut(&Token<'a>),
    ) -> Result<TextureMap, ImportError> {
        let mut map = TextureMap {
            kind,
            word: word.shown(),
            file: String::new(),
            span: word.span(),
            scale: [1.0; 2],
            offset: [0.0; 2],
            clamp: false,
            range: [0.0, 1.0],
            has_range: false,
            multiplies: false,
            channel: None,
            strength: 1.0,
        };
        loop {
            let rest = words.rest();
            let Some(option) = words.next() else { return Err(word.wrong("the name of a picture is missing")) };
            match option.text.to_ascii_lowercase().as_slice() {
                b"-s" => map.scale = two(&mut words, 1.0)?,
                b"-o" => map.offset = two(&mut words, 0.0)?,
                b"-mm" => {
                    let (base, gain) = (words.number("-mm")?, words.number("-mm")?);
                    (map.range, map.has_range) = ([base, base + gain], true);
                }
                b"-bm" => map.strength = words.number("-bm")?,
                b"-clamp" => map.clamp = is_on(&option, &mut words)?,
                b"-blendu" | b"-blendv" => {
                    is_on(&option, &mut words)?;
                }
                b"-cc" => {
                    if is_on(&option, &mut words)? {
                        left_out(&option);
                    }
                }
                b"-imfchan" => {
                    map.channel = match words.next().map(|channel| channel.text.to_ascii_lowercase()).as_deref() {
                        Some(b"r") => Some(Channel::Red),
                        Some(b"g") => Some(Channel::Green),
                        Some(b"b") => Some(Channel::Blue),
                        Some(b"m") => Some(Channel::Alpha),
                        Some(b"l") => Some(Channel::Luminance),
                        _ => {
                            left_out(&option);
                            None
                        }
                    };
                }
                b"-t" => {
                    left_out(&option);
                    two(&mut words, 0.0)?;
                }
                b"-texres" | b"-boost" | b"-type" => {
                    left_out(&option);
                    words.next();
                }
                _ => {
                    // A name may have spaces.
                    (map.file, map.span) = (rest.string(), rest.span());
                    break;
                }
            }
        }
        if map.scale.contains(&0.0) {
            return Err(word.wrong("-s of 0 leaves nothing of the picture"));
        }
        Ok(map)
    }

    /// The transform that places the picture, whose middle is the origin, x to the right and y upwards. It is the
    /// inverse of u' = s u + o. `None` if its numbers are too large or too small.
    pub(super) fn placement(&self) -> Option<Transform> {
        let [s, o] = [self.scale, self.offset];
        if (s, o) == ([1.0; 2], [0.0; 2]) {
            return Some(Transform::IDENTITY);
        }
        let middle = |axis: usize| s[axis] / 2.0 + o[axis] - 0.5;
        let to_picture = DAffine3 {
            matrix3: glam::DMat3::from_diagonal(DVec3::new(s[0], s[1], 1.0)),
            translation: DVec3::new(middle(0), middle(1), 0.0),
        };
        Transform::new(to_picture).ok().map(|transform| transform.inverse())
    }
}

/// One to three numbers, of which the first two count.
fn two(words: &mut Tokens<'_>, default: f64) -> Result<[f64; 2], ImportError> {
    let mut numbers = [f64::from(words.number("u")?), default];
    for index in 1..3 {
        let mut next = words.clone();
        // The name of the picture may follow.
        let Ok(number) = next.number("v") else { break };
        *words = next;
        if let Some(place) = numbers.get_mut(index) {
            *place = number.into();
        }
    }
    Ok(numbers)
}

fn is_on(option: &Token<'_>, words: &mut Tokens<'_>) -> Result<bool, ImportError> {
    match words.next().map(|word| word.text.to_ascii_lowercase()).as_deref() {
        Some(b"on") => Ok(true),
        Some(b"off") => Ok(false),
        _ => Err(option.wrong(format!("{} is on or off", option.shown()))),
    }
}
