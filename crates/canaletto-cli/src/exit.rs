//! The exit codes of all subcommands.

use crate::interrupt;
use std::process::ExitCode;

/// The result of a command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Exit {
    /// The command succeeded.
    Done = 0,
    /// A file can't be written, or the system refuses something else.
    Failed = 1,
    /// The command line is wrong.
    Usage = 2,
    /// The scene, or a file that it names, is wrong. A solution is wrong, or one of another scene.
    Scene = 3,
    /// Two pictures differ by more than a threshold, or a graded picture isn't right.
    Threshold = 4,
    /// Ctrl-C ended the command.
    Interrupted = 130,
    /// A termination signal ended the command. It stands in [`Exit::Interrupted`]'s place for the shell.
    Terminated = 143,
}

impl Exit {
    /// Every exit code with its meaning, for the help and the manual.
    pub(crate) const ALL: [(Exit, &str); 7] = [
        (Exit::Done, "success"),
        (Exit::Failed, "another failure: a file can't be written, memory is exhausted, ..."),
        (Exit::Usage, "the command line is wrong"),
        (Exit::Scene, "the scene, a file that it names or another input is wrong or missing, or a solution is refused"),
        (
            Exit::Threshold,
            "compare, compare-methods: the pictures differ by more than a threshold; grade: the picture isn't right",
        ),
        (
            Exit::Interrupted,
            "interrupted; render keeps finished frames, and the finished part of a picture as name.partial.png",
        ),
        (Exit::Terminated, "terminated by SIGTERM, which does the same"),
    ];

    /// The code for the shell. A termination signal has its own.
    pub(crate) fn code(self) -> u8 {
        match self {
            Exit::Interrupted if interrupt::is_terminated() => Exit::Terminated as u8,
            _ => self as u8,
        }
    }

    /// A table of all codes as text, one per line.
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
