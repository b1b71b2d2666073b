//! Scenes as other programs export them: what a file means by the program that wrote it, and what is said
//! where the program lost something. Values are those of Cycles (Blender 5.0.1) or follow by hand.

use std::fs;
use std::path::Path;

use glam::Vec3;
use lightopt_embree::film::{exr, image_file};
use lightopt_embree::import::{self, LoadOptions, sidecar::CameraName};
use lightopt_embree::light::Shape;

use crate::room::Room;

/// A room with the scene `name` of the test data and its sidecar, if it has one.
fn room_of(name: &str) -> Room {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/exporters");
    let room = Room::new();
    let sidecar = Path::new(name).with_extension("toml");
    for file in [Path::new(name), &sidecar] {
        if let Ok(content) = fs::read(data.join(file)) {
            room.write(file.to_str().unwrap(), content);
        }
    }
    room
}

/// Mean colour of the picture that `render` makes, and what it says.
fn render(room: &Room, name: &str, options: &[&str]) -> (Vec3, String) {
    let output = room.succeed(&[&["render", name, "--threads", "1", "-o", "a.exr"], options].concat());
    let picture = image_file::read_image(&room.path("a.exr")).unwrap();
    let sum: Vec3 = picture.rgb.iter().map(|&c| Vec3::from_array(c)).sum();
    (sum / picture.rgb.len() as f32, String::from_utf8(output.stderr).unwrap())
}

/// A binary glTF whose JSON is changed.
fn with_json(glb: &[u8], edit: &dyn Fn(&mut serde_json::Value)) -> Vec<u8> {
    let length = |at: usize| u32::from_le_bytes(glb[at..at + 4].try_into().unwrap()) as usize;
    let (json, rest) = glb[20..].split_at(length(12));
    let mut json = serde_json::from_slice(json).unwrap();
    edit(&mut json);
    crate::gltf::glb(&json, &rest[8..])
}

fn warnings_of(room: &Room, name: &str) -> Vec<String> {
    import::load(&room.path(name)).unwrap().warnings
}

#[test]
fn a_shader_that_blender_dropped_is_white_diffuse_and_named() {
    let room = room_of("diffuse_bsdf.glb");
    let (mean, said) = render(&room, "diffuse_bsdf.glb", &["--spp", "16"]);
    assert!((mean - Vec3::splat(0.8)).abs().max_element() < 1e-3, "{mean}");
    assert!(
        said.contains("material `RedDiffuse`: its shader is lost in the file, taken as white diffuse"),
        "{said}"
    );
    // Whoever says in the sidecar what it is need not be told.
    let own = fs::read_to_string(room.path("diffuse_bsdf.toml")).unwrap();
    let sidecar = format!("{own}\n[materials.RedDiffuse]\n");
    room.write("diffuse_bsdf.toml", format!("{sidecar}roughness = 0.5\n"));
    assert!(warnings_of(&room, "diffuse_bsdf.glb").iter().any(|w| w.contains("its shader is lost")));
    for model in ["diffuse", "dielectric", "conductor"] {
        room.write("diffuse_bsdf.toml", format!("{sidecar}model = \"{model}\"\n"));
        let said = warnings_of(&room, "diffuse_bsdf.glb");
        assert!(!said.iter().any(|w| w.contains("lost")), "{model}: {said:?}");
    }
    room.write("diffuse_bsdf.toml", own);
    // Written by another program the same is what the format says: a rough metal.
    let glb = fs::read(room.path("diffuse_bsdf.glb")).unwrap();
    let at = glb.windows(7).position(|w| w == b"Blender").unwrap();
    let other = [&glb[..at], b"Gimbal!", &glb[at + 7..]].concat();
    room.write("other.glb", other);
    let loaded = import::load(&room.path("other.glb")).unwrap();
    assert!(!loaded.warnings.iter().any(|w| w.contains("is lost")), "{:?}", loaded.warnings);
}

#[test]
fn the_spots_of_blender_fall_off_as_blender_renders_them() {
    let room = room_of("spot_blend.glb");
    let (mean, _) = render(&room, "spot_blend.glb", &["--max-depth", "2", "--spp", "128", "--size", "64x48"]);
    assert!((mean.y / 0.0723 - 1.0).abs() < 0.01, "{mean}");
}

