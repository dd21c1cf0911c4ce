//! NFF, the Neutral File Format of Eric Haines' Standard Procedural Databases (SPD 3.1; *A Proposal for Standard
//! Graphics Environments*, IEEE CG&A, November 1987). A file is a whole scene.
//!
//! | NFF | here |
//! |---|---|
//! | `f r g b Kd Ks Shine T index` | kd = Kd (r g b), ks = k = Ks, n = Shine, opacity = 1 − T, eta = index (0 is 1) |
//! | `l x y z [r g b]` | an omni light; without a colour each of n lights has the intensity √n / n |
//! | `v … angle hither resolution` | the view; `angle` is fovy |
//! | `c`, `s` | cones and cylinders without caps, spheres |
//! | `p`, `pp` | polygons, all of one material in one mesh, and those with normals in another |
//!
//! A file without `v` is framed as a whole, from the front, right and above. There is no ambient light. The film
//! develops to sRGB. SPD's published statistics limit the ray tree to depth 5; the integrator keeps its own default.
//! Negative radii, which turn a surface inside out in NFF, are taken as positive, since both sides are visible here.

use super::lines::{ImportError, Token, Tokens, lines};
use super::polygon::{Triangulator, vector_area};
use super::positions::Positions;
use super::precision_warning::{self, Precision};
use super::staging::fit_camera;
use super::{Holds, ModelFormat, ReadFragment, ReadOptions, UpAxis, attach_source, encoding, is_flat, unreadable};
use crate::assets::{Assets, OpenAsset};
use crate::diagnostic::{Diagnostic, Diagnostics};
use canaletto::light::{Light, LightKind, Omni};
use canaletto::material::{Material, Phong};
use canaletto::math::Rgb;
use canaletto::scene::{Content, Extrinsics, Fragment, Intrinsics, Node, View};
use canaletto::shape::{Cone, Cylinder, Mesh, Shape, Sphere};
use glam::{DVec3, Vec3};
use std::collections::HashMap;

/// The largest side of a picture, and the largest number of corners of a polygon.
const MAX_RESOLUTION: u32 = 1 << 16;

/// NFF in the table of formats.
pub(super) const FORMAT: ModelFormat = ModelFormat {
    name: "NFF",
    extensions: &["nff"],
    holds: Holds::Scene,
    up: UpAxis::Y,
    read: read_scene,
    duration: None,
};

fn read_scene(asset: &OpenAsset, _: &dyn Assets, _: &ReadOptions) -> ReadFragment {
    let file = asset.path.name();
    let bytes = asset.content.view().whole().map_err(|e| unreadable(&e).error(file))?;
    let bytes = encoding::text(&bytes);
    let mut reader = Reader::new(&bytes);
    let result = reader.scene();
    let mut said = Diagnostics::new();
    match result {
        Ok(()) if reader.fragment.nodes.is_empty() => {
            Err(Diagnostics::from(Diagnostic::error(file, "there are no objects in it").help("is it an NFF file?")))
        }
        Ok(()) => {
            for (complaint, count) in std::mem::take(&mut reader.skipped).into_values() {
                let times = if count > 1 { format!(" ({count} of them)") } else { String::new() };
                let message = format!("{}{times}", complaint.message);
                said.push(ImportError { message, ..complaint }.warning(file));
            }
            attach_source(&mut said, file, bytes[..].into());
            let fragment = reader.finish();
            let rounded = fragment.meshes.iter().find_map(|mesh| precision_warning::mesh(mesh, Precision::Double));
            rounded.into_iter().for_each(|complaint| said.push(complaint.warning(file)));
            Ok((fragment, said))
        }
        Err(complaint) => {
            let mut errors = Diagnostics::from(complaint.error(file));
            attach_source(&mut errors, file, bytes[..].into());
            Err(errors)
        }
    }
}

struct Reader<'a> {
    tokens: NffTokens<'a>,
    fragment: Fragment,
    view: Option<View>,
    lights: Vec<((Vec3, DVec3), Option<Rgb>)>,
    /// The index of each material by the bits of its numbers.
    known: HashMap<[u32; 8], u32>,
    material: Option<u32>,
    /// The corners of each mesh.
    corners: Vec<Positions>,
    /// The meshes of each material, without and with normals, as indices into the fragment's list.
    meshes: HashMap<(u32, bool), usize>,
    triangulator: Triangulator,
    /// The words that were ignored: the first place and the count.
    skipped: std::collections::BTreeMap<&'static str, (ImportError, usize)>,
}

