//! Generates the fruit basket scene: `fruit_basket.obj`, `.mtl` and `.toml`.
//!
//! `cargo run --release --example fruit_basket [DIRECTORY]` writes the three files into
//! DIRECTORY, by default the repository's `scenes/`, the same bytes every time.

#[path = "fruit_basket/files.rs"]
mod files;
#[path = "fruit_basket/fruit.rs"]
mod fruit;
#[path = "fruit_basket/mesh.rs"]
mod mesh;
#[path = "fruit_basket/pile.rs"]
mod pile;
#[path = "fruit_basket/random.rs"]
mod random;
#[path = "fruit_basket/settle.rs"]
mod settle;
#[path = "fruit_basket/stage.rs"]
mod stage;
#[path = "fruit_basket/wicker.rs"]
mod wicker;

use std::path::PathBuf;

use pile::Object;

/// Seed of the scene's randomness; any other gives another basket.
const SEED: u64 = 2014;

fn main() -> std::io::Result<()> {
    let default = || PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/scenes"));
    let directory = std::env::args_os().nth(1).map_or_else(default, PathBuf::from);
    let mut objects = pile::pile(&mut random::Rng::new(SEED));
    objects.push(Object { name: "table".into(), mesh: stage::table() });
    objects.push(Object { name: "backdrop".into(), mesh: stage::backdrop() });

    let (obj, triangles) = files::obj(&objects);
    for (name, text) in [
        ("fruit_basket.obj", &obj),
        ("fruit_basket.mtl", &files::mtl()),
        ("fruit_basket.toml", &files::sidecar(&objects)),
    ] {
        std::fs::write(directory.join(name), text)?;
    }
    println!("{triangles} triangles in {} objects, {} bytes of OBJ", objects.len(), obj.len());
    Ok(())
}
