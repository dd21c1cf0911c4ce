//! A job for GNU parallel: a script that renders the parts here, or on machines by ssh that share the folder.

use super::plan::FarmPlan;
use super::shell::{ENTER, Script, functions, introduction, last_cases};
use super::words::typed;
use crate::failure::Failure;
use std::path::Path;

/// The script.
pub(super) fn script(plan: &FarmPlan, path: &Path) -> Result<Vec<u8>, Failure> {
    let file = typed(path);
    let usage = format!(
        "bash {file}                    renders it here\nHOSTS=a,b,c bash {file}        renders it on these machines \
         by ssh (: is this one)\nbash {file} part 3             renders a part here\n\nAll machines have the folder \
         below at the same place, and the program. What is finished isn't rendered again."
    );
    let mut script = Script::new("#!/bin/bash\n");
    script.text(&introduction(plan, "by GNU parallel", &usage)).text("set -euo pipefail\n\n");
    script.text("hosts=${HOSTS:-:}   # the machines\njobs=${JOBS:-1}   # the parts that a machine renders at once\n");
    script.text("tries=3   # how often a part is tried, each time on another machine\n");
    script.bytes(&functions(plan, "")?.into_bytes());
    script.text("run() { \"$@\"; }\n\n").text(ENTER).text("step=${1:-all}\ncase $step in\n    all)\n");
    if plan.prepare.is_some() {
        script.text("        prepare\n");
    }
    script.text(
        "        seq \"$count\" | parallel --quote --will-cite --sshlogin \"$hosts\" --jobs \"$jobs\" \\
            --retries \"$tries\" --joblog \"$work/parts.log\" \\
            env CANALETTO=\"$canaletto\" bash \"$script\" part {}\n",
    );
    if plan.merge.is_some() {
        script.text("        merge\n");
    }
    script.text("        ;;\n    part) part \"${2:?the number of the part}\" >>\"$work/part-$2.log\" 2>&1 ;;\n");
    script.text(&last_cases(plan));
    Ok(script.into_bytes())
}
