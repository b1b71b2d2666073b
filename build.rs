//! Stamps where the program comes from, for manifests and image headers.
//!
//! Read with `env!`: `LIGHTOPT_COMMIT`, `LIGHTOPT_SOURCES` (hash of the sources), `LIGHTOPT_EMBREE`
//! (version of the headers), `LIGHTOPT_TARGET`, `LIGHTOPT_TARGET_FEATURES`, `LIGHTOPT_RUSTC`, `LIGHTOPT_PROFILE`.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// What the program is made of: changes elsewhere neither rebuild it nor make it dirty.
const SOURCES: [&str; 5] = ["Cargo.toml", "Cargo.lock", "build.rs", "ffi", "src"];

fn main() {
    for path in SOURCES {
        println!("cargo::rerun-if-changed={path}");
    }
    stamp("COMMIT", commit());
    stamp("SOURCES", Some(sources()));
    stamp("EMBREE", env::var("DEP_EMBREE_VERSION").ok());
    stamp("TARGET", env::var("TARGET").ok());
    stamp("TARGET_FEATURES", env::var("CARGO_CFG_TARGET_FEATURE").ok());
    stamp("RUSTC", env::var("RUSTC").ok().and_then(|rustc| run(&rustc, &["--version"])));
    stamp("PROFILE", env::var("PROFILE").ok());
}

fn stamp(name: &str, value: Option<String>) {
    println!("cargo::rustc-env=LIGHTOPT_{name}={}", value.as_deref().unwrap_or("unknown"));
}

/// Hash of all sources: other than the commit it differs between two states of an uncommitted tree,
/// and it is there outside git. Files are taken in the order of their paths.
fn sources() -> String {
    let mut files = Vec::new();
    let mut open: Vec<PathBuf> = SOURCES.iter().map(PathBuf::from).collect();
    while let Some(path) = open.pop() {
        match fs::read_dir(&path) {
            Ok(entries) => open.extend(entries.flatten().map(|entry| entry.path())),
            Err(_) => files.push(path),
        }
    }
    files.sort();
    // FNV-1a: the standard library's hash may differ between its versions.
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    for path in files {
        let content = fs::read(&path).unwrap_or_default();
        for byte in path.to_string_lossy().bytes().chain([0]).chain(content).chain([0]) {
            hash = (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }
    format!("{hash:016x}")
}

/// Short commit with `-dirty` when a source differs from it; `None` outside git.
fn commit() -> Option<String> {
    // Not of a repository that this directory merely lies in.
    if !run("git", &["rev-parse", "--show-prefix"])?.is_empty() {
        return None;
    }
    // The log grows at each commit, checkout and reset. A path that does not exist would
    // rerun this script every time; so would the index, which `git status` touches.
    for file in ["HEAD", "logs/HEAD"] {
        let path = run("git", &["rev-parse", "--git-path", file])?;
        if Path::new(&path).exists() {
            println!("cargo::rerun-if-changed={path}");
        }
    }
    let commit = run("git", &["rev-parse", "--short=12", "HEAD"])?;
    let mut status = vec!["--no-optional-locks", "status", "--porcelain", "--"];
    status.extend(SOURCES);
    let dirty = !run("git", &status)?.is_empty();
    Some(if dirty { format!("{commit}-dirty") } else { commit })
}

fn run(program: &str, args: &[&str]) -> Option<String> {
    let output = Command::new(program).args(args).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    output.status.success().then(|| text.trim().to_owned())
}
