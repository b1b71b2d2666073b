//! Equal pictures are equal files, also from separate processes.

use std::path::Path;
use std::process::Command;

use lightopt_embree::film::exr::{ExrImage, ExrPart, write_exr};
use serde_json::json;

/// When set, the test writes the picture there instead of testing: its own child process.
const DESTINATION: &str = "LIGHTOPT_TEST_EXR_DESTINATION";

fn write_picture(path: &Path) {
    let (width, height) = (40, 30);
    let rgb: Vec<[f32; 3]> =
        (0..width * height).map(|i| [i as f32, (i as f32).sin(), 1.0 / (1.0 + i as f32)]).collect();
    let image = ExrImage {
        width,
        height,
        parts: vec![
            ExrPart::rgb("beauty", &rgb),
            ExrPart::rgb("light.key", &rgb),
            ExrPart::single("mask", "mask", vec![1.0; rgb.len()]),
        ],
        lightopt: Some(json!({ "b": 1, "a": { "z": [1.5], "y": null }, "x": "é" })),
    };
    write_exr(path, &image).unwrap();
}

#[test]
fn separate_processes_write_the_same_bytes() {
    if let Some(destination) = std::env::var_os(DESTINATION) {
        write_picture(Path::new(&destination));
        return;
    }
    let directory = tempfile::tempdir().unwrap();
    let written_elsewhere = |name: &str| {
        let path = directory.path().join(name);
        let status = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "exr_bytes::separate_processes_write_the_same_bytes"])
            .env(DESTINATION, &path)
            .output()
            .unwrap();
        assert!(status.status.success());
        std::fs::read(path).unwrap()
    };
    let here = directory.path().join("here.exr");
    write_picture(&here);
    let here = std::fs::read(here).unwrap();
    for name in ["1.exr", "2.exr", "3.exr"] {
        assert!(written_elsewhere(name) == here, "{name} differs");
    }
}
