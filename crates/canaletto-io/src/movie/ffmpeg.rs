//! MP4 and WebM through the program `ffmpeg`, if it is installed.
//!
//! The program is searched for in PATH when it is needed. It receives raw pixels through a pipe, and writes a temporary
//! file that is renamed after success. Its arguments are passed as a list without a shell. The file's name has the
//! prefix `file:`, so a dash or a colon in it has no meaning. Its error output is shown if it fails.

use super::{Area, FormatInfo, Frames, MovieError, MovieFormat, MovieSettings, Part};
use crate::picture::{AtomicFile, WriteOptions};
use std::ffi::OsString;
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::thread::{self, JoinHandle};
use std::{env, fs};

/// MP4 in the table of film formats.
pub(super) const MP4: FormatInfo = FormatInfo {
    names: ["MP4", "MP4"],
    extension: "mp4",
    summary: "A film as MP4 (H.264), made by the program ffmpeg",
    recognises: |start| start.get(4..8) == Some(b"ftyp"),
    compression: false,
    alpha: false,
    needs_ffmpeg: true,
};

/// WebM in the table of film formats.
pub(super) const WEBM: FormatInfo = FormatInfo {
    names: ["WebM", "WebM"],
    extension: "webm",
    summary: "A film as WebM (VP9), made by the program ffmpeg",
    recognises: |start| start.starts_with(b"\x1a\x45\xdf\xa3"),
    compression: false,
    alpha: false,
    needs_ffmpeg: true,
};

pub(super) struct Ffmpeg {
    file: AtomicFile,
    running: Running,
}

/// A process that is ended with this value.
struct Running {
    child: Child,
    pixels: Option<ChildStdin>,
    /// The thread that reads the error output.
    said: Option<JoinHandle<String>>,
}

/// The largest number of bytes of the error output that are kept.
const MAX_WORDS: u64 = 4096;

/// The path of `ffmpeg`. Relative folders in PATH are skipped, because other users may place a program there.
pub fn find_ffmpeg() -> Option<PathBuf> {
    let name = if cfg!(windows) { "ffmpeg.exe" } else { "ffmpeg" };
    let path = env::var_os("PATH")?;
    env::split_paths(&path)
        .filter(|folder| folder.is_absolute())
        .map(|folder| folder.join(name))
        .find(|file| runs(file))
}

fn runs(file: &Path) -> bool {
    let Ok(metadata) = fs::metadata(file) else { return false };
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        metadata.is_file() && metadata.permissions().mode() & 0o111 != 0
    }
    #[cfg(not(unix))]
    metadata.is_file()
}

impl Ffmpeg {
    pub(super) fn begin(
        format: MovieFormat,
        path: &Path,
        options: WriteOptions,
        settings: &MovieSettings,
    ) -> Result<Ffmpeg, MovieError> {
        let program = find_ffmpeg().ok_or(MovieError::NoFfmpeg)?;
        let file = AtomicFile::begin_named(path, options)?;
        let Some(temporary) = file.temporary() else {
            return Err(MovieError::Unfit(format!(
                "{} isn't a file that ffmpeg can write its film to",
                path.display()
            )));
        };
        let target = fs::canonicalize(temporary).map_err(|reason| file.failed(reason))?;
        let mut command = Command::new(program);
        command.args(arguments(format, settings)).arg(protocol(&target));
        command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::piped());
        #[cfg(unix)]
        {
            use std::os::unix::process::CommandExt;
            // The process gets no Ctrl-C of the terminal; this program ends it.
            command.process_group(0);
        }
        let mut child = command.spawn().map_err(|e| MovieError::Ffmpeg(format!("it can't be started: {e}")))?;
        let stderr = child.stderr.take();
        // The error output is read from the start, so that the process never blocks on it.
        let said = stderr.map(|stderr| thread::spawn(move || listen(stderr)));
        let pixels = child.stdin.take();
        Ok(Ffmpeg { file, running: Running { child, pixels, said } })
    }
}

/// All arguments except the file's name.
fn arguments(format: MovieFormat, settings: &MovieSettings) -> Vec<String> {
    let MovieSettings { width, height, rate, .. } = settings;
    let input = format!(
        "-nostdin -hide_banner -loglevel error -y -f rawvideo -pixel_format rgb24 -video_size {width}x{height} \
         -framerate {}/{} -i pipe:0 -an",
        rate.frames, rate.seconds
    );
    // Chroma has half the resolution, so odd sides are padded by a black row. Values are encoded by BT.709 and tagged
    // accordingly.
    let colors = "-vf pad=ceil(iw/2)*2:ceil(ih/2)*2,scale=out_color_matrix=bt709:out_range=tv -pix_fmt yuv420p \
                  -colorspace bt709 -color_primaries bt709 -color_trc iec61966-2-1 -color_range tv";
    let codec = match format {
        MovieFormat::WebM => "-c:v libvpx-vp9 -crf 24 -b:v 0 -row-mt 1 -f webm",
        _ => "-c:v libx264 -preset medium -crf 18 -movflags +faststart -f mp4",
    };
    [input.as_str(), colors, codec].iter().flat_map(|part| part.split_whitespace()).map(str::to_owned).collect()
}

fn protocol(file: &Path) -> OsString {
    let mut name = OsString::from("file:");
    name.push(file);
    name
}

/// The first bytes of the error output; the rest is read and dropped.
fn listen(mut stderr: impl Read) -> String {
    let mut words = Vec::new();
    let _ = stderr.by_ref().take(MAX_WORDS).read_to_end(&mut words);
    let _ = io::copy(&mut stderr, &mut io::sink());
    String::from_utf8_lossy(&words).trim().to_owned()
}

impl Frames for Ffmpeg {
    fn add(&mut self, _: u32, rgb: &[u8], _: Area) -> Result<(), MovieError> {
        let sent =
            self.running.pixels.as_mut().map_or(Err(io::ErrorKind::BrokenPipe.into()), |pipe| pipe.write_all(rgb));
        // The process ended; its error output has the reason.
        sent.map_err(|e| self.running.failure(&e.to_string()))
    }

    fn finish(self: Box<Ffmpeg>, part: Option<Part<'_>>) -> Result<(), MovieError> {
        let Ffmpeg { mut file, mut running } = *self;
        drop(running.pixels.take());
        let status = running.child.wait().map_err(|e| MovieError::Ffmpeg(e.to_string()))?;
        if !status.success() {
            return Err(running.failure(&status.to_string()));
        }
        if let Some(part) = part {
            file.redirect(part.path);
        }
        Ok(file.commit()?)
    }

    fn temporary(&self) -> Option<&Path> {
        self.file.temporary()
    }
}

impl Running {
    /// Ends the process, and returns an error with its error output, or else with `otherwise`.
    fn failure(&mut self, otherwise: &str) -> MovieError {
        drop(self.pixels.take());
        // After a failure the process ends by itself, and may still write to its error output.
        let _ = self.child.wait();
        let said = self.said.take().and_then(|said| said.join().ok()).unwrap_or_default();
        MovieError::Ffmpeg(if said.is_empty() { otherwise.to_owned() } else { said })
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        drop(self.pixels.take());
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