#[test]
fn the_spots_of_other_files_fall_off_as_the_format_recommends() {
    let room = room_of("squared_spot.gltf");
    room.succeed(&["render", "--path", "--spp", "16", "--size", "32x32", "-o", "a.exr", "squared_spot.gltf"]);
    let picture = image_file::read_image(&room.path("a.exr")).unwrap();
    let at = |x: usize, y: usize| picture.rgb[y * 32 + x][1];
    // The middle of the pixel, seen from 3 m above; the lamp is 2 m above the floor.
    let tan = |x: usize| (x as f32 + 0.5 - 16.0) / 16.0 * (0.349_065_85_f32 / 2.0).tan();
    let expected = |x: usize| {
        let d = Vec3::new(3.0 * tan(x), -2.0, 3.0 * tan(16));
        let cos = 2.0 / d.length();
        let edge = ((cos - 0.3_f32.cos()) / (1.0 - 0.3_f32.cos())).clamp(0.0, 1.0);
        // Albedo 1 over π, 8582.83 cd / 683 lm/W.
        edge * edge * cos / d.length_squared() * 12.566_371 / std::f32::consts::PI
    };
    for x in [16, 20, 24, 28] {
        assert!((at(x, 16) - expected(x)).abs() < 0.01, "{x}: {} {}", at(x, 16), expected(x));
    }
}

#[test]
fn images_are_clamped_where_the_sampler_says() {
    let room = room_of("decal_clamp.glb");
    let (mean, said) = render(&room, "decal_clamp.glb", &["--max-depth", "2", "--spp", "64"]);
    let error = (mean - Vec3::new(0.982, 0.952, 0.952)).abs().max_element();
    // Cycles filters encoded texels, as glTF does not; repeated it would be 0.839, 0.596, 0.596.
    assert!(error < 5e-3, "{mean}");
    assert!(!said.contains("clamp"), "{said}");
}

#[test]
fn empty_nodes_that_may_have_been_lamps_are_named() {
    let room = room_of("area_lost.glb");
    let warnings = warnings_of(&room, "area_lost.glb");
    let hint = warnings.iter().find(|w| w.contains("hold nothing")).unwrap_or_else(|| panic!("{warnings:?}"));
    for wanted in
        ["nodes `Softbox`, `Strip` hold nothing", "Blender exports no area lights", "[[lights]]", "USD"]
    {
        assert!(hint.contains(wanted), "{hint}");
    }
    // What it says to add can be added.
    let keys = hint.split("to the sidecar, ").nth(1).unwrap().split(" (USD").next().unwrap();
    let table = keys.replace(", type", "\ntype").replace(", position", "\nposition");
    let table = table
        .replace(", look_at", "\nlook_at")
        .replace(", half_extents", "\nhalf_extents")
        .replace(", radiance", "\nradiance");
    room.write("area_lost.toml", format!("schema = 1\n[[lights]]\n{table}\n"));
    let loaded = import::load(&room.path("area_lost.glb")).unwrap();
    assert_eq!(loaded.scene.light_names(), ["Pin", "Softbox"]);
    // Then the other remains.
    assert!(
        loaded.warnings.iter().any(|w| w.contains("node `Strip` holds nothing")),
        "{:?}",
        loaded.warnings
    );
    let renamed = table.replace("\"Softbox\"", "\"big one\"");
    room.write("area_lost.toml", format!("schema = 1\n[[lights]]\n{renamed}\n"));
    let warnings = import::load(&room.path("area_lost.glb")).unwrap().warnings;
    assert!(warnings.iter().any(|w| w.contains("node `Strip` holds nothing")), "{warnings:?}");
    // A skeleton's last joints are no lamps, nor are nodes with content.
    let warnings = warnings_of(&room_of("posed_arm.glb"), "posed_arm.glb");
    assert!(!warnings.iter().any(|w| w.contains("hold")), "{warnings:?}");
}

