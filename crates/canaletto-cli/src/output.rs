//! Where pictures go: names, formats, and the files themselves.

use crate::exit::Exit;
use crate::failure::{Failure, reason};
use crate::interrupt;
use canaletto_io::picture::{Depth, PictureError, WriteError, WriteOptions, write_atomically};
use clap::{Args, ValueEnum};
use std::collections::HashSet;
use std::ffi::OsStr;
use std::fmt;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};

/// Flags about the file.
#[derive(Args, Clone, Debug)]
pub(crate) struct OutputFlags {
    /// Where the picture goes [default: the scene's name with .png, in the current folder]
    ///
    /// The extension chooses the format: .png or .exr. `-` writes to the standard output. With --frames, #### stands
    /// for the frame's number with that many digits.
    #[arg(short, long, value_name = "PATH", help_heading = "Output")]
    pub output: Option<PathBuf>,

    /// The format, whatever the extension says
    #[arg(long, value_name = "FORMAT", help_heading = "Output")]
    pub format: Option<Format>,

    /// Bits of each number in a PNG [default: 8]; an EXR always has 32-bit floats
    #[arg(long, value_name = "BITS", value_parser = ["8", "16"], help_heading = "Output")]
    pub bits: Option<String>,

    /// Fails rather than replace a file
    #[arg(long, help_heading = "Output")]
    pub no_clobber: bool,
}

/// A format of pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Format {
    /// Developed for display, 8 or 16 bits
    Png,
    /// Linear light in 32-bit floats, with any number of layers (OpenEXR)
    Exr,
}

impl Format {
    fn extension(self) -> &'static str {
        match self {
            Format::Png => "png",
            Format::Exr => "exr",
        }
    }
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Format::Png => "PNG",
            Format::Exr => "OpenEXR",
        })
    }
}

/// The frames of an animation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Frames {
    pub first: u32,
    pub last: u32,
}

/// The most frames of one run; each name is looked at before the first is rendered.
const MAX_FRAMES: u32 = 1_000_000;

impl Frames {
    /// One picture, number 0.
    pub(crate) const STILL: Frames = Frames { first: 0, last: 0 };

    /// "7" or "1-100".
    pub(crate) fn parse(text: &str) -> Result<Frames, String> {
        let number = |text: &str| {
            text.trim().parse::<u32>().map_err(|_| "write a number or two with - between, such as 1-100".to_owned())
        };
        let (first, last) = text.split_once('-').unwrap_or((text, text));
        let (first, last) = (number(first)?, number(last)?);
        if last.saturating_sub(first) >= MAX_FRAMES {
            return Err(format!("the most frames of one run are {MAX_FRAMES}"));
        }
        if first > last {
            Err(format!("the first frame, {first}, comes after the last, {last}"))
        } else {
            Ok(Frames { first, last })
        }
    }

    pub(crate) fn iter(self) -> impl Iterator<Item = u32> {
        self.first..=self.last
    }

    pub(crate) fn count(self) -> u64 {
        u64::from(self.last) - u64::from(self.first) + 1
    }
}

/// Where the pictures of a command go.
#[derive(Clone, Debug)]
pub(crate) struct Output {
    /// `-`, or a path whose name may hold a run of #.
    pattern: PathBuf,
    pub format: Format,
    pub depth: Depth,
    no_clobber: bool,
    /// Whether a run of # stands for the frame's number: only with --frames.
    numbered: bool,
}

