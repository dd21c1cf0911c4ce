//! A job for make: a makefile that renders the parts here, or on machines by ssh that share the folder.

use super::plan::{FarmPlan, Word};
use super::shell::{Script, folder, introduction, line};
use super::words::{quoted, shell_word, typed};
use crate::failure::Failure;
use std::path::Path;

/// They stand for the part's number, the command's first word and the number of parts until dollars are doubled. No
/// path of a job has them.
const NUMBER: u8 = 1;
const PROGRAM: u8 = 2;
const COUNT: u8 = 3;

/// The makefile.
pub(super) fn makefile(plan: &FarmPlan, path: &Path) -> Result<Vec<u8>, Failure> {
    let file = typed(path);
    let usage = format!(
        "make -f {file} -j 2                    renders two parts at once here\n\
         make -f {file} -j 3 HOSTS='a b c'      renders them on these machines by ssh\n\
         make -f {file} part-3                  renders one part\n\n\
         All machines have the folder below at the same place, and the program. What is finished isn't rendered again."
    );
    let mut script = Script::new(&introduction(plan, "by make", &usage));
    script.text("# The program on each machine, and the machines.\nCANALETTO = canaletto\nHOSTS =\n\n");
    script.text(&format!("COUNT = {}\nPARTS = $(addprefix part-,$(shell seq $(COUNT)))\n", plan.parts));
    script.text(
        "# What runs a command: a shell here, or on one of the machines, which take turns.\n\
         turn = $(word $(shell expr '(' $(1) - 1 ')' % $(words $(HOSTS)) + 1),$(HOSTS))\n\
         on = $(if $(HOSTS),ssh $(call turn,$(1)),sh -c)\n\n",
    );
    let (first, last) = (plan.prepare.as_deref(), plan.merge.as_deref());
    let name = |is_there: bool, name: &'static str| if is_there { name } else { "" };
    let (prepare, merge) = (name(first.is_some(), " prepare"), name(last.is_some(), " merge"));
    script.text(&format!(".PHONY: all folder{prepare}{merge} $(PARTS)\n\nall: $(PARTS){merge}\n\n"));
    script.text("folder:\n\t@").bytes(&in_folder([b"mkdir -p -- ", &shell_word(plan.work().as_os_str())], "")?);
    script.text("\n\n");
    if let Some(words) = first {
        script.text("prepare: | folder\n\t").bytes(&recipe(plan, words, "1", "prepare.log")?).text("\n\n");
    }
    script.text(&format!("$(PARTS): part-%:{prepare} | folder\n\t"));
    script.bytes(&recipe(plan, &plan.part, "$*", "part-*.log")?).text("\n");
    if let Some(words) = last {
        script.text("\nmerge: $(PARTS)\n\t").bytes(&recipe(plan, words, "1", "merge.log")?).text("\n");
    }
    Ok(script.into_bytes())
}

/// The line that runs a command of the job on the machine of a turn.
fn recipe(plan: &FarmPlan, words: &[Word], turn: &str, log: &str) -> Result<Vec<u8>, Failure> {
    let work = plan.work();
    let of_work =
        |name: &str| shell_word(work.join(name.replace('*', char::from(NUMBER).encode_utf8(&mut [0; 4]))).as_os_str());
    let words = line(words, &|word| match word {
        Word::Part => Some(vec![NUMBER, b'/', COUNT]),
        Word::Work(name) => Some(of_work(name)),
        Word::WorkFolder => Some(shell_word(work.as_os_str())),
        _ => None,
    });
    let log = [b" >>", &of_work(log)[..], b" 2>&1"].concat();
    in_folder([b"$(CANALETTO) ", &[words, log].concat()], turn)
}

/// A command in the job's folder, on the machine of a turn; here without one. Make replaces variables in `start`.
fn in_folder([start, command]: [&[u8]; 2], turn: &str) -> Result<Vec<u8>, Failure> {
    let all = [b"cd -- ", &shell_word(folder()?.as_os_str())[..], b" && ", &[PROGRAM], command].concat();
    let wrong = |word: &u8| *word == b'\n' || *word == b'\r';
    if all.iter().any(wrong) {
        return Err(Failure::usage("farm make: a line of a makefile can't have a path with a new line in it")
            .help("rename it, or use farm parallel"));
    }
    let quoted = if turn.is_empty() { all } else { quoted(&all) };
    let mut made = Vec::new();
    for byte in quoted {
        match byte {
            b'$' => made.extend(b"$$"),
            NUMBER => made.extend(b"$*"),
            PROGRAM => made.extend(start),
            COUNT => made.extend(b"$(COUNT)"),
            other => made.push(other),
        }
    }
    let on = if turn.is_empty() { String::new() } else { format!("$(call on,{turn}) ") };
    Ok([on.into_bytes(), made].concat())
}
