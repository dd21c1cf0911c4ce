//! Tests `peers list | head -1`: a closed pipe causes no panic.

use std::process::Command;

#[test]
fn a_closed_stdout_is_no_failure() {
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let output = Command::new(env!("CARGO_BIN_EXE_peers")).arg("list").stdout(writer).output().unwrap();
    assert!(output.status.success(), "{output:?}");
    assert!(output.stderr.is_empty(), "{output:?}");
}
