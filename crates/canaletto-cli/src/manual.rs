//! docs/cli.md, generated from the definitions of commands and flags. A test keeps both equal.

use crate::exit::Exit;
use crate::{Cli, layers};
use clap::{Arg, Command, CommandFactory};
use std::fmt::Write;
use std::path::Path;

const HEAD: &str = "\
<!-- Made of the commands' own definitions: CANALETTO_BLESS=1 cargo test -p canaletto-cli manual -->
# The command line

`canaletto COMMAND --help` says the same in the terminal, and `canaletto man` makes manual pages. Results go to the
standard output, everything else to stderr; colours are for terminals only and respect `NO_COLOR`.

";

const EVENTS: &str = "\
## Events of `--progress json`

With `--progress json` stderr carries one JSON object per line, each with its kind as `event`:

| event | when | fields |
|---|---|---|
| `diagnostics` | the scene is read, or built, and has warnings | `diagnostics`: a list of `severity`, `message`, `file`, `bytes`, `start`, `end`, `label`, `help` |
| `plan` | with `--dry-run`, in place of all events below | `version`, `scene`, `camera`, `size`, `frames`, `files`, `census`, `memory` (bytes: `world`, `picture`, `peak`) |
| `skipped` | a frame is complete already | `frame`, `files` |
| `denoised` | a frame is denoised | `frame`, `denoiser`, `seconds`, `outlier_light` (the share of light in single bright samples), `lost_light` (the part of it that is left out, since it would show) |
| `start` | a frame begins | `version`, `scene`, `camera`, `frame`, `frames` (first and last), `frames_done`, `frames_total`, `size`, `pixels`, `threads`, `files` |
| `solving` | radiosity is solved, or a picture graded: in each new phase, and at most five times a second | `frame`, `phase` (`patches`, `lights`, `links`, `balance`, `shooting`, `mistakes`, `numbers`), `patches`, `links`, `seconds`; `round` and `rounds` of `links`, `bounce` of `balance`, `step` and `unsent` (the share of the light) of `shooting`, `step` of `mistakes` and `numbers` |
| `preview` | a coarse picture of `--preview` is written | `frame`, `block` (the side of its blocks of pixels), `file` |
| `progress` | at most five times a second | `frame`, `pixels_done`, `pixels`, `percent`, `rays`, `rays_per_second`, `seconds`, `seconds_left`, `frames_done`, `frames_total`, `seconds_left_in_all`; of a picture in passes also `samples` and, with `--noise`, `noise` of the last pass |
| `resumed` | a frame goes on from its checkpoint | `frame`, `file`, `samples` of a pixel |
| `checkpoint` | a checkpoint is written | `file`, `samples` that each pixel has at least |
| `pass` | a pass of samples is over | `frame`, `samples` of a pixel, `next`: their number after the next pass, `pixels_left`: those that need more, `noise`, `seconds` |
| `outlook` | once, after a minute of a picture in passes | `frame`, `seconds`, `seconds_left`, `samples_needed` of the noisiest pixels and `out_of_reach` (whether `--samples` ends before), both with `--noise`; `noisiest` (`pixels`: the share of pixels that holds `noise`, a share of the noise; `pixel`: the noisiest one; `objects` with their shares), `clamp` (what `--clamp` of that value would take away: shares of `light` and of `noise`) |
| `done` | a frame is written | `frame`, `complete` (false if interrupted: `files` are parts then, and `samples_file` is the one with the samples of a picture that is no EXR, or `checkpoint` the file with which the same command goes on), `pixels_done`, `pixels`, `files`, `size`, `primitives`, `hierarchies`: BVHs of meshes and clouds (`kept` from the frame before, `refitted`, `built`), `solution` of radiosity (`solved`, `kept` from another frame, `read`), `samples` of a picture in passes (`fewest`, `most`, `mean`, `noise`, `non_finite`, `clamped`, `removed`: the share of light that --clamp took), `noise_left` of one that was stopped or missed its `--noise` (the fields of `outlook`), `rays` (by kind: `traced`, `hit`), `rays_total`, `rays_per_second`, `threads`, `seconds` (`read`, `build`, `render`, `write`) |
| `interrupted` | a film was stopped; its frames so far are kept in a file beside it | `frames`: their number, `files` |
| `finished` | all frames of `--frames` are complete | `frames`, `rendered`, `skipped`, `solves` (of radiosity), `seconds` |
| `watching` | with `--watch`, after each render; the next events are those of the next render | `files`: the number of files that are watched |
| `baked` | `bake` has written its files | `files`, `patches`, `triangles`, `charts`, `size` (of the light map), `texels_per_unit`, `coarse` (texels are larger than half a patch), `patch_limit_reached`, `clipped_planes`, `seconds` |
| `error` | something failed; the last line | `exit`: the exit code, and `message` and `help`, or `diagnostics` |

