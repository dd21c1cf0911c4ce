//! Output of pictures: names, formats and files.

use crate::command_files::{FolderFlag, folder_of};
use crate::digest::Digest;
use crate::exit::Exit;
use crate::failure::{Failure, reason};
use crate::output_format::Format;
use crate::partial::{free_partial_path, remove_part};
use canaletto::render::Job;
use canaletto::scene::Transfer;
use canaletto::texture::srgb_decode;
use canaletto_io::diagnostic::word_list;
use canaletto_io::movie::{MovieError, MovieFormat, find_ffmpeg};
use canaletto_io::picture::{
    AtomicFile, Compression, EncodeSettings, Image, PartError, PictureError, PictureFormat, Window, WriteError,
    WriteOptions, sweep, write_atomically,
};
use canaletto_stdio::stdout_was_closed;
use clap::{Args, ValueEnum};
use std::ffi::OsStr;
use std::fs::File;
use std::io::{self, IsTerminal, Write};
use std::path::{Path, PathBuf};

fn output_help() -> String {
    format!(
        "Sets the output file or folder [default: the scene's name with .png, in the current folder]\n\n\
         The extension selects the format: {}, or {} for a film in one file. `-` writes to the standard output. In a \
         folder the picture has its default name. {{name}} stands for the scene's name. With --frames, #### stands \
         for the frame's number; each # is a \
         digit.",
        Format::picture_extensions(),
        Format::film_extensions()
    )
}

/// Flags about the file.
#[derive(Args, Clone, Debug, Default)]
pub(crate) struct OutputFlags {
    /// Sets the output file or folder [default: the scene's name with .png, in the current folder]
    #[arg(short, long, value_name = "PATH", help_heading = "Output", long_help = output_help())]
    pub output: Option<PathBuf>,

    /// Sets the format, whatever the extension is
    #[arg(long, value_name = "FORMAT", help_heading = "Output")]
    pub format: Option<Format>,

    /// Sets the bits of each number: 8 or 16 in a PNG [default: 8], 16 or 32 in an EXR [default: 32]
    ///
    /// With 16, an EXR stores colours as half floats. Depths, normals, positions and ids keep 32 bits.
    #[arg(long, value_name = "BITS", value_parser = ["8", "16", "32"], help_heading = "Output")]
    pub bits: Option<String>,

    /// Sets the compression effort of a PNG or APNG [default: default]; changes no pixel
    #[arg(long, value_name = "HOW", help_heading = "Output")]
    pub compression: Option<CompressionFlag>,

    /// Sets the quality of a JPEG, from 1 to 100: how near its pixels are to the picture [default: 92]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=100), help_heading = "Output")]
    pub jpeg_quality: Option<u8>,
    /// Writes the layers object-id, material-id and element-id of an EXR as whole numbers (UINT) instead of floats
    #[arg(long, help_heading = "Output")]
    pub uint_ids: bool,

    /// Fails if a file exists already, instead of replacing it
    #[arg(long, help_heading = "Output")]
    pub no_clobber: bool,

    #[command(flatten)]
    pub folder: FolderFlag,
}

impl OutputFlags {
    /// Whether the output is a film, by its format or its name.
    pub(crate) fn is_film(&self) -> bool {
        let extension = self.output.as_ref().and_then(|output| output.extension());
        let by_name = || Format::of_extension(&extension?.to_string_lossy().to_lowercase());
        self.format.or_else(by_name).is_some_and(|format| format.film().is_some())
    }

    /// The flags for another picture's file, without those about the format of this one.
    pub(crate) fn for_file(&self, file: &Path) -> OutputFlags {
        OutputFlags {
            output: Some(file.to_owned()),
            format: None,
            bits: None,
            compression: None,
            jpeg_quality: None,
            uint_ids: false,
            ..self.clone()
        }
    }

