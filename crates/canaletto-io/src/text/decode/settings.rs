//! Decoding of camera, film, integrator, materials and scene-wide colours.
//!
//! If a node occurs in several files, later files change the fields that they set and keep the others.

use super::Decoder;
use super::fields::{Entry, Fields};
use crate::text::animate::POSES;
use crate::text::report::Message;
use crate::text::schema::{self, NodeSchema};
use crate::text::syntax::{self, Node, Span};
use canaletto::camera::Camera;
use canaletto::material::{Material, Phong};
use canaletto::render::Job;
use canaletto::scene::{Extrinsics, FilmSettings, Filter, Intrinsics, SamplePattern, Sampling, View, WhittedSettings};
use canaletto::{Named, OutOfRange};
use glam::DVec3;
use std::collections::HashMap;

pub(super) fn is_setting(node: &Node) -> bool {
    matches!(&*node.name, "environment" | "texture") || schema::SETTINGS.iter().any(|words| words.name == &*node.name)
}

impl<'a> Decoder<'a> {
    /// Decodes the materials first, so that all objects can refer to them.
    pub(super) fn materials<'n: 'a>(&mut self, nodes: &'n [Node]) {
        let mut places: HashMap<&str, Span> = HashMap::new();
        for node in nodes.iter().filter(|node| &*node.name == "material") {
            let title = node
                .values
                .first()
                .and_then(|v| v.as_text())
                .map_or("material".into(), |n| format!("material \"{n}\""));
            let unpacked = node.packed.and_then(|_| syntax::unpack(node, self.validator.files.slice(node.span)).pop());
            let fields = self.validator.fields(unpacked.as_ref().unwrap_or(node), &schema::MATERIAL, &title);
            self.valid &= fields.valid;
            // A packed node keeps its name, which outlives the node that was parsed again.
            let kept = node.values.first().and_then(|v| v.as_text()).or_else(|| Some(node.text("name")?.0));
            let Some(name) = kept.filter(|_| fields.text("name").is_some()) else { continue };
            let span = fields.span("name");
            if let Some(first) = places.insert(name, span) {
                let place = self.validator.files.first(first, span);
                let message = Message::error(span, format!("two materials are called \"{name}\""));
                self.validator.report.push(message.label(place));
                self.valid = false;
                continue;
            }
            let d = Phong::default();
            let phong = Phong {
                kd: fields.rgb("kd").unwrap_or(d.kd),
                ks: fields.rgb("ks").unwrap_or(d.ks),
                n: fields.real("n").unwrap_or(d.n),
                k: fields.rgb("k").unwrap_or(d.k),
                eta: fields.real("eta").unwrap_or(d.eta),
                opacity: fields.real("opacity").unwrap_or(d.opacity),
                roughness: fields.real("roughness").unwrap_or(d.roughness),
            };
            let mut material = Material::new(name, phong);
            material.coverage = fields.real("coverage").unwrap_or(material.coverage);
            material.priority = fields.real("priority").unwrap_or(material.priority);
            let checked = material.check();
            material.textures = self.surface_textures(&fields);
            if let Err(problem) = checked {
                self.out_of_range(&fields, &problem);
            }
            self.doubt_reflectance(&fields, &["kd", "ks", "k"]);
            self.doubt_eta(&fields, !material.is_opaque());
            self.materials.insert(name, self.scene.materials.len() as u32);
            self.scene.materials.push(material);
            self.used.push(false);
        }
    }

