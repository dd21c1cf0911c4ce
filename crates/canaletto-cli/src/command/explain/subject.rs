//! What is explained: a scene that is ready, and the tree of a pixel or of a ray in it.

use super::ExplainFlags;
use super::data_url::data_url;
use crate::command_files::CommandFiles;
use crate::exit::Exit;
use crate::failure::{Failure, print_diagnostics};
use crate::metering::metered;
use crate::settings::Settings;
use crate::solutions::{SolutionFlags, Solutions, fingerprint};
use crate::source::{Reader, build, seen_through};
use canaletto::explain::{
    ExplainError, Explainer, OutsideView, PageStyle, PathTree, PixelTree, RayTree, TextStyle, session_of_pixel,
};
use canaletto::integrator::radiosity::RadiositySolution;
use canaletto::math::Rgb;
use canaletto::render::{Job, Preparation, Session};
use canaletto::scene::{Extrinsics, Intrinsics, View};
use canaletto::world::World;
use serde::Serialize;
use std::sync::Arc;

/// What is explained.
#[derive(Serialize)]
#[serde(untagged)]
pub(super) enum Explained {
    Pixel(Box<PixelTree>),
    Ray(Box<RayTree>),
    Paths(Box<ChosenPath>),
}

/// The paths of a pixel, and the one that is shown.
#[derive(Serialize)]
pub(super) struct ChosenPath {
    #[serde(flatten)]
    pub(super) tree: PathTree,
    /// The index of its sample, if the flags choose one.
    #[serde(skip)]
    chosen: Option<usize>,
}

impl Explained {
    pub(super) fn sum(&self) -> Rgb {
        match self {
            Explained::Pixel(tree) => tree.sum(),
            Explained::Ray(tree) => tree.ray.sum(),
            Explained::Paths(paths) => paths.tree.sum(),
        }
    }

    pub(super) fn svg(&self, levels: Option<u32>, outside: Option<(&OutsideView, &str)>) -> String {
        match self {
            Explained::Pixel(tree) => tree.svg(levels, outside),
            Explained::Ray(tree) => tree.svg(levels, outside),
            Explained::Paths(paths) => paths.tree.svg(paths.chosen, levels, outside).unwrap_or_default(),
        }
    }

    pub(super) fn html(&self, scene: &str, text: TextStyle, outside: Option<(&OutsideView, &str)>) -> String {
        let mut style = PageStyle::new(scene, text);
        style.outside = outside;
        match self {
            Explained::Pixel(tree) => tree.html(&style),
            Explained::Ray(tree) => tree.html(&style),
            Explained::Paths(paths) => paths.tree.html(paths.chosen, &style),
        }
    }

    pub(super) fn text(&self, style: &TextStyle) -> String {
        match self {
            Explained::Pixel(tree) => tree.text(style),
            Explained::Ray(tree) => tree.text(style),
            Explained::Paths(paths) => paths.tree.text(style, paths.chosen),
        }
    }
}

/// A view from outside, with its picture as a `data:` URL.
pub(super) struct Outside {
    view: Option<OutsideView>,
    image: String,
}

impl Outside {
    pub(super) fn given(&self) -> Option<(&OutsideView, &str)> {
        self.view.as_ref().map(|view| (view, self.image.as_str()))
    }
}

/// A scene whose pixels and rays can be explained.
pub(super) struct Subject<'a> {
    flags: &'a ExplainFlags,
    /// The scene's file as the user wrote it.
    pub(super) name: String,
    world: World,
    job: Job,
    solution: Option<Arc<RadiositySolution>>,
}

