//! `canaletto form-factor`: the share of light that goes from one object to another.

use crate::exit::Exit;
use crate::failure::{Failure, eprint_line, print_diagnostics};
use crate::flags::{SourceFlags, named};
use crate::format::{JSON_VERSION, count, plural, short};
use crate::interrupt;
use crate::sampling_progress::SamplingDisplay;
use crate::settings::list;
use crate::source::{Reader, Source, build, on_threads};
use crate::stdout::{print, print_json};
use crate::terminal::Paint;
use canaletto::Named;
use canaletto::form_factor::{
    AverageHemicube, AverageHemicubeSettings, FormFactorError, FormFactorMethod, FormFactorSettings, FormFactors,
    HemicubeSettings, SampleSettings, Side, form_factors,
};
use canaletto::scene::{Content, Node, ObjectIds, Scene};
use canaletto::world::{ObjectSurface, World};
use canaletto_io::diagnostic::closest_word;
use clap::Args;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::ops::Range;

/// Prints the form factors between two objects: the share of the light of one that arrives at the other.
///
/// The objects are diffuse, and all others are in the way: every surface is opaque, but holes are open. Triangles, flat
/// meshes and boxes in full view of each other have an exact answer. For all others rays are sampled until the error
/// that you ask for is reached. --method chooses otherwise.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct FormFactorFlags {
    #[command(flatten)]
    pub source: SourceFlags,

    /// The object that sends light: its name, or its kind and number, such as "sphere #3"
    ///
    /// Objects without a name are counted for each kind, in the order of the file, as in `explain`. The name of a group
    /// or of an instance stands for all objects in it.
    #[arg(value_name = "A")]
    pub a: String,

    /// The object that receives light
    #[arg(value_name = "B")]
    pub b: String,

    /// Sets the side of A that counts
    #[arg(long, value_name = "SIDE", default_value = "front", value_parser = named::<Side>(),
        help_heading = "Surfaces")]
    pub side_a: Side,

    /// Sets the side of B that counts
    #[arg(long, value_name = "SIDE", default_value = "front", value_parser = named::<Side>(),
        help_heading = "Surfaces")]
    pub side_b: Side,

    /// Sets the frame [default: the scene's first, or 0]
    #[arg(long, value_name = "N", help_heading = "Scene")]
    pub frame: Option<u32>,

    /// Sets how the factor is computed
    #[arg(long, value_name = "METHOD", default_value = "auto", value_parser = named::<FormFactorMethod>(),
        help_heading = "Method")]
    pub method: FormFactorMethod,

    /// Sets the pixels along an edge of a hemicube's top face
    ///
    /// It is an even number from 4 to 4096. Each hemicube is drawn again with half of it, to estimate the error.
    #[arg(long, value_name = "N", default_value_t = 256, value_parser = resolution, help_heading = "Method")]
    pub hemicube: u32,

    /// Sets the number of points of A with a hemicube, rounded up to a multiple of 8
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = points, help_heading = "Method")]
    pub points: u32,

    /// Sets the standard error of F(A->B) at which sampling ends
    #[arg(long, allow_hyphen_values = true, value_name = "E", default_value = "1e-4", value_parser = error,
        help_heading = "Sampling")]
    pub error: f64,

    /// Sets the most rays, such as 1e6
    #[arg(long, allow_hyphen_values = true, value_name = "N", default_value = "1e9", value_parser = rays,
        help_heading = "Sampling")]
    pub max_rays: u64,

    /// Sets the seed of the random numbers; the same seed gives the same answer
    #[arg(long, value_name = "N", default_value_t = 0, help_heading = "Sampling")]
    pub seed: u64,

    /// Prints JSON
    #[arg(long, help_heading = "Messages")]
    pub json: bool,

    /// Shows no progress
    #[arg(short, long, help_heading = "Messages")]
    pub quiet: bool,
}

const EXAMPLES: &str = "\
Examples:
  canaletto form-factor scenes/form-factor.kdl floor ceiling
  canaletto form-factor scenes/form-factor.kdl ball plate --error 1e-5
  canaletto form-factor scenes/form-factor.kdl ball room --side-b back      # the room's inner side
  canaletto form-factor scenes/form-factor.kdl low high --method hemicube --hemicube 512
  canaletto form-factor scenes/form-factor.kdl floor \"disk #2\" --json | jq .a_to_b";

fn error(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(error) if error > 0.0 && error < 1.0 => Ok(error),
        _ => Err("write a number between 0 and 1, such as 1e-4".into()),
    }
}

