//! Every command with every kind of standard output: files, devices, closed ones, pipes whose reader has gone.
#![cfg(target_os = "linux")]

use std::fs::{self, File};
use std::process::{Command, Stdio};

const SCENE: &str = r#"
camera { eye 0 1 5; size 8 8 }
sphere { center 0 0 0; radius 1 }
light "omni" { position 3 3 3 }
"#;

/// Commands that print.
const COMMANDS: [&str; 20] = [
    "render s.kdl -q -o -",
    "render s.kdl --dry-run",
    "explain s.kdl -p 4,4",
    "explain s.kdl -p 4,4 --json",
    "explain s.kdl -p 4,4 --svg -",
    "explain s.kdl -p 4,4 --html -",
    "explain s.kdl -p 4,4 --diff-pixel 2,2",
    "form-factor r.kdl a b",
    "measure s.kdl --points p.csv --rays 16 --integrator path",
    "info s.kdl",
    "info s.png",
    "check s.kdl",
    "compare s.png s.png",
    "compare-methods s.kdl -o m.png",
    "ladder s.kdl -o -",
    "grade s.kdl s.png",
    "completions bash",
    "man",
    "help render",
    "--version",
];

#[test]
fn every_command_and_every_standard_output() {
    let folder = tempfile::tempdir().unwrap();
    let place = |name: &str| folder.path().join(name);
    fs::write(place("s.kdl"), SCENE).unwrap();
    let boxes = "box name=\"a\" { min 0 0 0; max 1 1 1 }\nbox name=\"b\" { min 0 2 0; max 1 3 1 }\n";
    fs::write(place("r.kdl"), boxes).unwrap();
    fs::write(place("p.csv"), "0 1.1 0 0 1 0\n").unwrap();
    let binary = env!("CARGO_BIN_EXE_canaletto");
    let run = |arguments: &str, out: Stdio| {
        let mut command = Command::new(binary);
        command.args(arguments.split_whitespace()).current_dir(folder.path());
        let done = command.stdin(Stdio::null()).stdout(out).stderr(Stdio::piped()).output().unwrap();
        (done.status.code().unwrap(), String::from_utf8_lossy(&done.stderr).into_owned())
    };
    let null = |read: bool| Stdio::from(File::options().read(read).write(true).open("/dev/null").unwrap());
    assert_eq!(run("render s.kdl -q -o s.png", null(false)).0, 0);
    let mut printing = 0;
    for arguments in COMMANDS {
        let file = || Stdio::from(File::create(place("out")).unwrap());
        let (code, said) = run(arguments, file());
        assert!(code == 0 || code == 4, "{arguments}: {said}");
        let prints = fs::metadata(place("out")).unwrap().len() > 0;
        printing += usize::from(prints);
        // Python's DEVNULL and Node's "ignore" open it for reading and writing.
        for out in [null(false), null(true)] {
            assert_eq!(run(arguments, out).0, code, "{arguments}: {said}");
        }
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        assert_eq!(run(arguments, writer.into()).0, code, "{arguments}, whose reader has gone");
        let full = Stdio::from(File::options().write(true).open("/dev/full").unwrap());
        let lost = if prints { 1 } else { code };
        let (full_code, full_said) = run(arguments, full);
        assert_eq!(full_code, lost, "{arguments} > /dev/full: {full_said}");
        let shell = |redirection: &str| {
            let line = format!("'{binary}' {arguments} {redirection}");
            let mut command = Command::new("sh");
            command.args(["-c", &line]).current_dir(folder.path()).stdin(Stdio::null());
            command.stdout(Stdio::null()).stderr(Stdio::null()).status().unwrap().code().unwrap()
        };
        assert_eq!(shell(">&-"), lost, "{arguments} >&-");
        assert_eq!(shell("2>&-"), code, "{arguments} 2>&-");
        assert_eq!(shell("2> /dev/full"), code, "{arguments} 2> /dev/full");
    }
    assert!(printing > 14, "{printing} commands print");
}
