//! Checkpoints: the samples of a growing picture in a file beside it, while it is rendered. A render that ended at any
//! moment is taken up by the same command, and its bytes are those of one that wasn't ended.

use crate::exit::Exit;
use crate::failure::{Failure, print_diagnostics, reason};
use crate::interrupt;
use crate::output::{window, write_seekable, write_with};
use crate::partial::UNFINISHED;
use crate::passes::{TakesCheckpoints, time};
use crate::progress::{Style, emit};
use crate::sample_file::{SampleFile, sample_texts};
use canaletto::film::{Checkpoint, Pass};
use canaletto::render::Job;
use canaletto_io::diagnostic::Diagnostic;
use canaletto_io::picture::{Compression, EncodeSettings, PictureFormat, Rendered, WriteOptions};
use clap::Args;
use serde_json::json;
use std::ffi::OsString;
use std::fs::{self, File, TryLockError};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Flags about checkpoints.
#[derive(Args, Clone, Debug)]
pub(crate) struct CheckpointFlags {
    /// Keeps what a growing picture needs to be gone on with in this file, or in none [default: NAME.checkpoint.exr
    /// beside the picture, after a minute]
    ///
    /// The same command takes the picture up after any end, also by a loss of power, and the bytes are those of a
    /// render that wasn't ended. A finished picture removes the file. A checkpoint of another picture is never
    /// overwritten.
    #[arg(long, value_name = "FILE|off", help_heading = "Sampling")]
    pub checkpoint: Option<PathBuf>,

    /// Sets the time between two checkpoints [default: 30s, or more where they take more than a 200th of the time]
    #[arg(long, value_name = "TIME", value_parser = time, hide_short_help = true, help_heading = "Sampling")]
    pub checkpoint_every: Option<Duration>,
}

/// The time of rendering after which checkpoints are made without being asked for.
const BY_ITSELF_AFTER: Duration = Duration::from_secs(60);
/// The time between two checkpoints, and the least multiple of the time that one takes.
const EVERY: Duration = Duration::from_secs(30);
const LEAST_PAUSE: u32 = 200;
/// The keys of the texts of the pass in work: the numbers of samples before and after it, and its cells.
const PASS: &str = "pass";
const CELLS: &str = "pass-cells";
/// The key of the text of the seconds of rendering so far.
const SECONDS: &str = "seconds-so-far";

/// A lock on a checkpoint's file, which ends with the program. No two renders write one file.
#[derive(Debug)]
struct Lock {
    file: PathBuf,
    _open: File,
}

impl Lock {
    /// Locks a checkpoint's file by one beside it.
    fn of(checkpoint: &Path) -> Result<Lock, Failure> {
        let mut name = OsString::from(".");
        name.push(checkpoint.file_name().unwrap_or_default());
        name.push(".lock");
        let file = checkpoint.with_file_name(name);
        let failed = |why: &str| Failure::new(Exit::Failed, format!("checkpoint {}: {why}", checkpoint.display()));
        let open = File::options().create(true).truncate(false).write(true).open(&file);
        let open = open.map_err(|error| failed(&reason(&error)))?;
        match open.try_lock() {
            Ok(()) => Ok(Lock { file, _open: open }),
            Err(TryLockError::WouldBlock) => Err(failed("another render is at work on it")),
            // The file system has no locks.
            Err(TryLockError::Error(_)) => Ok(Lock { file, _open: open }),
        }
    }
}

impl Drop for Lock {
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.file);
    }
}

/// The file of a picture's checkpoints.
#[derive(Debug)]
pub(crate) struct CheckpointPlace {
    path: PathBuf,
    /// The time between two, if it was given.
    every: Option<Duration>,
    is_asked_for: bool,
    /// Whether frames one after the other have this file.
    is_of_frames: bool,
    lock: Mutex<Option<Lock>>,
}

/// A checkpoint that is taken up.
pub(crate) struct Found {
    pub checkpoint: Checkpoint,
    /// The time of rendering so far.
    pub spent: Duration,
}

