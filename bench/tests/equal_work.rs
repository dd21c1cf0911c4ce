//! Renderers that are compared trace equally many camera rays.

use std::path::Path;
use std::process::Command;

#[test]
fn compared_pictures_have_one_camera_ray_for_each_pixel() {
    let peers = env!("CARGO_BIN_EXE_peers");
    if !Path::new(peers).with_file_name("canaletto").is_file() {
        eprintln!("skipped: the program canaletto isn't built (cargo test --workspace builds it)");
        return;
    }
    // It counts the rays of each renderer that reports them before it measures, and fails where they differ.
    let run = ["--rounds", "1", "--threads", "1", "--size", "64x36", "pictures", "--scene", "balls,serpent"];
    let output = Command::new(peers).args(run).output().unwrap();
    assert!(output.status.success(), "{output:?}");
}
