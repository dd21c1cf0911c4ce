//! Output of pictures: names, formats and files.

use crate::digest::Digest;
use crate::exit::Exit;
use crate::failure::{Failure, reason};
use crate::partial::{free_partial_path, remove_part};
use crate::stdout::check_open;
use canaletto::render::Job;
use canaletto_io::movie::{MovieError, MovieFormat, find_ffmpeg};
use canaletto_io::picture::{
    AtomicFile, Compression, Depth, PartError, PictureError, PngSettings, WriteError, WriteOptions, sweep,
    write_atomically,
};
use clap::{Args, ValueEnum};
use std::ffi::OsStr;
use std::fmt;
use std::fs::File;
use std::io::{self, IsTerminal};
use std::path::{Path, PathBuf};

/// Flags about the file.
#[derive(Args, Clone, Debug)]
pub(crate) struct OutputFlags {
    /// Where the picture goes [default: the scene's name with .png, in the current folder]
    ///
    /// The extension chooses the format: .png or .exr, and for a film in one file .apng, .gif, .mp4 or .webm. `-`
    /// writes to the standard output, and a folder gets the picture by its default name. With --frames, #### stands for
    /// the frame's number with that many digits.
    #[arg(short, long, value_name = "PATH", help_heading = "Output")]
    pub output: Option<PathBuf>,

    /// The format, whatever the extension says
    #[arg(long, value_name = "FORMAT", help_heading = "Output")]
    pub format: Option<Format>,

    /// Bits of each number: 8 or 16 in a PNG [default: 8], 16 or 32 of colours in an EXR [default: 32]
    ///
    /// With 16, an EXR has its colours in half floats; depths, normals, positions and ids keep 32 bits.
    #[arg(long, value_name = "BITS", value_parser = ["8", "16", "32"], help_heading = "Output")]
    pub bits: Option<String>,

    /// How much time is spent on a small PNG or APNG [default: default]; its pixels are the same with each
    #[arg(long, value_name = "HOW", help_heading = "Output")]
    pub compression: Option<CompressionFlag>,
    /// Writes the layers object-id and material-id of an EXR as whole numbers (UINT) instead of floats
    #[arg(long, help_heading = "Output")]
    pub uint_ids: bool,

    /// Fails rather than replace a file
    #[arg(long, help_heading = "Output")]
    pub no_clobber: bool,
}

impl OutputFlags {
    /// The name of the picture of a scene. `stem` is the scene's name; `numbered` says whether the user gave --frames.
    pub(crate) fn default_name(&self, stem: &str, numbered: bool) -> PathBuf {
        let format = self.format.unwrap_or(Format::Png);
        let number = if numbered && format.film().is_none() { ".####" } else { "" };
        PathBuf::from(format!("{stem}{number}.{}", format.extension()))
    }
}

/// How hard a PNG is compressed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum CompressionFlag {
    /// A fifth of the time, and a tenth to twice as large as by default
    Fast,
    /// As small as zlib's level 6 makes it
    Default,
    /// A few hundredths smaller, in three times the time
    Best,
}

impl From<CompressionFlag> for Compression {
    fn from(flag: CompressionFlag) -> Compression {
        match flag {
            CompressionFlag::Fast => Compression::Fast,
            CompressionFlag::Default => Compression::Default,
            CompressionFlag::Best => Compression::Best,
        }
    }
}

/// A format of pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Format {
    /// Developed for display, 8 or 16 bits
    Png,
    /// Linear light in 32-bit floats, with any number of layers (OpenEXR)
    Exr,
    /// A film as animated PNG, in full colour
    Apng,
    /// A film as GIF, with 256 colours in each frame and at most 50 frames a second
    Gif,
    /// A film as MP4 (H.264), made by the program ffmpeg
    Mp4,
    /// A film as WebM (VP9), made by the program ffmpeg
    Webm,
}

impl Format {
    /// All formats with their extensions and their usual names.
    const ALL: [(Format, &str, &str); 6] = [
        (Format::Png, "png", "PNG"),
        (Format::Exr, "exr", "OpenEXR"),
        (Format::Apng, "apng", "animated PNG"),
        (Format::Gif, "gif", "GIF"),
        (Format::Mp4, "mp4", "MP4"),
        (Format::Webm, "webm", "WebM"),
    ];

    fn extension(self) -> &'static str {
        Format::ALL.iter().find(|(format, ..)| *format == self).map_or("", |(_, extension, _)| extension)
    }

    /// The film format; `None` for pictures.
    pub(crate) fn film(self) -> Option<MovieFormat> {
        match self {
            Format::Png | Format::Exr => None,
            Format::Apng => Some(MovieFormat::Apng),
            Format::Gif => Some(MovieFormat::Gif),
            Format::Mp4 => Some(MovieFormat::Mp4),
            Format::Webm => Some(MovieFormat::WebM),
        }
    }
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(Format::ALL.iter().find(|(format, ..)| format == self).map_or("", |(.., name)| name))
    }
}