impl CheckpointFlags {
    /// The file of the checkpoints of a picture; none if there are none. `picture` is the picture's own file, if a file
    /// can lie beside it. `is_film`: it is the film of many.
    pub(crate) fn place(&self, picture: Option<&Path>, is_film: bool) -> Option<CheckpointPlace> {
        let path = match &self.checkpoint {
            Some(off) if off == Path::new("off") => return None,
            Some(file) => file.clone(),
            None => beside(picture?, 1),
        };
        let (every, is_asked_for) = (self.checkpoint_every, self.checkpoint.is_some());
        let is_of_frames = is_asked_for || is_film;
        Some(CheckpointPlace { path, every, is_asked_for, is_of_frames, lock: Mutex::default() })
    }

    /// Whether checkpoints are made after so much time, if there are any.
    pub(crate) fn is_due(&self, elapsed: Duration) -> bool {
        match &self.checkpoint {
            Some(file) => file != Path::new("off"),
            None => elapsed >= self.checkpoint_every.unwrap_or(EVERY).max(BY_ITSELF_AFTER),
        }
    }

    /// The file that is asked for.
    pub(crate) fn file(&self) -> Option<PathBuf> {
        self.checkpoint.clone().filter(|file| file != Path::new("off"))
    }

    /// The files that are asked for: that of the samples, and that of what was prepared.
    pub(crate) fn files(&self) -> impl Iterator<Item = PathBuf> {
        self.file().into_iter().flat_map(|file| [file.with_extension("state"), file])
    }
}

/// The n-th name of a checkpoint beside a picture.
fn beside(picture: &Path, n: u32) -> PathBuf {
    let mut name = picture.file_stem().unwrap_or_default().to_owned();
    name.push(if n > 1 { format!(".checkpoint-{n}.exr") } else { ".checkpoint.exr".to_owned() });
    picture.with_file_name(name)
}

impl CheckpointPlace {
    /// The checkpoint of this picture in the file; none if there is no file. A file of another picture is an error
    /// where it was asked for. Otherwise there is a warning, and another name is taken.
    pub(crate) fn open(
        &mut self,
        (job, texts): (&Job, &[(String, String)]),
        picture: Option<&Path>,
        warn: &mut dyn FnMut(Diagnostic),
    ) -> Result<Option<Found>, Failure> {
        for n in 1.. {
            let is_there = self.path.symlink_metadata().is_ok();
            if is_there || self.is_asked_for {
                self.lock()?;
            }
            if !is_there {
                return Ok(None);
            }
            let found = SampleFile::open("checkpoint", &self.path).and_then(|file| {
                let of_file = file.text("frame").and_then(|frame| frame.parse().ok());
                let frame = of_file.filter(|_| self.is_of_frames).unwrap_or(job.frame);
                file.belongs_to(&Job { frame, ..job.clone() }, texts)?;
                // A frame before this one was finished, and its checkpoint is obsolete.
                if frame != job.frame {
                    return Ok(None);
                }
                let samples = file.samples(job)?;
                let pass = pass_of(&file).filter(|_| file.text("noise") == job.noise.map(|v| v.to_string()));
                let spent = file.text(SECONDS).and_then(|spent| spent.parse().ok());
                let spent = spent.and_then(|spent| Duration::try_from_secs_f64(spent).ok()).unwrap_or_default();
                Ok(Some(Found { checkpoint: Checkpoint { samples, pass }, spent }))
            });
            match found {
                Ok(found) => return Ok(found),
                Err(failure) if self.is_asked_for => {
                    return Err(failure.help("remove it, or give --checkpoint another file"));
                }
                Err(Failure::Message { message, .. }) => {
                    let Some(picture) = picture else { return Ok(None) };
                    *self.lock.get_mut().unwrap_or_else(PoisonError::into_inner) = None;
                    self.path = beside(picture, n + 1);
                    let kept = format!("it is kept; checkpoints of this picture go into {}", self.path.display());
                    warn(Diagnostic::warning("--checkpoint", message).help(kept));
                }
                Err(failure) => return Err(failure),
            }
        }
        Ok(None)
    }

    /// Locks the file for this render.
    fn lock(&self) -> Result<(), Failure> {
        let mut lock = self.lock.lock().unwrap_or_else(PoisonError::into_inner);
        if lock.is_none() {
            *lock = Some(Lock::of(&self.path)?);
        }
        Ok(())
    }

