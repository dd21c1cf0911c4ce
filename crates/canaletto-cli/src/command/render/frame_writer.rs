//! The files of rendered frames: a picture with its layers, the part of an interrupted picture, or a film.

use super::Plan;
use super::film_frames::FilmFrames;
use crate::complete::{FINGERPRINT, texts};
use crate::failure::Failure;
use crate::interrupt;
use crate::layers;
use crate::output::{OutputFlags, film_failed, unfit, window};
use crate::partial::{UNFINISHED, free_partial_path, remove_part, with_samples};
use crate::preview::{Preview, PreviewFile, enlarged};
use crate::sample_file::SCENE_DIGEST;
use crate::told_developing::METERED_EXPOSURE;
use canaletto::Named;
use canaletto::render::{Aov, Job, Rendering};
use canaletto::scene::Developing;
use canaletto::world::World;
use canaletto_io::movie::{Movie, MovieSettings};
use canaletto_io::picture::{Compression, EncodeSettings, Image, PictureFormat, Rendered};
use std::path::{Path, PathBuf};

/// Writes the frames of a plan.
pub(crate) struct FrameWriter<'a> {
    plan: &'a Plan,
    /// The film, once it has a frame.
    film: Option<Movie>,
    /// Where the film's finished frames are kept, if files can lie beside it.
    film_frames: Option<FilmFrames>,
}

/// A rendered frame with what its files need.
#[derive(Clone, Copy)]
pub(crate) struct FramePicture<'a> {
    pub world: &'a World,
    pub job: &'a Job,
    pub rendering: &'a Rendering,
    /// How the picture is developed.
    pub developing: Developing,
    /// The text entries that all files of the series share.
    pub texts: &'a [(String, String)],
}

