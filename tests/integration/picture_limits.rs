//! Pictures whose headers promise more than a picture may take: refused at once, in little
//! memory, whatever the format and the use.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::time::{Duration, Instant};

use image::{ImageFormat, RgbImage};
use tempfile::TempDir;

/// Side that the headers claim, pixels; WebP cannot say more than 16384, and its decoder takes that for 0.
const SIDE: u32 = 60_000;

fn encoded(format: ImageFormat) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    RgbImage::new(16, 16).write_to(&mut bytes, format).unwrap();
    bytes.into_inner()
}

fn patch(bytes: &mut [u8], at: usize, with: &[u8]) {
    bytes[at..at + with.len()].copy_from_slice(with);
}

fn find(bytes: &[u8], pattern: &[u8]) -> usize {
    bytes.windows(pattern.len()).position(|w| w == pattern).unwrap()
}

fn png() -> Vec<u8> {
    let mut bytes = encoded(ImageFormat::Png);
    patch(&mut bytes, 16, &SIDE.to_be_bytes());
    patch(&mut bytes, 20, &SIDE.to_be_bytes());
    let crc = crc32(&bytes[12..29]);
    patch(&mut bytes, 29, &crc.to_be_bytes());
    bytes
}

/// CRC of PNG chunks, bit by bit.
fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(u32::MAX, |crc, &b| {
        (0..8).fold(crc ^ u32::from(b), |c, _| if c & 1 == 1 { c >> 1 ^ 0xedb8_8320 } else { c >> 1 })
    })
}

fn jpeg() -> Vec<u8> {
    let mut bytes = encoded(ImageFormat::Jpeg);
    let frame = find(&bytes, &[0xff, 0xc0]);
    let side = (SIDE as u16).to_be_bytes();
    patch(&mut bytes, frame + 5, &[side, side].concat());
    bytes
}

/// One strip for all rows.
fn tiff() -> Vec<u8> {
    let entries: [(u16, u16, u32); 9] = [
        (256, 4, SIDE),
        (257, 4, SIDE),
        (258, 3, 8),
        (259, 3, 8), // Deflate
        (262, 3, 1),
        (273, 4, 8),
        (277, 3, 1),
        (278, 4, SIDE),
        (279, 4, 16),
    ];
    let mut bytes = b"II*\0\x08\0\0\0\x09\0".to_vec();
    for (tag, kind, value) in entries {
        bytes.extend([tag.to_le_bytes(), kind.to_le_bytes()].concat());
        bytes.extend([1_u32.to_le_bytes(), value.to_le_bytes()].concat());
    }
    bytes.extend([0; 32]);
    bytes
}

fn exr() -> Vec<u8> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/pictures/plain.exr");
    let mut bytes = fs::read(path).unwrap();
    for name in ["dataWindow\0box2i\0", "displayWindow\0box2i\0"] {
        let at = find(&bytes, name.as_bytes()) + name.len() + 4;
        let last = (SIDE - 1).to_le_bytes();
        patch(&mut bytes, at + 8, &[last, last].concat());
    }
    bytes
}

fn hdr() -> Vec<u8> {
    format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {SIDE} +X {SIDE}\n").into_bytes()
}

fn bmp() -> Vec<u8> {
    let mut bytes = encoded(ImageFormat::Bmp);
    patch(&mut bytes, 18, &[SIDE.to_le_bytes(), SIDE.to_le_bytes()].concat());
    bytes
}

fn tga() -> Vec<u8> {
    let mut bytes = encoded(ImageFormat::Tga);
    let side = (SIDE as u16).to_le_bytes();
    patch(&mut bytes, 12, &[side, side].concat());
    bytes
}

fn webp() -> Vec<u8> {
    let mut bytes = encoded(ImageFormat::WebP);
    // [WebP lossless] 14 bits each of width - 1 and height - 1 behind the signature byte: 16383.
    let at = find(&bytes, b"VP8L") + 9;
    let header = u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    patch(&mut bytes, at, &(header & 0xf000_0000 | 0x0fff_bffe).to_le_bytes());
    bytes
}

/// Files of all formats.
fn bombs(directory: &TempDir) -> Vec<PathBuf> {
    let files: [(&str, Vec<u8>); 8] = [
        ("a.png", png()),
        ("a.jpg", jpeg()),
        ("a.tif", tiff()),
        ("a.exr", exr()),
        ("a.hdr", hdr()),
        ("a.bmp", bmp()),
        ("a.tga", tga()),
        ("a.webp", webp()),
    ];
    files
        .map(|(name, bytes)| {
            let path = directory.path().join(name);
            fs::write(&path, bytes).unwrap();
            path
        })
        .to_vec()
}

/// Runs the program in 1 GiB of address space beside that of its code and threads.
fn run(directory: &Path, arguments: &[&str]) -> Output {
    let start = Instant::now();
    let mut command = Command::new("sh");
    command.current_dir(directory);
    command.args(["-c", "ulimit -v 2097152; exec \"$0\" \"$@\""]).arg(env!("CARGO_BIN_EXE_lightopt-embree"));
    let output = command.args(arguments).env("RAYON_NUM_THREADS", "2").output().unwrap();
    assert!(start.elapsed() < Duration::from_secs(10), "{arguments:?}");
    output
}

fn refused(output: &Output, file: &str) {
    let text = String::from_utf8_lossy(&output.stderr);
    assert_eq!((text.lines().count(), output.status.code()), (1, Some(1)), "{file}: {text}");
    assert!(text.contains(file) && text.contains("over the limit of"), "{file}: {text}");
}

#[test]
fn absurd_sizes_are_refused_before_anything_is_reserved() {
    let directory = tempfile::tempdir().unwrap();
    let small = directory.path().join("small.png");
    RgbImage::new(4, 4).save(&small).unwrap();
    for path in bombs(&directory) {
        let file = path.file_name().unwrap().to_str().unwrap();
        let evaluate = |image: &str, mask: &str| {
            run(directory.path(), &["evaluate", "--target", "low-key", "--mask", mask, image])
        };
        refused(&evaluate(file, "small.png"), file);
        refused(&evaluate("small.png", file), file);
        refused(&run(directory.path(), &["classify", file]), file);
    }
}

#[test]
fn absurd_textures_and_skies_are_refused_too() {
    let directory = tempfile::tempdir().unwrap();
    for path in bombs(&directory) {
        let file = path.file_name().unwrap().to_str().unwrap();
        let write = |name: &str, text: &str| fs::write(directory.path().join(name), text).unwrap();
        let scene = "mtllib a.mtl\no q\nv -1 0 -1\nv -1 0 1\nv 1 0 1\nvt 0 0\nusemtl m\nf 1/1 2/1 3/1\n";
        write("a.obj", scene);
        write("a.mtl", &format!("newmtl m\nmap_Kd {file}\n"));
        let head = "schema = 1\n[camera]\nposition = [0, 3, 0]\nlook_at = [0, 0, 0]\nup = [0, 0, -1]\nvfov = 20\n\
                    size = [4, 4]\n[main_object]\nobjects = [\"*\"]\n";
        let sky = "[[lights]]\nname = \"e\"\ntype = \"environment\"\n";
        write("a.toml", &format!("{head}{sky}"));
        refused(&run(directory.path(), &["render", "--spp", "1", "a.obj"]), file);
        write("a.mtl", "newmtl m\nKd 1 1 1\n");
        write("a.toml", &format!("{head}{sky}image = \"{file}\"\n"));
        refused(&run(directory.path(), &["render", "--spp", "1", "a.obj"]), file);
    }
}