impl<'a> Reader<'a> {
    fn new(bytes: &'a [u8]) -> Reader<'a> {
        Reader {
            tokens: NffTokens::new(bytes),
            fragment: Fragment::default(),
            view: None,
            lights: Vec::new(),
            known: HashMap::new(),
            material: None,
            corners: Vec::new(),
            meshes: HashMap::new(),
            triangulator: Triangulator::new(),
            skipped: std::collections::BTreeMap::new(),
        }
    }

    fn scene(&mut self) -> Result<(), ImportError> {
        while let Some(word) = self.tokens.next() {
            match word.text {
                b"b" => self.fragment.background = Some(self.tokens.color("background")?),
                b"v" => self.view(&word)?,
                b"l" => {
                    let position = self.tokens.position("light")?;
                    let color =
                        if self.tokens.number_follows() { Some(self.tokens.color("light's colour")?) } else { None };
                    self.lights.push((position, color));
                }
                b"f" => self.fill(&word)?,
                b"s" => self.sphere(&word)?,
                b"c" => self.cone(&word)?,
                b"p" => self.polygon(&word, false)?,
                b"pp" => self.polygon(&word, true)?,
                _ => {
                    let message = format!("\"{}\" is not a word of NFF: b, v, l, f, s, c, p or pp", word.shown());
                    return Err(word.wrong(message));
                }
            }
        }
        Ok(())
    }

    fn view(&mut self, start: &Token<'_>) -> Result<(), ImportError> {
        let (mut eye, mut center, mut up) = (None, None, DVec3::Z);
        let mut intrinsics = Intrinsics { fovy: 45.0, width: 512, height: 512, ..Intrinsics::default() };
        while let Some(word) = self.tokens.peek() {
            let vector = |what: &str, tokens: &mut NffTokens<'_>| {
                tokens.next();
                tokens.position(what)
            };
            match word.text {
                b"from" => eye = Some(vector("from", &mut self.tokens)?),
                b"at" => center = Some(vector("at", &mut self.tokens)?),
                b"up" => up = vector("up", &mut self.tokens)?.0.as_dvec3(),
                b"angle" => {
                    self.tokens.next();
                    let (angle, at) = self.tokens.number("angle")?;
                    if angle <= 0.0 || angle >= 180.0 {
                        return Err(at.wrong(format!("angle is {angle}; it must lie between 0 and 180 degrees")));
                    }
                    intrinsics.fovy = f64::from(angle);
                }
                b"hither" => {
                    self.tokens.next();
                    let (near, at) = self.tokens.number("hither")?;
                    if near < 0.0 {
                        return Err(at.wrong(format!("hither is {near}; it must be 0 or more")));
                    }
                    intrinsics.near = (near > 0.0).then_some(f64::from(near));
                }
                b"resolution" => {
                    self.tokens.next();
                    intrinsics.width = self.tokens.count("resolution", 1, MAX_RESOLUTION)?;
                    intrinsics.height = self.tokens.count("resolution", 1, MAX_RESOLUTION)?;
                }
                _ => break,
            }
        }
        let (Some(eye), Some(center)) = (eye, center) else {
            return Err(start.wrong("the view needs `from` and `at`"));
        };
        // Near the origin the view is rounded like the geometry.
        let far = eye.1.abs().max_element() > FAR_EYE * (eye.1 - center.1).abs().max_element();
        let [eye, center] = [eye, center].map(|(rounded, exact)| if far { exact } else { rounded.as_dvec3() });
        if (center - eye).cross(up).length_squared() == 0.0 {
            return Err(
                start.wrong("the view has no direction: `from` and `at` are the same point, or `up` points along them")
            );
        }
        // Files say 0 where they mean no plane, and a projection plane is needed all the same.
        intrinsics.near.get_or_insert((center - eye).length() * 1e-3);
        self.view = Some(View {
            name: "main".into(),
            intrinsics,
            extrinsics: Extrinsics { eye, center, up },
            motion: Vec::new(),
        });
        Ok(())
    }

    fn fill(&mut self, start: &Token<'_>) -> Result<(), ImportError> {
        let numbers = self.tokens.numbers::<8>("f")?;
        let [r, g, b, kd, ks, shine, t, index] = numbers;
        let phong = Phong {
            kd: Rgb::new(r, g, b) * kd,
            ks: Rgb::gray(ks),
            n: shine,
            k: Rgb::gray(ks),
            eta: if index == 0.0 { 1.0 } else { index },
            opacity: 1.0 - t,
            ..Phong::default()
        };
        phong.check().map_err(|problem| start.wrong(problem.to_string()))?;
        let next = self.fragment.materials.len();
        self.material = Some(*self.known.entry(numbers.map(f32::to_bits)).or_insert_with(|| {
            self.fragment.materials.push(Material::new(format!("fill {}", next + 1), phong));
            next as u32
        }));
        Ok(())
    }