    /// The name of the picture of a scene. `stem` is the scene's name; `numbered` says whether the user gave --frames.
    pub(crate) fn default_name(&self, stem: &str, numbered: bool) -> PathBuf {
        let format = self.format.unwrap_or_default();
        let number = if numbered && format.film().is_none() { ".####" } else { "" };
        PathBuf::from(format!("{stem}{number}.{}", format.extension()))
    }
}

/// How hard a PNG is compressed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum CompressionFlag {
    /// A fifth of the time; files are 1.1 to 2 times as large as by default
    Fast,
    /// Files as small as those of zlib level 6
    Default,
    /// Three times the time; files are a few percent smaller
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

/// The destination of a command's pictures.
#[derive(Clone, Debug)]
pub(crate) struct Output {
    /// `-`, or a path whose name may contain a run of #.
    pattern: PathBuf,
    pub format: Format,
    /// How pictures are written.
    pub settings: EncodeSettings,
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
        let known = extension.as_deref().and_then(Format::of_extension);
        let format = match (flags.format.or(known), to_stdout) {
            (Some(format), false) => format,
            (_, true) => flags.format.unwrap_or_default(),
            (None, false) => {
                let shown = pattern.display();
                let failure = Failure::usage(match extension {
                    Some(other) => format!("--output {shown}: pictures can't be written as .{other}"),
                    None => format!("--output {shown} has no extension to choose the format by"),
                });
                return Err(failure.help(format!(
                    "end the name in {}, for films in {}, or give --format",
                    Format::picture_extensions(),
                    Format::film_extensions()
                )));
            }
        };
        match format.film() {
            Some(film) if film.needs_ffmpeg() && to_stdout => {
                return Err(Failure::usage(format!("{format} can't be written to the standard output"))
                    .help(format!("{} can", word_list(&own_films("--format "), "and"))));
            }
            Some(film) if film.needs_ffmpeg() && find_ffmpeg().is_none() => return Err(no_ffmpeg(format)),
            None if many && to_stdout => {
                return Err(Failure::usage("--output - takes one picture, but --frames asks for several")
                    .help("render into files such as --output shot.####.png, or a film with --format apng"));
            }
            None if many && crate::output::numbered(&pattern).is_none() => {
                let extensions = Format::film_extensions();
                return Err(Failure::usage(format!("every frame would be written to {}", pattern.display())).help(
                    format!(
                        "put #### where the frame's number belongs, such as --output shot.####.png; \
                     a film in one file ends in {extensions}"
                    ),
                ));
            }
            _ => {}
        }
        let bits = flags.bits.as_deref().and_then(|bits| bits.parse::<u8>().ok());
        match (bits, format.capabilities()) {
            (Some(bits), Some(can)) if !can.bits.contains(&bits) => {
                let mut all: Vec<u8> = can.bits.to_vec();
                all.sort_unstable();
                let all = word_list(&all.iter().map(u8::to_string).collect::<Vec<_>>(), "or");
                let name = format.short_name();
                return Err(Failure::usage(format!("--bits {bits}: {} {name} has {all} bits", article(name))));
            }
            (Some(_), None) => {
                let names = Format::short_names(|format| format.capabilities().is_some_and(|can| can.bits.len() > 1));
                return Err(Failure::usage(format!("--bits is for {names}; a film always has 8 bits")));
            }
            _ => {}
        }
        if flags.compression.is_some() && !format.has_compression() {
            let names = Format::short_names(Format::has_compression);
            return Err(Failure::usage(format!("--compression is for {names}")));
        }
        if flags.uint_ids && !format.has_whole_ids() {
            let names = Format::short_names(Format::has_whole_ids);
            return Err(Failure::usage(format!("--uint-ids is for {names}; {format} has no numbers in its layers")));
        }
        if flags.jpeg_quality.is_some() && !format.is_lossy() {
            let names = Format::short_names(Format::is_lossy);
            return Err(Failure::usage(format!("--jpeg-quality is for {names}")));
        }
        let compression = flags.compression.map_or(Compression::Default, Into::into);
        let (quality, whole_ids) = (flags.jpeg_quality, flags.uint_ids);
        let settings = EncodeSettings { bits, compression, quality, whole_ids, window: None };
        let durable = numbered || format.film().is_some();
        let numbered = numbered && format.film().is_none();
        let no_clobber = flags.no_clobber;
        Ok(Output { pattern, format, settings, no_clobber, durable, numbered })
    }

    /// The path as it was given: that of one file, or with a run of # for the numbers of frames.
    pub(crate) fn pattern(&self) -> &Path {
        &self.pattern
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
        // Layers in files of their own don't count. Tiles change no pixel. The frame's number is among the texts.
        let aovs = if self.format.has_layers() { job.aovs.clone() } else { Vec::new() };
        let mut job = Job { aovs, tile: 0, frame: 0, ..job.clone() };
        // A default counts as if it were given.
        let developing = job.developing();
        (job.film.tone, job.film.exposure) = (Some(developing.tone), Some(developing.exposure));
        let digest = digest.with(&texts).with(&job).with(&self.format);
        digest.with(&(self.settings.bits, self.settings.whole_ids))
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
            check_stdout()?;
            if std::io::stdout().is_terminal() {
                return Err(Failure::usage("--output - would write the picture's bytes to the terminal")
                    .help("send it somewhere: canaletto render ... -o - | display, or > picture.png"));
            }
            return Ok(());
        }
        check_files(files, &self.pattern, self.no_clobber)
    }

    /// Writes a complete picture or nothing. Removes the partial picture of an interrupted run, which is obsolete.
    pub(crate) fn write(&self, path: &Path, bytes: &[u8]) -> Result<(), Failure> {
        write(path, self.options(), bytes)?;
        remove_part(path);
        Ok(())
    }

    /// Writes a complete picture that gets its name when it is [committed](Output::commit). What isn't a file of its
    /// own, such as the standard output, is written at once.
    pub(crate) fn begin<'p>(&self, path: &'p Path, bytes: &[u8]) -> Result<Option<(&'p Path, AtomicFile)>, Failure> {
        if !self.has_place_beside(path) {
            return self.write(path, bytes).map(|()| None);
        }
        Ok(Some((path, begin_file(path, self.options(), bytes)?)))
    }

    /// Gives a complete picture its name. Removes the partial picture of an interrupted run, which is obsolete.
    pub(crate) fn commit(&self, path: &Path, file: AtomicFile) -> Result<(), Failure> {
        file.commit().map_err(wrong)?;
        remove_part(path);
        Ok(())
    }

    /// Writes a drawing, whose values are display values of the sRGB curve.
    pub(crate) fn write_drawing(
        &self,
        path: &Path,
        format: PictureFormat,
        image: Image,
        texts: &[(String, String)],
    ) -> Result<(), Failure> {
        let is_linear = format.capabilities().is_some_and(|can| can.linear);
        let (image, transfer) =
            if is_linear { (image.map_color(srgb_decode), Transfer::None) } else { (image, Transfer::Srgb) };
        let EncodeSettings { bits, compression, quality, .. } = self.settings;
        let settings = EncodeSettings { bits, compression, quality, ..EncodeSettings::default() };
        let bytes = format.encode_image(&image, transfer, &settings, texts);
        self.write(path, &bytes.map_err(|e| unfit(&e))?)
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
        write_seekable(&place, WriteOptions::default(), write)?;
        Ok(place)
    }

    /// Whether a file can lie beside this output. None can beside the standard output, devices and pipes.
    pub(crate) fn has_place_beside(&self, path: &Path) -> bool {
        !self.is_stdout() && path.metadata().map_or(true, |old| old.is_file())
    }
}