";

fn manual() -> String {
    let mut command = Cli::command();
    command.build();
    let mut out = HEAD.to_owned();
    let mut codes = String::from("## Exit codes\n\n| code | meaning |\n|---|---|\n");
    for (exit, meaning) in Exit::ALL {
        let _ = writeln!(codes, "| {} | {meaning} |", exit.code());
    }
    for sub in command.get_subcommands().filter(|c| c.get_name() != "help" && !c.is_hide_set()) {
        section(&mut out, sub);
    }
    let _ = write!(out, "## Layers\n\n```text\n{}\n```\n\n{EVENTS}{codes}", layers::MAPPINGS);
    out
}

fn section(out: &mut String, command: &Command) {
    let about = command.get_long_about().or(command.get_about()).map(ToString::to_string).unwrap_or_default();
    let usage = command.clone().render_usage().to_string();
    let usage = usage.trim_start_matches("Usage: ").trim();
    let _ = write!(out, "## canaletto {}\n\n{about}\n\n```text\n{usage}\n```\n\n", command.get_name());
    let positional: Vec<&Arg> = command.get_positionals().collect();
    table(out, "Arguments", &positional);
    let mut headings: Vec<&str> = Vec::new();
    for arg in command.get_arguments().filter(|arg| !arg.is_positional()) {
        let heading = arg.get_help_heading().unwrap_or("Options");
        if !headings.contains(&heading) {
            headings.push(heading);
        }
    }
    for heading in headings {
        let args: Vec<&Arg> = command
            .get_arguments()
            .filter(|arg| !arg.is_positional() && arg.get_help_heading().unwrap_or("Options") == heading)
            .filter(|arg| !matches!(arg.get_id().as_str(), "help" | "version"))
            .collect();
        table(out, heading, &args);
    }
    if let Some(examples) = command.get_after_help() {
        let examples = examples.to_string();
        let _ = write!(
            out,
            "```sh\n{}\n```\n\n",
            examples.trim_start_matches("Examples:\n").trim_end().replace("\n  ", "\n").trim_start()
        );
    }
}

fn table(out: &mut String, heading: &str, args: &[&Arg]) {
    if args.is_empty() {
        return;
    }
    let _ = write!(out, "| {heading} | |\n|---|---|\n");
    for arg in args {
        let _ = writeln!(out, "| `{}` | {} |", name(arg).replace('|', "\\|"), meaning(arg).replace('|', "\\|"));
    }
    out.push('\n');
}

fn name(arg: &Arg) -> String {
    let values = arg.get_value_names().unwrap_or_default().join(" ");
    if arg.is_positional() {
        return format!("{values}{}", if arg.get_num_args().is_some_and(|n| n.max_values() > 1) { "..." } else { "" });
    }
    let short = arg.get_short().map(|c| format!("-{c}, ")).unwrap_or_default();
    let long = arg.get_long().unwrap_or_default();
    let takes = arg.get_action().takes_values();
    format!("{short}--{long}{}", if takes { format!(" {values}") } else { String::new() })
}

fn meaning(arg: &Arg) -> String {
    let help = arg.get_long_help().or(arg.get_help()).map(ToString::to_string).unwrap_or_default();
    // The first line of a help text has no full stop; later paragraphs have one.
    let mut text = help.replacen("\n\n", ". ", 1).split_whitespace().collect::<Vec<_>>().join(" ");
    let values: Vec<_> = arg.get_possible_values().into_iter().filter(|_| arg.get_action().takes_values()).collect();
    let described = |v: &clap::builder::PossibleValue| match v.get_help() {
        Some(help) => format!("`{}` ({})", v.get_name(), help.to_string().trim_end_matches('.')),
        None => format!("`{}`", v.get_name()),
    };
    if !values.is_empty() {
        let lead = if text.ends_with('.') { " Values" } else { "" };
        let _ = write!(text, "{lead}: {}", values.iter().map(described).collect::<Vec<_>>().join(", "));
    }
    let defaults: Vec<_> = arg.get_default_values().iter().map(|v| v.to_string_lossy().into_owned()).collect();
    if !defaults.is_empty() && arg.get_action().takes_values() {
        let _ = write!(text, " [default: {}]", defaults.join(" "));
    }
    text
}

