//! One function for each format that is read: it is given the bytes of a file, whatever they are, and ends.
//!
//! An error is right; a panic, a hang or memory out of proportion is a fault of the reader.

use std::{cell::OnceCell, fs, path::PathBuf};

use lightopt_embree::{
    audit::{lights::LightsFile, live::Live},
    film::{
        exr::read_exr,
        image_file::{LinearImage, MaskImage},
    },
    import,
    lighting::Lighting,
    objective::{Target, signature::library::Library},
    picture::{Picture, Purpose, Reading},
    scene::Scene,
    transport::TransportBasis,
};
use tempfile::TempDir;

/// A floor, a box and an image, whose material library is `s.mtl`.
const OBJ: &str = "mtllib s.mtl
v -1 0 -1\nv 1 0 -1\nv 1 0 1\nv -1 0 1\nv 0 0 0\nv .3 0 0\nv 0 .5 0\nvt 0 0\nvt 1 0\nvt 0 1
o floor\nusemtl floor\nf 4 3 2 1
o thing\nusemtl red\nf 5/1 6/2 7/3
";
const MTL: &str = "newmtl floor\nKd 0.5 0.5 0.5\nnewmtl red\nKd 0.7 0.2 0.1\n";
const SIDECAR: &str = "schema = 1
[camera]
position = [0.0, 1.0, 3.0]
look_at = [0.0, 0.2, 0.0]
vfov = 45.0
size = [24, 18]
[main_object]
objects = [\"thing\"]
[[lights]]
name = \"key\"
type = \"rectangle\"
position = [0.5, 1.8, 0.8]
look_at = [0.0, 0.3, 0.0]
half_extents = [0.2, 0.15]
radiance = 8.0
";

/// A directory with a whole scene, one file of which is replaced.
struct Place {
    directory: TempDir,
    scene: OnceCell<Scene>,
}

thread_local! {
    static PLACE: Place = Place {
        directory: tempfile::tempdir().expect("a temporary directory"),
        scene: OnceCell::new(),
    };
}

impl Place {
    /// Writes a file and returns its path.
    fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        let path = self.directory.path().join(name);
        fs::write(&path, bytes).expect("room for a small file");
        path
    }

    /// Writes the files of the scene `s` that are not `replaced`.
    fn write_scene(&self, replaced: &str) {
        for (name, text) in [("s.obj", OBJ), ("s.mtl", MTL), ("s.toml", SIDECAR)] {
            if name != replaced {
                self.write(name, text);
            }
        }
    }

    /// The scene as it is.
    fn scene(&self) -> &Scene {
        self.scene.get_or_init(|| {
            self.write_scene("");
            import::load(&self.directory.path().join("s.obj")).expect("a valid scene").scene
        })
    }
}

/// Wavefront OBJ, staged.
pub fn obj(bytes: &[u8]) {
    PLACE.with(|place| {
        place.write_scene("s.obj");
        let _ = fs::remove_file(place.directory.path().join("s.toml"));
        let _ = import::load(&place.write("s.obj", bytes));
    });
}

/// Wavefront MTL.
pub fn mtl(bytes: &[u8]) {
    PLACE.with(|place| {
        place.write_scene("s.mtl");
        place.write("s.mtl", bytes);
        let _ = import::load(&place.directory.path().join("s.obj"));
    });
}

/// The sidecar of a scene.
pub fn sidecar(bytes: &[u8]) {
    PLACE.with(|place| {
        place.write_scene("s.toml");
        place.write("s.toml", bytes);
        let _ = import::load(&place.directory.path().join("s.obj"));
    });
}

/// glTF 2.0, text or binary, which its beginning tells.
pub fn gltf(bytes: &[u8]) {
    PLACE.with(|place| {
        let _ = import::load(&place.write("g.gltf", bytes));
    });
}

/// `lights.toml`, applied to a scene.
pub fn lights(bytes: &[u8]) {
    PLACE.with(|place| {
        let path = place.write("lights.toml", bytes);
        let Ok(file) = LightsFile::load(&path) else { return };
        let scene = place.scene();
        let _ = file.apply(scene, &mut Lighting::authored(scene), &path);
    });
}

/// A target.
pub fn targets(bytes: &[u8]) {
    PLACE.with(|place| {
        let path = place.write("target.toml", bytes);
        let _ = Target::resolve(&path.to_string_lossy());
    });
}

/// A library of signatures.
pub fn signatures(bytes: &[u8]) {
    PLACE.with(|place| {
        let path = place.write("signatures.toml", bytes);
        let Ok(library) = Library::read(&path) else { return };
        let _ = library.signatures(&path);
    });
}

/// An EXR as a run writes it, and as a picture.
pub fn exr(bytes: &[u8]) {
    PLACE.with(|place| {
        let _ = read_exr(&place.write("p.exr", bytes));
    });
    picture(bytes);
}

/// A picture of any format, for every purpose.
pub fn picture(bytes: &[u8]) {
    for purpose in [Purpose::Light, Purpose::Mask, Purpose::Texture, Purpose::RawTexture] {
        let Ok(picture) = Picture::decode(bytes, &Reading::of(purpose)) else { continue };
        let _ = match purpose {
            Purpose::Light => LinearImage::of(&picture).make_radiance().is_ok(),
            Purpose::Mask => MaskImage::of(&picture).object.is_empty(),
            Purpose::Texture | Purpose::RawTexture => picture.straight(picture.n_pixels() - 1)[3] > 0.0,
        };
    }
}

/// A stored transport basis.
pub fn basis(bytes: &[u8]) {
    PLACE.with(|place| {
        let _ = TransportBasis::load(&place.write("s.basis", bytes));
    });
}

/// A small copy of a transport basis, and a picture of it.
pub fn live(bytes: &[u8]) {
    PLACE.with(|place| {
        let Ok(live) = Live::load(&place.write("live.basis", bytes)) else { return };
        if let Ok(open) = live.copy.open() {
            let _ = open.picture(&live.facts.authored);
        }
    });
}
