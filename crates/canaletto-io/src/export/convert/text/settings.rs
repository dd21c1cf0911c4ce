//! Settings: cameras, film, integrator, colours and environment.

use super::Writer;
use super::line::{Line, flag, quoted};
use super::number::{color, double, doubles, fine_vector, single, singles, vector};
use super::transform;
use crate::import::DEFAULT_SAMPLING;
use canaletto::Named;
use canaletto::integrator::describe;
use canaletto::light::environment::{Environment, EnvironmentKind, Face, Gradient, Sky, Smoothing};
use canaletto::math::Rgb;
use canaletto::scene::{
    Aperture, CameraProjection, Exposure, Extrinsics, FilmSettings, Filter, Focus, Integrator, Intrinsics, Lens,
    PathSettings, RadiositySettings, SamplePattern, Sampling, ShadowMethod, Transfer, View, WhittedSettings,
    ZbufferSettings,
};

/// The name of a camera that has none.
const DEFAULT_CAMERA: &str = "camera";

/// A value unless it is the default.
fn unless<T: PartialEq>(value: T, default: T, text: impl FnOnce(T) -> String) -> Option<String> {
    (value != default).then(|| text(value))
}

fn word<T: Named + PartialEq>(value: T, default: T) -> Option<String> {
    unless(value, default, |value| quoted(value.name()))
}

fn whole(value: u32, default: u32) -> Option<String> {
    unless(value, default, |value| value.to_string())
}

impl Writer<'_> {
    /// The settings of the scene.
    pub(super) fn settings(&mut self) -> Vec<Line> {
        let scene = self.scene;
        let mut lines: Vec<Line> = Vec::new();
        for view in &scene.views {
            let line = self.camera(view);
            lines.push(line);
        }
        lines.extend(integrator(&scene.integrator));
        lines.extend(film(&scene.film, describe(&scene.integrator).default_sampling(DEFAULT_SAMPLING)));
        if scene.background != Rgb::BLACK {
            lines.push(Line::of("background", color(scene.background)));
        }
        if scene.ambient != Rgb::BLACK {
            lines.push(Line::of("ambient", color(scene.ambient)));
        }
        if let Some(environment) = &scene.environment {
            lines.extend(self.environment(environment));
        }
        lines
    }

    fn camera(&mut self, view: &View) -> Line {
        let View { name, intrinsics, extrinsics: Extrinsics { eye, center, up }, motion } = view;
        let Intrinsics { fovy, projection, width, height, near, far, shift, lens, shutter } = intrinsics;
        let default = Intrinsics::default();
        let head = if name == DEFAULT_CAMERA { Line::new("camera") } else { Line::named("camera", name) };
        let window = match projection {
            CameraProjection::Orthographic { height } => Line::of("orthographic", double(*height)),
            _ => Line::of("fovy", double(*fovy)),
        };
        let line = head
            .child(Line::of("eye", fine_vector(*eye)))
            .child(Line::of("center", fine_vector(*center)))
            .child_if("up", unless(*up, Extrinsics::default().up, fine_vector))
            .child(window)
            .child_if("near", near.map(double))
            .child_if("far", far.map(double))
            .child(Line::of("size", format!("{width} {height}")))
            .child_if("shift", unless(*shift, default.shift, |shift| doubles(&shift)))
            .child_if("shutter", unless(*shutter, default.shutter, |shutter| doubles(&shutter)))
            .children(lens.as_ref().map(lens_line));
        match motion.as_slice() {
            [] => line,
            [from, to] if *from == view.extrinsics => line.child(
                Line::new("motion")
                    .child_if("eye", unless(to.eye, from.eye, fine_vector))
                    .child_if("center", unless(to.center, from.center, fine_vector))
                    .child_if("up", unless(to.up, from.up, fine_vector)),
            ),
            _ => {
                self.lost.add("motion of cameras while the shutter is open", name);
                line
            }
        }
    }

    fn environment(&mut self, environment: &Environment) -> Option<Line> {
        let Environment { kind, rotation, intensity, ambient, visible } = environment;
        let head = Line::named("environment", environment.kind_name());
        let smoothed =
            |line: Line, smoothing: Smoothing| line.child_if("filter", word(smoothing, Smoothing::default()));
        let line = match kind {
            EnvironmentKind::Cube { faces, smoothing } => {
                let mut line = head;
                for (face, image) in Face::NAMES.iter().zip(faces) {
                    line = line.child(Line::named(face, &self.picture(*image)?));
                }
                smoothed(line, *smoothing)
            }
            EnvironmentKind::Cross { image, smoothing } | EnvironmentKind::LatLong { image, smoothing } => {
                smoothed(head.property("file", quoted(&self.picture(*image)?)), *smoothing)
            }
            EnvironmentKind::Gradient(Gradient { stops }) => {
                let numbers = stops.iter().flat_map(|(at, Rgb { r, g, b })| [*at, *r, *g, *b]);
                head.child(Line::of("stops", singles(&numbers.collect::<Vec<_>>())))
            }
            EnvironmentKind::Sky(Sky { sun, turbidity, ground, exposure, disk, light }) => {
                let d = Sky::default();
                head.child(Line::of("sun", vector(*sun)))
                    .child_if("turbidity", unless(*turbidity, d.turbidity, single))
                    .child_if("ground", unless(*ground, d.ground, color))
                    .child_if("exposure", unless(*exposure, d.exposure, single))
                    .child_if("disk", unless(*disk, d.disk, flag))
                    .child_if("light", unless(*light, d.light, flag))
            }
            _ => {
                self.lost.of_scene("the environment");
                return None;
            }
        };
        Some(
            line.children(transform::lines(rotation))
                .child_if("intensity", unless(*intensity, Rgb::WHITE, color))
                .child_if("ambient", unless(*ambient, false, flag))
                .child_if("visible", unless(*visible, true, flag)),
        )
    }
}

