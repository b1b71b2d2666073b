//! A room of 14 triangles with two lights, quick to load and render.

use std::fs;
use std::ops::{Deref, DerefMut};
use std::path::{Path, PathBuf};
use std::process::{Child, Output};

use assert_cmd::Command;
use tempfile::TempDir;

pub const OBJ: &str = "mtllib room.mtl
v -1 0 -1\nv 1 0 -1\nv 1 0 1\nv -1 0 1\nv -1 2 -1\nv 1 2 -1
v -.3 0 -.3\nv .3 0 -.3\nv .3 0 .3\nv -.3 0 .3
v -.3 .6 -.3\nv .3 .6 -.3\nv .3 .6 .3\nv -.3 .6 .3
o floor\nusemtl floor\nf 4 3 2 1
o wall\nusemtl wall\nf 1 2 6 5
o box\nusemtl red
f 14 13 12 11\nf 10 9 13 14\nf 8 7 11 12\nf 7 10 14 11\nf 9 8 12 13
";

pub const MTL: &str = "newmtl floor\nKd 0.5 0.5 0.5
newmtl wall\nKd 0.6 0.6 0.7
newmtl red\nKd 0.7 0.2 0.1
";

pub const TOML: &str = r#"schema = 1
[camera]
position = [0.0, 1.0, 3.0]
look_at = [0.0, 0.5, 0.0]
vfov = 45.0
size = [24, 18]
[main_object]
objects = ["box"]
[[lights]]
name = "key"
type = "rectangle"
position = [0.5, 1.8, 0.8]
look_at = [0.0, 0.3, 0.0]
half_extents = [0.2, 0.15]
radiance = 8.0
[[lights]]
name = "fill"
type = "sphere"
position = [-0.8, 1.2, 0.8]
radius = 0.1
radiance = 5.0
"#;

/// Options that make a run quick.
pub const QUICK: [&str; 10] =
    ["--work-size", "16x12", "--size", "24x18", "--spp", "4", "--final-spp", "4", "--max-evaluations", "4"];

/// A directory with the scene's three files; commands run in it.
pub struct Room {
    pub directory: TempDir,
}

impl Room {
    pub fn new() -> Self {
        Self::with(OBJ, MTL, TOML)
    }

    pub fn with(obj: &str, mtl: &str, toml: &str) -> Self {
        let room = Self { directory: tempfile::tempdir().unwrap() };
        room.write("room.obj", obj);
        room.write("room.mtl", mtl);
        room.write("room.toml", toml);
        room
    }

    pub fn path(&self, name: impl AsRef<Path>) -> PathBuf {
        self.directory.path().join(name)
    }

    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        let path = self.path(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, content).unwrap();
    }

    pub fn command(&self, arguments: &[&str]) -> Command {
        let mut command = program(self.directory.path());
        command.args(arguments);
        command
    }

    pub fn succeed(&self, arguments: &[&str]) -> Output {
        self.command(arguments).assert().code(0).get_output().clone()
    }

    /// The error's line: the only one on standard error besides progress.
    pub fn fail(&self, arguments: &[&str]) -> String {
        let assert = self.command(arguments).assert().code(1).stdout("");
        let stderr = String::from_utf8(assert.get_output().stderr.clone()).unwrap();
        let lines: Vec<&str> = stderr.lines().collect();
        let error = lines.last().copied().unwrap_or_default();
        assert!(error.starts_with("error: "), "{stderr}");
        assert_eq!(lines.iter().filter(|l| l.starts_with("error: ")).count(), 1, "{stderr}");
        assert!(!stderr.contains("panicked"), "{stderr}");
        error.to_owned()
    }

    /// As [`Self::fail`], when nothing at all comes before the error.
    pub fn fail_at_once(&self, arguments: &[&str]) -> String {
        let assert = self.command(arguments).assert().code(1).stdout("");
        let stderr = String::from_utf8(assert.get_output().stderr.clone()).unwrap();
        assert!(stderr.starts_with("error: ") && stderr.lines().count() == 1, "{stderr}");
        stderr.trim_end().to_owned()
    }
}

/// The program, run in a directory.
pub fn program(directory: &Path) -> Command {
    let mut command = Command::cargo_bin("lightopt-embree").unwrap();
    command.current_dir(directory);
    command
}

/// Runs a command that must fail with one line which says all of `wanted`.
pub fn refused(command: &mut Command, wanted: &[&str]) {
    let output = command.assert().failure().stdout("").get_output().clone();
    let text = String::from_utf8(output.stderr).unwrap();
    assert_eq!((text.lines().count(), output.status.code()), (1, Some(1)), "{text}");
    for want in wanted {
        assert!(text.contains(want), "`{want}` is not in: {text}");
    }
}

/// Names of the files in a directory, sorted.
pub fn names(directory: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        fs::read_dir(directory).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// A program at work. It ends with its test: one that fails would else leave it running, some of them for ever.
pub struct Running(pub Child);

impl Deref for Running {
    type Target = Child;
    fn deref(&self) -> &Child {
        &self.0
    }
}

impl DerefMut for Running {
    fn deref_mut(&mut self) -> &mut Child {
        &mut self.0
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // Most have ended.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Sends a signal to a program, by its name for `kill`.
pub fn signal(child: &Child, name: &str) {
    let kill = std::process::Command::new("kill").args([name, &child.id().to_string()]).status();
    assert!(kill.unwrap().success());
}

/// Waits until something is so, a minute at most.
pub fn wait_for(what: impl Fn() -> bool) {
    let start = std::time::Instant::now();
    while !what() {
        assert!(start.elapsed() < std::time::Duration::from_secs(60), "nothing happened");
        std::thread::sleep(std::time::Duration::from_millis(10));
    }
}
