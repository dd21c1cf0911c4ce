//! The summary of a picture: its format, the settings that made it, and the command that makes it again.

use super::recipe::Recipe;
use crate::failure::Failure;
use crate::format::JSON_VERSION;
use crate::part::{Cut, PART, PICTURE_TEXTS};
use crate::partial::UNFINISHED;
use crate::picture_file::read_picture;
use crate::stdout::{print, print_json};
use canaletto::Named;
use canaletto_io::picture::{Decoded, PictureFormat, Window};
use serde_json::{Value, json};
use std::path::Path;

/// Prints the summary of the picture `path`.
pub(super) fn print_picture(path: &Path, format: PictureFormat, as_json: bool) -> Result<(), Failure> {
    let decoded = read_picture(path)?;
    let recipe = Recipe::of(path, format, &decoded);
    if as_json {
        print_json(&json(path, format, &decoded, recipe.as_ref()))
    } else {
        print(&text(path, format, &decoded, recipe.as_ref()))
    }
}

fn json(path: &Path, format: PictureFormat, decoded: &Decoded, recipe: Option<&Recipe>) -> Value {
    let texts: serde_json::Map<String, Value> =
        decoded.metadata.iter().map(|(key, text)| (key.clone(), json!(text))).collect();
    json!({
        "version": JSON_VERSION,
        "picture": path.display().to_string(),
        "format": format.short_name(),
        "size": [decoded.image.width, decoded.image.height],
        "bits": decoded.bits,
        "channels": decoded.image.channels.iter().map(|channel| &channel.name).collect::<Vec<_>>(),
        "part": Cut::of_texts(&decoded.metadata),
        "settings": texts,
        "command": recipe.map(|recipe| &recipe.arguments),
    })
}

fn text(path: &Path, format: PictureFormat, decoded: &Decoded, recipe: Option<&Recipe>) -> String {
    let image = &decoded.image;
    let curve = match decoded.transfer {
        _ if !decoded.display_referred => ", linear".to_owned(),
        Some(transfer) => format!(", transfer {}", transfer.name()),
        None => String::new(),
    };
    let kind = format!("{}, {} x {} pixels, {} bits{curve}", format.name(), image.width, image.height, decoded.bits);
    let channels: Vec<&str> = image.channels.iter().map(|channel| channel.name.as_str()).collect();
    let mut rows = vec![("picture", path.display().to_string()), ("format", kind), ("channels", channels.join(", "))];
    let part = Cut::of_texts(&decoded.metadata);
    if let Some(part) = part {
        rows.push(("part", part.words()));
    } else if decoded.window != Window::whole(image.width, image.height) {
        let Window { at: [x, y], whole: [width, height] } = decoded.window;
        rows.push(("part", format!("at {x},{y} of {width} x {height} pixels")));
    }
    let mut label = "settings";
    let is_setting = |key: &str| part.is_none() || ![PART, PICTURE_TEXTS].contains(&key);
    for (key, text) in decoded.metadata.iter().filter(|(key, _)| is_setting(key)) {
        // Further lines of a text stand below its first.
        let text = text.replace('\n', &format!("\n{:28}", ""));
        rows.push((std::mem::take(&mut label), format!("{key:<16}{text}")));
    }
    if decoded.metadata.is_empty() {
        rows.push((label, "none in the file".into()));
    }
    let mut out: String = rows.iter().map(|(name, text)| format!("{name:<12}{text}\n")).collect();
    if let Some(recipe) = recipe {
        let is_part = part.is_some() || decoded.metadata.iter().any(|(key, _)| key == UNFINISHED);
        out += if is_part { "\nthe command that makes all of it:\n" } else { "\nthe command that makes it again:\n" };
        out += &format!("  {}\n", recipe.command());
        if recipe.scene.is_none() && recipe.arguments.get(2).is_some_and(|scene| scene != "-") {
            out += "the scene isn't here: the file holds its name without a folder\n";
        }
    }
    out
}