fn rays(text: &str) -> Result<u64, String> {
    // The most numbers of the generator.
    const MOST: f64 = 1e11;
    match text.parse::<f64>() {
        Ok(rays) if (1.0..=MOST).contains(&rays) => Ok(rays as u64),
        _ => Err(format!("write a number between 1 and {MOST:e}, such as 1e6")),
    }
}

fn resolution(text: &str) -> Result<u32, String> {
    const MOST: u32 = HemicubeSettings::MAX_RESOLUTION;
    match text.parse::<u32>() {
        Ok(side) if (4..=MOST).contains(&side) && side % 2 == 0 => Ok(side),
        _ => Err(format!("write an even number from 4 to {MOST}, such as 512")),
    }
}

fn points(text: &str) -> Result<u32, String> {
    const MOST: u32 = AverageHemicubeSettings::MAX_POINTS;
    match text.parse::<u32>() {
        Ok(points) if (1..=MOST).contains(&points) => Ok(points),
        _ => Err(format!("write a number from 1 to {MOST}, such as 64")),
    }
}

/// The answer.
struct Answer {
    scene: String,
    names: [String; 2],
    sides: [Side; 2],
    factors: FormFactors,
    /// For each object in the way of rays that would have arrived without it: its name, or that of the outermost group
    /// around it, and their number. The largest number comes first.
    blocked: Vec<(String, u64)>,
}

/// Runs the command.
pub(crate) fn run(flags: &FormFactorFlags) -> Result<Exit, Failure> {
    let answer = on_threads(flags.source.threads, || answer(flags))??;
    if flags.json {
        print_json(&answer.json())?;
    } else {
        print(&answer.text())?;
    }
    if answer.factors.is_cancelled() {
        return Ok(Exit::Interrupted);
    }
    if answer.factors.sampled.is_some() && answer.factors.errors[0] > flags.error {
        let warning = Paint::stderr().yellow("warning:");
        eprint_line(&format!("{warning} --max-rays ended sampling before the error of {}", flags.error));
    }
    Ok(Exit::Done)
}

fn answer(flags: &FormFactorFlags) -> Result<Answer, Failure> {
    let mut reader = Reader::open_classic(&flags.source)?;
    reader.use_no_camera();
    let Source { name, scene, warnings, .. } = reader.at_chosen(None, flags.frame)?;
    print_diagnostics(&warnings, false);
    let names = [&flags.a, &flags.b];
    let [a, b] = names.map(|object| find(&name, &scene, object));
    let groups: Vec<(String, Range<u32>)> =
        scene.outermost_groups().into_iter().map(|(name, ids)| (name.to_owned(), ids)).collect();
    let (world, _) = build(&name, scene, &flags.source.build_options(flags.max_rays), None)?;
    let surface = |object: &str, ids: ObjectIds| {
        world.object_surface(ids).map_err(|e| Failure::new(Exit::Scene, format!("{name}: \"{object}\": {e}")))
    };
    let (a, b) = (surface(&flags.a, a?)?, surface(&flags.b, b?)?);
    let factors = factors(&world, [&a, &b], flags).map_err(|e| refused(&name, &names.map(String::as_str), e))?;
    let mut blocked: BTreeMap<&str, u64> = BTreeMap::new();
    for (object, rays) in factors.sampled.iter().flat_map(|sampled| &sampled.blocked) {
        let after = groups.partition_point(|(_, ids)| ids.start <= *object);
        let group = groups[..after].last().filter(|(_, ids)| ids.contains(object));
        let name = match group {
            Some((name, _)) => name,
            None => world.object_with_id(*object).map_or("an object", |object| &object.name),
        };
        *blocked.entry(name).or_default() += rays;
    }
    let mut blocked: Vec<(String, u64)> = blocked.into_iter().map(|(name, rays)| (name.to_owned(), rays)).collect();
    blocked.sort_by_key(|(_, rays)| std::cmp::Reverse(*rays));
    Ok(Answer { scene: name, names: names.map(Clone::clone), sides: [flags.side_a, flags.side_b], factors, blocked })
}