/// The format of a picture's file, by its extension. `flag` is what names the file.
pub(crate) fn picture_format(flag: &str, file: &Path) -> Result<PictureFormat, Failure> {
    let extension = file.extension().map(|e| e.to_string_lossy().to_lowercase());
    extension.as_deref().and_then(Format::of_extension).and_then(Format::picture).ok_or_else(|| {
        let extensions = Format::picture_extensions();
        Failure::usage(format!("{flag} {}: end the name in {extensions}", file.display()))
    })
}

/// Detects before other work what would make writing these files fail after it. `pattern` tells their folder.
pub(crate) fn check_files(
    files: impl IntoIterator<Item = PathBuf>,
    pattern: &Path,
    no_clobber: bool,
) -> Result<(), Failure> {
    if pattern == Path::new("-") {
        return check_stdout();
    }
    for file in files {
        match file.metadata() {
            Ok(old) if old.is_dir() => return Err(wrong(WriteError::IsFolder(file))),
            Ok(_) if no_clobber => return Err(wrong(WriteError::Exists(file))),
            _ => {}
        }
    }
    if pattern.metadata().is_ok_and(|old| !old.is_file()) {
        return Ok(()); // A device or pipe has no temporary file beside it.
    }
    let folder = folder_of(pattern);
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

/// Calls `write` to write a complete file or nothing.
pub(crate) fn write_with(
    path: &Path,
    options: WriteOptions,
    write: impl FnOnce(&mut dyn io::Write) -> io::Result<()>,
) -> Result<(), Failure> {
    if path == Path::new("-") {
        check_stdout()?;
    }
    write_atomically(path, options, write).map_err(wrong)
}

/// Calls `write` to write a complete file, in which it may seek, or nothing.
pub(crate) fn write_seekable(
    path: &Path,
    options: WriteOptions,
    write: impl FnOnce(&mut &File) -> Result<(), PartError>,
) -> Result<(), Failure> {
    let part = AtomicFile::begin(path, options).map_err(wrong)?;
    let Some(mut file) = part.file() else { return Err(wrong(part.failed(io::ErrorKind::NotSeekable.into()))) };
    match write(&mut file) {
        Ok(()) => part.commit().map_err(wrong),
        Err(PartError::Picture(error)) => Err(unfit(&error)),
        Err(PartError::Write(reason)) => Err(wrong(part.failed(reason))),
    }
}

/// Writes files that belong together. None of them appears before all are complete.
pub(crate) fn write_files(files: &[PathBuf], contents: &[Vec<u8>], no_clobber: bool) -> Result<(), Failure> {
    let options = WriteOptions { no_clobber, durable: false };
    let mut written = Vec::new();
    for (path, bytes) in files.iter().zip(contents) {
        written.push(begin_file(path, options, bytes)?);
    }
    written.into_iter().try_for_each(|file| file.commit().map_err(wrong))
}

/// Writes a file that has no name yet.
fn begin_file(path: &Path, options: WriteOptions, bytes: &[u8]) -> Result<AtomicFile, Failure> {
    let file = AtomicFile::begin(path, options).map_err(wrong)?;
    let done = file.handle().map(|mut out| out.write_all(bytes).and_then(|()| out.flush()));
    done.map_err(wrong)?.map_err(|reason| wrong(file.failed(reason)))?;
    Ok(file)
}

/// Checks that there is a standard output. If the caller has closed it (`>&-`), results would be lost silently.
pub(crate) fn check_stdout() -> Result<(), Failure> {
    if stdout_was_closed() { Err(Failure::new(Exit::Failed, "the standard output is closed")) } else { Ok(()) }
}

/// Writes to the standard output.
pub(crate) fn write_stdout(bytes: &[u8]) -> Result<(), Failure> {
    write(Path::new("-"), WriteOptions::default(), bytes)
}

/// Writes a complete file or nothing; `-` is the standard output. Removes temporary files that a killed program left
/// beside it.
pub(crate) fn write_file(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    if path != Path::new("-") {
        sweep(folder_of(path));
    }
    write(path, WriteOptions::default(), bytes)
}

fn write(path: &Path, options: WriteOptions, bytes: &[u8]) -> Result<(), Failure> {
    write_with(path, options, |out| out.write_all(bytes))
}

/// The rendered part's place in the camera's picture.
pub(crate) fn window(job: &Job) -> Window {
    let [x, y, ..] = job.window();
    Window { at: [x as i32, y as i32], whole: job.camera.size() }
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

/// The extensions of films that need no other program, each after `prefix`.
fn own_films(prefix: &str) -> Vec<String> {
    let own = MovieFormat::all().filter(|film| !film.needs_ffmpeg());
    own.map(|film| format!("{prefix}{}", film.extension())).collect()
}

/// The article before an abbreviation that is spelled letter by letter: "a PNG", "an EXR".
fn article(abbreviation: &str) -> &'static str {
    if abbreviation.starts_with(['A', 'E', 'F', 'H', 'I', 'L', 'M', 'N', 'O', 'R', 'S', 'X']) { "an" } else { "a" }
}

fn no_ffmpeg(format: Format) -> Failure {
    Failure::new(Exit::Failed, format!("{format} needs the program ffmpeg, which isn't in PATH")).help(format!(
        "install it (https://ffmpeg.org), or take {}, which need nothing",
        word_list(&own_films("."), "or")
    ))
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
        WriteError::NoFolder(folder) => Failure::new(Exit::Failed, &error)
            .help(format!("create it: mkdir -p {}, or give --mkdir", folder.display())),
        WriteError::Exists(_) => Failure::new(Exit::Failed, &error).help("leave out --no-clobber to replace it"),
        WriteError::IsFolder(folder) => Failure::new(Exit::Failed, &error)
            .help(format!("name a file in it, such as {}", folder.join("picture.png").display())),
        _ => Failure::new(Exit::Failed, &error),
    }
}