    fn sphere(&mut self, start: &Token<'_>) -> Result<(), ImportError> {
        let (center, exact) = self.tokens.position("s")?;
        let [radius] = self.tokens.numbers("s")?;
        if radius == 0.0 {
            return self.skip("a sphere of radius 0 is left out", start);
        }
        self.place(Shape::Sphere(Sphere { center, radius: radius.abs() }), &[exact])
    }

    fn cone(&mut self, start: &Token<'_>) -> Result<(), ImportError> {
        let (base, exact_base) = self.tokens.position("c")?;
        let [radius] = self.tokens.numbers("c")?;
        let (top, exact_top) = self.tokens.position("c")?;
        let [top_radius] = self.tokens.numbers("c")?;
        let (radius, top_radius) = (radius.abs(), top_radius.abs());
        if (exact_top - exact_base).as_vec3().try_normalize().is_none() {
            return self.skip("a cone whose ends are the same point is left out", start);
        }
        if radius == 0.0 && top_radius == 0.0 {
            return self.skip("a cone without radius is left out", start);
        }
        let shape = if radius == top_radius {
            Shape::Cylinder(Cylinder { base, top, radius, caps: false })
        } else {
            Shape::Cone(Cone { base, top, radius, top_radius, caps: false })
        };
        self.place(shape, &[exact_base, exact_top])
    }

    fn polygon(&mut self, start: &Token<'_>, smooth: bool) -> Result<(), ImportError> {
        let count = self.tokens.count(if smooth { "pp" } else { "p" }, 0, u32::MAX)?;
        let (mut corners, mut normals) = (Positions::default(), Vec::new());
        for _ in 0..count {
            let (rounded, exact) = self.tokens.position("corner")?;
            corners.push(rounded, exact);
            if smooth {
                normals.push(Vec3::from(self.tokens.numbers::<3>("normal")?));
            }
        }
        if corners.len() < 3 {
            return self.skip("a polygon of fewer than 3 corners is left out", start);
        }
        let form = corners.form();
        let mut cut = Vec::new();
        self.triangulator.cut(&form, |t| cut.push(t)).map_err(|message| start.wrong(message))?;
        let near = |corner: usize| form[corner] - form[0];
        if cut.iter().all(|t| is_flat(t.map(near))) {
            drop(form);
            return self.skip("a polygon whose corners lie on a line or at one place is left out", start);
        }
        let face = vector_area(&form).try_normalize().unwrap_or(DVec3::Y).as_vec3();
        normals.iter_mut().for_each(|n| *n = n.as_dvec3().try_normalize().map_or(face, |n| n.as_vec3()));
        let material = self.material();
        let fragment = &mut self.fragment;
        let mesh = *self.meshes.entry((material, smooth)).or_insert_with(|| {
            let index = fragment.meshes.len();
            let name = format!("polygons of {}", fragment.materials[material as usize].name);
            self.corners.push(Positions::default());
            fragment.meshes.push(Mesh { name, materials: vec![material], ..Mesh::default() });
            fragment.nodes.push(Node::new(Content::Mesh(index as u32)).with_material(material));
            index
        });
        let (mesh, all) = (&mut fragment.meshes[mesh], &mut self.corners[mesh]);
        let first = all.len();
        if first + corners.len() > u32::MAX as usize {
            return Err(start.wrong("the polygons have more corners than 32 bits can count"));
        }
        mesh.triangles.extend(cut.into_iter().map(|t| t.map(|i| (first + i) as u32)));
        drop(form);
        all.append(corners);
        mesh.normals.extend(normals);
        Ok(())
    }

    /// The index of the current material; before any `f`, that of the default material.
    fn material(&mut self) -> u32 {
        *self.material.get_or_insert_with(|| {
            self.fragment.materials.push(Material::new("default", Phong::default()));
            self.fragment.materials.len() as u32 - 1
        })
    }

    fn place(&mut self, shape: Shape, points: &[DVec3]) -> Result<(), ImportError> {
        let material = self.material();
        self.fragment.nodes.push(Node::from(shape).with_points(points).with_material(material));
        Ok(())
    }

    fn skip(&mut self, why: &'static str, at: &Token<'_>) -> Result<(), ImportError> {
        self.skipped.entry(why).or_insert_with(|| (at.wrong(why), 0)).1 += 1;
        Ok(())
    }

    fn finish(self) -> Fragment {
        let mut fragment = self.fragment;
        let (origin, lists) = Positions::rebase_each(self.corners);
        for (mesh, positions) in fragment.meshes.iter_mut().zip(lists) {
            (mesh.origin, mesh.positions) = (origin, positions);
        }
        let usual = Rgb::gray((self.lights.len() as f32).sqrt() / self.lights.len().max(1) as f32);
        for (position, color) in self.lights {
            let light = Light::new(LightKind::Omni(Omni::at(position.0)), color.unwrap_or(usual));
            fragment.nodes.push(Node::from(light).with_points(&[position.1]));
        }
        fragment.views.extend(self.view.or_else(|| whole_view(&fragment)));
        fragment
    }
}

