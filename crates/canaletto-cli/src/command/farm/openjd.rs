//! A job as a template of Open Job Description 2023-09, which AWS Deadline Cloud and others run.

use super::JobFile;
use super::plan::{FarmPlan, Word};
use super::shell::folder;
use crate::command_files::folder_of;
use crate::exit::Exit;
use crate::failure::{Failure, reason};
use serde_json::json;
use std::fmt::Write;
use std::path::Path;

/// The longest name of a job.
const MOST_NAME: usize = 128;

/// The template, with files of values for its parameters.
pub(super) fn bundle(plan: &FarmPlan, path: &Path) -> Result<Vec<JobFile>, Failure> {
    let base = folder()?;
    let (scene, output) = (base.join(&plan.scene), base.join(&plan.output));
    let scene_folder = folder_of(&scene).canonicalize();
    let scene_folder =
        scene_folder.map_err(|e| Failure::new(Exit::Scene, format!("{}: {}", scene.display(), reason(&e))))?;
    let name =
        |file: &Path| -> Result<String, Failure> { template_text(file.file_name().map(Path::new).unwrap_or(file)) };
    let (scene_name, output_name, work_name) = (name(&scene)?, name(&output)?, name(&plan.work())?);
    let mut values = vec![
        ("SceneFolder".to_owned(), checked_path(&scene_folder)?),
        ("OutputFolder".to_owned(), checked_path(folder_of(&output))?),
    ];
    let mut parameters = String::new();
    let mut parameter = |name: &str, kind: &str, more: &[(&str, String)], description: &str| {
        let _ = writeln!(parameters, "- name: {name}\n  type: {kind}\n  description: {description}");
        more.iter().for_each(|(key, value)| {
            let _ = writeln!(parameters, "  {key}: {value}");
        });
    };
    let folder_of_kind = |flow: &str| [("objectType", "DIRECTORY".to_owned()), ("dataFlow", flow.to_owned())];
    parameter("SceneFolder", "PATH", &folder_of_kind("IN"), "The folder of the scene, with all files that it names.");
    parameter("OutputFolder", "PATH", &folder_of_kind("OUT"), "The folder of the result and of the parts.");
    parameter(
        "Parts",
        "INT",
        &[("default", plan.parts.to_string()), ("minValue", "1".to_owned())],
        "The number of parts.",
    );
    parameter("Canaletto", "STRING", &[("default", "canaletto".to_owned())], "The program on each machine.");
    let mut inputs: Vec<(&str, String)> = Vec::new();
    for word in plan.prepare.iter().flatten().chain(&plan.part) {
        if let Word::Input(flag, file) = word
            && inputs.iter().all(|(known, _)| known != flag)
        {
            let kind = flag.trim_start_matches('-');
            let parameter_name = format!("{}{}", kind[..1].to_uppercase(), &kind[1..]);
            let more = [("objectType", "FILE".to_owned()), ("dataFlow", "IN".to_owned())];
            parameter(&parameter_name, "PATH", &more, &format!("The file of {flag}."));
            values.push((parameter_name.clone(), checked_path(&base.join(file))?));
            inputs.push((flag, parameter_name));
        }
    }
    let arguments = |words: &[Word]| -> Result<String, Failure> {
        let mut list = String::new();
        for word in words {
            let argument = match word {
                Word::Text(text) => template_text(Path::new(text))?,
                Word::Scene(_) => format!("{{{{Param.SceneFolder}}}}/{scene_name}"),
                Word::Output(_) => format!("{{{{Param.OutputFolder}}}}/{output_name}"),
                Word::Input(flag, _) => {
                    let name = inputs.iter().find(|(known, _)| known == flag).map_or("", |(_, name)| name);
                    format!("{{{{Param.{name}}}}}")
                }
                Word::Part => "{{Task.Param.Part}}/{{Param.Parts}}".to_owned(),
                Word::Work(file) => {
                    let file = file.replace('*', "{{Task.Param.Part}}");
                    format!("{{{{Param.OutputFolder}}}}/{work_name}/{file}")
                }
                Word::WorkFolder => format!("{{{{Param.OutputFolder}}}}/{work_name}"),
            };
            let _ = writeln!(list, "        - {}", json!(argument));
        }
        Ok(list)
    };
    let mut steps = String::new();
    let mut step = |name: &str, needs: Option<&str>, has_parts: bool, words: &[Word]| -> Result<(), Failure> {
        let _ = writeln!(steps, "- name: {name}");
        if let Some(needs) = needs {
            let _ = writeln!(steps, "  dependencies:\n  - dependsOn: {needs}");
        }
        if has_parts {
            steps += "  parameterSpace:\n    taskParameterDefinitions:\n    - name: Part\n      type: INT\n      \
                      range: \"1-{{Param.Parts}}\"\n";
        }
        steps += "  script:\n    actions:\n      onRun:\n        command: \"{{Param.Canaletto}}\"\n        args:\n";
        steps += &arguments(words)?;
        if has_parts {
            // Cancelled parts get a SIGTERM, and keep their samples.
            steps += "        cancelation:\n          mode: NOTIFY_THEN_TERMINATE\n          \
                      notifyPeriodInSeconds: 30\n";
        }
        Ok(())
    };
    let progress = |words: &[Word], makes_folder: bool| -> Vec<Word> {
        let mut words = words.to_vec();
        words.extend(["--progress", "openjd"].map(|word| Word::Text(word.into())));
        words.extend(makes_folder.then(|| Word::Text("--mkdir".into())));
        words
    };
    if let Some(words) = &plan.prepare {
        step("Prepare", None, false, &progress(words, true))?;
    }
    step("Render", plan.prepare.is_some().then_some("Prepare"), true, &progress(&plan.part, true))?;
    if let Some(words) = &plan.merge {
        step("Merge", Some("Render"), false, words)?;
    }
    let usage = plan.how_to_run(super::Engine::Openjd, path);
    let mut title = format!("{} by canaletto", plan.name());
    title = title.chars().filter(|c| !c.is_control()).take(MOST_NAME).collect();
    let template = format!(
        "# {}\n#\n# {usage}\n# deadline bundle submit submits it to AWS Deadline Cloud.\n#\n\
         # canaletto farm wrote this file. Change what you like.\nspecificationVersion: jobtemplate-2023-09\nname: {}\nparameterDefinitions:\n\
         {parameters}steps:\n{steps}",
        plan.summary().replace(['\n', '\r'], " "),
        json!(title.replace("{{", "{ {").replace("}}", "} }")),
    );
    let of_deadline: Vec<_> = values.iter().map(|(name, value)| json!({ "name": name, "value": value })).collect();
    let of_openjd: serde_json::Map<String, serde_json::Value> =
        values.iter().map(|(name, value)| (name.clone(), json!(value))).collect();
    let pretty = |value: &serde_json::Value| {
        let mut text = serde_json::to_string_pretty(value).unwrap_or_default();
        text.push('\n');
        text.into_bytes()
    };
    Ok(vec![
        JobFile { path: path.join("template.yaml"), content: template.into_bytes() },
        JobFile {
            path: path.join("parameter_values.json"),
            content: pretty(&json!({ "parameterValues": of_deadline })),
        },
        JobFile { path: path.join("values.json"), content: pretty(&json!(of_openjd)) },
    ])
}

/// Text of a command line in a template, where double braces and control characters mean something else.
fn template_text(word: &Path) -> Result<String, Failure> {
    let refuse = |why: &str| {
        let failure = Failure::usage(format!("farm openjd: {:?} can't stand in a template: {why}", word.display()));
        Err(failure.help("rename the file, or use another engine"))
    };
    match word.to_str() {
        None => refuse("it isn't UTF-8"),
        Some(text) if text.contains("{{") || text.contains("}}") => refuse("it has double braces"),
        Some(text) if text.chars().any(char::is_control) => refuse("it has a control character"),
        Some(text) => Ok(text.to_owned()),
    }
}

/// The value of a parameter for a path, which may have any text.
fn checked_path(path: &Path) -> Result<String, Failure> {
    path.to_str().map(str::to_owned).ok_or_else(|| {
        Failure::usage(format!("farm openjd: {:?} isn't UTF-8", path.display()))
            .help("rename it, or use another engine")
    })
}