impl<'a> Subject<'a> {
    /// Reads and builds the scene.
    pub(super) fn open(flags: &'a ExplainFlags) -> Result<Subject<'a>, Failure> {
        let files = CommandFiles::default().reads("--solution", &flags.solution.solution);
        let files = files.writes("--svg", flags.svg.clone()).writes("--html", flags.html.clone());
        files.check()?;
        flags.folder.make_folders(&files)?;
        let mut reader =
            Reader::open(&flags.source, flags.picture.integrator_of(&flags.source), flags.picture.max_depth)?;
        if flags.ray.is_some() {
            reader.use_no_camera();
        }
        let mut source = reader.at_chosen(flags.picture.camera.as_deref(), flags.frame)?;
        print_diagnostics(&source.warnings, false);
        files.check_scene(&reader)?;
        if flags.ray.is_some() && source.scene.views.is_empty() {
            // A ray has no camera, but a job has one.
            source.scene.views.push(View {
                name: "none".into(),
                intrinsics: Intrinsics::default(),
                extrinsics: Extrinsics::default(),
                motion: Vec::new(),
            });
        }
        let settings = Settings::new(&source.name, &source.scene, &flags.picture)?;
        let solution = SolutionFlags::from(&flags.solution);
        solution.check_integrator(&source.name, &settings.job.integrator)?;
        let mut solutions = Solutions::new(&solution, false)?;
        let fingerprint = fingerprint(&source.scene, &settings.job).filter(|_| solution.given().is_some());
        let options = seen_through(&settings.camera, &source.scene, flags.source.build_options(0));
        let (world, _) = build(&source.name, source.scene, &options, None)?;
        let job = Job { frame: source.frame, ..settings.job };
        let given = match (&fingerprint, job.description().radiosity()) {
            (Some(fingerprint), Some(settings)) => {
                let found = solutions.solution(&source.name, &world, fingerprint, settings, &())?;
                Some(found.ok_or(Failure::Reported(Exit::Interrupted))?.0)
            }
            _ => None,
        };
        let picture = (&flags.source, &flags.picture);
        // A ray's light isn't developed.
        let job = match flags.ray {
            Some(_) => job,
            None => metered(&mut reader, picture, (&world, &job), given.as_ref())?,
        };
        Ok(Subject { flags, name: source.name, world, job, solution: given })
    }

    /// A session that is prepared for one pixel, or for a ray.
    fn session(&self, pixel: [u32; 2]) -> Result<Session<'_>, ExplainError> {
        let preparation = Preparation { solution: self.solution.as_ref(), keeps_links: true, ..Preparation::default() };
        session_of_pixel(&self.world, &self.job, pixel, preparation)
    }

    /// The scene from outside with a tree's rays.
    pub(super) fn outside(&self, tree: &Explained) -> Result<Outside, Failure> {
        let (Subject { world, job, .. }, levels) = (self, self.flags.levels);
        let view = match tree {
            Explained::Pixel(tree) => tree.outside(world, job, levels),
            Explained::Ray(tree) => Some(tree.outside(world, job, levels)),
            Explained::Paths(paths) => paths.tree.outside(world, job, paths.chosen, levels),
        };
        let image = view.as_ref().map_or(Ok(String::new()), |view| data_url(&view.picture))?;
        Ok(Outside { view, image })
    }

    /// The tree of the ray that the flags give, or else of the pixel. `flag` is where the pixel is from.
    pub(super) fn explained(&self, pixel: Option<[u32; 2]>, flag: &str, has_steps: bool) -> Result<Explained, Failure> {
        let traces_paths = self.job.description().traces_paths();
        self.refuse_flags_of_other_integrators(traces_paths)?;
        if let Some([ox, oy, oz, dx, dy, dz]) = self.flags.ray {
            let session = self.session([0, 0]);
            let explained =
                |session: Session| Explainer::new(&session).with_steps(has_steps).ray([ox, oy, oz], [dx, dy, dz]);
            let ray = session.and_then(explained).map_err(|e| Failure::usage(format!("--ray: {e}")))?;
            return Ok(Explained::Ray(Box::new(ray)));
        }
        let [x, y] = pixel.unwrap_or_default();
        let [_, height] = self.job.camera.size();
        // A row outside the picture is not mirrored, so that the message shows the user's own number.
        let row = if self.flags.y_up && y < height { height - 1 - y } else { y };
        let failure = |e: ExplainError| Failure::usage(format!("{flag}: {e}"));
        let session = self.session([x, row]).map_err(failure)?;
        let explainer = Explainer::new(&session).with_steps(has_steps);
        if !traces_paths {
            return Ok(Explained::Pixel(Box::new(explainer.pixel(x, row).map_err(failure)?)));
        }
        let tree = explainer.paths(x, row).map_err(failure)?;
        let chosen = match self.flags.sample {
            None if self.flags.brightest => tree.brightest(),
            None => None,
            Some(number) if number as usize <= tree.samples.len() => Some(number as usize - 1),
            Some(number) => {
                let count = tree.samples.len();
                return Err(Failure::usage(format!("--sample {number}: the pixel has {count} samples, from 1 on")));
            }
        };
        Ok(Explained::Paths(Box::new(ChosenPath { tree, chosen })))
    }

    /// Refuses flags that have no meaning for the job's integrator.
    fn refuse_flags_of_other_integrators(&self, traces_paths: bool) -> Result<(), Failure> {
        let ExplainFlags { sample, brightest, ray, steps, .. } = self.flags;
        let (given, needs) = if traces_paths {
            let given = [("--ray", ray.is_some()), ("--steps", *steps)];
            (given, "explains a tree of rays; add --integrator whitted")
        } else {
            let given = [("--sample", sample.is_some()), ("--brightest", *brightest)];
            (given, "chooses one of a pixel's paths; add --integrator path")
        };
        match given.iter().find(|(_, is_given)| *is_given) {
            Some((flag, _)) => Err(Failure::usage(format!("{flag} {needs}"))),
            None => Ok(()),
        }
    }
}