/// The view is far from the origin if its coordinates are more than this multiple of the distance from the eye to its
/// target.
const FAR_EYE: f64 = 64.0;

/// A view of everything, for files without one. SPD's scenes have z up.
fn whole_view(fragment: &Fragment) -> Option<View> {
    let corners =
        fragment.meshes.iter().flat_map(|mesh| mesh.positions.iter().map(|p| (mesh.origin + p.as_dvec3(), 0.0)));
    let balls = fragment.nodes.iter().flat_map(|node| match &node.content {
        Content::Shape(Shape::Sphere(s)) => vec![(s.center, s.radius)],
        Content::Shape(Shape::Cylinder(c)) => vec![(c.base, c.radius), (c.top, c.radius)],
        Content::Shape(Shape::Cone(c)) => vec![(c.base, c.radius), (c.top, c.top_radius)],
        _ => Vec::new(),
    });
    let balls = balls.map(|(center, radius)| (center.as_dvec3(), f64::from(radius)));
    let intrinsics = Intrinsics { fovy: 45.0, width: 512, height: 512, ..Intrinsics::default() };
    fit_camera(corners.chain(balls), DVec3::new(1.0, -2.0, 1.0).normalize(), DVec3::Z, intrinsics)
}

/// The words of the file without comments; line ends don't matter.
struct NffTokens<'a> {
    lines: super::lines::Lines<'a>,
    words: Tokens<'a>,
    peeked: Option<Token<'a>>,
    /// The last word, for errors about the end of the file.
    latest: Token<'a>,
}

impl<'a> NffTokens<'a> {
    fn new(bytes: &'a [u8]) -> NffTokens<'a> {
        let nothing = Token { start: 0, text: &bytes[..0] };
        NffTokens { lines: lines(bytes), words: nothing.words(), peeked: None, latest: nothing }
    }

    fn peek(&mut self) -> Option<Token<'a>> {
        while self.peeked.is_none() {
            self.peeked = self.words.next().filter(|word| !word.text.starts_with(b"#"));
            if self.peeked.is_none() {
                self.words = self.lines.next()?.words();
            }
        }
        self.peeked
    }

    fn next(&mut self) -> Option<Token<'a>> {
        let word = self.peek()?;
        self.latest = word;
        self.peeked = None;
        Some(word)
    }

    fn number_follows(&mut self) -> bool {
        self.peek().is_some_and(|word| word.number().is_ok())
    }

    fn number(&mut self, what: &str) -> Result<(f32, Token<'a>), ImportError> {
        let Some(word) = self.next() else {
            return Err(self.latest.wrong(format!("{what} is not complete: the file ends here")));
        };
        Ok((word.number().map_err(|complaint| complaint.within(what))?, word))
    }

    fn numbers<const N: usize>(&mut self, what: &str) -> Result<[f32; N], ImportError> {
        let mut out = [0.0; N];
        for value in &mut out {
            *value = self.number(what)?.0;
        }
        Ok(out)
    }

    /// The three numbers of a position, in `f32` and in `f64`.
    fn position(&mut self, what: &str) -> Result<(Vec3, DVec3), ImportError> {
        let (mut rounded, mut exact) = (Vec3::ZERO, DVec3::ZERO);
        for axis in 0..3 {
            let word = self.number(what)?.1;
            (rounded[axis], exact[axis]) = word.exact_number()?;
        }
        Ok((rounded, exact))
    }

    fn color(&mut self, what: &str) -> Result<Rgb, ImportError> {
        let mut out = [0.0; 3];
        for value in &mut out {
            let (number, word) = self.number(what)?;
            if number < 0.0 {
                return Err(word.wrong(format!("{what} is {number}; it must be 0 or more")));
            }
            *value = number;
        }
        Ok(out.into())
    }

    fn count(&mut self, what: &str, least: u32, most: u32) -> Result<u32, ImportError> {
        let Some(word) = self.next() else {
            return Err(self.latest.wrong(format!("{what} is not complete: the file ends here")));
        };
        let value = std::str::from_utf8(word.text).ok().and_then(|text| text.parse::<u32>().ok());
        value.filter(|v| (least..=most).contains(v)).ok_or_else(|| {
            word.wrong(format!("{what}: \"{}\" is not a whole number from {least} to {most}", word.shown()))
        })
    }
}

#[cfg(test)]
mod tests;