    /// Decodes the other settings in the order of the files.
    pub(super) fn settings(&mut self, nodes: &[Node]) {
        let mut places: HashMap<(&str, &str), Span> = HashMap::new();
        let mut last: Vec<Fields> = Vec::new();
        let mut film_fields = None;
        for node in nodes {
            let name = match &*node.name {
                "background" | "environment" | "ambient" | "film" | "integrator" => "",
                "camera" => node.values.first().and_then(|v| v.as_text()).unwrap_or(schema::DEFAULT_CAMERA),
                "include" => {
                    let message = Message::error(node.name_span, "include has no place here");
                    self.validator.report.push(message);
                    continue;
                }
                _ => continue,
            };
            let before = places.insert((&node.name, name), node.name_span);
            let before = before.filter(|first| first.file == node.name_span.file);
            let twice = before.is_some();
            if let Some(first) = before {
                let place = self.validator.files.first(first, node.name_span);
                let what = if name.is_empty() {
                    format!("two {} nodes", node.name)
                } else {
                    format!("two cameras called \"{name}\"")
                };
                let message = Message::error(node.name_span, format!("the file has {what}"));
                self.validator.report.push(message.label(place));
                self.valid = false;
            }
            if &*node.name == "environment" {
                let environment = self.environment(node);
                self.valid &= environment.is_some();
                self.scene.environment = environment;
                continue;
            }
            let words: &'static NodeSchema = match &*node.name {
                "background" => &schema::BACKGROUND,
                "ambient" => &schema::AMBIENT,
                "film" => &schema::FILM,
                "integrator" => &schema::INTEGRATOR,
                _ => &schema::CAMERA,
            };
            let title = if node.values.is_empty() || words.name != "camera" {
                words.name.into()
            } else {
                format!("camera \"{name}\"")
            };
            let mut fields = self.validator.fields(node, words, &title);
            fields.valid &= !twice;
            self.valid &= fields.valid;
            match words.name {
                "background" => {
                    self.scene.background = fields.rgb("colour").unwrap_or_default();
                    self.doubt_light(&fields, "colour");
                }
                "ambient" => {
                    self.scene.ambient = self.not_negative(&fields, "colour");
                    self.doubt_light(&fields, "colour");
                }
                "film" => {
                    self.film(&fields);
                    film_fields = Some(fields);
                }
                "integrator" => self.integrator(&fields),
                _ => {
                    let index = self.scene.views.iter().position(|view| view.name == name).unwrap_or_else(|| {
                        let view = View {
                            name: name.to_owned(),
                            intrinsics: Intrinsics::default(),
                            extrinsics: Extrinsics::default(),
                            motion: Vec::new(),
                        };
                        self.scene.views.push(view);
                        self.scene.views.len() - 1
                    });
                    let lens = if fields.has("lens") { self.lens(&fields) } else { None };
                    change_view(&mut self.scene.views[index], &fields);
                    let from = self.scene.views[index].extrinsics;
                    let motion = if fields.has("motion") { self.camera_motion(&fields, from) } else { None };
                    let motion = motion.or_else(|| keyed_motion(&self.scene.views[index], &fields));
                    let view = &mut self.scene.views[index];
                    set(&mut view.intrinsics.lens, lens.map(Some));
                    set(&mut view.motion, motion);
                    if index < last.len() { last[index] = fields } else { last.push(fields) }
                }
            }
        }
        self.keep_rolls();
        self.check_views(&last, film_fields.as_ref());
    }

    fn not_negative(&mut self, fields: &Fields, word: &str) -> canaletto::math::Rgb {
        let value = fields.rgb(word).unwrap_or_default();
        if value.to_array().iter().any(|v| *v < 0.0) {
            self.validator.report.error(fields.span(word), format!("{} must not be negative", fields.node.name));
            self.valid = false;
        }
        value
    }

    fn integrator(&mut self, fields: &Fields) {
        let Some(settings) = self.scene.integrator.whitted_mut() else { return };
        set(&mut settings.max_depth, fields.count("max-depth"));
        set(&mut settings.min_weight, fields.real("min-weight"));
        set(&mut settings.shadows, fields.flag("shadows"));
        set(&mut settings.stage, fields.named("stage"));
        if settings.max_depth == 0 {
            let problem = "is 0; the eye's rays have depth 1, so it must be at least that";
            self.out_of_range(fields, &OutOfRange::new("max-depth", problem));
        } else if settings.max_depth > WhittedSettings::MAX_DEPTH {
            let (depth, most) = (settings.max_depth, WhittedSettings::MAX_DEPTH);
            self.out_of_range(fields, &OutOfRange::new("max-depth", format!("is {depth}; it must be at most {most}")));
        } else if settings.min_weight < 0.0 {
            self.out_of_range(fields, &OutOfRange::new("min-weight", "must be 0 or more"));
        }
    }

    fn film(&mut self, fields: &Fields) {
        let mut film = self.scene.film;
        set(&mut film.tone, fields.named("tone"));
        set(&mut film.transfer, fields.named("transfer"));
        set(&mut film.crop, fields.counts("crop").map(Some));
        set(&mut film.sampling, self.sampling(fields));
        set(&mut film.sampler, fields.named("sampler"));
        set(&mut film.filter, self.filter(fields));
        self.scene.film = film;
    }

    fn sampling(&mut self, film: &Fields) -> Option<Sampling> {
        if let Some(samples) = film.count("samples") {
            if film.has("sample") {
                let message = Message::error(film.span("samples"), "film has either sample or samples");
                self.validator.report.push(
                    message
                        .help("sample says where on a grid rays go; samples how many go where the sampler puts them"),
                );
                self.valid = false;
            }
            if !(1..=Sampling::MAX_SAMPLES).contains(&samples) {
                let message = format!("samples is {samples}; it must be between 1 and {}", Sampling::MAX_SAMPLES);
                self.validator.report.error(film.span("samples"), message);
                self.valid = false;
            }
            return Some(Sampling::Sampled(samples));
        }
        let inner = match film.raw("sample")?.node {
            Some(node) => {
                let inner = self.validator.fields(node, &schema::SAMPLE, "sample");
                self.valid &= inner.valid;
                Some(inner)
            }
            None => None,
        };
        let inner = inner.as_ref();
        let pattern: SamplePattern = match inner {
            Some(inner) => inner.named("place")?,
            None => film.named("sample")?,
        };
        let n = inner.and_then(|f| f.count("n")).unwrap_or(SamplePattern::DEFAULT_GRID);
        let threshold = inner.and_then(|f| f.real("threshold")).unwrap_or(SamplePattern::DEFAULT_THRESHOLD);
        let single = matches!(pattern, SamplePattern::Corner | SamplePattern::Center);
        let adaptive = pattern == SamplePattern::Adaptive;
        for (word, foreign) in [("n", single), ("threshold", !adaptive)] {
            if let Some(inner) = inner.filter(|inner| foreign && inner.has(word)) {
                self.validator.report.error(inner.span(word), format!("\"{}\" has no {word}", pattern.name()));
                self.valid = false;
            }
        }
        let least = if adaptive { 2 } else { 1 };
        if !(least..=Sampling::MAX_GRID).contains(&n) {
            let span = inner.map_or(film.node.name_span, |f| f.span("n"));
            let message = format!("n is {n}; it must be between {least} and {}", Sampling::MAX_GRID);
            self.validator.report.error(span, message);
            self.valid = false;
        }
        if !(0.0..=1.0).contains(&threshold) {
            let span = inner.map_or(film.node.name_span, |f| f.span("threshold"));
            self.validator.report.error(span, format!("threshold is {threshold}; it must be between 0 and 1"));
            self.valid = false;
        }
        Some(match pattern {
            SamplePattern::Corner => Sampling::Corner,
            SamplePattern::Center => Sampling::Center,
            SamplePattern::Regular => Sampling::Regular(n),
            SamplePattern::Jittered => Sampling::Jittered(n),
            SamplePattern::Adaptive => Sampling::Adaptive { n, threshold },
        })
    }

    fn filter(&mut self, film: &Fields) -> Option<Filter> {
        let inner = match film.raw("filter")?.node {
            Some(node) => {
                let inner = self.validator.fields(node, &schema::FILTER, "filter");
                self.valid &= inner.valid;
                Some(inner)
            }
            None => None,
        };
        let mut filter: Filter = match &inner {
            Some(inner) => inner.named("kind")?,
            None => film.named("filter")?,
        };
        let Some(inner) = inner.filter(|inner| inner.has("sigma")) else { return Some(filter) };
        let Filter::Gaussian { sigma } = &mut filter else {
            self.validator.report.error(inner.span("sigma"), format!("\"{}\" has no sigma", filter.name()));
            self.valid = false;
            return Some(filter);
        };
        *sigma = inner.real("sigma").unwrap_or(*sigma);
        if !(*sigma > 0.0 && *sigma <= 4.0) {
            let message = format!("sigma is {sigma}; it must be more than 0 and at most 4 pixels");
            self.validator.report.error(inner.span("sigma"), message);
            self.valid = false;
        }
        Some(filter)
    }

    /// Validates the cameras as merged from all files, and the crop window in them.
    fn check_views(&mut self, last: &[Fields], film: Option<&Fields>) {
        let mut outside = None;
        let mut inside = false;
        for (index, fields) in last.iter().enumerate() {
            match Camera::of(&self.scene.views[index]) {
                Err(problem) if fields.valid => {
                    self.validator.report.error(fields.span(problem.field()), problem.to_string());
                    self.valid = false;
                }
                Err(_) => {}
                Ok(camera) => {
                    let film = FilmSettings { crop: self.scene.film.crop, ..FilmSettings::default() };
                    match Job::new(camera, film, self.scene.integrator).check() {
                        Ok(()) => inside = true,
                        Err(problem) => outside = Some(problem.to_string()),
                    }
                }
            }
        }
        // With several cameras, the window must fit only one.
        if let (Some(problem), Some(film), false) = (outside, film, inside) {
            self.validator.report.error(film.span("crop"), problem);
            self.valid = false;
        }
    }

    /// Reports a value that is out of range, at its field or else at the node's name.
    pub(super) fn out_of_range(&mut self, fields: &Fields, problem: &OutOfRange) {
        let span = problem.field.map_or(fields.node.name_span, |field| fields.span(field));
        self.validator.report.error(span, problem.to_string());
        self.valid = false;
    }
}

