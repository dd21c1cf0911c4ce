//! MTL, the materials of OBJ files (Wavefront, *Advanced Visualizer* manual, appendix B1), on Phong's model.
//!
//! | MTL | here |
//! |---|---|
//! | `Kd`, `Ks` | kd, ks; linear, unchanged; as [fractions](super::color) of 255 if they are that large |
//! | `Ns` | n; below 1, where a highlight is wider than diffuse reflection, ks is scaled by it; the default is 0 |
//! | `d` | coverage, the fraction of the surface that exists; for glass the opacity |
//! | `Tr` | 1 − `d` if there is no `d`. `Tr 1` means opaque unless it is glass, as some programs write it |
//! | `Ni` | eta |
//! | `Ke` | emission: radiance from the outer side, unchanged |
//! | `illum` 0, 1 | no highlight: ks = 0 |
//! | `illum` 3, 5, 8 | a mirror: k = `Ks` |
//! | `illum` 4, 6, 7, 9 | glass: k = `Ks`; without `d` and `Tr`, opacity = 1 − the largest of `Tf` (default 1) |
//! | other `illum` | `Ks` gives highlights only |
//! | no `illum` | glass if `Ni` isn't 1, else as 2 |
//! | `Pr`, `Pm`, `Ps`, `Pc`, `Pcr`, `aniso`, `anisor` | the [standard surface](super::mtl_standard) instead |
//!
//! Materials other than glass don't refract: eta = 1, whatever `Ni` is, because exporters write `Ni` with every
//! material. `Ka` is ignored without a warning, since the scene's ambient light acts on kd and every exporter writes
//! it; so is `map_Ka`. [Pictures](super::texture_map) are textures of the material. Other words are ignored with a
//! warning. An invalid number causes a warning and keeps its default. Words may be in capitals.

use super::color::{ROUNDED, Scale};
use super::ignored::Ignored;
use super::lines::{ImportError, Token, Tokens, lines};
use super::mtl_standard::PhysicalNumbers;
use super::texture_map::{MapKind, TextureMap};
use crate::diagnostic::Diagnostics;
use canaletto::material::{Material, Phong};
use canaletto::math::Rgb;

/// A material with the pictures that it names.
#[derive(Debug)]
pub(super) struct MtlMaterial {
    pub(super) material: Material,
    pub(super) maps: Vec<TextureMap>,
}

/// The words of a material that is being read.
struct Draft<'a> {
    name: String,
    kd: Option<Rgb>,
    ks: Rgb,
    n: Option<f32>,
    eta: Option<f32>,
    dissolve: Option<f32>,
    /// `Tr` with its word, for messages.
    transparency: Option<(f32, Token<'a>)>,
    filter: Option<Rgb>,
    illum: Option<u32>,
    emission: Rgb,
    physical: PhysicalNumbers,
    maps: Vec<TextureMap>,
}