impl<'a> FrameWriter<'a> {
    /// A writer that has written nothing.
    pub(crate) fn new(plan: &'a Plan, flags: &OutputFlags) -> Result<FrameWriter<'a>, Failure> {
        let film = plan.output.path(0);
        let has_frames = plan.output.format.film().is_some() && plan.output.has_place_beside(&film);
        let film_frames = has_frames.then(|| FilmFrames::beside(&film, flags)).transpose()?;
        Ok(FrameWriter { plan, film: None, film_frames })
    }

    /// Adds a frame to the film that was finished before; false if there is none. `texts` are those of the frames.
    pub(crate) fn add_kept(&mut self, job: &Job, own: &[(String, String)]) -> Result<bool, Failure> {
        let kept = self.film_frames.as_ref().and_then(|frames| frames.find(job, &texts(own, job, None)));
        let Some((image, metadata)) = kept else { return Ok(false) };
        let metered = metadata.into_iter().filter(|(key, _)| key == METERED_EXPOSURE);
        self.add_to_film(&image, job, own.iter().cloned().chain(metered).collect())?;
        Ok(true)
    }

    /// Keeps a frame of a film, so that it isn't rendered again if the film ends early. Returns the folder.
    pub(crate) fn keep(&self, frame: &FramePicture<'_>) -> Result<Option<&Path>, Failure> {
        let Some(frames) = &self.film_frames else { return Ok(None) };
        let rendered = Rendered { picture: &frame.rendering.picture, developing: frame.developing };
        let format = PictureFormat::Png;
        frames.keep(frame.job.frame, |output| {
            let bytes = format.encode(&rendered, &output.settings, &frame.texts(None), &|| true);
            bytes.map_err(|e| unfit(&e))
        })?;
        Ok(Some(frames.folder()))
    }

    /// Writes a picture and its layers, or adds it to the film; returns the files' names. None if a signal stops it: no
    /// file has its name then.
    pub(crate) fn write(&mut self, frame: &FramePicture<'_>) -> Result<Option<Vec<String>>, Failure> {
        let (plan, files) = (self.plan, self.plan.files(frame.job.frame));
        if interrupt::stops() {
            return Ok(None);
        }
        if plan.output.format.film().is_some() {
            let image = layers::developed(&frame.rendering.picture, &frame.developing);
            self.add_to_film(&image, frame.job, frame.texts.to_vec())?;
        } else {
            let mut written = Vec::new();
            self.encode(frame, |index, bytes| {
                if !interrupt::stops() {
                    written.extend(plan.output.begin(&files[index], bytes)?);
                }
                Ok(())
            })?;
            if interrupt::stops() {
                return Ok(None);
            }
            written.into_iter().try_for_each(|(path, file)| plan.output.commit(path, file))?;
        }
        Ok(Some(files.iter().map(|file| file.display().to_string()).collect()))
    }

    /// Writes a coarse picture in the place of the whole one, or in the file of previews; returns its name.
    pub(crate) fn write_preview(&self, frame: &FramePicture<'_>, preview: &Preview) -> Result<String, Failure> {
        let (job, output) = (frame.job, self.plan.preview.as_ref().unwrap_or(&self.plan.output));
        let [_, _, width, height] = job.window();
        let picture = enlarged(&frame.rendering.picture, [width, height]);
        let block = preview.block;
        let finish = self.plan.finish(output, frame.world);
        let file = PreviewFile { output, job, texts: frame.texts, window: window(job), finish };
        file.write_as(&picture, format!("a preview with one ray for {block} x {block} pixels"))?;
        Ok(output.path(job.frame).display().to_string())
    }

    /// Writes a partial picture and its layers beside their files; returns the names.
    pub(crate) fn write_part(&self, frame: &FramePicture<'_>) -> Result<Vec<String>, Failure> {
        let (plan, files) = (self.plan, self.plan.files(frame.job.frame));
        let mut names = Vec::new();
        if plan.output.has_place_beside(&files[0]) {
            interrupt::Rendering::saves();
            let picture = &frame.rendering.picture;
            if let Some(format) = plan.output.format.picture().filter(|format| format.has_rows(picture)) {
                names.push(self.write_rows(format, frame, &files[0], &self.settings(frame))?);
            }
        }
        if names.is_empty() {
            self.encode(frame, |index, bytes| {
                names.push(plan.output.write_part(&files[index], bytes)?.display().to_string());
                Ok(())
            })?;
        }
        Ok(names)
    }

    /// Writes the samples of a partial picture beside its file, for formats that hold no samples; returns the name.
    pub(crate) fn write_samples(&self, frame: &FramePicture<'_>) -> Result<String, Failure> {
        interrupt::Rendering::saves();
        let file = with_samples(&self.plan.files(frame.job.frame)[0]);
        let settings = EncodeSettings { bits: None, ..self.settings(frame) };
        self.write_rows(PictureFormat::Exr, frame, &file, &settings)
    }

    /// The folder of the film's frames, if some are kept.
    pub(crate) fn kept_frames(&self) -> Option<PathBuf> {
        self.film_frames.as_ref().map(|frames| frames.folder().to_owned()).filter(|folder| folder.is_dir())
    }

    /// Gives the film its name, if there is one.
    pub(crate) fn finish(self) -> Result<(), Failure> {
        if let Some(film) = self.film {
            film.finish().map_err(|e| film_failed(self.plan.output.format, e))?;
            interrupt::remove_on_leaving(None);
            remove_part(&self.plan.output.path(0));
            if let Some(frames) = &self.film_frames {
                frames.remove(self.plan.frames.iter());
            }
        }
        Ok(())
    }

    /// Saves a partial film of the finished frames beside the film's file; returns its path.
    pub(crate) fn finish_part(self) -> Result<Option<String>, Failure> {
        let (plan, Some(film)) = (self.plan, self.film) else { return Ok(None) };
        let format = plan.output.format;
        let path = plan.output.path(0);
        let beside = plan.output.has_place_beside(&path);
        let place = if beside { free_partial_path(&path) } else { path };
        // The program doesn't wait for ffmpeg, which may take long.
        if beside && format.film().is_some_and(|film| !film.needs_ffmpeg()) {
            interrupt::Rendering::saves();
        }
        let frames = film.finish_part(&place).map_err(|e| film_failed(format, e))?;
        interrupt::remove_on_leaving(None);
        let name = if place == Path::new("-") { "the standard output".to_owned() } else { place.display().to_string() };
        Ok((frames > 0).then_some(name))
    }

    /// Writes a partial picture with its layers beside its file, row by row; returns its name.
    fn write_rows(
        &self,
        format: PictureFormat,
        frame: &FramePicture<'_>,
        file: &Path,
        settings: &EncodeSettings,
    ) -> Result<String, Failure> {
        let rendered = Rendered { picture: &frame.rendering.picture, developing: frame.developing };
        let texts = frame.texts(None);
        let place = self.plan.output.write_part_with(file, |out| {
            format.write_rows(&rendered, settings, &texts, out, &interrupt::has_time_to_save)
        })?;
        Ok(place.display().to_string())
    }

    /// How a picture is written. A partial picture must be written in the time that a signal leaves.
    fn settings(&self, frame: &FramePicture<'_>) -> EncodeSettings {
        let settings = self.plan.output.settings;
        let compression = if frame.rendering.complete { settings.compression } else { Compression::Fast };
        EncodeSettings { compression, window: Some(window(frame.job)), ..settings }
    }

    /// Calls `write` with the bytes of each file of a picture: the picture itself, then layers that have files of their
    /// own.
    fn encode(
        &self,
        frame: &FramePicture<'_>,
        mut write: impl FnMut(usize, &[u8]) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        let (rendering, job, output) = (frame.rendering, frame.job, self.plan.output.format);
        let (picture, developing) = (&rendering.picture, frame.developing);
        let Some(format) = output.picture() else { return Ok(()) };
        let goes_on = || if rendering.complete { !interrupt::stops() } else { interrupt::has_time_to_save() };
        let settings = self.settings(frame);
        let bytes = format.encode(&Rendered { picture, developing }, &settings, &frame.texts(None), &goes_on);
        write(0, &bytes.map_err(|e| unfit(&e))?)?;
        if output.has_layers() {
            return Ok(());
        }
        for (index, (layer, aov)) in picture.layers.iter().zip(&job.aovs).enumerate() {
            if !goes_on() {
                break;
            }
            let (image, transfer) = layers::to_image(layer, picture, &job.developing(), &frame.world.bounds());
            let mut texts = frame.texts(Some(*aov));
            texts.push(("transfer".into(), transfer.name().into()));
            let bytes = format.encode_image(&image, transfer, &settings, &texts).map_err(|e| unfit(&e))?;
            write(index + 1, &bytes)?;
        }
        Ok(())
    }

    fn add_to_film(&mut self, image: &Image, job: &Job, mut metadata: Vec<(String, String)>) -> Result<(), Failure> {
        let (output, format) = (&self.plan.output, self.plan.output.format);
        let failed = |error| film_failed(format, error);
        let mut film = match (self.film.take(), format.film()) {
            (Some(film), _) => film,
            (None, None) => return Ok(()),
            (None, Some(kind)) => {
                metadata.retain(|(key, _)| ![FINGERPRINT, SCENE_DIGEST].contains(&key.as_str()));
                metadata.push(("frames".into(), self.plan.frames.to_string()));
                let settings = MovieSettings {
                    width: image.width,
                    height: image.height,
                    rate: self.plan.rate,
                    frames: self.plan.frames.count() as u32,
                    transfer: job.film.transfer,
                    alpha: job.film.alpha,
                    compression: output.settings.compression,
                    metadata,
                };
                let film = Movie::begin(kind, &output.path(0), output.options(), settings).map_err(failed)?;
                interrupt::remove_on_leaving(film.temporary());
                film
            }
        };
        // A frame that is being added isn't lost by a signal, nor are those before it.
        if format.film().is_some_and(|film| !film.needs_ffmpeg()) {
            interrupt::Rendering::saves();
        }
        film.add(image).map_err(failed)?;
        self.film = Some(film);
        Ok(())
    }
}

impl FramePicture<'_> {
    /// The text entries of the picture's file, or of a layer's file.
    fn texts(&self, layer: Option<Aov>) -> Vec<(String, String)> {
        let mut texts = texts(self.texts, self.job, layer);
        if !self.rendering.complete {
            let [_, _, width, height] = self.job.window();
            let lacks = match self.rendering.pixels_done < u64::from(width) * u64::from(height) {
                true => "black parts aren't rendered",
                false => "samples, denoising or layers may be missing",
            };
            texts.push((UNFINISHED.into(), format!("interrupted; {lacks}")));
        }
        texts
    }
}