    /// Whether this render has the file.
    fn is_locked(&self) -> bool {
        self.lock.lock().unwrap_or_else(PoisonError::into_inner).is_some()
    }

    /// The file of what was prepared, which is made once.
    fn prepared_file(&self) -> PathBuf {
        self.path.with_extension("state")
    }

    /// The file's path.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }
}

fn pass_of(file: &SampleFile) -> Option<Pass> {
    let (counts, cells) = (file.text(PASS)?, file.text(CELLS)?);
    let ((begin, end), (count, bits)) = (counts.split_once(' ')?, cells.split_once(' ')?);
    let digit = |c: char| c.to_digit(16).map(|bits| [8, 4, 2, 1].map(|bit| bits & bit != 0));
    let mut needed = bits.chars().map(digit).collect::<Option<Vec<_>>>()?.concat();
    needed.truncate(count.parse().ok()?);
    Some(Pass { begin: begin.parse().ok()?, end: end.parse().ok()?, needed })
}

fn texts_of_pass(pass: &Pass) -> [(String, String); 2] {
    let digit = |cells: &[bool]| {
        let bits = cells.iter().zip([8, 4, 2, 1]).map(|(needed, bit)| u32::from(*needed) * bit).sum();
        char::from_digit(bits, 16).unwrap_or('0')
    };
    let cells: String = pass.needed.chunks(4).map(digit).collect();
    [
        (PASS.to_owned(), format!("{} {}", pass.begin, pass.end)),
        (CELLS.to_owned(), format!("{} {cells}", pass.needed.len())),
    ]
}

/// Writes checkpoints while a picture is rendered.
pub(crate) struct CheckpointWriter<'a> {
    place: &'a CheckpointPlace,
    job: &'a Job,
    /// The text entries of the file, with those of the scene's digest.
    texts: Vec<(String, String)>,
    style: Style,
    is_quiet: bool,
    /// When rendering began, and the time before the checkpoint that was taken up.
    start: Instant,
    spent_before: Duration,
    state: Mutex<WriterState>,
    /// What writes the file of what was prepared, until it is written.
    prepared: Mutex<Option<PreparedWriter<'a>>>,
}

/// Writes what an integrator prepared.
type PreparedWriter<'a> = Box<dyn Fn(&mut dyn Write) -> io::Result<()> + Send + 'a>;

struct WriterState {
    /// When the next checkpoint is due; none while one is made.
    due: Option<Instant>,
    /// Whether the file holds a checkpoint of this picture.
    is_written: bool,
}