impl Draft<'_> {
    fn new(name: String) -> Self {
        Draft {
            name,
            kd: None,
            ks: Rgb::BLACK,
            n: None,
            eta: None,
            dissolve: None,
            transparency: None,
            filter: None,
            illum: None,
            emission: Rgb::BLACK,
            physical: PhysicalNumbers::default(),
            maps: Vec::new(),
        }
    }

    fn is_glass(&self) -> bool {
        match self.illum {
            Some(illum) => matches!(illum, 4 | 6 | 7 | 9),
            None => self.eta.is_some_and(|eta| eta != 1.0),
        }
    }

    /// The value of `d`: the coverage, or the opacity of glass.
    fn share(&self, ignored: &mut Ignored) -> f32 {
        let glass = self.is_glass();
        match (self.dissolve, self.transparency) {
            (Some(d), Some((tr, word))) => {
                if (1.0 - tr - d).abs() > 0.005 {
                    ignored.note(&word, "disagrees with `d`, and `d` decides");
                }
                d
            }
            (Some(d), None) => d,
            (None, Some((tr, word))) if tr > 0.999 && !glass => {
                ignored.note(&word, "of 1 is read as opaque, as some programs mean it; `d 0` makes faces invisible");
                1.0
            }
            (None, Some((tr, _))) => 1.0 - tr,
            (None, None) if matches!(self.illum, Some(4 | 6 | 7 | 9)) => {
                1.0 - self.filter.unwrap_or(Rgb::WHITE).max_component().min(1.0)
            }
            (None, None) => 1.0,
        }
    }

    fn finish(mut self, ignored: &mut Ignored) -> MtlMaterial {
        if self.physical.are_given() || self.maps.iter().any(|map| map.kind.is_of_standard()) {
            return self.finish_standard(ignored);
        }
        let plain = Phong::default();
        let (share, glass) = (self.share(ignored), self.is_glass());
        let (coverage, opacity) = if glass { (1.0, share) } else { (share, 1.0) };
        let n = self.n.unwrap_or(0.0);
        let phong = Phong {
            kd: self.kd.unwrap_or(plain.kd),
            ks: if matches!(self.illum, Some(0 | 1)) { Rgb::BLACK } else { self.ks * n.min(1.0) },
            n: n.max(1.0),
            k: if matches!(self.illum, Some(3..=9)) { self.ks } else { Rgb::BLACK },
            eta: if glass { self.eta.unwrap_or(1.0) } else { 1.0 },
            opacity,
            emission: self.emission,
            ..plain
        };
        for map in &mut self.maps {
            let color = match map.kind {
                MapKind::Diffuse => self.kd.unwrap_or(Rgb::WHITE),
                MapKind::Specular => phong.ks,
                MapKind::Emission => phong.emission,
                MapKind::Dissolve => Rgb::gray(share),
                MapKind::Exponent => Rgb::gray(n),
                _ => Rgb::WHITE,
            };
            let [r, g, b] = color.to_array();
            match color.is_black() {
                true => {}
                false if r == g && g == b => map.range = map.range.map(|v| v * r),
                false => map.multiplies = true,
            }
        }
        if matches!(self.illum, Some(0 | 1)) {
            self.maps.retain(|map| map.kind != MapKind::Specular);
        }
        let material = Material::new(self.name, phong).with_coverage(coverage);
        MtlMaterial { material, maps: self.maps }
    }

    /// The material as a standard surface. Pictures multiply its numbers; a number of 0 beside a picture counts as 1.
    fn finish_standard(mut self, ignored: &mut Ignored) -> MtlMaterial {
        let (share, is_glass) = (self.share(ignored), self.is_glass() && self.illum.is_some());
        let has = |kind: MapKind| self.maps.iter().any(|map| map.kind == kind);
        let mut surface = self.physical.surface(has);
        let kd = self.kd.unwrap_or(Phong::default().kd);
        surface.base.color = if kd.is_black() && has(MapKind::Diffuse) { Rgb::WHITE } else { kd.map(|v| v.min(1.0)) };
        surface.specular.ior = self.eta.filter(|eta| *eta >= 1.0).unwrap_or(surface.specular.ior);
        let has_glow = has(MapKind::Emission);
        let glow = if self.emission.is_black() && has_glow { Rgb::WHITE } else { self.emission };
        (surface.emission.color, surface.emission.radiance) = (glow, 1.0);
        let coverage = if is_glass { 1.0 } else { share };
        if is_glass {
            (surface.transmission.weight, surface.transmission.color) = (1.0 - share, surface.base.color);
        }
        self.maps.iter_mut().for_each(|map| map.multiplies = true);
        let material = Material::new_standard(self.name, surface).with_coverage(coverage);
        MtlMaterial { material, maps: self.maps }
    }
}

