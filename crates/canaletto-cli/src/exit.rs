//! The exit codes of all subcommands.

use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};

/// Whether a termination signal has arrived.
pub(crate) static TERMINATED: AtomicBool = AtomicBool::new(false);

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
    /// Parts of a picture are missing.
    PartMissing = 10,
    /// A part is there twice.
    PartDouble = 11,
    /// Two parts have samples in common.
    PartOverlap = 12,
    /// A part is of another scene.
    PartScene = 13,
    /// A part was made with other settings, or in another size.
    PartSetting = 14,
    /// A part was made by another version of the program.
    PartVersion = 15,
    /// A file is no part, or isn't whole.
    PartUnreadable = 16,
    /// The bytes of a part's pixels have changed.
    PartChanged = 17,
    /// Ctrl-C ended the command.
    Interrupted = 130,
    /// A termination signal ended the command. It stands in [`Exit::Interrupted`]'s place for the shell.
    Terminated = 143,
}

impl Exit {
    /// Every exit code with its meaning, for the help and the manual.
    pub(crate) const ALL: [(Exit, &str); 15] = [
        (Exit::Done, "success"),
        (Exit::Failed, "another failure: a file can't be written, memory is exhausted, ..."),
        (Exit::Usage, "the command line is wrong"),
        (Exit::Scene, "the scene, a file that it names or another input is wrong or missing, or a solution is refused"),
        (
            Exit::Threshold,
            "compare, compare-methods: the pictures differ by more than a threshold; grade: the picture isn't right",
        ),
        (Exit::PartMissing, "merge: parts are missing"),
        (Exit::PartDouble, "merge: a part is there twice"),
        (Exit::PartOverlap, "merge: two parts have samples in common"),
        (Exit::PartScene, "merge: a part is of another scene"),
        (Exit::PartSetting, "merge: a part was made with other settings, or in another size"),
        (Exit::PartVersion, "merge: a part was made by another version of the program"),
        (Exit::PartUnreadable, "merge: a file is no part, or isn't whole"),
        (Exit::PartChanged, "merge: the pixels of a part aren't those that were written"),
        (
            Exit::Interrupted,
            "interrupted; render keeps finished frames, and the finished part of a picture as name.partial.png",
        ),
        (Exit::Terminated, "terminated by SIGTERM, which does the same"),
    ];

    /// The code for the shell. A termination signal has its own.
    pub(crate) fn code(self) -> u8 {
        match self {
            Exit::Interrupted if TERMINATED.load(Ordering::Relaxed) => Exit::Terminated as u8,
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