/// The destination of a command's pictures.
#[derive(Clone, Debug)]
pub(crate) struct Output {
    /// `-`, or a path whose name may contain a run of #.
    pattern: PathBuf,
    pub format: Format,
    pub png: PngSettings,
    /// Whether the colours of an EXR are half floats.
    pub half: bool,
    /// Whether the ids of an EXR are whole numbers.
    pub uint_ids: bool,
    no_clobber: bool,
    /// Whether written files survive a power cut. This matters for frames, many of which may be finished before it.
    durable: bool,
    /// Whether a run of # stands for the frame's number, which needs --frames.
    numbered: bool,
}

impl Output {
    /// Evaluates the flags. `stem` is the scene's name. `numbered` says whether the user gave --frames, `many` whether
    /// there are several frames.
    pub(crate) fn new(flags: &OutputFlags, stem: &str, numbered: bool, many: bool) -> Result<Output, Failure> {
        let pattern = flags.output.clone().unwrap_or_else(|| flags.default_name(stem, numbered));
        let to_stdout = pattern == Path::new("-");
        let extension = pattern.extension().map(|e| e.to_string_lossy().to_lowercase());
        let known = Format::ALL.iter().find(|(_, name, _)| extension.as_deref() == Some(*name));
        let format = match (flags.format, known) {
            (Some(format), _) => format,
            (None, _) if to_stdout => Format::Png,
            (None, Some((format, ..))) => *format,
            (None, None) => {
                let shown = pattern.display();
                let failure = Failure::usage(match extension {
                    Some(other) => format!("--output {shown}: pictures can't be written as .{other}"),
                    None => format!("--output {shown} has no extension to choose the format by"),
                });
                return Err(failure
                    .help("end the name in .png or .exr, for films in .apng, .gif, .mp4 or .webm, or give --format"));
            }
        };
        match format.film() {
            Some(film) if film.needs_ffmpeg() && to_stdout => {
                return Err(Failure::usage(format!("{format} can't be written to the standard output"))
                    .help("--format apng and --format gif can"));
            }
            Some(film) if film.needs_ffmpeg() && find_ffmpeg().is_none() => return Err(no_ffmpeg(format)),
            None if many && to_stdout => {
                return Err(Failure::usage("--output - takes one picture, but --frames asks for several")
                    .help("render into files such as --output shot.####.png, or a film with --format apng"));
            }
            None if many && crate::output::numbered(&pattern).is_none() => {
                return Err(Failure::usage(format!("every frame would be written to {}", pattern.display())).help(
                    "put #### where the frame's number belongs, such as --output shot.####.png; \
                     a film in one file ends in .apng, .gif, .mp4 or .webm",
                ));
            }
            _ => {}
        }
        let bits = flags.bits.as_deref();
        match (format, bits) {
            (Format::Png, Some("32")) => return Err(Failure::usage("--bits 32: a PNG has 8 or 16 bits")),
            (Format::Exr, Some("8")) => return Err(Failure::usage("--bits 8: an EXR has 16 or 32 bits")),
            (Format::Png | Format::Exr, _) | (_, None) => {}
            (_, Some(_)) => return Err(Failure::usage("--bits is for PNG and EXR; a film always has 8 bits")),
        }
        if !matches!(format, Format::Png | Format::Apng) && flags.compression.is_some() {
            return Err(Failure::usage("--compression is for PNG and APNG"));
        }
        if flags.uint_ids && format != Format::Exr {
            return Err(Failure::usage(format!("--uint-ids is for EXR; {format} has no numbers in its layers")));
        }
        let (half, uint_ids) = (format == Format::Exr && bits == Some("16"), flags.uint_ids);
        let depth = if flags.bits.as_deref() == Some("16") { Depth::Sixteen } else { Depth::Eight };
        let compression = flags.compression.map_or(Compression::Default, Into::into);
        let png = PngSettings { depth, compression };
        let durable = numbered || format.film().is_some();
        let numbered = numbered && format.film().is_none();
        let no_clobber = flags.no_clobber;
        Ok(Output { pattern, format, png, half, uint_ids, no_clobber, durable, numbered })
    }

    /// The file of a frame; `-` for the standard output.
    pub(crate) fn path(&self, frame: u32) -> PathBuf {
        match numbered(&self.pattern).filter(|_| self.numbered) {
            Some((before, digits, after)) => {
                self.pattern.with_file_name(format!("{before}{frame:0width$}{after}", width = digits))
            }
            None => self.pattern.clone(),
        }
    }