impl Output {
    /// What the flags mean; `stem` is the scene's name.
    pub(crate) fn new(flags: &OutputFlags, stem: &str, frames: Option<Frames>) -> Result<Output, Failure> {
        let many = frames.is_some_and(|frames| frames.count() > 1);
        let pattern = flags.output.clone().unwrap_or_else(|| {
            let number = if frames.is_some() { ".####" } else { "" };
            PathBuf::from(format!("{stem}{number}.{}", flags.format.unwrap_or(Format::Png).extension()))
        });
        let to_stdout = pattern == Path::new("-");
        let extension = pattern.extension().map(|e| e.to_string_lossy().to_lowercase());
        let format = match (flags.format, extension.as_deref()) {
            (Some(format), _) => format,
            (None, _) if to_stdout => Format::Png,
            (None, Some("png")) => Format::Png,
            (None, Some("exr")) => Format::Exr,
            (None, other) => {
                let shown = pattern.display();
                let failure = Failure::usage(match other {
                    Some(other) => format!("--output {shown}: pictures can't be written as .{other}"),
                    None => format!("--output {shown} has no extension to choose the format by"),
                });
                return Err(failure.help("end the name in .png or .exr, or give --format"));
            }
        };
        if many && to_stdout {
            return Err(Failure::usage("--output - takes one picture, but --frames asks for several")
                .help("render into files such as --output shot.####.png"));
        }
        if many && numbered(&pattern).is_none() {
            return Err(Failure::usage(format!("every frame would be written to {}", pattern.display()))
                .help("put #### where the frame's number belongs, such as --output shot.####.png"));
        }
        if format == Format::Exr && flags.bits.is_some() {
            return Err(Failure::usage("--bits is for PNG; an EXR always has 32-bit floats"));
        }
        let depth = if flags.bits.as_deref() == Some("16") { Depth::Sixteen } else { Depth::Eight };
        Ok(Output { pattern, format, depth, no_clobber: flags.no_clobber, numbered: frames.is_some() })
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

    /// The file of a frame's layer, where layers have files of their own.
    pub(crate) fn layer_path(&self, frame: u32, layer: &str) -> PathBuf {
        let path = self.path(frame);
        let stem = path.file_stem().unwrap_or(OsStr::new("picture")).to_string_lossy().into_owned();
        let extension = path.extension().map_or_else(String::new, |e| format!(".{}", e.to_string_lossy()));
        path.with_file_name(format!("{stem}.{layer}{extension}"))
    }

    pub(crate) fn is_stdout(&self) -> bool {
        self.pattern == Path::new("-")
    }

    /// Finds out before rendering what would make writing fail after it.
    pub(crate) fn check(&self, files: impl IntoIterator<Item = PathBuf>) -> Result<(), Failure> {
        if self.is_stdout() {
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
            return Ok(()); // A device or pipe: nothing is put beside it.
        }
        let folder = match self.pattern.parent() {
            Some(folder) if folder != Path::new("") => folder,
            _ => Path::new("."),
        };
        if !folder.is_dir() {
            return Err(wrong(WriteError::NoFolder(folder.to_owned())));
        }
        // A file without a name: nothing is seen of it, and nothing left.
        match tempfile::tempfile_in(folder) {
            Ok(_) => Ok(()),
            Err(e) => Err(Failure::new(Exit::Failed, format!("can't write into {}: {}", folder.display(), reason(&e)))),
        }
    }

    /// Makes sure that no file of `inputs` would be replaced by a picture.
    pub(crate) fn spare<'a>(
        &self,
        files: impl IntoIterator<Item = PathBuf>,
        inputs: impl IntoIterator<Item = &'a Path>,
    ) -> Result<(), Failure> {
        let inputs: HashSet<PathBuf> = inputs.into_iter().filter_map(|input| input.canonicalize().ok()).collect();
        match files.into_iter().find(|file| file.canonicalize().is_ok_and(|file| inputs.contains(&file))) {
            Some(file) if !self.is_stdout() => Err(replaced("--output", &file)),
            _ => Ok(()),
        }
    }

    /// Writes a file whole or not at all.
    pub(crate) fn write(&self, path: &Path, bytes: &[u8]) -> Result<(), Failure> {
        write_file(path, self.no_clobber, bytes)
    }
}

/// Writes a file whole or not at all; `-` is the standard output.
pub(crate) fn write_file(path: &Path, no_clobber: bool, bytes: &[u8]) -> Result<(), Failure> {
    let _guard = interrupt::writing();
    write_atomically(path, WriteOptions { no_clobber }, |out| out.write_all(bytes)).map_err(wrong)
}

/// A picture would take the place of what it is made from.
pub(crate) fn replaced(flag: &str, file: &Path) -> Failure {
    let file = file.display();
    Failure::usage(format!("{flag} {file} would replace a file that is read for it")).help("choose another name")
}

/// A format that can't hold the picture.
pub(crate) fn unfit(error: &PictureError) -> Failure {
    Failure::new(Exit::Failed, error)
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
    }
}

/// The name around its longest run of #, the last one of several; and the run's length.
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
        OutputFlags { output: Some(output.into()), format: None, bits: None, no_clobber: false }
    }

    #[test]
    fn numbers_replace_the_longest_run() {
        let output = Output::new(&flags("a#/shot#.####.png"), "s", Some(Frames { first: 9, last: 10 })).unwrap();
        assert_eq!(output.path(9), Path::new("a#/shot#.0009.png"));
        assert_eq!(output.path(123_456), Path::new("a#/shot#.123456.png"));
        assert_eq!(output.layer_path(9, "depth"), Path::new("a#/shot#.0009.depth.png"));
    }

    #[test]
    fn names_and_formats() {
        let new = |output: &str| Output::new(&flags(output), "s", None);
        assert_eq!(new("a.EXR").unwrap().format, Format::Exr);
        assert_eq!(new("-").unwrap().format, Format::Png);
        assert_eq!(new("a.jpg").unwrap_err().exit(), Exit::Usage);
        assert_eq!(new("a").unwrap_err().exit(), Exit::Usage);
        let none = OutputFlags { output: None, format: Some(Format::Exr), bits: None, no_clobber: false };
        assert_eq!(Output::new(&none, "s", None).unwrap().path(0), Path::new("s.exr"));
        let frames = Some(Frames { first: 1, last: 2 });
        assert_eq!(Output::new(&none, "s", frames).unwrap().path(2), Path::new("s.0002.exr"));
        assert!(Output::new(&flags("a.png"), "s", frames).is_err());
        assert!(Output::new(&flags("a.png"), "s", Some(Frames { first: 4, last: 4 })).is_ok());
    }

    #[test]
    fn frames_are_a_range() {
        assert_eq!(Frames::parse("1-100"), Ok(Frames { first: 1, last: 100 }));
        assert_eq!(Frames::parse("7").map(Frames::count), Ok(1));
        assert!(Frames::parse("5-3").is_err() && Frames::parse("a-b").is_err() && Frames::parse("-3").is_err());
        assert!(Frames::parse("0-999999").is_ok() && Frames::parse("0-1000000").is_err());
    }
}
