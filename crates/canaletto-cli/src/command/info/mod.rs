//! `canaletto info`: a summary of a scene, a model or a picture.

mod picture;
mod recipe;

use crate::digest::UsedFile;
use crate::exit::Exit;
use crate::failure::{Failure, print_diagnostics};
use crate::flags::{PictureFlags, SourceFlags};
use crate::format::{JSON_VERSION, bytes, count, duration, plural, short};
use crate::memory::Memory;
use crate::output_format::Format;
use crate::picture_file::picture_format;
use crate::settings::Settings;
use crate::source::{Source, build, on_threads};
use crate::stdout::{print, print_json};
use canaletto::light::{Light, PreparedLight};
use canaletto::material::{Material, Parameter, ParameterValue, Shown};
use canaletto::math::{Rgb, Transform};
use canaletto::scene::{CameraProjection, View};
use canaletto::world::{World, WorldStats};
use clap::Args;
use picture::print_picture;
pub(super) use recipe::quoted;
use serde_json::json;
use std::time::Duration;

/// Prints what a scene, a model or a picture consists of.
///
/// Of a scene or model: files, counts, bounds, memory, cameras, lights and materials. Of a picture: its format, the
/// settings in its file, and the command that makes it again.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct InfoFlags {
    #[command(flatten)]
    pub source: SourceFlags,

    /// Sets the frame [default: the scene's first, or 0]
    #[arg(long, value_name = "N", help_heading = "Scene")]
    pub frame: Option<u32>,

    /// Prints JSON
    #[arg(long, help_heading = "Messages")]
    pub json: bool,
}

const EXAMPLES: &str = "\
Examples:
  canaletto info scenes/models/spot.obj
  canaletto info scenes/models/spot.obj --build high   # memory and time of BVHs of high quality
  canaletto info scenes/still-life.kdl --json | jq .census.primitives
  canaletto render scenes/chapter/box-5.4.kdl -o box.png
  canaletto info box.png                         # its settings, and the command that makes it again
  canaletto info box.png --json | jq -r '.command | @sh' | (cd scenes/chapter && sh)   # does so";

/// The content of the summary.
struct Info {
    name: String,
    files: Vec<UsedFile>,
    views: Vec<View>,
    materials: Vec<Material>,
    world: World,
    read: Duration,
    build: Duration,
    /// The memory of a render through the first camera, without layers.
    memory: Memory,
}

/// Runs the command.
pub(crate) fn run(flags: &InfoFlags) -> Result<Exit, Failure> {
    if let Some(format) = picture_format(&flags.source.scene) {
        let given = [(!flags.source.set.is_empty(), "--set"), (flags.frame.is_some(), "--frame")];
        if let Some((_, flag)) = given.iter().find(|(given, _)| *given) {
            return Err(Failure::usage(format!("{flag}: {} is a picture", flags.source.scene.display())));
        }
        print_picture(&flags.source.scene, format, flags.json)?;
        return Ok(Exit::Done);
    }
    let info = on_threads(flags.source.threads, || {
        let source = Source::read(&flags.source, flags.frame)?;
        print_diagnostics(&source.warnings, false);
        let Source { name, scene, files, time: read, .. } = source;
        let (views, materials) = (scene.views.clone(), scene.materials.clone());
        // A scene without a camera has no picture.
        let job = Settings::new(&name, &scene, &PictureFlags::default()).ok().map(|settings| settings.job);
        let (world, build) = build(&name, scene, &flags.source.build_options(0), None)?;
        let memory = Memory::of(&world, job.as_ref(), Format::default(), false);
        Ok::<Info, Failure>(Info { name, files, views, materials, world, read, build, memory })
    })??;
    if flags.json {
        print_json(&info.json())?
    } else {
        print(&info.text())?
    };
    Ok(Exit::Done)
}

impl Info {
    /// The lowest and the highest corner of all bounded objects.
    fn bounds(&self) -> Option<[[f32; 3]; 2]> {
        let bounds = self.world.bounds();
        (!bounds.is_empty()).then(|| [bounds.min.to_array(), bounds.max.to_array()])
    }

    /// The lights with their positions in the scene's coordinates.
    fn lights(&self) -> Vec<Light> {
        let origin = self.world.origin();
        let there = |light: &Light| {
            if origin == Default::default() { light.clone() } else { light.transformed(&Transform::translate(origin)) }
        };
        self.world.lights.iter().map(|source| there(&source.light)).collect()
    }

    fn json(&self) -> serde_json::Value {
        json!({
            "version": JSON_VERSION,
            "scene": self.name,
            "files": self.files,
            "census": self.world.stats(),
            "memory": self.memory,
            "bounds": self.bounds(),
            "background": self.world.background,
            "ambient": self.world.ambient,
            "cameras": self.views,
            "lights": self.lights(),
            "materials": self.materials,
            "seconds": { "read": self.read.as_secs_f64(), "build": self.build.as_secs_f64() },
        })
    }