    /// The file of a frame's layer, for formats that put layers into files of their own.
    pub(crate) fn layer_path(&self, frame: u32, layer: &str) -> PathBuf {
        let path = self.path(frame);
        let stem = path.file_stem().unwrap_or(OsStr::new("picture")).to_string_lossy().into_owned();
        let extension = path.extension().map_or_else(String::new, |e| format!(".{}", e.to_string_lossy()));
        path.with_file_name(format!("{stem}.{layer}{extension}"))
    }

    /// Adds everything that the bytes of a frame's picture depend on: its settings, and the flags about files.
    pub(crate) fn digest(&self, digest: Digest, texts: &[(String, String)], job: &Job) -> Digest {
        // Layers of a PNG are in files of their own. Tiles change no pixel. The frame's number is among the texts.
        let aovs = if self.format == Format::Exr { job.aovs.clone() } else { Vec::new() };
        let job = Job { aovs, tile: 0, frame: 0, ..job.clone() };
        let digest = digest.with(&texts).with(&job).with(&self.format).with(&self.png.depth);
        digest.with(&(self.half, self.uint_ids))
    }

    /// The options for writing files.
    pub(crate) fn options(&self) -> WriteOptions {
        WriteOptions { no_clobber: self.no_clobber, durable: self.durable }
    }

    pub(crate) fn is_stdout(&self) -> bool {
        self.pattern == Path::new("-")
    }

    /// Detects before rendering what would make writing fail after it.
    pub(crate) fn check(&self, files: impl IntoIterator<Item = PathBuf>) -> Result<(), Failure> {
        if self.is_stdout() {
            check_open()?;
            if std::io::stdout().is_terminal() {
                return Err(Failure::usage("--output - would write the picture's bytes to the terminal")
                    .help("send it somewhere: canaletto render ... -o - | display, or > picture.png"));
            }
            return Ok(());
        }
        for file in files {
            match file.metadata() {
                Ok(old) if old.is_dir() => return Err(wrong(WriteError::IsFolder(file))),
                Ok(_) if self.no_clobber => return Err(wrong(WriteError::Exists(file))),
                _ => {}
            }
        }
        if self.pattern.metadata().is_ok_and(|old| !old.is_file()) {
            return Ok(()); // A device or pipe has no temporary file beside it.
        }
        let folder = folder_of(&self.pattern);
        if !folder.is_dir() {
            return Err(wrong(WriteError::NoFolder(folder.to_owned())));
        }
        sweep(folder);
        // The test file has no name: it is invisible, and the system removes it.
        match tempfile::tempfile_in(folder) {
            Ok(_) => Ok(()),
            Err(e) => Err(Failure::new(Exit::Failed, format!("can't write into {}: {}", folder.display(), reason(&e)))),
        }
    }

    /// Writes a complete picture or nothing. Removes the partial picture of an interrupted run, which is obsolete.
    pub(crate) fn write(&self, path: &Path, bytes: &[u8]) -> Result<(), Failure> {
        write(path, self.options(), bytes)?;
        remove_part(path);
        Ok(())
    }

    /// Writes a partial picture beside its file; returns the path. An output that no file can lie beside receives the
    /// partial picture itself.
    pub(crate) fn write_part(&self, path: &Path, bytes: &[u8]) -> Result<PathBuf, Failure> {
        let place = if self.has_place_beside(path) { free_partial_path(path) } else { path.to_owned() };
        write(&place, WriteOptions::default(), bytes)?;
        Ok(place)
    }

    /// Calls `write` to write a partial picture beside its file; returns the path.
    pub(crate) fn write_part_with(
        &self,
        path: &Path,
        write: impl FnOnce(&mut &File) -> Result<(), PartError>,
    ) -> Result<PathBuf, Failure> {
        let place = free_partial_path(path);
        let part = AtomicFile::begin(&place, WriteOptions::default()).map_err(wrong)?;
        let Some(mut file) = part.file() else { return Err(wrong(part.failed(io::ErrorKind::NotSeekable.into()))) };
        match write(&mut file) {
            Ok(()) => part.commit().map_err(wrong)?,
            Err(PartError::Picture(error)) => return Err(unfit(&error)),
            Err(PartError::Write(reason)) => return Err(wrong(part.failed(reason))),
        }
        Ok(place)
    }

    /// Whether a file can lie beside this output. None can beside the standard output, devices and pipes.
    pub(crate) fn has_place_beside(&self, path: &Path) -> bool {
        !self.is_stdout() && path.metadata().map_or(true, |old| old.is_file())
    }
}

/// Writes a complete file or nothing; `-` is the standard output. Removes temporary files that a killed program left
/// beside it.
pub(crate) fn write_file(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    sweep(folder_of(path));
    write(path, WriteOptions::default(), bytes)
}

