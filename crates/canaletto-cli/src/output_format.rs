//! The formats that `render` writes: pictures, and films in one file. What each can hold is asked of the tables in
//! `canaletto_io`.

use canaletto_io::diagnostic::word_list;
use canaletto_io::movie::MovieFormat;
use canaletto_io::picture::{Capabilities, PictureFormat};
use clap::ValueEnum;
use clap::builder::PossibleValue;
use std::fmt;
use std::sync::LazyLock;

/// A format of pictures or films.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Format {
    Picture(PictureFormat),
    Movie(MovieFormat),
}

/// All formats, pictures first.
static ALL: LazyLock<Vec<Format>> = LazyLock::new(|| {
    PictureFormat::written().map(Format::Picture).chain(MovieFormat::all().map(Format::Movie)).collect()
});

impl Format {
    /// The format of files with this extension, which is in lower case.
    pub(crate) fn of_extension(extension: &str) -> Option<Format> {
        let extension = if extension == "jpeg" { "jpg" } else { extension };
        ALL.iter().copied().find(|format| format.extension() == extension)
    }

    /// The extensions of pictures, as messages list them: ".png or .exr".
    pub(crate) fn picture_extensions() -> String {
        extensions(|format| format.film().is_none())
    }

    /// The extensions of films, as messages list them.
    pub(crate) fn film_extensions() -> String {
        extensions(|format| format.film().is_some())
    }

    /// The short names of some formats, as messages list them: "PNG and EXR".
    pub(crate) fn short_names(is_named: fn(Format) -> bool) -> String {
        let names: Vec<&str> =
            ALL.iter().filter(|format| is_named(**format)).map(|format| format.short_name()).collect();
        word_list(&names, "and")
    }

    pub(crate) fn extension(self) -> &'static str {
        match self {
            Format::Picture(format) => format.extension(),
            Format::Movie(format) => format.extension(),
        }
    }

    pub(crate) fn short_name(self) -> &'static str {
        match self {
            Format::Picture(format) => format.short_name(),
            Format::Movie(format) => format.short_name(),
        }
    }

    /// The picture format; `None` for films.
    pub(crate) fn picture(self) -> Option<PictureFormat> {
        if let Format::Picture(format) = self { Some(format) } else { None }
    }

    /// The film format; `None` for pictures.
    pub(crate) fn film(self) -> Option<MovieFormat> {
        if let Format::Movie(format) = self { Some(format) } else { None }
    }

    /// What a picture of this format can hold; `None` for films.
    pub(crate) fn capabilities(self) -> Option<&'static Capabilities> {
        self.picture()?.capabilities()
    }

    /// Whether one file holds all layers of a picture.
    pub(crate) fn has_layers(self) -> bool {
        self.capabilities().is_some_and(|can| can.layers)
    }

    /// Whether a picture can have an alpha.
    pub(crate) fn has_alpha(self) -> bool {
        match self {
            Format::Picture(_) => self.capabilities().is_some_and(|can| can.alpha),
            Format::Movie(format) => format.has_alpha(),
        }
    }

    /// Whether the quality of values can be chosen.
    pub(crate) fn is_lossy(self) -> bool {
        self.capabilities().is_some_and(|can| can.lossy)
    }

    /// Whether ids of objects and materials can be whole numbers.
    pub(crate) fn has_whole_ids(self) -> bool {
        self.capabilities().is_some_and(|can| can.whole_ids)
    }

    /// Whether the effort of compression can be chosen.
    pub(crate) fn has_compression(self) -> bool {
        match self {
            Format::Picture(_) => self.capabilities().is_some_and(|can| can.compression),
            Format::Movie(format) => format.has_compression(),
        }
    }
}

fn extensions(is_named: fn(Format) -> bool) -> String {
    let named = ALL.iter().filter(|format| is_named(**format));
    word_list(&named.map(|format| format!(".{}", format.extension())).collect::<Vec<_>>(), "or")
}

impl Default for Format {
    fn default() -> Format {
        Format::Picture(PictureFormat::default())
    }
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Format::Picture(format) => format.name(),
            Format::Movie(format) => format.name(),
        })
    }
}

impl ValueEnum for Format {
    fn value_variants<'a>() -> &'a [Format] {
        &ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        let summary = match self {
            Format::Picture(format) => format.capabilities()?.summary,
            Format::Movie(format) => format.summary(),
        };
        Some(PossibleValue::new(self.extension()).help(summary))
    }
}
