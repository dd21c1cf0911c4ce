//! MTL, the materials beside an OBJ file (Wavefront, *Advanced Visualizer* manual, appendix B1), whose model is Phong's
//! own.
//!
//! | MTL | here |
//! |---|---|
//! | `Kd`, `Ks` | kd, ks; linear, as they stand |
//! | `Ns` | n |
//! | `d`, or `Tr` = 1 − `d` | opacity |
//! | `Ni` | eta |
//! | `illum` 0, 1 | no highlight: ks = 0 |
//! | `illum` 3, 5, 8 | a mirror: k = `Ks` |
//! | `illum` 4, 6, 7, 9 | glass: k = `Ks`; without `d` or `Tr` the opacity is 1 − the largest of `Tf`, whose default is 1 |
//! | other `illum` | `Ks` gives highlights only |
//!
//! Where `illum` is given and isn't glass, light that passes isn't bent: eta = 1, whatever `Ni` says; exporters write
//! `Ni` with every material. `Ka` is left out in silence, since the scene's ambient light acts on kd and every exporter
//! writes it; everything else with a warning.
//! A wrong number is a warning and leaves its default.

use super::ignored::Ignored;
use super::lines::{Complaint, Word, Words, lines};
use crate::diagnostic::Diagnostics;
use canaletto::material::{Material, Phong};
use canaletto::math::Rgb;

/// What a material says before `illum` is known.
struct Draft {
    name: String,
    kd: Option<Rgb>,
    ks: Rgb,
    n: Option<f32>,
    eta: Option<f32>,
    opacity: Option<f32>,
    filter: Option<Rgb>,
    illum: Option<u32>,
}

impl Draft {
    fn new(name: String) -> Draft {
        Draft { name, kd: None, ks: Rgb::BLACK, n: None, eta: None, opacity: None, filter: None, illum: None }
    }

    fn finish(self) -> Material {
        let plain = Phong::default();
        let (mirror, glass) = (matches!(self.illum, Some(3..=9)), matches!(self.illum, Some(4 | 6 | 7 | 9)));
        let clear = || if glass { 1.0 - self.filter.unwrap_or(Rgb::WHITE).max_component().min(1.0) } else { 1.0 };
        let phong = Phong {
            kd: self.kd.unwrap_or(plain.kd),
            ks: if matches!(self.illum, Some(0 | 1)) { Rgb::BLACK } else { self.ks },
            n: self.n.unwrap_or(plain.n),
            k: if mirror { self.ks } else { Rgb::BLACK },
            eta: if glass || self.illum.is_none() { self.eta.unwrap_or(1.0) } else { 1.0 },
            opacity: self.opacity.unwrap_or_else(clear),
            ..plain
        };
        Material::new(self.name, phong)
    }
}

/// The materials of an MTL file, in its order.
pub(super) fn read(file: &str, bytes: &[u8], warnings: &mut Diagnostics) -> Vec<Material> {
    let mut done: Vec<Material> = Vec::new();
    let mut draft: Option<Draft> = None;
    let mut ignored = Ignored::default();
    let mut wrong = 0;
    for line in lines(bytes).joined() {
        let mut words = line.words();
        let Some(word) = words.next() else { continue };
        if word.text.starts_with(b"#") {
            continue;
        }
        if word.text == b"newmtl" {
            done.extend(draft.take().map(Draft::finish));
            draft = Some(Draft::new(words.rest().string()));
            continue;
        }
        let Some(draft) = draft.as_mut() else {
            ignored.note(&word, "stands before the first `newmtl` and is left out");
            continue;
        };
        if let Err(complaint) = property(draft, &word, words, &mut ignored) {
            wrong += 1;
            if wrong <= 20 {
                warnings.push(complaint.within(&word.shown()).warning(file));
            }
        }
    }
    done.extend(draft.map(Draft::finish));
    ignored.report(file, warnings);
    done
}

fn property(draft: &mut Draft, word: &Word<'_>, mut words: Words<'_>, ignored: &mut Ignored) -> Result<(), Complaint> {
    match word.text {
        b"Kd" => draft.kd = color(words)?.or(draft.kd),
        b"Ks" => draft.ks = color(words)?.unwrap_or(draft.ks),
        b"Tf" => draft.filter = color(words)?.or(draft.filter),
        b"Ns" => draft.n = Some(at_least(words, 0.0)?),
        b"Ni" => draft.eta = Some(at_least(words, 1e-3)?),
        b"Tr" => draft.opacity = Some(1.0 - share(words)?),
        b"d" => {
            if words.clone().next().is_some_and(|w| w.text == b"-halo") {
                ignored.note(&word.clone(), "with -halo is read as the same opacity everywhere");
                words.next();
            }
            draft.opacity = Some(share(words)?);
        }
        b"illum" => {
            let value = at_least(words, 0.0)?;
            if value > 10.0 || value.fract() != 0.0 {
                return Err(word.wrong(format!("{value} is not an illumination model; they are 0 to 10")));
            }
            draft.illum = Some(value as u32);
        }
        b"Ka" => {}
        b"Ke" => {
            if words.any(|w| w.number().is_ok_and(|v| v != 0.0)) {
                ignored.note(word, "is left out: surfaces don't emit light yet");
            }
        }
        text if text.starts_with(b"map_") || [&b"bump"[..], b"disp", b"decal", b"refl", b"norm"].contains(&text) => {
            ignored.note(word, "is not yet supported: textures are left out");
        }
        _ => ignored.note(word, "is left out"),
    }
    Ok(())
}

