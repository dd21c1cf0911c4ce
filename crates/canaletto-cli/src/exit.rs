//! The exit codes of every subcommand.

use std::process::ExitCode;

/// How a command ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Exit {
    /// All is well.
    Done = 0,
    /// A file can't be written, or the system refuses something else.
    Failed = 1,
    /// The command line is wrong.
    Usage = 2,
    /// The scene, or a file that it names, is wrong.
    Scene = 3,
    /// Two pictures differ by more than a threshold.
    Threshold = 4,
    /// Stopped by Ctrl-C or a request to terminate.
    Interrupted = 130,
}

impl Exit {
    /// Every exit with its meaning, for the help and the manual.
    pub(crate) const ALL: [(Exit, &str); 6] = [
        (Exit::Done, "all is well"),
        (Exit::Failed, "something else failed: a file can't be written, no memory, ..."),
        (Exit::Usage, "the command line is wrong"),
        (Exit::Scene, "the scene, or a file that it names, is wrong or missing"),
        (Exit::Threshold, "compare: the pictures differ by more than a threshold"),
        (
            Exit::Interrupted,
            "interrupted; render has kept the frames that were finished, and what there is of a picture as name.partial.png",
        ),
    ];

    /// The number that the shell sees.
    pub(crate) fn code(self) -> u8 {
        self as u8
    }

    /// All codes as text, a line each.
    pub(crate) fn table() -> String {
        let mut out = String::from("Exit codes:\n");
        for (exit, meaning) in Exit::ALL {
            out += &format!("  {:>3}  {meaning}\n", exit.code());
        }
        out
    }
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> ExitCode {
        ExitCode::from(exit.code())
    }
}
