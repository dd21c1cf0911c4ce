//! The work of `render`, derived from its flags before anything is rendered.

use super::{Layers, RenderFlags, stem};
use crate::backdrop::{Backdrop, BackdropFlag, BackgroundFlag, Finish};
use crate::exit::Exit;
use crate::failure::Failure;
use crate::frames::{Frames, FramesFlag};
use crate::output::{Output, OutputFlags};
use crate::progress::Style;
use crate::source::Reader;
use canaletto::Named;
use canaletto::integrator::layers_of;
use canaletto::render::Aov;
use canaletto::world::World;
use canaletto_io::movie::Rate;
use std::path::{Path, PathBuf};

/// The work of `render`, derived from all flags.
pub(crate) struct Plan {
    pub output: Output,
    pub frames: Frames,
    /// Whether the user gave --frames.
    pub numbered: bool,
    pub rate: Rate,
    pub aovs: Vec<Aov>,
    pub style: Style,
    /// Where pictures in the making are written.
    pub preview: Option<Output>,
    /// What pictures are laid over.
    pub backdrop: Option<Backdrop>,
}

impl Plan {
    pub(super) fn new(flags: &RenderFlags, style: Style, reader: &mut Reader) -> Result<Plan, Failure> {
        let many = match flags.frames {
            Some(FramesFlag::These(frames)) => frames.count() > 1,
            Some(FramesFlag::All) => true,
            None => false,
        };
        let output = Output::new(&flags.output, &stem(&flags.source.scene), flags.frames.is_some(), many)?;
        flags.parts.check(flags.frames.is_some())?;
        let frames = flags.parts.frames(frames_of(flags, &output, reader)?)?;
        let mut aovs: Vec<Aov> = Vec::new();
        for layers in &flags.aov {
            let named = match layers {
                // Layers for denoising take passes of their own, and are asked for by name.
                Layers::All => {
                    let integrator = match flags.picture.integrator {
                        Some(integrator) => integrator,
                        None => reader.at(frames.first)?.scene.integrator,
                    };
                    let is_progressive = flags.picture.progressive || flags.passes.given().is_some();
                    let all = layers_of(&integrator, is_progressive).into_iter();
                    all.filter(|aov| !aov.is_of_denoising()).collect()
                }
                Layers::One(aov) => vec![*aov],
            };
            for aov in named {
                if !aovs.contains(&aov) {
                    aovs.push(aov);
                }
            }
        }
        if output.is_stdout() && output.format.picture().is_some() && !output.format.has_layers() && !aovs.is_empty() {
            let name = output.format.short_name();
            let failure = Failure::usage(format!("--aov with {name} writes several files, but --output - takes one"));
            return Err(failure.help("--format exr holds all layers in one file"));
        }
        if output.format.film().is_some() && !aovs.is_empty() {
            return Err(Failure::usage(format!("--aov: {} has no layers", output.format))
                .help("render numbered pictures, such as --output shot.####.exr"));
        }
        let preview = match &flags.preview {
            Some(own) => Some(preview(&flags.output, own.as_deref(), &output, frames)?),
            None => None,
        };
        if let Some(denoiser) = flags.denoiser() {
            denoiser.check()?;
        } else if aovs.contains(&Aov::Noisy) {
            return Err(Failure::usage("--aov noisy: without --denoise the picture itself is the noisy one"));
        }
        let has_samples = output.format.has_layers() && output.settings.bits != Some(16);
        if flags.parts.is_of_picture() {
            flags.check_part()?;
        }
        if flags.parts.is_of_picture() && (!has_samples || flags.frames.is_some() || output.is_stdout()) {
            return Err(Failure::usage("--part: a part is one EXR of 32 bits")
                .help("such as -o part-1.exr; --split frames gives each part some frames"));
        }
        if flags.parts.part.is_some() && output.format.film().is_some() {
            return Err(Failure::usage("--part: a film in one file has no parts")
                .help("render numbered pictures, such as -o shot.####.png, and make the film by canaletto merge"));
        }
        let rate = Rate::new(flags.fps.unwrap_or(reader.timeline().fps));
        let backdrop = flags.picture.background.as_ref().and_then(BackgroundFlag::backdrop);
        let backdrop = backdrop.map(BackdropFlag::load).transpose()?;
        Ok(Plan { output, frames, numbered: flags.frames.is_some(), rate, aovs, style, preview, backdrop })
    }

    /// What becomes of a picture of a world before it is written to an output.
    pub(super) fn finish<'a>(&'a self, output: &Output, world: &'a World) -> Finish<'a> {
        let is_linear = output.format.capabilities().is_some_and(|can| can.linear);
        Finish { world, backdrop: self.backdrop.as_ref(), is_linear }
    }

    /// Whether the pictures are frames: numbered pictures, or those of a film.
    pub(super) fn has_frames(&self) -> bool {
        self.numbered || self.output.format.film().is_some()
    }

    /// The files of a frame, the picture first.
    pub(crate) fn files(&self, frame: u32) -> Vec<PathBuf> {
        let mut files = vec![self.output.path(frame)];
        if !self.output.format.has_layers() {
            files.extend(self.aovs.iter().map(|aov| self.output.layer_path(frame, aov.name())));
        }
        files
    }

    /// The files of all frames. A film appears once.
    pub(super) fn all_files(&self) -> impl Iterator<Item = PathBuf> {
        let one = self.output.format.film().is_some();
        self.frames.iter().take(if one { 1 } else { usize::MAX }).flat_map(|frame| self.files(frame))
    }
}

/// The output of pictures in the making: that of the picture, which finer ones replace, or a file of its own.
fn preview(flags: &OutputFlags, own: Option<&Path>, output: &Output, frames: Frames) -> Result<Output, Failure> {
    if let Some(own) = own {
        let preview = Output::new(&flags.for_file(own), "", false, false)?;
        if preview.format.film().is_some() || preview.is_stdout() {
            return Err(Failure::usage(format!("--preview={}: it takes a picture's file", own.display()))
                .help("such as --preview=live.png"));
        }
        return Ok(preview);
    }
    let why = match output.format.film() {
        Some(_) => format!("{} holds whole frames only", output.format),
        None if output.is_stdout() => "--output - takes one picture".to_owned(),
        None if frames.count() > 1 => "it is for one frame, but there are several".to_owned(),
        None => return Ok(output.clone()),
    };
    Err(Failure::usage(format!("--preview: {why}")).help("render one picture into a file, such as --output shot.png"))
}

/// The frames to render.
pub(crate) fn frames_of(flags: &RenderFlags, output: &Output, reader: &Reader) -> Result<Frames, Failure> {
    let own = || {
        let frames = reader.timeline().frames.map(|[first, last]| Frames::new(first, last, 1));
        frames.transpose().map_err(|e| Failure::new(Exit::Scene, format!("{}: animation: {e}", reader.name)))
    };
    let none = |what: &str| {
        Failure::usage(format!("{what}, but {} doesn't say which", reader.name))
            .help("give --frames 1-100, or write animation { frames 1 100 } in the scene")
    };
    match flags.frames {
        Some(FramesFlag::These(frames)) => Ok(frames),
        Some(FramesFlag::All) => own()?.ok_or_else(|| none("--frames all means the frames of the scene's animation")),
        None if output.format.film().is_some() => own()?.ok_or_else(|| none("a film needs its frames")),
        None => Ok(Frames::one(reader.first_frame())),
    }
}
