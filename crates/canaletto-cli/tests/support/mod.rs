//! What the tests of commands share: the program, folders with files, and what a run says.
#![allow(dead_code)] // Each program of tests uses a part.

use canaletto_io::picture::{Decoded, decode};
use std::fs;
use std::ops::Deref;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// The program.
pub(crate) const CANALETTO: &str = env!("CARGO_BIN_EXE_canaletto");

/// The project's root.
pub(crate) fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().unwrap()
}

/// The program in a folder.
pub(crate) fn canaletto(folder: impl AsRef<Path>) -> Command {
    let mut command = Command::new(CANALETTO);
    command.current_dir(folder).env_remove("NO_COLOR");
    command
}

/// Asserts the exit code, and that the standard output or error has these words. Returns both.
#[track_caller]
pub(crate) fn says(output: &Output, code: i32, words: &[&str]) -> String {
    let said = [&output.stdout, &output.stderr].map(|stream| String::from_utf8_lossy(stream)).concat();
    assert_eq!(output.status.code(), Some(code), "{said}");
    words.iter().for_each(|word| assert!(said.contains(word), "no {word:?} in:\n{said}"));
    said
}

/// What a run that succeeds prints.
#[track_caller]
pub(crate) fn printed(command: &mut Command) -> String {
    let output = command.output().unwrap();
    assert!(output.status.success(), "{command:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// A temporary folder with a scene.
pub(crate) struct Folder {
    folder: tempfile::TempDir,
    scene: String,
}

impl Folder {
    /// A folder with a scene of this name.
    pub(crate) fn new(scene: &str, text: &str) -> Folder {
        let folder = Folder { folder: tempfile::tempdir().unwrap(), scene: scene.to_owned() };
        folder.write(scene, text);
        folder
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub(crate) fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        fs::write(self.path(name), content).unwrap();
    }

    pub(crate) fn bytes(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).unwrap()
    }

    #[track_caller]
    pub(crate) fn picture(&self, name: &str) -> Decoded {
        decode(&self.bytes(name)).unwrap()
    }

    /// The names of all files except the scene.
    pub(crate) fn names(&self) -> Vec<String> {
        let entries = fs::read_dir(self.folder.path()).unwrap();
        let mut names: Vec<String> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.retain(|name| *name != self.scene);
        names.sort();
        names
    }

    /// The program in this folder, with arguments between spaces.
    pub(crate) fn command(&self, arguments: &str) -> Command {
        let mut command = canaletto(&self.folder);
        command.args(arguments.split_whitespace());
        command
    }

    pub(crate) fn run(&self, arguments: &str) -> Ran {
        Ran(self.command(arguments).output().unwrap())
    }

    /// Runs the program, and asserts what it says, as [`says`].
    #[track_caller]
    pub(crate) fn says(&self, arguments: &str, code: i32, words: &[&str]) -> String {
        says(&self.run(arguments), code, words)
    }
}

/// A run of the program that has ended.
pub(crate) struct Ran(pub(crate) Output);

impl Deref for Ran {
    type Target = Output;

    fn deref(&self) -> &Output {
        &self.0
    }
}

impl Ran {
    pub(crate) fn code(&self) -> i32 {
        self.status.code().unwrap()
    }

    pub(crate) fn out(&self) -> String {
        String::from_utf8_lossy(&self.stdout).into_owned()
    }

    pub(crate) fn err(&self) -> String {
        String::from_utf8_lossy(&self.stderr).into_owned()
    }

    /// Asserts what the run said, as [`says`].
    #[track_caller]
    pub(crate) fn says(&self, code: i32, words: &[&str]) -> &Ran {
        says(self, code, words);
        self
    }
}