#[test]
fn cameras_that_are_not_read_or_share_a_name_are_said() {
    let room = room_of("two_cameras.glb");
    let edited = |edit: &dyn Fn(&mut serde_json::Value)| {
        let bytes = std::fs::read(room.path("two_cameras.glb")).unwrap();
        room.write("edited.glb", with_json(&bytes, edit));
    };
    edited(&|json| {
        for node in json["nodes"].as_array_mut().unwrap() {
            if node.get("camera").is_some() {
                node["name"] = "Hero".into();
            }
        }
    });
    let named = |name: CameraName| {
        let options = LoadOptions { camera: Some(name), ..LoadOptions::default() };
        import::load_with(&room.path("edited.glb"), &options).unwrap().warnings
    };
    let said = "the cameras 1, 2 are called `Hero`: the first is taken; a number chooses another";
    assert!(named(CameraName::Name("Hero".into())).iter().any(|w| w == said));
    assert!(!named(CameraName::Number(2)).iter().any(|w| w == said));

    edited(&|json| {
        for camera in json["cameras"].as_array_mut().unwrap() {
            *camera = serde_json::json!({
                "type": "orthographic",
                "orthographic": { "xmag": 1.0, "ymag": 1.0, "zfar": 10.0, "znear": 0.1 }
            });
        }
    });
    room.write("edited.toml", "schema = 1\n");
    let error = room.fail(&["render", "edited.glb", "-o", "a.png"]);
    let wanted = "`camera`: is missing, and edited.glb has no perspective camera, as others are not read (`";
    assert!(error.contains(wanted), "{error}");
}

#[test]
fn a_camera_is_taken_by_name_or_number() {
    let room = room_of("two_cameras.glb");
    let position = |camera: Option<CameraName>| {
        let loaded = import::load_with(
            &room.path("two_cameras.glb"),
            &LoadOptions { camera, ..LoadOptions::default() },
        )
        .unwrap();
        let said = loaded
            .warnings
            .iter()
            .any(|w| w.contains("of 2 cameras `A_behind_the_scenes` is taken, the first"));
        (loaded.scene.camera.position, said)
    };
    let (first, hero) = (Vec3::new(-3.0, 2.0, 3.0), Vec3::new(0.0, 1.2, 2.5));
    assert_eq!(position(None), (first, true));
    for name in [CameraName::Name("Z_hero".into()), CameraName::Name("2".into()), CameraName::Number(2)] {
        assert_eq!(position(Some(name)), (hero, false));
    }
    let sidecar =
        |name: &str| room.write("two_cameras.toml", format!("schema = 1\n[camera]\nname = {name}\n"));
    for name in ["\"Z_hero\"", "2", "\"2\""] {
        sidecar(name);
        assert_eq!(position(None), (hero, false), "{name}");
    }
    // The option comes before the sidecar.
    assert_eq!(position(Some(CameraName::Number(1))), (first, false));
    sidecar("\"Hero\"");
    let error = room.fail_at_once(&["render", "two_cameras.glb", "-o", "a.png"]);
    assert!(error.ends_with("two_cameras.toml: `camera.name`: no `Hero`: the cameras of two_cameras.glb are 1 `A_behind_the_scenes`, 2 `Z_hero`"), "{error}");
    for command in [
        &["render", "--camera", "3"][..],
        &["run", "--camera", "3", "--out", "r"],
        &["export", "--format", "mitsuba", "-o", "e", "--camera", "3"],
        &["stage", "--force", "--camera", "3"],
    ] {
        let error = room.fail(&[command, &["two_cameras.glb"]].concat());
        assert!(
            error.contains("`--camera`: no `3`: the cameras of two_cameras.glb are 1 `A_behind"),
            "{error}"
        );
    }
    let error = room.fail(&["render", "--camera", "1", "room.obj", "-o", "a.png"]);
    assert!(error.contains("`--camera`: no `1`: room.obj has no camera"), "{error}");
    // A staged sidecar keeps to the camera it was staged for.
    room.succeed(&["stage", "--force", "--camera", "Z_hero", "two_cameras.glb"]);
    assert_eq!(position(None), (hero, false));
}