fn write(path: &Path, options: WriteOptions, bytes: &[u8]) -> Result<(), Failure> {
    write_atomically(path, options, |out| out.write_all(bytes)).map_err(wrong)
}

fn folder_of(file: &Path) -> &Path {
    match file.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    }
}

/// The error that an output would replace one of its inputs.
pub(crate) fn replaced(flag: &str, file: &Path) -> Failure {
    let file = file.display();
    Failure::usage(format!("{flag} {file} would replace a file that is read for it")).help("choose another name")
}

/// The error that a format can't hold the picture.
pub(crate) fn unfit(error: &PictureError) -> Failure {
    Failure::new(Exit::Failed, error)
}

/// The error of a film.
pub(crate) fn film_failed(format: Format, error: MovieError) -> Failure {
    match error {
        MovieError::Write(error) => wrong(error),
        MovieError::NoFfmpeg => no_ffmpeg(format),
        MovieError::Ffmpeg(_) => Failure::new(Exit::Failed, error)
            .help("render numbered pictures (--output shot.####.png) and call ffmpeg on them yourself"),
        MovieError::Unfit(_) => Failure::new(Exit::Usage, error),
        _ => Failure::new(Exit::Failed, error),
    }
}

fn no_ffmpeg(format: Format) -> Failure {
    Failure::new(Exit::Failed, format!("{format} needs the program ffmpeg, which isn't in PATH"))
        .help("install it (https://ffmpeg.org), or take .apng or .gif, which need nothing")
}

fn wrong(error: WriteError) -> Failure {
    match &error {
        WriteError::Failed { path, reason } if path == Path::new("-") => Failure::stdout(reason),
        WriteError::Failed { path, reason: why } => {
            Failure::new(Exit::Failed, format!("can't write {}: {}", path.display(), reason(why)))
        }
        WriteError::Folder { folder, reason: why } => {
            Failure::new(Exit::Failed, format!("can't write into {}: {}", folder.display(), reason(why)))
        }
        WriteError::NoFolder(folder) => {
            Failure::new(Exit::Failed, &error).help(format!("create it: mkdir -p {}", folder.display()))
        }
        WriteError::Exists(_) => Failure::new(Exit::Failed, &error).help("leave out --no-clobber to replace it"),
        WriteError::IsFolder(folder) => Failure::new(Exit::Failed, &error)
            .help(format!("name a file in it, such as {}", folder.join("picture.png").display())),
        _ => Failure::new(Exit::Failed, &error),
    }
}

/// The name before and after its longest run of #, and the run's length. Of several longest runs it is the last one.
fn numbered(path: &Path) -> Option<(&str, usize, &str)> {
    let name = path.file_name()?.to_str()?;
    let longest = name.split(|c| c != '#').map(str::len).max().filter(|length| *length > 0)?;
    let start = name.rfind(&"#".repeat(longest))?;
    Some((&name[..start], longest, &name[start + longest..]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flags(output: &str) -> OutputFlags {
        OutputFlags {
            output: Some(output.into()),
            format: None,
            bits: None,
            compression: None,
            uint_ids: false,
            no_clobber: false,
        }
    }

    #[test]
    fn numbers_replace_the_longest_run() {
        let output = Output::new(&flags("a#/shot#.####.png"), "s", true, true).unwrap();
        assert_eq!(output.path(9), Path::new("a#/shot#.0009.png"));
        assert_eq!(output.path(123_456), Path::new("a#/shot#.123456.png"));
        assert_eq!(output.layer_path(9, "depth"), Path::new("a#/shot#.0009.depth.png"));
    }

    #[test]
    fn names_and_formats() {
        let new = |output: &str| Output::new(&flags(output), "s", false, false);
        assert_eq!(new("a.EXR").unwrap().format, Format::Exr);
        assert_eq!(new("-").unwrap().format, Format::Png);
        assert_eq!(new("a.gif").unwrap().format.film(), Some(MovieFormat::Gif));
        let film = OutputFlags { format: Some(Format::Apng), ..flags("a.png") };
        assert_eq!(Output::new(&film, "s", true, true).unwrap().path(7), Path::new("a.png"));
        assert_eq!(new("a.jpg").unwrap_err().exit(), Exit::Usage);
        assert_eq!(new("a").unwrap_err().exit(), Exit::Usage);
        let none = OutputFlags { output: None, format: Some(Format::Exr), ..flags("a.exr") };
        assert_eq!(Output::new(&none, "s", false, false).unwrap().path(0), Path::new("s.exr"));
        assert_eq!(Output::new(&none, "s", true, true).unwrap().path(2), Path::new("s.0002.exr"));
        assert!(Output::new(&flags("a.png"), "s", true, true).is_err());
        assert!(Output::new(&flags("a.png"), "s", true, false).is_ok());
    }
}