fn factors(
    world: &World,
    [a, b]: [&ObjectSurface; 2],
    flags: &FormFactorFlags,
) -> Result<FormFactors, FormFactorError> {
    // After a signal, the answer so far is printed.
    let _sampling = interrupt::Rendering;
    interrupt::Rendering::begins();
    let display = SamplingDisplay::begin(flags.quiet);
    let settings = FormFactorSettings {
        method: flags.method,
        sampling: SampleSettings { standard_error: flags.error, max_rays: flags.max_rays, seed: flags.seed },
        hemicubes: AverageHemicubeSettings { points: flags.points, resolution: flags.hemicube, seed: flags.seed },
    };
    let (a, b) = ((a, flags.side_a), (b, flags.side_b));
    let factors = form_factors(world, a, b, &settings, &|progress| display.show(progress));
    display.finish();
    factors
}

/// The objects with this name.
fn find(scene_name: &str, scene: &Scene, object: &str) -> Result<ObjectIds, Failure> {
    let ids = scene
        .objects_named(object)
        .map_err(|e| Failure::new(Exit::Scene, format!("{scene_name}: \"{object}\": {e}")))?;
    if !ids.is_empty() {
        return Ok(ids);
    }
    let failure = Failure::usage(format!("{scene_name} has no object \"{object}\""));
    if is_light(&scene.nodes, object) {
        return Err(failure.help("a light has no surface that rays meet; give its object a name"));
    }
    let mut names: Vec<String> = Vec::new();
    scene.for_each_object_name(|name| {
        if names.len() < MAX_NAMES {
            names.push(name.to_owned());
        }
    });
    names.sort_unstable();
    names.dedup();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let all = format!("its objects are {}", list(&names));
    Err(match closest_word(object, names.iter().copied()) {
        Some(near) => failure.help(format!("did you mean \"{near}\"? {all}")),
        None => failure.help(all),
    })
}

/// The most names that are compared with a wrong one.
const MAX_NAMES: usize = 1 << 16;

fn is_light(nodes: &[Node], name: &str) -> bool {
    nodes.iter().any(|node| match &node.content {
        Content::Light(light) => [&node.name, &light.name].into_iter().flatten().any(|own| &**own == name),
        Content::Group(children) => is_light(children, name),
        _ => false,
    })
}

fn refused(scene_name: &str, names: &[&str; 2], error: FormFactorError) -> Failure {
    let failure = |index: usize, problem: &str| {
        Failure::new(Exit::Scene, format!("{scene_name}: \"{}\" {problem}", names[index]))
    };
    match error {
        FormFactorError::NoArea(index) => failure(index, "has no area"),
        FormFactorError::Infinite => {
            failure(0, "is a plane, which is infinite: none of its light arrives anywhere else")
                .help("exchange the two: a plane can be B")
        }
        FormFactorError::NotAnalytic => {
            let [a, b] = names;
            Failure::new(Exit::Scene, format!("{scene_name}: \"{a}\" to \"{b}\": {error}"))
                .help("--method sampled or hemicube computes it with an error")
        }
        other => Failure::new(Exit::Failed, other),
    }
}

impl Answer {
    fn json(&self) -> Value {
        let FormFactors { values, errors, areas, area_errors, sampled, hemicubes, is_from_b, .. } = &self.factors;
        let surface = |k: usize| {
            let area = if areas[k].is_finite() { json!(areas[k]) } else { json!("infinity") };
            json!({ "name": self.names[k], "side": self.sides[k].name(), "area": area, "area_error": area_errors[k] })
        };
        let mut answer = json!({
            "version": JSON_VERSION,
            "scene": self.scene,
            "a": surface(0),
            "b": surface(1),
            "a_to_b": { "value": values[0], "error": errors[0] },
            "b_to_a": { "value": values[1], "error": errors[1] },
            "method": self.method().name(),
            "sampled": null,
            "hemicube": null,
        });
        if let Some(average) = hemicubes {
            answer["hemicube"] = json!({
                "points": average.points,
                "resolution": average.resolution,
                "point_error": average.point_error,
                "resolution_error": average.resolution_error,
                "complete": !average.cancelled,
            });
        }
        if let Some(sampled) = sampled {
            let blocked: Vec<Value> =
                self.blocked.iter().map(|(name, rays)| json!({ "object": name, "rays": rays })).collect();
            answer["sampled"] = json!({
                "from": if *is_from_b { "b" } else { "a" },
                "rays": sampled.rays,
                "arrived": sampled.arrived,
                "blocked": blocked,
                "complete": !sampled.cancelled,
            });
        }
        answer
    }

    /// The method that was used.
    fn method(&self) -> FormFactorMethod {
        match &self.factors {
            FormFactors { hemicubes: Some(_), .. } => FormFactorMethod::Hemicube,
            FormFactors { sampled: Some(_), .. } => FormFactorMethod::Sampled,
            _ => FormFactorMethod::Analytic,
        }
    }