#[test]
fn a_skeleton_takes_the_pose_of_its_animation() {
    let room = room_of("posed_arm.glb");
    let (_, said) = render(&room, "posed_arm.glb", &["--spp", "1", "--size", "96x72"]);
    assert!(said.contains("animation `ArmatureAction`: the pose is that of its first frame"), "{said}");
    let parts = exr::read_exr(&room.path("a.exr")).unwrap();
    let mask = parts.part("mask").unwrap().channel("mask").unwrap();
    let columns: Vec<usize> = (0..96).filter(|x| (0..72).any(|y| mask[y * 96 + x] > 0.5)).collect();
    // In Blender it covers columns 21 to 52, those at the edges in part; ours are where it covers the
    // middle. At rest it is straight, in columns 44 to 51.
    let [first, last] = [columns[0], columns[columns.len() - 1]];
    assert!((21..=22).contains(&first) && (51..=52).contains(&last), "{first} {last}");
}

#[test]
fn keys_of_the_sidecar_are_laid_over_camera_and_lights_of_the_file() {
    let room = room_of("partial_override.glb");
    let load = || import::load(&room.path("partial_override.glb")).unwrap();
    let scene = load().scene;
    let own = {
        fs::rename(room.path("partial_override.toml"), room.path("aside")).unwrap();
        load().scene
    };
    let lens = scene.camera.lens().unwrap();
    assert_eq!((lens.radius, lens.focus_distance), (0.01786, 2.6));
    assert_eq!(scene.camera.position, own.camera.position);
    assert_eq!((scene.camera.forward(), scene.camera.vfov()), (own.camera.forward(), own.camera.vfov()));
    assert_eq!(scene.camera.size(), own.camera.size());
    let (light, point) = (&scene.lights[0], &own.lights[0]);
    let Shape::Sphere(sphere) = light.shape else { panic!("{light:?}") };
    assert_eq!((scene.lights.len(), sphere.radius, sphere.center), (1, 0.05, Vec3::new(1.0, 1.5, 1.0)));
    // From afar it shines as the point does.
    let intensity = light.radiance * std::f32::consts::PI * 0.05 * 0.05;
    assert!((intensity / point.radiance - 1.0).abs() < 1e-5, "{intensity} {}", point.radiance);

    let with = |camera: &str, light: &str| {
        let light =
            if light.is_empty() { String::new() } else { format!("[[lights]]\nname = \"Key\"\n{light}\n") };
        room.write(
            "partial_override.toml",
            format!("schema = 1\n[camera]\n{camera}\n[main_object]\nobjects = [\"Jar\"]\n{light}"),
        );
        load().scene
    };
    // A radius makes a point a sphere; what else is not given stays.
    assert!(matches!(with("", "radius = 0.02").lights[0].shape, Shape::Sphere(s) if s.radius == 0.02));
    assert_eq!(with("", "radiance = 7").lights[0].radiance, 7.0);
    assert!(matches!(with("", "radiance = 7").lights[0].shape, Shape::Point(_)));
    // Without a distance the middle of the main object is in focus.
    let focus = with("aperture_radius = 0.01", "").camera.lens().unwrap().focus_distance;
    let middle = (Vec3::new(0.0, 0.25, 0.0) - own.camera.position).dot(own.camera.forward());
    assert!((focus - middle).abs() < 1e-3, "{focus} {middle}");
    let moved = with("position = [0, 1, 5]", "").camera;
    assert!((moved.forward() - own.camera.forward()).length() < 1e-6 && moved.position.z == 5.0);
    assert_eq!(with("vfov = 50", "").camera.vfov().round(), 50.0);
    let shifted = with("shift = [0.1, -0.2]", "").camera;
    assert_eq!((shifted.shift().to_array(), shifted.forward()), ([0.1, -0.2], own.camera.forward()));
}