/// The name before and after its longest run of #, and the run's length. Of several longest runs it is the last one.
pub(crate) fn numbered(path: &Path) -> Option<(&str, usize, &str)> {
    let name = path.file_name()?.to_str()?;
    let longest = name.split(|c| c != '#').map(str::len).max().filter(|length| *length > 0)?;
    let start = name.rfind(&"#".repeat(longest))?;
    Some((&name[..start], longest, &name[start + longest..]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use canaletto_io::picture::PictureFormat;

    const PNG: Format = Format::Picture(PictureFormat::Png);
    const EXR: Format = Format::Picture(PictureFormat::Exr);

    fn flags(output: &str) -> OutputFlags {
        OutputFlags {
            output: Some(output.into()),
            format: None,
            bits: None,
            compression: None,
            jpeg_quality: None,
            uint_ids: false,
            no_clobber: false,
            folder: FolderFlag::default(),
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
        assert_eq!(new("a.EXR").unwrap().format, EXR);
        assert_eq!(new("-").unwrap().format, PNG);
        assert_eq!(new("a.gif").unwrap().format.film(), Some(MovieFormat::Gif));
        let film = OutputFlags { format: Some(Format::Movie(MovieFormat::Apng)), ..flags("a.png") };
        assert_eq!(Output::new(&film, "s", true, true).unwrap().path(7), Path::new("a.png"));
        assert_eq!(new("a.tiff").unwrap_err().exit(), Exit::Usage);
        assert_eq!(new("a").unwrap_err().exit(), Exit::Usage);
        let none = OutputFlags { output: None, format: Some(EXR), ..flags("a.exr") };
        assert_eq!(Output::new(&none, "s", false, false).unwrap().path(0), Path::new("s.exr"));
        assert_eq!(Output::new(&none, "s", true, true).unwrap().path(2), Path::new("s.0002.exr"));
        assert!(Output::new(&flags("a.png"), "s", true, true).is_err());
        assert!(Output::new(&flags("a.png"), "s", true, false).is_ok());
    }
}