/// The materials of an MTL file, in the order of the file.
pub(super) fn read(file: &str, bytes: &[u8], warnings: &mut Diagnostics) -> Vec<MtlMaterial> {
    let mut done: Vec<MtlMaterial> = Vec::new();
    let mut draft: Option<Draft<'_>> = None;
    let mut ignored = Ignored::default();
    let (mut wrong, mut maps) = (0, 0);
    for line in lines(bytes).joined() {
        let mut words = line.words();
        let Some(word) = words.next() else { continue };
        if word.text.starts_with(b"#") {
            continue;
        }
        let key = word.text.to_ascii_lowercase();
        if key == b"newmtl" {
            done.extend(draft.take().map(|draft| draft.finish(&mut ignored)));
            draft = Some(Draft::new(words.rest().string()));
            continue;
        }
        let Some(draft) = draft.as_mut() else {
            ignored.note(&word, "stands before the first `newmtl` and is left out");
            continue;
        };
        if key == b"map_ka" {
            continue;
        }
        if let Some(kind) = MapKind::of(&key) {
            let is_left_out =
                |option: &Token<'_>| ignored.note(option, "is an option of pictures that isn't supported");
            match TextureMap::read(kind, word, words, is_left_out) {
                Ok(map) => {
                    draft.maps.retain(|other| other.kind != kind);
                    draft.maps.push(map);
                }
                Err(complaint) => {
                    wrong += 1;
                    if wrong <= MAX_TOLD {
                        warnings.push(complaint.within(&word.shown()).warning(file));
                    }
                }
            }
            continue;
        }
        if is_map(&key) {
            maps += 1;
            if maps <= MAX_TOLD {
                warnings.push(left_out(&word, words.rest(), &draft.name).warning(file));
            }
            continue;
        }
        let words = words.before_comment();
        if let Err(complaint) = property(draft, &key, word, words, &mut ignored) {
            wrong += 1;
            if wrong <= MAX_TOLD {
                warnings.push(complaint.within(&word.shown()).warning(file));
            }
        }
    }
    done.extend(draft.map(|draft| draft.finish(&mut ignored)));
    for (count, what) in [(maps, "pictures"), (wrong, "properties with wrong values")] {
        if count > MAX_TOLD {
            let message = format!("{} more {what} are left out", count - MAX_TOLD);
            warnings.push(ImportError::file(message).warning(file));
        }
    }
    ignored.report(file, warnings);
    done
}

/// The largest number of texture maps, and of invalid values, that are reported one by one.
const MAX_TOLD: usize = 20;

/// Whether a word names a picture of a kind that isn't supported.
fn is_map(key: &[u8]) -> bool {
    key.starts_with(b"map_") || [&b"decal"[..], b"refl"].contains(&key)
}

fn left_out(map: &Token<'_>, picture: Token<'_>, material: &str) -> ImportError {
    let message = format!(
        "the `{}` of material `{material}` is left out, since pictures of this kind aren't supported: {}",
        map.shown(),
        picture.shown()
    );
    map.wrong(message).help("in a scene, a `texture` with this file can be put on the `material` of the mesh")
}

fn property<'a>(
    draft: &mut Draft<'a>,
    key: &[u8],
    word: Token<'a>,
    mut words: Tokens<'a>,
    ignored: &mut Ignored,
) -> Result<(), ImportError> {
    match key {
        b"kd" => draft.kd = Some(color(word, words, ignored)?),
        b"ks" => draft.ks = color(word, words, ignored)?,
        b"tf" => draft.filter = Some(color(word, words, ignored)?),
        b"ns" => draft.n = Some(at_least(words, 0.0)?),
        b"ni" => draft.eta = Some(at_least(words, 1e-3)?),
        b"tr" => draft.transparency = Some((share(words)?, word)),
        b"d" => {
            if words.clone().next().is_some_and(|w| w.text.eq_ignore_ascii_case(b"-halo")) {
                ignored.note(&word, "with -halo is read as the same opacity everywhere");
                words.next();
            }
            draft.dissolve = Some(share(words)?);
        }
        b"illum" => {
            let value = at_least(words, 0.0)?;
            if value > 10.0 || value.fract() != 0.0 {
                return Err(word.wrong(format!("{value} is not an illumination model; they are 0 to 10")));
            }
            draft.illum = Some(value as u32);
        }
        b"ka" => {}
        b"ke" => draft.emission = components(words)?,
        _ if draft.physical.takes(key) => draft.physical.set(key, share(words)?),
        _ => ignored.note(&word, "is left out"),
    }
    Ok(())
}

/// A colour. Components beyond 1 may be shares of a larger number.
fn color(word: Token<'_>, words: Tokens<'_>, ignored: &mut Ignored) -> Result<Rgb, ImportError> {
    let line = words.clone().rest();
    let color = components(words)?;
    let (largest, fraction) = (color.max_component(), color.to_array().iter().any(|v| v.fract() != 0.0));
    match Scale::of(largest, fraction) {
        Some(Scale::One) if largest <= ROUNDED => Ok(color),
        Some(scale) => {
            ignored.note(&word, scale.assumed());
            Ok(color * (1.0 / scale.most()))
        }
        None => Err(line.wrong(format!("{} is no colour", line.shown()))),
    }
}