#[test]
fn tangents_of_the_file_and_their_handedness_turn_normal_maps() {
    let room = room_of("tangents.gltf");
    room.succeed(&["render", "--spp", "4", "--size", "8x8", "-o", "a.exr", "tangents.gltf"]);
    let parts = exr::read_exr(&room.path("a.exr")).unwrap();
    let normal = parts.part("normal").unwrap();
    let of = |name: &str| normal.channel(name).unwrap()[4 * 8 + 4];
    let n = Vec3::new(of("X"), of("Y"), of("Z"));
    // The image says (0, 0.5, 0.87): half along the bitangent, which is cross(normal, tangent) · w.
    assert!((n - Vec3::new(0.0, 0.87, 0.5)).length() < 0.01, "{n}");
}

/// Warnings of a square whose material is `mtl`, and its vertices `v`.
fn square(vertex: impl Fn(&str) -> String, mtl: &str) -> Vec<String> {
    let corners = ["-1 0 -1", "-1 0 1", "1 0 1", "1 0 -1"].map(vertex).concat();
    let obj = format!("mtllib room.mtl\no box\n{corners}usemtl m\nf 1 2 3 4\n");
    warnings_of(&Room::with(&obj, mtl, crate::room::TOML), "room.obj")
}

#[test]
fn empty_entries_of_a_material_are_passed_over_and_counted() {
    let plain = |v: &str| format!("v {v}\n");
    let mtl = "newmtl m\nKd .7 .3 .2\nillum 2\nmap_Kd \nmap_bump \nbump\t\nmap_d # none\nmap_opacity \nrefl \nKs\nNs \nillum \nmap_Ks -s 1 1 1\n";
    let warnings = square(plain, mtl);
    let wanted = "line 4 and 9 more have no value and are passed over";
    assert!(warnings.iter().any(|w| w.contains(wanted)), "{warnings:?}");
    assert!(!warnings.iter().any(|w| w.contains("material `m`")), "{warnings:?}");
}

#[test]
fn what_glass_loses_of_a_material_library_is_said() {
    let plain = |v: &str| format!("v {v}\n");
    let about = |mtl: &str, what: &str| {
        square(plain, &format!("newmtl m\nKd 0.2 0.2 0.2\n{mtl}\n"))
            .iter()
            .filter(|w| w.contains(what))
            .count()
    };
    for ni in ["0.75", "0.5", "1.0", "0", "-1.5"] {
        assert_eq!(about(&format!("illum 4\nNi {ni}"), "is not above 1: 1.5 is taken"), 1, "{ni}");
    }
    assert_eq!(about("illum 4\nNi 1.33", "`Ni`"), 0);
    // Of an opaque surface 1 is what programs write, and a filter says nothing.
    assert_eq!(about("illum 2\nKs 1 1 1\nNi 1.0\nTf 1 0 0", "`"), 0);
    assert_eq!(about("illum 2\nKs 1 1 1\nNi 0.5", "`Ni` 0.5"), 1);
    assert_eq!(about("illum 4\nTf spectral a.rfl", "`Tf` is ignored: it must be 1 or 3 numbers"), 1);
    // A sheet and a body of glass let that colour pass.
    assert_eq!(about("illum 4\nTf 1 0 0", "`Tf`"), 0);
    let closed = crate::room::OBJ.replace("f 9 8 12 13", "f 9 8 12 13\nf 7 8 9 10");
    let mtl = "newmtl floor\nnewmtl wall\nnewmtl red\nillum 4\nTf .64 0 1\n";
    let body = import::load(&Room::with(&closed, mtl, crate::room::TOML).path("room.obj")).unwrap();
    assert!(body.warnings.iter().all(|w| !w.contains("`Tf`")));
    let red = body.scene.materials.into_iter().find(|m| m.name == "red").unwrap();
    // Through a body light passes two faces.
    assert_eq!(
        (red.glass_tint().transmitted, red.glass_tint().reflected),
        (Vec3::new(0.8, 0.0, 1.0), Vec3::ONE)
    );
}

#[test]
fn colours_of_vertices_are_said_to_be_ignored() {
    let n = |colour: &str, head: &str| {
        let colored = |v: &str| format!("{head}v {v}{colour}\n");
        square(colored, "newmtl m\n").iter().filter(|w| w.contains("vertex colours are ignored")).count()
    };
    assert_eq!([n("", ""), n(" 1 1 1", ""), n(" 255 255 255", "")], [0; 3]);
    assert_eq!([n(" 1 0 0", ""), n(" 1 0 0 1", ""), n(" 1 0.5 0.5 0.5", "")], [1; 3]);
    assert_eq!(n("", "#MRGB ffff0000ffff0000\n"), 1);
}