fn lens_line(lens: &Lens) -> Line {
    let Lens { aperture, focus, blades, rotation } = lens;
    let aperture = match aperture {
        Aperture::Number(number) => Line::of("f-number", double(*number)),
        Aperture::Radius(radius) => Line::of("radius", double(*radius)),
        _ => Line::of("radius", "0"),
    };
    let focus = match focus {
        Focus::Distance(distance) => Some(Line::of("focus", double(*distance))),
        Focus::Point(point) => Some(Line::of("focus-point", fine_vector(*point))),
        _ => None,
    };
    Line::new("lens")
        .child(aperture)
        .children(focus)
        .child_if("blades", whole(*blades, 0))
        .child_if("rotation", unless(*rotation, 0.0, double))
}

/// The film, unless it is the default one for the integrator.
fn film(film: &FilmSettings, usual: Sampling) -> Option<Line> {
    let FilmSettings { sampling, sampler, filter, exposure, tone, transfer, alpha, crop } = *film;
    let d = FilmSettings::default();
    let line = Line::new("film")
        .children((sampling != usual).then(|| samples(sampling)))
        .child_if("sampler", word(sampler, d.sampler))
        .children((filter != d.filter).then(|| filter_line(filter)))
        .child_if("exposure", exposure.map(exposure_text))
        .child_if("tone", tone.map(|tone| quoted(tone.name())))
        .child_if("transfer", word(transfer, Transfer::Srgb))
        .child_if("alpha", unless(alpha, false, flag))
        .child_if("crop", crop.map(|crop| crop.map(|side| side.to_string()).join(" ")));
    (!line.has_no_block()).then_some(line)
}

fn exposure_text(exposure: Exposure) -> String {
    match exposure {
        Exposure::Stops(stops) => single(stops),
        auto => quoted(&auto.to_string()),
    }
}

fn samples(sampling: Sampling) -> Line {
    let Some(pattern) = sampling.pattern() else { return Line::of("samples", sampling.count().to_string()) };
    let line = Line::named("sample", pattern.name());
    let grid = |n: u32| whole(n, SamplePattern::DEFAULT_GRID);
    match sampling {
        Sampling::Regular(n) | Sampling::Jittered(n) => line.property_if("n", grid(n)),
        Sampling::Adaptive { n, threshold } => line
            .property_if("n", grid(n))
            .property_if("threshold", unless(threshold, SamplePattern::DEFAULT_THRESHOLD, single)),
        Sampling::Corner | Sampling::Center | Sampling::Sampled(_) => line,
    }
}

fn filter_line(filter: Filter) -> Line {
    let line = Line::named("filter", filter.name());
    match filter {
        Filter::Gaussian { sigma } => line.property_if("sigma", unless(sigma, Filter::DEFAULT_SIGMA, single)),
        _ => line,
    }
}

/// The integrator, unless it is the default one.
fn integrator(integrator: &Integrator) -> Option<Line> {
    let line = Line::named("integrator", integrator.name());
    let line = match integrator {
        Integrator::Whitted(WhittedSettings { max_depth, min_weight, stage, shadows }) => {
            let d = WhittedSettings::DEFAULT;
            line.child_if("max-depth", whole(*max_depth, d.max_depth))
                .child_if("min-weight", unless(*min_weight, d.min_weight, single))
                .child_if("stage", word(*stage, d.stage))
                .child_if("shadows", unless(*shadows, d.shadows, flag))
        }
        Integrator::Zbuffer(ZbufferSettings { shading, shadows, shadow_map_size, multisampling, tolerance }) => {
            let d = ZbufferSettings::DEFAULT;
            line.child_if("shading", word(*shading, d.shading))
                .child_if("shadows", unless(*shadows, d.shadows, |shadows| flag(shadows != ShadowMethod::None)))
                .child_if("shadow-map-size", whole(*shadow_map_size, d.shadow_map_size))
                .child_if("multisampling", whole(*multisampling, d.multisampling))
                .child_if("tolerance", unless(*tolerance, d.tolerance, single))
        }
        Integrator::Radiosity(RadiositySettings { method, error, show, max_patches, light_samples }) => {
            let d = RadiositySettings::DEFAULT;
            line.child_if("method", word(*method, d.method))
                .child_if("error", unless(*error, d.error, single))
                .child_if("show", word(*show, d.show))
                .child_if("max-patches", whole(*max_patches, d.max_patches))
                .child_if("light-samples", whole(*light_samples, d.light_samples))
        }
        Integrator::Path(PathSettings { max_depth, roulette, guiding }) => {
            let d = PathSettings::DEFAULT;
            line.child_if("max-depth", whole(*max_depth, d.max_depth))
                .child_if("roulette", unless(*roulette, d.roulette, flag))
                .child_if("guiding", word(*guiding, d.guiding))
        }
        _ => line,
    };
    (*integrator != Integrator::default()).then_some(line)
}