    fn text(&self) -> String {
        let mut rows: Vec<(&str, String)> = Vec::new();
        rows.push(("scene", self.name.clone()));
        let files = self.files.iter().map(|used| format!("{}, {}", used.file, bytes(used.bytes)));
        several(&mut rows, "files", files);
        let stats = self.world.stats();
        rows.push(("contents", contents(&stats)));
        rows.push(("hierarchies", bytes(stats.bytes)));
        rows.push(("memory", self.memory.words()));
        if let Some([low, high]) = self.bounds() {
            rows.push(("bounds", format!("{} to {}", vector(low), vector(high))));
        }
        rows.push(("background", rgb(self.world.background)));
        rows.push(("ambient", rgb(self.world.ambient)));
        several(&mut rows, "cameras", self.views.iter().map(camera));
        several(&mut rows, "lights", self.world.lights.iter().map(light));
        several(&mut rows, "materials", self.materials.iter().map(material));
        rows.push(("time", format!("read {}, build {}", duration(self.read), duration(self.build))));
        rows.iter().map(|(name, text)| format!("{name:<12}{text}\n")).collect()
    }
}

/// Adds one row per item, with the name in the first row. Long lists are cut.
fn several(rows: &mut Vec<(&'static str, String)>, name: &'static str, items: impl ExactSizeIterator<Item = String>) {
    const MOST: usize = 20;
    let total = items.len();
    if total == 0 {
        rows.push((name, "none".into()));
    }
    for (index, text) in items.take(MOST).enumerate() {
        rows.push((if index == 0 { name } else { "" }, text));
    }
    if total > MOST {
        rows.push(("", format!("... and {} more", count((total - MOST) as u64))));
    }
}

fn contents(stats: &WorldStats) -> String {
    let stored = [
        (stats.shapes, "single shape"),
        (stats.triangles, "triangle"),
        (stats.cloud_spheres, "sphere of clouds"),
        (stats.cloud_cylinders, "cylinder of clouds"),
    ];
    let stored: Vec<String> = stored
        .iter()
        .filter(|(n, _)| *n > 0)
        .map(|(n, noun)| match noun.split_once(' ') {
            Some((first, "of clouds")) => format!("{} of clouds", plural(*n, first)),
            _ => plural(*n, noun),
        })
        .collect();
    let stored = if stored.is_empty() { "nothing".to_owned() } else { stored.join(", ") };
    let objects = plural(stats.objects, "object");
    if stats.primitives > stats.shapes + stats.triangles + stats.cloud_spheres + stats.cloud_cylinders {
        format!("{objects}: {stored}; instances make them {}", plural(stats.primitives, "primitive"))
    } else {
        format!("{objects}: {stored}")
    }
}

fn camera(view: &View) -> String {
    let (i, e) = (&view.intrinsics, &view.extrinsics);
    let point = |p: [f64; 3]| format!("({}, {}, {})", short(p[0]), short(p[1]), short(p[2]));
    let window = match i.projection {
        CameraProjection::Orthographic { height } => format!("orthographic {}", short(height)),
        _ => format!("fovy {}", short(i.fovy)),
    };
    format!(
        "\"{}\": eye {}, center {}, {window}, {} x {} pixels",
        view.name,
        point(e.eye.to_array()),
        point(e.center.to_array()),
        i.width,
        i.height
    )
}

fn light(source: &PreparedLight) -> String {
    let light = &source.light;
    let name = light.name.as_ref().map_or_else(String::new, |name| format!("\"{name}\": "));
    let points = if source.points() > 1 { format!(", {} points", source.points()) } else { String::new() };
    let shadows = if light.shadows { "" } else { ", no shadows" };
    format!("{name}{}, intensity {}{points}{shadows}", light.kind_name(), rgb(light.intensity))
}

fn material(material: &Material) -> String {
    let phong = &material.classic();
    let shown: Vec<String> = Parameter::ALL
        .iter()
        .filter(|row| row.shown == Shown::Always || row.get(phong) != row.default_value())
        .map(|row| match row.get(phong) {
            ParameterValue::Color(color) => format!("{} {}", row.name, rgb(color)),
            ParameterValue::Number(number) => format!("{} {number}", row.name),
        })
        .collect();
    let mut text = format!("\"{}\": {}", material.name, shown.join(", "));
    if material.coverage < 1.0 {
        text += &format!(", coverage {}", material.coverage);
    }
    if material.two_sided {
        text += ", two-sided";
    }
    if material.priority != 0.0 {
        text += &format!(", priority {}", material.priority);
    }
    text
}

fn rgb(c: Rgb) -> String {
    format!("({}, {}, {})", c.r, c.g, c.b)
}

fn vector(v: [f32; 3]) -> String {
    format!("({}, {}, {})", v[0], v[1], v[2])
}
