//! `cargo xtask picture`, as a person runs it.

use super::programs::{ok, rerun};
use std::path::Path;
use std::process::Command;

/// Makes a drawing with the command line of Rerun alone: a picture that it shows.
fn drawing(folder: &Path) -> std::path::PathBuf {
    let (picture, drawing) = (folder.join("points.obj"), folder.join("points.rrd"));
    std::fs::write(&picture, "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 3//1\n").unwrap();
    let output = Command::new(rerun()).arg("--save").arg(&drawing).arg(&picture).output();
    ok("rerun --save", &output.unwrap());
    drawing
}

/// Width and height, which follow the signature and the head of the first part.
fn size(png: &[u8]) -> (u32, u32) {
    assert!(png.starts_with(b"\x89PNG\r\n\x1a\n") && png.ends_with(b"IEND\xae\x42\x60\x82"), "{} bytes", png.len());
    let number = |at: usize| u32::from_be_bytes(png[at..at + 4].try_into().unwrap());
    (number(16), number(20))
}

#[test]
fn a_picture_is_made_of_a_drawing_without_a_screen() {
    let folder = tempfile::tempdir().unwrap();
    let picture = folder.path().join("points.png");
    let output = Command::new(env!("CARGO"))
        .args(["xtask", "picture"])
        .arg(drawing(folder.path()))
        .arg(&picture)
        .args(["--size", "640x400", "--wait", "2"])
        .current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
        .output()
        .unwrap();
    if String::from_utf8_lossy(&output.stderr).contains("the viewer needs a Vulkan driver") {
        return rohrpost_testbed::report::skipped(&String::from_utf8_lossy(&output.stderr));
    }
    let said = ok("cargo xtask picture", &output);
    assert!(said.contains("points.png"), "it says where the picture is: {said}");
    let png = std::fs::read(&picture).unwrap();
    assert_eq!(size(&png), (640, 400));
    // One colour all over would take some hundreds.
    assert!(png.len() > 5000, "{} bytes", png.len());
}
