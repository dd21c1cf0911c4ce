//! What the scripts of engines share: the commands of a job as functions of a shell.

use super::plan::{FarmPlan, Word};
use super::words::shell_word;
use crate::exit::Exit;
use crate::failure::Failure;
use std::io;
use std::path::PathBuf;

/// A script in the making. It is bytes, since paths may be no text.
pub(super) struct Script(Vec<u8>);

impl Script {
    /// A script with its first lines.
    pub(super) fn new(text: &str) -> Script {
        Script(text.as_bytes().to_vec())
    }

    /// Adds text.
    pub(super) fn text(&mut self, text: &str) -> &mut Script {
        self.bytes(text.as_bytes())
    }

    /// Adds bytes.
    pub(super) fn bytes(&mut self, bytes: &[u8]) -> &mut Script {
        self.0.extend(bytes);
        self
    }

    pub(super) fn into_bytes(self) -> Vec<u8> {
        self.0
    }
}

/// The folder in which relative paths are meant: the one where the job is written.
pub(super) fn folder() -> Result<PathBuf, Failure> {
    std::env::current_dir().map_err(|error: io::Error| {
        Failure::new(Exit::Failed, format!("the current folder: {}", crate::failure::reason(&error)))
    })
}

/// The words of a command for a shell. `special` writes those that an engine has its own way for.
pub(super) fn line(words: &[Word], special: &dyn Fn(&Word) -> Option<Vec<u8>>) -> Vec<u8> {
    let words = words.iter().map(|word| {
        special(word).unwrap_or_else(|| match word {
            Word::Text(text) => shell_word(text),
            Word::Scene(path) | Word::Input(_, path) | Word::Output(path) => shell_word(path.as_os_str()),
            Word::Part | Word::Work(_) | Word::WorkFolder => Vec::new(),
        })
    });
    words.collect::<Vec<_>>().join(&b' ')
}

/// The words of a command for bash, where the part's number is the first argument.
fn in_bash(words: &[Word]) -> Vec<u8> {
    line(words, &|word| {
        let word = match word {
            // Each flag begins a line.
            Word::Text(flag) if flag.as_encoded_bytes().starts_with(b"-") => {
                return Some([b"\\\n        ", &shell_word(flag)[..]].concat());
            }
            Word::Part => "\"$1/$count\"".to_owned(),
            Word::Work(name) => format!("\"$work/{}\"", name.replace('*', "$1")),
            Word::WorkFolder => "\"$work\"".to_owned(),
            _ => return None,
        };
        Some(word.into_bytes())
    })
}

/// The variables and functions of a job in bash. `more` are words that each part has besides.
pub(super) fn functions(plan: &FarmPlan, more: &str) -> Result<Script, Failure> {
    let mut script = Script::new("canaletto=${CANALETTO:-canaletto}   # the program on each machine\n");
    script.text("folder=").bytes(&shell_word(folder()?.as_os_str()));
    script.text("   # relative paths are meant from here, on each machine\n");
    script.text("work=").bytes(&shell_word(plan.work().as_os_str()));
    script.text(&format!(
        "   # the folder of parts, checkpoints and logs\ncount={}   # the number of parts\n\n",
        plan.parts
    ));
    let mut function = |name: &str, words: &[Word], more: &str| {
        script.text(&format!("{name}() {{\n    run \"$canaletto\" ")).bytes(&in_bash(words));
        script.text(&format!("{more}\n}}\n\n"));
    };
    if let Some(prepare) = &plan.prepare {
        function("prepare", prepare, more);
    }
    function("part", &plan.part, more);
    if let Some(merge) = &plan.merge {
        function("merge", merge, "");
    }
    Ok(script)
}

/// How scripts begin their work: with their own path, in the job's folder.
pub(super) const ENTER: &str = "script=$0
[[ $script == /* ]] || script=$PWD/$script
cd -- \"$folder\"
mkdir -p -- \"$work\"
";

/// The last cases of a script by its `step`: what comes before the parts and after them, and what isn't there.
pub(super) fn last_cases(plan: &FarmPlan) -> String {
    let case = |is_there: bool, name: &str| if is_there { format!("    {name}) {name} ;;\n") } else { String::new() };
    let (prepare, merge) = (case(plan.prepare.is_some(), "prepare"), case(plan.merge.is_some(), "merge"));
    format!("{prepare}{merge}    *) echo \"there is no step $step\" >&2; exit 2 ;;\nesac\n")
}

/// The first lines of a script: what it does, and how to run it.
pub(super) fn introduction(plan: &FarmPlan, engine: &str, usage: &str) -> String {
    let scene = plan.scene.display().to_string();
    let lines = format!(
        "Renders {scene} {engine}: {}.\n\n{usage}\n\ncanaletto farm wrote this file. Change what you \
         like.",
        plan.summary()
    );
    let comment: String = lines.lines().map(|line| format!("# {line}").trim_end().to_owned() + "\n").collect();
    comment.replace('\r', " ")
}