/// Red, green and blue, each 0 or more; a single number stands for all three. Spectral curves are errors.
fn components(mut words: Tokens<'_>) -> Result<Rgb, ImportError> {
    let line = words.rest();
    let curve = |w: Token<'_>| w.text.eq_ignore_ascii_case(b"spectral") || w.text.eq_ignore_ascii_case(b"xyz");
    if words.clone().next().is_some_and(curve) {
        return Err(line.wrong("colours are understood as red green blue only"));
    }
    let r = words.number("red")?;
    let rgb = if words.clone().next().is_some() { [r, words.number("green")?, words.number("blue")?] } else { [r; 3] };
    if let Some(v) = rgb.iter().find(|v| **v < 0.0) {
        return Err(line.wrong(format!("{v} is less than 0")));
    }
    Ok(Rgb::from(rgb))
}

fn at_least(mut words: Tokens<'_>, least: f32) -> Result<f32, ImportError> {
    let line = words.rest();
    let value = words.number("the value")?;
    if value < least { Err(line.wrong(format!("{value} is less than {least}"))) } else { Ok(value) }
}

fn share(words: Tokens<'_>) -> Result<f32, ImportError> {
    let line = words.rest();
    match at_least(words, 0.0)? {
        value if value > 1.0 => Err(line.wrong(format!("{value} is more than 1"))),
        value => Ok(value),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn material(text: &str) -> (Material, String) {
        let mut warnings = Diagnostics::new();
        let mut list = read("a.mtl", format!("newmtl m\n{text}").as_bytes(), &mut warnings);
        let MtlMaterial { material, .. } = list.remove(0);
        assert_eq!((list.len(), material.name.as_str()), (0, "m"));
        material.check().unwrap();
        (material, warnings.to_string())
    }

    fn one(text: &str) -> (Phong, String) {
        let (material, warnings) = material(text);
        (material.classic(), warnings)
    }

    #[test]
    fn phongs_numbers_are_taken() {
        let (phong, warnings) = one("Kd 0.1 .2 0.3 # kd\nKs 0.5#ks\nNs 40\nd 0.4\nNi 1.5\n");
        assert_eq!(warnings, "");
        let ks = Rgb::gray(0.5);
        let kd = Rgb::new(0.1, 0.2, 0.3);
        assert_eq!(phong, Phong { kd, ks, n: 40.0, k: Rgb::BLACK, eta: 1.5, opacity: 0.4, ..Phong::default() });
        assert_eq!(one("KD 0.1 .2 0.3\nKS 0.5\nNS 40\nD 0.4\nNI 1.5\n").0, phong);
    }

    #[test]
    fn illum_decides_mirror_and_glass() {
        let with = |illum: u32, more: &str| one(&format!("Ks 0.5 0.5 0.5\nNi 1.5\nillum {illum}\n{more}")).0;
        assert_eq!(with(1, "Ns 5").ks, Rgb::BLACK);
        assert_eq!((with(2, "d 0.5").k, with(2, "d 0.5").eta), (Rgb::BLACK, 1.0));
        assert_eq!((with(3, "").k, with(3, "").opacity), (Rgb::gray(0.5), 1.0));
        assert_eq!((with(7, "").k, with(7, "").opacity, with(7, "").eta), (Rgb::gray(0.5), 0.0, 1.5));
        assert_eq!((with(6, "Tf 0.25 0.25 0.5").opacity, with(4, "d 0.75").opacity), (0.5, 0.75));
        for illum in [0, 1, 2, 3, 5, 8, 10] {
            let dissolved = material(&format!("illum {illum}\nd 0.75")).0;
            assert_eq!((dissolved.coverage, dissolved.classic().opacity), (0.75, 1.0));
        }
    }

    #[test]
    fn d_decides_before_tr() {
        for (text, opacity, told) in [
            ("d 1\nTr 0", 1.0, ""),
            ("d 1\nTr 1", 1.0, "`Tr` disagrees with `d`, and `d` decides"),
            ("Tr 1\nd 1", 1.0, "`Tr` disagrees with `d`, and `d` decides"),
            ("d 0.25\nTr 0.75", 0.25, ""),
            ("d 0.25\nTr 0.25", 0.25, "disagrees"),
            ("Tr 0", 1.0, ""),
            ("Tr 0.25\nillum 2", 0.75, ""),
            ("Tr 1\nillum 0", 1.0, "`Tr` of 1 is read as opaque"),
            ("Tr 1\nillum 2", 1.0, "`Tr` of 1 is read as opaque"),
            ("Tr 0.9999\nillum 3", 1.0, "`Tr` of 1 is read as opaque"),
            ("Tr 1", 1.0, "`Tr` of 1 is read as opaque"),
            ("Tr 1\nNi 1.5", 0.0, ""),
            ("Tr 1\nillum 7", 0.0, ""),
            ("Tr 1\nillum 4", 0.0, ""),
            ("d 0\nillum 2", 0.0, ""),
            ("d -halo 0.5", 0.5, "with -halo"),
        ] {
            let (material, warnings) = material(text);
            let glass = text.contains("Ni") || text.contains("illum 7") || text.contains("illum 4");
            let shares = if glass { (1.0, opacity) } else { (opacity, 1.0) };
            assert_eq!((material.coverage, material.classic().opacity), shares, "{text}");
            assert!(warnings.contains(told) && warnings.is_empty() == told.is_empty(), "{text}: {warnings}");
        }
    }

    #[test]
    fn highlights_wider_than_matte_light_fade() {
        let ks = |text: &str| one(&format!("Ks 0.5\n{text}")).0.ks.r;
        assert_eq!((ks("Ns 0"), ks(""), ks("Ns 0.5"), ks("Ns 1"), ks("Ns 200")), (0.0, 0.0, 0.25, 0.5, 0.5));
        assert_eq!(one("Ks 0.5\nNs 0\nillum 3").0.k, Rgb::gray(0.5));
    }

    #[test]
    fn colours_beyond_1_are_shares() {
        let (phong, warnings) = one("Kd 128 77 51\nKs 65535 0 0\nNs 10\n");
        assert_eq!(phong.kd, Rgb::new(128.0, 77.0, 51.0) * (1.0 / 255.0));
        assert_eq!(phong.ks.r, 1.0);
        assert!(warnings.contains("`Kd` goes beyond 1, so it is read as going from 0 to 255"), "{warnings}");
        let (bright, warnings) = one("Kd 1.2 0 0");
        assert_eq!(bright.kd.r, 1.2);
        assert!(warnings.contains("`Kd` goes beyond 1 and is taken as it is"), "{warnings}");
        assert_eq!(one("Kd 3.5 0 0").0.kd.r, 3.5, "not a 73rd of full intensity");
        assert_eq!(one("Kd 2 0 0").0.kd.r, 2.0 / 255.0);
        assert!(one("Kd 1e9 0 0").1.contains("is no colour"));
    }

    #[test]
    fn radiance_is_taken_as_it_is() {
        let emission = |text: &str| {
            let (phong, warnings) = one(text);
            assert_eq!(warnings, "", "{text}");
            phong.emission
        };
        assert_eq!(emission("Ke 17 12 4"), Rgb::new(17.0, 12.0, 4.0));
        assert_eq!(emission("Ke 300 # bright"), Rgb::gray(300.0));
        assert_eq!((emission("Ke 0 0 0"), emission("Kd 1 1 1")), (Rgb::BLACK, Rgb::BLACK));
        let (phong, warnings) = one("Ke 1 -2 0\n");
        assert!(phong.emission == Rgb::BLACK && warnings.contains("Ke: -2 is less than 0"), "{warnings}");
        assert!(!material("Ke 1").0.two_sided);
    }

    #[test]
    fn what_is_left_out_is_told() {
        let text = "Ka 1 1 1\nmap_Ka k.png\ndecal -bm 1 a b.png\nmap_Kd -t 1 1 c.png\nKe 0 0 0\nsharpness 60\n";
        let (_, warnings) = one(text);
        assert!(warnings.contains("the `decal` of material `m` is left out"), "{warnings}");
        assert!(warnings.contains("aren't supported: -bm 1 a b.png"), "{warnings}");
        assert!(warnings.contains("`-t` is an option of pictures that isn't supported"), "{warnings}");
        assert!(warnings.contains("`sharpness` is left out") && !warnings.contains("Ka"), "{warnings}");
        let (_, warnings) = one(&"refl a.png\n".repeat(1000));
        assert!(warnings.contains("980 more pictures are left out") && warnings.len() < 5000, "{warnings}");
    }

    /// The words of physically based materials, as Blender, tinyobjloader and others write them.
    #[test]
    fn physical_words_are_the_standard_surface() {
        let standard = |text: &str| *material(text).0.standard().unwrap_or_else(|| panic!("{text}"));
        let metal = standard("Kd 0.9 0.7 0.5\nPm 1\nPr 0.3\naniso 0.7\nanisor 0.25\nNi 1.45\nd 0.5\n");
        assert_eq!((metal.base.color, metal.base.metalness), (Rgb::new(0.9, 0.7, 0.5), 1.0));
        let specular = metal.specular;
        assert_eq!((specular.roughness, specular.anisotropy, specular.anisotropy_rotation), (0.3, 0.7, 90.0));
        assert_eq!(specular.ior, 1.45);
        let coat = standard("Pc 1\nPcr 0.05\nPs 0.8\nKe 2 1.5 1").coat;
        assert_eq!((coat.weight, coat.roughness), (1.0, 0.05));
        let cloth = standard("Ps 0.8\nKe 2 1.5 1");
        assert_eq!((cloth.fuzz.weight, cloth.emission.color), (0.8, Rgb::new(2.0, 1.5, 1.0)));
        assert_eq!(material("Pr 1\nd 0.5").0.coverage, 0.5);
        let glass = standard("Pr 0\nillum 7\nd 0.25\nNi 1.5");
        assert_eq!((glass.transmission.weight, glass.specular.ior), (0.75, 1.5));
        // Without a number a picture's values are the numbers.
        let mapped = standard("map_Pr r.png\nmap_Pm m.png");
        assert_eq!((mapped.specular.roughness, mapped.base.metalness), (1.0, 1.0));
        assert_eq!(standard("Pr 0.5\nmap_Pm m.png").specular.roughness, 0.5);
        assert!(material("Pr 2").1.contains("Pr"), "{}", material("Pr 2").1);
    }

    /// The pictures of a material that has these lines.
    fn maps(text: &str) -> (Vec<TextureMap>, String) {
        let mut warnings = Diagnostics::new();
        let read = read("a.mtl", format!("newmtl m\n{text}").as_bytes(), &mut warnings);
        (read.into_iter().next().unwrap().maps, warnings.to_string())
    }

    #[test]
    fn pictures_have_options() {
        let one = |text: &str| {
            let (maps, warnings) = maps(text);
            assert_eq!((maps.len(), warnings.as_str()), (1, ""), "{text}");
            maps.into_iter().next().unwrap()
        };
        let map = one("Kd 0.5\nmap_Kd -clamp on -s 2 3 1 -blendu off -mm 0.25 0.5 -o 0.5 my wood.png\n");
        assert_eq!((map.file.as_str(), map.kind, map.clamp), ("my wood.png", MapKind::Diffuse, true));
        assert_eq!(map.range, [0.125, 0.375], "(0.25 + 0.5 v) times Kd");
        // u' = s u + o for coordinates that start at the lower left corner, in a picture around its middle.
        let place = map.placement().unwrap().inverse();
        for [u, v] in [[0.0, 0.0], [1.0, 0.25], [-2.0, 5.0]] {
            let found = place.point(glam::DVec3::new(u - 0.5, v - 0.5, 0.0));
            let expected = glam::DVec3::new(2.0 * u + 0.5 - 0.5, 3.0 * v - 0.5, 0.0);
            assert!((found - expected).length() < 1e-12, "{found} {expected}");
        }
        assert_eq!(one("map_d -imfchan r a.png").channel, Some(canaletto::material::Channel::Red));
        assert_eq!(one("norm -bm 2 n.png").strength, 2.0);
        assert_eq!(one("map_Kd a.png\nmap_Kd b.png").file, "b.png", "the last one counts");
        assert_eq!(one("Kd 0 0 0\nmap_Kd a.png").range, [0.0, 1.0], "black beside a picture means nothing");
        let tinted = one("Kd 1 0.5 0\nmap_Kd a.png");
        assert!(tinted.multiplies && tinted.range == [0.0, 1.0], "{tinted:?}");
        for (text, words) in [
            ("map_Kd", "the name of a picture is missing"),
            ("map_Kd -s 2", "the name of a picture is missing"),
            ("map_Kd -s 0 1 a.png", "-s of 0"),
            ("map_Kd -clamp maybe a.png", "-clamp is on or off"),
            ("map_Kd -o x a.png", "\"x\" is not a number"),
        ] {
            let (maps, warnings) = maps(text);
            assert!(maps.is_empty() && warnings.contains(words), "{text}: {warnings}");
        }
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