impl<'a> CheckpointWriter<'a> {
    /// `found` is the checkpoint that the file holds already.
    pub(crate) fn new(
        place: &'a CheckpointPlace,
        job: &'a Job,
        texts: Vec<(String, String)>,
        (style, is_quiet): (Style, bool),
        found: Option<&Found>,
    ) -> CheckpointWriter<'a> {
        let is_there = found.is_some();
        let spent_before = found.map_or(Duration::ZERO, |found| found.spent);
        let every = place.every.unwrap_or(EVERY);
        let first = if place.is_asked_for || is_there { every } else { every.max(BY_ITSELF_AFTER) };
        let state = Mutex::new(WriterState { due: Some(Instant::now() + first), is_written: is_there });
        let (start, prepared) = (Instant::now(), Mutex::default());
        CheckpointWriter { place, job, texts, style, is_quiet, start, spent_before, state, prepared }
    }

    /// The file of what was prepared, beside the checkpoint.
    pub(crate) fn prepared_file(&self) -> PathBuf {
        self.place.prepared_file()
    }

    /// Keeps what was prepared, which `write` writes: at once if checkpoints are asked for or if it took long, else
    /// with the first checkpoint.
    pub(crate) fn keep_prepared(&self, write: impl Fn(&mut dyn Write) -> io::Result<()> + Send + 'a) {
        *self.prepared.lock().unwrap_or_else(PoisonError::into_inner) = Some(Box::new(write));
        if (self.place.is_asked_for || self.start.elapsed() >= BY_ITSELF_AFTER)
            && let Err(failure) = self.place.lock().and_then(|()| self.write_prepared())
        {
            self.warn(&failure, false);
        }
    }

    fn write_prepared(&self) -> Result<(), Failure> {
        let mut prepared = self.prepared.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(write) = &*prepared else { return Ok(()) };
        let options = WriteOptions { durable: true, ..WriteOptions::default() };
        write_with(&self.place.prepared_file(), options, |out| write(out))?;
        *prepared = None;
        Ok(())
    }

    /// Warns that something couldn't be written.
    fn warn(&self, failure: &Failure, has_checkpoint: bool) {
        if let Failure::Message { message, .. } = failure
            && !self.is_quiet
        {
            let kept = if has_checkpoint { "the last one is kept, and " } else { "" };
            let warning = Diagnostic::warning("--checkpoint", message.clone());
            let warning = warning.help(format!("{kept}the render goes on"));
            print_diagnostics(&warning.into(), self.style == Style::Json);
        }
    }

    /// Writes the last checkpoint of a render that ends early. Returns its file, if checkpoints were asked for or had
    /// begun.
    pub(crate) fn write_last(&self, checkpoint: &Checkpoint) -> Option<&Path> {
        let is_wanted = self.place.is_asked_for || self.state.lock().unwrap_or_else(PoisonError::into_inner).is_written;
        if is_wanted {
            interrupt::Rendering::saves();
            self.take(checkpoint);
        }
        self.state.lock().unwrap_or_else(PoisonError::into_inner).is_written.then_some(&self.place.path)
    }

    /// Removes the file of a finished picture.
    pub(crate) fn remove(&self) {
        if self.state.lock().unwrap_or_else(PoisonError::into_inner).is_written {
            let _ = fs::remove_file(&self.place.path);
        }
        if self.place.is_locked() {
            let _ = fs::remove_file(self.place.prepared_file());
        }
    }

    fn write_file(&self, checkpoint: &Checkpoint) -> Result<(), Failure> {
        let mut picture = checkpoint.samples.picture();
        picture.layers = checkpoint.samples.layers(&picture.pixels);
        picture.layers.extend(checkpoint.samples.half_layers());
        let mut texts = self.texts.clone();
        texts.extend(sample_texts(&checkpoint.samples));
        texts.extend(checkpoint.pass.iter().flat_map(texts_of_pass));
        let spent = self.spent_before + self.start.elapsed();
        texts.push((SECONDS.into(), format!("{:.3}", spent.as_secs_f64())));
        texts.push(("frame".into(), self.job.frame.to_string()));
        texts.push((UNFINISHED.into(), "a checkpoint; the command that made it goes on with it".into()));
        let settings = EncodeSettings {
            bits: None,
            compression: Compression::Fast,
            window: Some(window(self.job)),
            ..EncodeSettings::default()
        };
        let rendered = Rendered { picture: &picture, developing: self.job.developing() };
        // It has its name when the disk has its bytes.
        let options = WriteOptions { durable: true, ..WriteOptions::default() };
        write_seekable(&self.place.path, options, |out| {
            PictureFormat::Exr.write_rows(&rendered, &settings, &texts, out, &|| true)
        })
    }
}

impl TakesCheckpoints for CheckpointWriter<'_> {
    fn is_due(&self) -> bool {
        // Threads that don't get the lock go on rendering.
        let Ok(mut state) = self.state.try_lock() else { return false };
        // A request during a checkpoint is answered by the next one.
        let is_due = state.due.is_some_and(|due| due <= Instant::now() || interrupt::takes_checkpoint_request());
        if is_due {
            state.due = None;
        }
        is_due
    }

    /// Writes a checkpoint. Where it can't be written, the last one stays, and the render goes on.
    fn take(&self, checkpoint: &Checkpoint) {
        let start = Instant::now();
        let written = self.place.lock().and_then(|()| self.write_prepared()).and_then(|()| self.write_file(checkpoint));
        let pause = self.place.every.unwrap_or_else(|| EVERY.max(start.elapsed() * LEAST_PAUSE));
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        state.due = Some(Instant::now() + pause);
        match written {
            Ok(()) => {
                state.is_written = true;
                if self.style == Style::Json {
                    let samples = checkpoint.samples.counts().iter().min();
                    emit(&json!({ "event": "checkpoint", "file": self.place.path, "samples": samples }));
                }
            }
            Err(failure) => self.warn(&failure, state.is_written),
        }
    }
}