/// The places of the camera while the shutter is open, if keys in this node or an earlier one move it.
fn keyed_motion(view: &View, fields: &Fields) -> Option<Vec<Extrinsics>> {
    let moves = |word| fields.raw(word).is_some_and(Entry::moves);
    let mut motion = match view.motion.len() {
        POSES => view.motion.clone(),
        _ if ["eye", "center", "up"].into_iter().any(moves) => vec![view.extrinsics; POSES],
        _ => return None,
    };
    for (moment, place) in motion.iter_mut().enumerate() {
        let at = |word| fields.raw(word).and_then(|got| got.at(moment).numbers()).map(DVec3::from_array);
        set(&mut place.eye, at("eye"));
        set(&mut place.center, at("center"));
        set(&mut place.up, at("up"));
    }
    Some(motion)
}

fn change_view(view: &mut View, fields: &Fields) {
    let (i, e) = (&mut view.intrinsics, &mut view.extrinsics);
    set(&mut e.eye, fields.dvec("eye"));
    set(&mut e.center, fields.dvec("center"));
    set(&mut e.up, fields.dvec("up"));
    set(&mut i.fovy, fields.number("fovy"));
    set(&mut i.near, fields.number("near"));
    set(&mut i.far, fields.number("far"));
    set(&mut i.shift, fields.numbers("shift"));
    set(&mut i.shutter, fields.numbers("shutter"));
    if let Some([width, height]) = fields.counts("size") {
        (i.width, i.height) = (width, height);
    }
}

fn set<T>(place: &mut T, value: Option<T>) {
    if let Some(value) = value {
        *place = value;
    }
}