#[test]
fn manual_is_up_to_date() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/cli.md");
    let text = manual();
    if std::env::var_os("CANALETTO_BLESS").is_some_and(|v| v == "1") {
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, &text).unwrap();
    }
    let stored = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        stored.replace("\r\n", "\n") == text,
        "docs/cli.md isn't what the commands say: CANALETTO_BLESS=1 writes it anew"
    );
}

#[test]
fn clap_finds_no_fault() {
    Cli::command().debug_assert();
}

/// Help is written for terminals of 80 columns. Text with manual line breaks must fit.
#[test]
fn examples_are_not_too_wide() {
    for sub in Cli::command().get_subcommands() {
        for line in sub.get_after_help().map(ToString::to_string).unwrap_or_default().lines() {
            assert!(line.chars().count() <= 110, "{line}");
        }
    }
}

/// The words of a command line of the help, without quotes and escapes.
#[cfg(test)]
fn shell_words(line: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    let mut quote = None;
    for c in line.chars() {
        match (c, quote) {
            (c, Some(open)) if c == open => quote = None,
            ('\'' | '"', None) => quote = Some(c),
            (' ', None) => words.push(String::new()),
            _ => words.last_mut().unwrap().push(c),
        }
    }
    words.retain(|word| !word.is_empty());
    words
}

/// Whether a pattern with at most one `*` fits a file of the repository.
#[cfg(test)]
fn is_in_repository(pattern: &str) -> bool {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let Some((before, after)) = pattern.split_once('*') else { return root.join(pattern).is_file() };
    let folder = std::fs::read_dir(root.join(before)).into_iter().flatten();
    folder.flatten().any(|file| file.file_name().to_string_lossy().ends_with(after))
}

/// Examples can be pasted in their order at the root of the repository: their words are known, and each file that they
/// read is there or was written by an example before.
#[test]
fn examples_can_be_pasted() {
    const WRITES: [&str; 8] = ["-o", "--output", "--out", ">", "--save-solution", "--svg", "--html", "--diff"];
    let main = Cli::command();
    let helps = main.get_subcommands().chain([&main]).filter_map(|command| command.get_after_help());
    let (mut count, mut wrong) = (0, Vec::new());
    for help in helps {
        let help = help.to_string().replace("\\\n", "");
        let mut written: Vec<String> = Vec::new();
        for line in help.lines().filter(|line| line.starts_with("  ")) {
            let line = line.split("  #").next().unwrap().trim();
            for part in line.split(" | ") {
                let (command, into) = part.split_once(" > ").unwrap_or((part, ""));
                let words = shell_words(command);
                if words[0] == "canaletto" {
                    count += 1;
                    if let Err(mistake) = main.clone().try_get_matches_from(&words) {
                        wrong.push(format!("{line}: {mistake}"));
                    }
                }
                let is_converted = words.get(1).is_some_and(|word| word == "convert");
                let is_output = |i: usize| i > 0 && WRITES.contains(&words[i - 1].as_str()) || i == 3 && is_converted;
                let (own, inputs): (Vec<usize>, Vec<usize>) = (0..words.len()).partition(|i| is_output(*i));
                for word in inputs.into_iter().map(|i| &words[i]).filter(|word| !word.starts_with('-')) {
                    let names_file = Path::new(word).extension().is_some_and(|e| e.len() == 3 && e != "sum");
                    let is_there = || is_in_repository(word) || written.contains(word);
                    if names_file && !word.contains([',', '=', ' ', '[']) && !is_there() {
                        wrong.push(format!("{line}: no example before writes {word}"));
                    }
                }
                written.extend(own.into_iter().map(|i| words[i].clone()).chain([into.trim().to_owned()]));
            }
            if let ["canaletto", "render", scene, rest @ ..] =
                &shell_words(line).iter().map(String::as_str).collect::<Vec<_>>()[..]
                && !rest.contains(&"-o")
            {
                written.extend(Path::new(scene).file_stem().map(|stem| format!("{}.png", stem.display())));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(count > 60, "{count} commands");
}