    fn text(&self) -> String {
        const MOST: usize = 8;
        let FormFactors { values, errors, areas, area_errors, sampled, hemicubes, is_from_b, .. } = &self.factors;
        let mut rows: Vec<(&str, String)> = Vec::new();
        for (k, label) in ["A", "B"].into_iter().enumerate() {
            let area = match areas[k] {
                area if area.is_infinite() => "infinite".to_owned(),
                area if area_errors[k] > 0.0 => with_error(area, area_errors[k]),
                area => short(area).to_string(),
            };
            rows.push((label, format!("{}, {}, area {area}", self.names[k], self.sides[k].name())));
        }
        for (k, label) in ["F(A->B)", "F(B->A)"].into_iter().enumerate() {
            rows.push((label, with_error(values[k], errors[k])));
        }
        match (sampled, hemicubes) {
            (None, None) => rows.push(("method", "analytic; ± is a bound of the error".into())),
            (None, Some(average)) => {
                let AverageHemicube { points, resolution, point_error, resolution_error, cancelled, .. } = average;
                let ended = if *cancelled { ", interrupted" } else { "" };
                let hemicubes = format!("{} of {resolution} pixels", plural(u64::from(*points), "hemicube"));
                rows.push(("method", format!("{hemicubes} on A{ended}; ± is an estimate of the error")));
                let parts = format!("{point_error:.1e} by the points, {resolution_error:.1e} by the resolution");
                rows.push(("error", parts));
            }
            (Some(sampled), _) => {
                let from = if *is_from_b { "B" } else { "A" };
                let ended = if sampled.cancelled { ", interrupted" } else { "" };
                let rays = plural(sampled.rays, "ray");
                rows.push(("method", format!("sampled with {rays} from {from}{ended}; ± is the standard error")));
                rows.push(("arrived", plural(sampled.arrived, "ray")));
                for (index, (name, rays)) in self.blocked.iter().take(MOST).enumerate() {
                    let label = if index == 0 { "blocked" } else { "" };
                    rows.push((label, format!("{} by {name}", plural(*rays, "ray"))));
                }
                if self.blocked.len() > MOST {
                    let others = &self.blocked[MOST..];
                    let rays: u64 = others.iter().map(|(_, rays)| rays).sum();
                    let objects = plural(others.len() as u64, "other object");
                    rows.push(("", format!("{} by {objects}", count(rays))));
                }
            }
        }
        if values[0] == 0.0 && self.blocked.is_empty() && !self.factors.is_cancelled() {
            let hint = "the sides that count don't see each other; --side-a and --side-b choose others";
            rows.push(("note", hint.into()));
        }
        rows.iter().map(|(name, text)| format!("{name:<10}{text}\n")).collect()
    }
}

/// A number with its error, to the digits that the error leaves.
fn with_error(value: f64, error: f64) -> String {
    // The exponent of the error, such as −5 for 1.2e-5.
    let exponent = format!("{error:e}").split_once('e').and_then(|(_, e)| e.parse::<i32>().ok()).unwrap_or(0);
    let digits = if error > 0.0 { (1 - exponent).clamp(0, 15) as usize } else { 15 };
    format!("{value:.digits$} ± {error:.1e}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_the_digits_of_their_error() {
        assert_eq!(with_error(0.199_824_9, 8.7e-5), "0.199825 ± 8.7e-5");
        assert_eq!(with_error(0.2, 1.4e-15), "0.200000000000000 ± 1.4e-15");
        assert_eq!(with_error(12345.6, 30.0), "12346 ± 3.0e1");
        assert_eq!(with_error(0.0, 0.0), "0.000000000000000 ± 0.0e0");
    }

    #[test]
    fn numbers_of_flags() {
        assert_eq!((error("1e-4"), rays("1e6"), rays("20")), (Ok(1e-4), Ok(1_000_000), Ok(20)));
        for text in ["0", "-1", "2", "nan", "x"] {
            assert!(error(text).unwrap_err().contains("between 0 and 1"), "{text}");
        }
        assert_eq!((resolution("512"), points("20")), (Ok(512), Ok(20)));
        for text in ["0", "3", "255", "8192", "-2", "x"] {
            assert!(resolution(text).unwrap_err().contains("even number from 4 to 4096"), "{text}");
        }
        assert!(points("0").is_err() && points("1e9").is_err());
        assert!(rays("0").is_err() && rays("1e30").is_err() && rays("inf").is_err());
    }
}