#[test]
fn a_comment_behind_a_name_is_none_of_it_unless_the_name_is_written_so() {
    let albedo = |mtl: &str, name: &str| {
        let obj = format!(
            "mtllib room.mtl # materials\n{}o box\nusemtl {name}\nf 1 2 3\n",
            "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
        );
        let loaded = import::load(&Room::with(&obj, mtl, crate::room::TOML).path("room.obj")).unwrap();
        let m = &loaded.scene.materials[loaded.scene.mesh.materials[0] as usize];
        (m.name.clone(), m.tint().x, loaded.warnings.iter().filter(|w| w.contains("library")).count())
    };
    let of = |name: &str, x: f32| (name.to_owned(), x, 0);
    assert_eq!(albedo("newmtl red\nKd 0.5 0 0\n", "red # warm"), of("red", 0.5));
    assert_eq!(albedo("newmtl red # warm\nKd 0.5 0 0\n", "red"), of("red", 0.5));
    assert_eq!(albedo("newmtl red # warm\nKd 0.5 0 0\n", "red # again"), of("red", 0.5));
    let numbered = "newmtl Material #25\nKd 0.25 0 0\nnewmtl Material #26\nKd 0.75 0 0\n";
    assert_eq!(albedo(numbered, "Material #25"), of("Material #25", 0.25));
    assert_eq!(albedo(numbered, "Material #26"), of("Material #26", 0.75));
}

/// The floor of albedo 0.5 seen through a pane, under a sky of radiance 1, by the reflectance 2R/(1 + R) of
/// the pane: at normal incidence, and to the light of a whole half-space.
fn seen_through(n_panes: u32) -> f32 {
    let fresnel = |cos: f64| {
        let cos_t = (1.0 - (1.0 - cos * cos) / 2.25).sqrt();
        let (s, p) = ((cos - 1.5 * cos_t) / (cos + 1.5 * cos_t), (1.5 * cos - cos_t) / (1.5 * cos + cos_t));
        let r = 0.5 * (s * s + p * p);
        // Of n sheets, each of two faces, one behind the other.
        let faces = f64::from(2 * n_panes);
        faces * r / (1.0 + (faces - 1.0) * r)
    };
    let n = 10_000;
    let diffuse: f64 =
        (0..n).map(|i| (f64::from(i) + 0.5) / f64::from(n)).map(|c| 2.0 * c * fresnel(c)).sum();
    let (head_on, diffuse) = (fresnel(1.0), diffuse / f64::from(n));
    let floor = 0.5 * (1.0 - diffuse) / (1.0 - 0.5 * diffuse);
    (head_on + (1.0 - head_on) * floor) as f32
}

#[test]
fn glass_without_a_volume_is_a_thin_sheet() {
    for (name, n_panes) in [("pane.gltf", 1), ("slab.gltf", 2)] {
        let room = room_of(name);
        let options = ["--path", "--spp", "64", "--max-depth", "32", "--size", "32x32"];
        let (mean, _) = render(&room, name, &options);
        let right = seen_through(n_panes);
        // Floor and pane end 5 m away: at the horizon light comes in below the pane and goes out above the
        // floor, which is 0.006. As the face of a body that is never left it was 0.319.
        assert!((mean.y - right).abs() < 0.01, "{name}: {mean} {right}");
    }
}

#[test]
fn sheets_and_the_surroundings_of_images_have_their_counterparts_in_mitsuba() {
    for (name, wanted) in [
        ("pane.gltf", "<bsdf type=\"thindielectric\">"),
        ("decal_clamp.glb", "<string name=\"wrap_mode\" value=\"clamp\"/>"),
    ] {
        let room = room_of(name);
        room.succeed(&["export", "--format", "mitsuba", "-o", "m", name]);
        let xml = fs::read_to_string(room.path("m/scene.xml")).unwrap();
        assert!(xml.contains(wanted), "{name}: {xml}");
    }
}
