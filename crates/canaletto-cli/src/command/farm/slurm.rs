//! A job for Slurm: a script that submits itself as an array of parts, and the merge after them.

use super::plan::FarmPlan;
use super::shell::{ENTER, Script, functions, introduction, last_cases};
use super::words::typed;
use crate::failure::Failure;
use std::path::Path;

/// The processors of a part without --threads.
const PROCESSORS: u16 = 4;

/// How a command is run, so that signals reach it, and when its task is queued again.
const RUN: &str = r#"# Runs a command. A minute before the time limit Slurm sends USR1: the program keeps its samples, and
# the task is queued again. So is one that a signal killed. scancel and errors end it.
run() {
    local pid code=0 ended=''
    local task=${SLURM_JOB_ID:-}
    [[ -z ${SLURM_ARRAY_JOB_ID:-} ]] || task=${SLURM_ARRAY_JOB_ID}_$SLURM_ARRAY_TASK_ID
    "$@" &
    pid=$!
    trap 'ended=limit; kill -TERM "$pid" 2>/dev/null || true' USR1
    trap 'ended=cancelled; kill -TERM "$pid" 2>/dev/null || true' TERM
    while :; do
        code=0
        wait "$pid" || code=$?
        kill -0 "$pid" 2>/dev/null || break
    done
    if ((code > 128)) && [[ -n $task && $ended != cancelled ]]; then
        if [[ $ended == limit ]] || ((${SLURM_RESTART_COUNT:-0} < restarts)); then
            scontrol requeue "$task" && sleep 60   # Slurm ends this script meanwhile.
        fi
    fi
    return "$code"
}

"#;

/// The script.
pub(super) fn script(plan: &FarmPlan, path: &Path) -> Result<Vec<u8>, Failure> {
    let file = typed(path);
    let merge =
        if plan.merge.is_some() { format!("\nbash {file} merge    merges the parts here") } else { String::new() };
    let usage = format!("bash {file}          submits the job\nbash {file} part 3   renders a part here{merge}");
    let job_name: String = plan.name().chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).collect();
    let processors = plan.threads.unwrap_or(PROCESSORS);
    let mut script = Script::new("#!/bin/bash\n");
    script.text(&introduction(plan, "on a Slurm cluster", &usage));
    script.text(&format!(
        "#SBATCH --job-name=canaletto-{job_name}
#SBATCH --output=/dev/null          # each step has a log in the folder of parts
#SBATCH --cpus-per-task={processors}
#SBATCH --requeue
#SBATCH --signal=B:USR1@60
##SBATCH --time=2:00:00             # two # hide a line from Slurm
##SBATCH --mem=8G
##SBATCH --partition=render
set -euo pipefail

restarts=3   # how often a killed task is queued again
"
    ));
    let threads =
        if plan.threads.is_none() { " \\\n        --threads \"${SLURM_CPUS_PER_TASK:-$(nproc)}\"" } else { "" };
    let functions = functions(plan, threads)?;
    script.bytes(&functions.into_bytes()).text(RUN);
    script.text("submit() {\n    local script=$1 after=()\n");
    if plan.prepare.is_some() {
        script.text(
            "    prepared=$(sbatch --parsable \"$script\" prepare)
    after=(--dependency=\"afterok:${prepared%%;*}\" --kill-on-invalid-dep=yes)
    echo \"prepares it:       job ${prepared%%;*}\"\n",
        );
    }
    script.text(
        "    parts=$(sbatch --parsable --array=\"1-$count\" ${after[@]+\"${after[@]}\"} \"$script\" part)
    echo \"renders $count parts: job ${parts%%;*}\"\n",
    );
    if plan.merge.is_some() {
        script.text(
            "    merged=$(sbatch --parsable --dependency=\"afterok:${parts%%;*}\" --kill-on-invalid-dep=yes \\
        \"$script\" merge)
    echo \"merges them:       job ${merged%%;*}\"\n",
        );
    }
    script.text("}\n\n").text(ENTER).text(
        "step=${1:-submit}
number=${2:-${SLURM_ARRAY_TASK_ID:-}}
if [[ -n ${SLURM_JOB_ID:-} && $step != submit ]]; then
    exec >>\"$work/$step${number:+-$number}.log\" 2>&1
fi
case $step in
    submit) submit \"$script\" ;;
    part) part \"${number:?the number of the part}\" ;;\n",
    );
    script.text(&last_cases(plan));
    Ok(script.into_bytes())
}