/// A colour: one number stands for all three. Nothing for spectral curves.
fn color(words: Words<'_>) -> Result<Option<Rgb>, Complaint> {
    let mut words = words;
    let line = words.rest();
    if words.clone().next().is_some_and(|w| w.text == b"spectral" || w.text == b"xyz") {
        return Err(line.wrong("colours are understood as red green blue only"));
    }
    let r = words.number("red")?;
    let rgb = if words.clone().next().is_some() { [r, words.number("green")?, words.number("blue")?] } else { [r; 3] };
    match rgb.iter().find(|v| **v < 0.0) {
        Some(v) => Err(line.wrong(format!("{v} is less than 0"))),
        None => Ok(Some(rgb.into())),
    }
}

fn at_least(mut words: Words<'_>, least: f32) -> Result<f32, Complaint> {
    let line = words.rest();
    let value = words.number("the value")?;
    if value < least { Err(line.wrong(format!("{value} is less than {least}"))) } else { Ok(value) }
}

fn share(words: Words<'_>) -> Result<f32, Complaint> {
    let line = words.rest();
    match at_least(words, 0.0)? {
        value if value > 1.0 => Err(line.wrong(format!("{value} is more than 1"))),
        value => Ok(value),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one(text: &str) -> (Phong, String) {
        let mut warnings = Diagnostics::new();
        let list = read("a.mtl", format!("newmtl m\n{text}").as_bytes(), &mut warnings);
        assert_eq!((list.len(), list[0].name.as_str()), (1, "m"));
        list[0].check().unwrap();
        (list[0].phong, warnings.to_string())
    }

    #[test]
    fn phongs_numbers_are_taken() {
        let (phong, warnings) = one("Kd 0.1 .2 0.3\nKs 0.5\nNs 40\nd 0.4\nNi 1.5\n");
        assert_eq!(warnings, "");
        let ks = Rgb::gray(0.5);
        let kd = Rgb::new(0.1, 0.2, 0.3);
        assert_eq!(phong, Phong { kd, ks, n: 40.0, k: Rgb::BLACK, eta: 1.5, opacity: 0.4, roughness: 0.0 });
    }

    #[test]
    fn illum_decides_mirror_and_glass() {
        let with = |illum: u32, more: &str| one(&format!("Ks 0.5 0.5 0.5\nNi 1.5\nillum {illum}\n{more}")).0;
        assert_eq!(with(1, "").ks, Rgb::BLACK);
        assert_eq!((with(2, "d 0.5").k, with(2, "d 0.5").eta), (Rgb::BLACK, 1.0));
        assert_eq!((with(3, "").k, with(3, "").opacity), (Rgb::gray(0.5), 1.0));
        assert_eq!((with(7, "").k, with(7, "").opacity, with(7, "").eta), (Rgb::gray(0.5), 0.0, 1.5));
        assert_eq!((with(6, "Tf 0.25 0.25 0.5").opacity, with(4, "d 0.75").opacity), (0.5, 0.75));
        assert_eq!(with(2, "Tr 0.25").opacity, 0.75);
    }

    #[test]
    fn what_is_left_out_is_told() {
        let (_, warnings) = one("Ka 1 1 1\nmap_d a.png\nmap_d b.png\nKe 0 0 0\nsharpness 60\n");
        assert!(warnings.contains("`map_d` is not yet supported: textures are left out (2 times)"), "{warnings}");
        assert!(warnings.contains("`sharpness` is left out") && !warnings.contains("K"), "{warnings}");
    }

    #[test]
    fn wrong_numbers_leave_the_default() {
        let (phong, warnings) = one("Kd 1 x 1\nd 7\nNs -3\nillum 77\nKs spectral a.rfl\nNi\n");
        assert_eq!(phong, Phong::default());
        for part in
            ["Kd: green: \"x\" is not a number", "d: 7 is more than 1", "Ns: -3 is less than 0", "illum: 77 is not"]
        {
            assert!(warnings.contains(part), "{warnings}");
        }
    }
}
