//! Files that are not what they should be: the seeds of `fuzz/corpus` and mutations of them.
//!
//! Readers may refuse them, but neither panic, nor take long, nor take memory out of proportion to the file.

// Helpers outside #[test] functions may panic too.
#![allow(clippy::unwrap_used)]

#[path = "../../fuzz/entry.rs"]
mod entry;
mod memory;
mod mutation;

use std::{
    fs,
    panic::catch_unwind,
    path::{Path, PathBuf},
    sync::Mutex,
    time::{Duration, Instant},
};

use lightopt_embree::import::budget::{MEMORY_BASE, MEMORY_PER_BYTE};

use self::mutation::Mutations;

/// Longest that a reader may take for one file, on a machine that does other things too.
const PATIENCE: Duration = Duration::from_secs(10);
/// Memory that reading a picture may take, bytes: 1 GiB for its numbers, as much for another form of them,
/// and the file.
const PICTURE_MEMORY: u64 = 3 << 30;
/// Memory that reading a text of settings, or a basis, may take for every byte of it: tables of the parser,
/// and its copies.
const TEXT_PER_BYTE: u64 = 1000;
/// Memory that it takes for any file, bytes: the scene to which lights belong, and Rust's own tables.
const TEXT_BASE: u64 = 1 << 24;

/// A format: the folder of its seeds, its reader, and the memory that it may take: for any file and for
/// every byte.
type Format = (&'static str, fn(&[u8]), u64, u64);

const FORMATS: [Format; 11] = [
    ("obj", entry::obj, MEMORY_BASE, MEMORY_PER_BYTE),
    ("mtl", entry::mtl, MEMORY_BASE, MEMORY_PER_BYTE),
    ("gltf", entry::gltf, MEMORY_BASE, MEMORY_PER_BYTE),
    ("sidecar", entry::sidecar, TEXT_BASE, TEXT_PER_BYTE),
    ("lights", entry::lights, TEXT_BASE, TEXT_PER_BYTE),
    ("targets", entry::targets, TEXT_BASE, TEXT_PER_BYTE),
    ("signatures", entry::signatures, TEXT_BASE, TEXT_PER_BYTE),
    ("basis", entry::basis, TEXT_BASE, TEXT_PER_BYTE),
    // Codes are deflated, and numbers of 16 bits for two bytes of them.
    ("live", entry::live, TEXT_BASE, 2 * TEXT_PER_BYTE),
    ("exr", entry::exr, PICTURE_MEMORY, MEMORY_PER_BYTE),
    ("picture", entry::picture, PICTURE_MEMORY, MEMORY_PER_BYTE),
];

/// Tests take turns: memory is counted for the whole process.
static TURN: Mutex<()> = Mutex::new(());

fn seeds(format: &str) -> Vec<Vec<u8>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus").join(format);
    let mut paths: Vec<PathBuf> = fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
    paths.sort();
    assert!(!paths.is_empty(), "{format}");
    paths.iter().map(|p| fs::read(p).unwrap()).collect()
}

/// Gives a reader the bytes of a file; what is wrong in words.
fn judge((_, read, base, per_byte): Format, bytes: &[u8]) -> Result<(), String> {
    let start = Instant::now();
    let before = memory::reset_peak();
    catch_unwind(|| read(bytes)).map_err(|_| "panicked".to_owned())?;
    let taken = memory::peak().saturating_sub(before) as u64;
    let most = base + per_byte * bytes.len() as u64;
    if taken > most {
        return Err(format!("took {taken} bytes of memory for {}; {most} are allowed", bytes.len()));
    }
    match start.elapsed() {
        elapsed if elapsed > PATIENCE => Err(format!("took {elapsed:?}")),
        _ => Ok(()),
    }
}

/// Reads the seeds of every format, and `n` mutations of them.
fn read_mutations(n: usize) {
    let _turn = TURN.lock();
    for format in FORMATS {
        let (name, ..) = format;
        let seeds = seeds(name);
        let mutations = Mutations::new(name, &seeds).take(n);
        for (i, bytes) in seeds.iter().cloned().chain(mutations).enumerate() {
            if let Err(what) = judge(format, &bytes) {
                let out = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{name}-{i}"));
                fs::write(&out, &bytes).unwrap();
                panic!("{name}: file {i}, now {}: {what}", out.display());
            }
        }
    }
}

#[test]
fn mutated_files_are_refused_in_time_and_memory() {
    read_mutations(300);
}

/// Reads as many mutations of each format as the environment variable `MUTATIONS` says.
#[test]
#[ignore = "takes minutes"]
fn many_mutated_files_are_refused_in_time_and_memory() {
    let asked = std::env::var("MUTATIONS").ok().map(|n| n.parse().expect("MUTATIONS is a number"));
    read_mutations(asked.unwrap_or(10_000));
}

#[test]
fn the_counter_counts_and_mutations_differ() {
    let _turn = TURN.lock();
    let before = memory::reset_peak();
    drop(std::hint::black_box(vec![1_u8; 1 << 20]));
    let taken = memory::peak() - before;
    assert!((1 << 20..1 << 21).contains(&taken), "{taken}");
    let hungry: Format = ("", |bytes| drop(std::hint::black_box(vec![1_u8; 1000 * bytes.len()])), 0, 999);
    assert!(judge(hungry, &[0; 4096]).unwrap_err().contains("bytes of memory"));
    let seeds = seeds("obj");
    let some: Vec<Vec<u8>> = Mutations::new("obj", &seeds).take(100).collect();
    assert!(some.iter().filter(|m| !seeds.contains(m)).count() > 90);
    assert_eq!(some, Mutations::new("obj", &seeds).take(100).collect::<Vec<_>>());
}
