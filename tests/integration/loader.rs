//! OBJ, MTL and textures.

use glam::{Vec2, Vec3};
use lightopt_embree::import::{self, ImportError, imported::Imported, obj};
use lightopt_embree::scene::{
    Material,
    material::{Coats, MaterialParams, Model, Relief},
    texture::ScalarMap,
};

use crate::room::{MTL, OBJ, Room, TOML};

const CREASE: f32 = 0.7;

/// A square in the plane y = 0.
const SQUARE: &str = "v 0 0 0\nv 0 0 1\nv 1 0 1\nv 1 0 0\n";

fn load(obj: &str, mtl: &str) -> Result<Imported, ImportError> {
    let room = Room::with(obj, mtl, TOML);
    obj::load(&room.path("room.obj"), CREASE)
}

fn load_ok(obj: &str) -> Imported {
    load(obj, MTL).unwrap()
}

fn line_of(e: &ImportError) -> String {
    let text = e.to_string();
    text.split_once("room.").map(|(_, rest)| rest.to_owned()).unwrap_or(text)
}

fn area(s: &Imported) -> f32 {
    (0..s.mesh.indices.len())
        .map(|t| {
            let [a, b, c] = s.mesh.corners(t);
            0.5 * (b - a).cross(c - a).length()
        })
        .sum()
}

#[test]
fn indices_may_be_negative_and_point_ahead() {
    let absolute = load_ok(&format!("{SQUARE}f 1 2 3 4\n"));
    let relative = load_ok(&format!("{SQUARE}f -4 -3 -2 -1\n"));
    let ahead = load_ok(&format!("f 1 2 3 4\n{SQUARE}"));
    assert_eq!(absolute.mesh.indices.len(), 2);
    for other in [relative, ahead] {
        assert_eq!(absolute.mesh.positions, other.mesh.positions);
        assert_eq!(absolute.mesh.normals, other.mesh.normals);
    }
}

#[test]
fn files_may_be_utf16_or_latin1() {
    let plain = format!("mtllib room.mtl\n{SQUARE}usemtl gr\u{fc}n\nf 1 2 3 4\n");
    let mtl = "newmtl gr\u{fc}n\nKd 0 0.5 0\n";
    let utf16 = |text: &str| -> Vec<u8> {
        std::iter::once(0xfeff).chain(text.encode_utf16()).flat_map(u16::to_be_bytes).collect()
    };
    let latin1 = |text: &str| -> Vec<u8> { text.chars().map(|c| c as u8).collect() };
    let room = Room::new();
    for encode in [&utf16 as &dyn Fn(&str) -> Vec<u8>, &latin1] {
        room.write("room.obj", encode(&plain));
        room.write("room.mtl", encode(mtl));
        let s = obj::load(&room.path("room.obj"), CREASE).unwrap();
        assert!(s.warnings.is_empty(), "{:?}", s.warnings);
        assert_eq!(s.mesh.indices.len(), 2);
        assert_eq!((s.materials[0].0.as_str(), s.materials[0].1.base_color.y), ("gr\u{fc}n", 0.5));
    }
}

#[test]
fn polygons_become_triangles_of_the_same_area() {
    let pentagon = load_ok("v 0 0 0\nv 2 0 0\nv 2 1 0\nv 1 2 0\nv 0 1 0\nf 1 2 3 4 5\n");
    assert_eq!(pentagon.mesh.indices.len(), 3);
    assert!((area(&pentagon) - 3.0).abs() < 1e-6);
    // An L, which a fan from its first corner would overlap.
    let l = load_ok("v 1 1 0\nv 1 3 0\nv 0 3 0\nv 0 0 0\nv 4 0 0\nv 4 1 0\nf 1 2 3 4 5 6\n");
    assert!((area(&l) - 6.0).abs() < 1e-6);
}

#[test]
fn absent_normals_are_smooth_below_the_crease_across_materials_and_groups() {
    // Two squares that meet at 30 and at 90 degrees.
    let roof = |y: f32, z: f32| {
        format!(
            "mtllib room.mtl\n{SQUARE}v 0 {y} {z}\nv 1 {y} {z}\no roof\nusemtl red\ng a\nf 1 2 3 4\n\
             usemtl floor\ng b\nf 2 5 6 3\n"
        )
    };
    let shared = |s: &Imported| {
        let at = |t: usize, p: Vec3| {
            let i = s.mesh.indices[t].iter().find(|&&i| s.mesh.positions[i as usize] == p).unwrap();
            s.mesh.normals[*i as usize]
        };
        (0..4).filter(|&t| s.mesh.corners(t).contains(&Vec3::Z)).map(|t| at(t, Vec3::Z)).collect::<Vec<_>>()
    };
    let smooth = shared(&load_ok(&roof(-0.5, 1.0 + 0.75_f32.sqrt())));
    assert!(smooth.iter().all(|n| n.angle_between(smooth[0]) < 1e-3), "{smooth:?}");
    let sharp = shared(&load_ok(&roof(-1.0, 1.0)));
    assert!(sharp.iter().any(|n| n.angle_between(sharp[0]) > 1.5), "{sharp:?}");
}

#[test]
fn given_normals_are_kept_where_only_some_corners_have_them() {
    let s = load_ok(&format!("{SQUARE}vt 0.25 0.75\nvn 0 2 0\nvn .6 .8 0\nf 1//2 2/1 3/1/1\nf 1 3 4\n"));
    let [a, b, c] = s.mesh.indices[0].map(|i| i as usize);
    assert!((s.mesh.normals[a] - Vec3::new(0.6, 0.8, 0.0)).length() < 1e-6);
    assert_eq!((s.mesh.normals[b], s.mesh.normals[c]), (Vec3::Y, Vec3::Y));
    // Texture coordinates stay with their corners.
    assert_eq!((s.mesh.uvs[a].x, s.mesh.uvs[b].x, s.mesh.uvs[c].y), (0.0, 0.25, 0.75));
}

#[test]
fn indices_into_lists_that_the_file_does_not_have_are_left_out() {
    let plain = load_ok(&format!("{SQUARE}f 1 2 3 4\n"));
    let s = load_ok(&format!("{SQUARE}f 1/1/1 2/2/1 3/3/1 4/-4/-1\n"));
    assert_eq!((&s.mesh.indices, &s.mesh.normals), (&plain.mesh.indices, &plain.mesh.normals));
    let of = |what| format!("room.obj:5: faces name {what}, of which the file has none: left out");
    assert_eq!(s.warnings.len(), 2, "{:?}", s.warnings);
    assert!(s.warnings[0].ends_with(&of("texture coordinates")) && s.warnings[1].ends_with(&of("normals")));
}

#[test]
fn objects_groups_and_materials_are_respected() {
    let s = load_ok(&format!(
        "mtllib room.mtl\n{SQUARE}f 1 2 3\no fruit\nusemtl red\ng apple left\nf 1 2 3\nusemtl floor\nf 1 3 4\n\
         g pear\nusemtl red\nf 1 2 4\no bowl\nf 2 3 4\n"
    ));
    let names: Vec<Vec<&str>> =
        s.mesh.objects.iter().map(|&o| s.parts[o as usize].names().collect()).collect();
    let apple = vec!["fruit", "apple", "left", "apple left"];
    assert_eq!(names, [vec![], apple.clone(), apple, vec!["fruit", "pear"], vec!["bowl"]]);
    let materials: Vec<&str> = s.mesh.materials.iter().map(|&m| s.materials[m as usize].0.as_str()).collect();
    assert_eq!(materials, ["(none)", "red", "floor", "red", "red"]);
    assert!(s.warnings.is_empty(), "{:?}", s.warnings);

    let main = |names: &str| {
        let toml = TOML.replace("\"box\"", names);
        let obj = OBJ.replace("o box\n", "o furniture\ng box left\n");
        import::load(&Room::with(&obj, MTL, &toml).path("room.obj"))
            .map(|loaded| loaded.scene.is_main.iter().filter(|m| **m).count())
    };
    for (pattern, n) in [("\"box\"", 10), ("\"furniture\"", 10), ("\"f*\"", 12), ("\"wall\", \"left\"", 12)] {
        assert_eq!(main(pattern).unwrap(), n, "{pattern}");
    }
}

#[test]
fn a_missing_library_is_a_warning_and_its_materials_are_grey_but_named() {
    let s = load_ok(&OBJ.replace("room.mtl", "other.mtl"));
    assert_eq!(s.warnings.len(), 1);
    assert!(s.warnings[0].contains("room.obj:1: material library"), "{:?}", s.warnings);
    assert!(s.warnings[0].contains("other.mtl") && s.warnings[0].contains("using grey"));
    // A name with spaces is one name unless some of its words are files.
    let n_warnings = |library: &str| load_ok(&OBJ.replace("room.mtl", library)).warnings.len();
    assert_eq!(["no such file.mtl", "room.mtl no.mtl", "no.mtl room.mtl", ""].map(n_warnings), [1, 1, 1, 1]);
    let names: Vec<&str> = s.materials.iter().map(|(n, _)| n.as_str()).collect();
    assert_eq!(names, ["floor", "wall", "red"]);
    assert!(s.materials.iter().all(|(_, p)| p.model == Model::Diffuse && p.base_color.x == 0.8));

    let s = load_ok(&OBJ.replace("usemtl red", "usemtl rde"));
    assert_eq!(s.warnings.len(), 1);
    assert!(s.warnings[0].contains("room.obj:23: no library defines material `rde`"), "{:?}", s.warnings);
}

#[test]
fn ways_of_writing_do_not_matter() {
    let plain = load_ok(OBJ);
    let crlf = OBJ.replace('\n', "\r\n");
    let noisy = format!("\u{feff}# caf\u{e9}\n\n{}", OBJ.replace("v 1 0 -1\n", "  v\t1 0\\\n  -1 # one\n"));
    let colours = OBJ.replace("v 1 0 1\n", "v 1 0 1 1.0 1.0 1.0\n").replace("v 1 2 -1", "v 2 4 -2 2");
    let tabs = OBJ.replace("usemtl ", "\tusemtl\t").replace("mtllib ", "mtllib\t");
    let comments = OBJ.replace("f 1 2 6 5", "f 1 2 6 5 # the wall");
    let named = OBJ.replace("usemtl red", "usemtl red # warm").replace("o wall", "o wall # behind");
    let cr = OBJ.replace('\n', "\r");
    let lines = OBJ.replace("o wall", "l 1 2 3\np 1\no wall\ns off");
    for other in [crlf, noisy, colours, tabs, comments, named, cr, lines] {
        let s = load_ok(&other);
        assert_eq!(s.mesh.indices, plain.mesh.indices, "{other}");
        assert_eq!(s.mesh.positions, plain.mesh.positions, "{other}");
        assert_eq!(s.mesh.materials, plain.mesh.materials, "{other}");
        assert!(s.warnings.is_empty(), "{other}: {:?}", s.warnings);
    }
    // Latin-1 bytes in a comment or a name.
    let room = Room::new();
    room.write("room.obj", [b"# caf\xe9\n".as_slice(), OBJ.as_bytes()].concat());
    assert_eq!(obj::load(&room.path("room.obj"), CREASE).unwrap().mesh.indices, plain.mesh.indices);
}

#[test]
fn degenerate_triangles_are_left_out_and_counted() {
    let s = load_ok(&format!(
        "{SQUARE}v nan 0 0\nv 1e30 0 0\nv 0 inf 0\nf 1 2 3\nf 1 1 2\nf 1 2 5\nf 1 2 7\nf 1 2\nf 1 6 6\n"
    ));
    assert_eq!(s.mesh.indices.len(), 1);
    assert_eq!(s.mesh.positions.len(), 3);
    assert!(s.warnings[0].ends_with("room.obj: left out 2 degenerate triangles"), "{:?}", s.warnings);
    let first = SQUARE.lines().count() + 1;
    let wanted = format!(
        "room.obj: left out 3 triangles with vertices out of range, the first in line {first}, vertex 5: \
         coordinates must be finite and at most 1.844e18 in magnitude"
    );
    assert!(s.warnings[1].ends_with(&wanted), "{:?}", s.warnings);
    let e = load(&format!("{SQUARE}f 1 1 2\n"), MTL).unwrap_err();
    assert!(e.to_string().ends_with("no triangle in this file but for 1 that are degenerate"), "{e}");
}

/// The room scaled by `scale`, with its camera and lights.
fn scaled(scale: f32) -> [String; 2] {
    let numbers = |list: &str, separator: &str| {
        let scaled = list.split(separator).map(|n| (n.trim().parse::<f32>().unwrap() * scale).to_string());
        scaled.collect::<Vec<_>>().join(separator)
    };
    let obj = OBJ.lines().map(|l| match l.strip_prefix("v ") {
        Some(p) => format!("v {}\n", numbers(p, " ")),
        None => format!("{l}\n"),
    });
    let toml = TOML.lines().map(|l| match l.split_once(" = ") {
        Some((key, list)) if ["position", "look_at", "half_extents"].contains(&key) => {
            format!("{key} = [{}]\n", numbers(list.trim_matches(['[', ']']), ", "))
        }
        Some(("radius", r)) => format!("radius = {:e}\n", r.parse::<f32>().unwrap() * scale),
        _ => format!("{l}\n"),
    });
    [obj.collect(), toml.collect()]
}

#[test]
fn scenes_of_any_scale_render_or_say_why_not() {
    for scale in [1e-4, 1e4, 1e10] {
        let [obj, toml] = scaled(scale);
        let room = Room::with(&obj, MTL, &toml);
        for integrator in ["--bdpt", "--path"] {
            room.succeed(&["render", "room.obj", integrator, "--spp", "8", "-o", "a.exr"]);
            let output = room.succeed(&["evaluate", "--target", "high-key", "--json", "a.exr"]);
            let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
            assert!(report["f_q"].is_f64(), "{scale} {integrator}");
        }
    }
    for (scale, wanted) in [
        (1e-30, "room.obj: no triangle in this file but for 14 that are degenerate"),
        (
            1e19,
            "room.obj: no triangle in this file but for 14 with vertices out of range, the first in line 2, \
             vertex 1: coordinates must be finite and at most 1.844e18 in magnitude",
        ),
    ] {
        let [obj, _] = scaled(scale);
        let error = Room::with(&obj, MTL, TOML).fail_at_once(&["render", "room.obj", "-o", "a.png"]);
        assert!(error.contains(wanted), "{scale}: {error}");
    }
}

#[test]
fn a_stray_triangle_does_not_spoil_a_picture() {
    for far in ["1e10", "1e17", "2e18", "1e19", "1e25", "1e30", "1e39", "nan", "-inf"] {
        let back = far.trim_start_matches('-');
        let obj = format!("{OBJ}o stray\nv {far} 0 0\nv 0 {far} 0\nv 0 0 -{back}\nf -3 -2 -1\n");
        let toml = format!("{TOML}[[lights]]\nname = \"sky\"\ntype = \"environment\"\n");
        let room = Room::with(&obj, MTL, &toml);
        let output = room.succeed(&["render", "room.obj", "--spp", "8", "-o", "a.exr"]);
        let said = String::from_utf8_lossy(&output.stderr);
        let is_left_out = said.contains("left out 1 triangle with vertices out of range, the first in line");
        assert_eq!(is_left_out, !["1e10", "1e17"].contains(&far), "{far}");
        let output = room.succeed(&["evaluate", "--target", "high-key", "--json", "a.exr"]);
        let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        assert!(report["f_q"].is_f64(), "{far}");
    }
}

#[test]
fn mtl_maps_to_models_as_documented() {
    let material = |body: &str| {
        let s = load(&format!("mtllib room.mtl\n{SQUARE}usemtl m\nf 1 2 3\n"), &format!("newmtl m\n{body}"));
        let s = s.unwrap_or_else(|e| panic!("{body}: {e}"));
        (s.materials[0].1.clone(), s.warnings)
    };
    let is = |body: &str, model: Model, base: [f32; 3], roughness: f32, ior: f32| {
        let (p, warnings) = material(body);
        assert_eq!((p.model, p.base_color.to_array()), (model, base), "{body}");
        assert!((p.roughness - roughness).abs() < 1e-6 && p.ior == ior, "{body}: {p:?}");
        assert!(warnings.is_empty(), "{body}: {warnings:?}");
    };
    let red = [0.7, 0.2, 0.1];
    let ns = |ns: f32| (2.0 / (ns + 2.0)).sqrt().sqrt();
    is("", Model::Diffuse, [0.8; 3], 0.5, 1.5);
    is("Kd 0.7 0.2 0.1\nKs 0 0 0\n", Model::Diffuse, red, 0.5, 1.5);
    is("Kd .5\n", Model::Diffuse, [0.5; 3], 0.5, 1.5);
    is("Kd 0.7 0.2 0.1\nKs 0.5 0.5 0.5\nNs 100\n", Model::Plastic, red, ns(100.0), 1.5);
    is("Kd 0.7 0.2 0.1\nKs 0.5 0.5 0.5\nNs 100\nPr 0.3\nNi 1.4\n", Model::Plastic, red, 0.3, 1.4);
    is("Kd 0.7 0.2 0.1\nKs 1 1 1\nNi 1\n", Model::Plastic, red, 0.5, 1.5);
    is("Kd 0.7 0.2 0.1\nPm 1\nPr 0.2\n", Model::Conductor, red, 0.2, 1.5);
    is("Kd 0.7 0.2 0.1\nPm 0.4\n", Model::Diffuse, red, 0.5, 1.5);
    assert_eq!(material("Kd 0.7 0.2 0.1\nPm 0.4\n").0.metallic, 0.4);
    is("Kd 0 0 0\nKs 0.7 0.2 0.1\nillum 3\nPr 0\n", Model::Conductor, red, 0.0, 1.5);
    is("Kd 0.7 0.2 0.1\nKs 1 1 1\nillum 3\nPr 0.1\n", Model::Plastic, red, 0.1, 1.5);
    for illum in [4, 6, 7, 9] {
        is(&format!("Kd 1 1 1\nNi 1.33\nillum {illum}\n"), Model::Thin, [1.0; 3], 0.0, 1.33);
    }
    is("Kd 0.7 0.2 0.1\nNi 1.33\nillum 7\nPr 0.2\nd 1\nTr 0\nKe 0 0 0\n", Model::Thin, [1.0; 3], 0.2, 1.33);
    is("Kd 1 1 1\nTf 0.7 0.2 0.1\nNi 1.33\nillum 7\n", Model::Thin, red, 0.0, 1.33);

    for (body, wanted) in [
        ("Kd 1.2 0 0\n", "`Kd` [1.2, 0, 0] is not in [0, 1]: [1, 0, 0] is taken"),
        ("d 0\n", "is invisible, says its `d`"),
        ("Tr 1\n", "is invisible, says its `Tr`"),
        ("disp a.png\n", "`disp` is ignored"),
        ("map_Bump a.png\n", "a.png`; the map is left out"),
        ("Pc 0.5\n", "`Pc` is ignored"),
    ] {
        let (_, warnings) = material(body);
        assert_eq!(warnings.len(), 1, "{body}: {warnings:?}");
        assert!(warnings[0].contains("material `m`") && warnings[0].contains(wanted), "{warnings:?}");
    }
}

#[test]
fn textures_are_found_beside_the_scene() {
    let obj = format!("mtllib room.mtl\n{SQUARE}vt 0 0\nusemtl m\nf 1/1 2/1 3/1\n");
    let texel = |mtl: &str| {
        let room = Room::with(&obj, mtl, TOML);
        std::fs::create_dir(room.path("maps")).unwrap();
        image::RgbImage::from_pixel(2, 2, image::Rgb([255, 188, 0])).save(room.path("maps/a b.png")).unwrap();
        // A PNG by content.
        std::fs::copy(room.path("maps/a b.png"), room.path("b.jpg")).unwrap();
        std::fs::create_dir(room.path("textures")).unwrap();
        std::fs::copy(room.path("maps/a b.png"), room.path("textures/c.png")).unwrap();
        obj::load(&room.path("room.obj"), CREASE)
            .map(|s| s.materials[0].1.texture.as_ref().unwrap().sample(glam::Vec2::ZERO).to_array())
    };
    for name in ["maps/a b.png", r"maps\a b.png", "-s 1 1 1 -clamp on maps/a b.png", "b.jpg"] {
        let [r, g, b] = texel(&format!("newmtl m\nmap_Kd {name}\n")).unwrap();
        assert!((r, b) == (1.0, 0.0) && (g - 0.5).abs() < 0.01, "{name}: {r} {g} {b}");
    }
    // As it was on another machine, in quotes, in other letter case.
    for name in [
        r"C:\Users\me\B.JPG",
        r"C:\\Users\\me\\maps\\a b.png",
        "/home/me/textures/b.jpg",
        "\"b.jpg\"",
        "../b.jpg",
        "c.png",
        "C.PNG",
    ] {
        assert_eq!(texel(&format!("newmtl m\nmap_Kd {name}\n")).unwrap()[0], 1.0, "{name}");
    }

    let room = Room::with(
        &obj,
        "newmtl m\nmap_Kd no.png\n",
        &TOML.replace("objects = [\"box\"]", "materials = [\"m\"]"),
    );
    let s = obj::load(&room.path("room.obj"), CREASE).unwrap();
    assert_eq!(s.warnings.len(), 1);
    assert!(s.warnings[0].contains("material `m`: `map_Kd`: no file `") && s.warnings[0].contains("no.png`"));
    assert!(s.materials[0].1.texture.is_none() && s.materials[0].1.base_color.x == 0.8);
    room.write("no.png", "no picture");
    let error = room.fail_at_once(&["render", "room.obj", "-o", "a.png"]);
    assert!(error.contains("no.png: cannot read the texture"), "{error}");
}

#[test]
fn lines_that_make_no_sense_are_named() {
    for (obj, wanted) in [
        ("v 1 2\n", "obj:1: `v`: needs 3 numbers, got 2"),
        ("v 1 2 x\n", "obj:1: `v`: `x` is not a number"),
        ("v 1,0 2 3\n", "obj:1: `v`: `1,0` is not a number"),
        ("v 1 2 3 0\n", "obj:1: `v`: the weight (4th number) must not be 0"),
        ("\n\nvn 1 2\n", "obj:3: `vn`: needs 3 numbers, got 2"),
        ("vt\n", "obj:1: `vt`: needs 1 to 3 numbers, got 0"),
        ("v 0 0 0\nf 1 1 2\n", "obj:2: `f`: vertex 2 does not exist: the file has 1"),
        ("v 0 0 0\nf 1 1 0\n", "obj:2: `f`: `0`: indices begin at 1"),
        ("f 1 2 3\n", "obj:1: `f`: vertex 1 does not exist: the file has 0"),
        ("v 0 0 0\nf -1 -1 -2\n", "obj:2: `f`: vertex -2 does not exist: the file has 1 so far"),
        ("v 0 0 0\nvt 0 0\nf 1/9 1 1\n", "obj:3: `f`: texture coordinate 9 does not exist: the file has 1"),
        ("v 0 0 0\nvn 0 1 0\nf 1//9223372036854775807 1 1\n", "normal 9223372036854775807 does not exist"),
        ("v 0 0 0\nf 1 1 -9223372036854775808\n", "vertex -9223372036854775808 does not exist"),
        ("v 0 0 0\nf 1 1 99999999999999999999\n", "`99999999999999999999` is not an index"),
        ("v 0 0 0\nf 1/1/1/1 1 1\n", "`1/1/1/1` has more than 3 indices"),
        ("v 0 0 0\nf /1 1 1\n", "`/1` names no vertex"),
        ("v 0 0 0\nf a b c\n", "obj:2: `f`: `a` is not an index"),
    ] {
        let e = load(obj, MTL).unwrap_err();
        assert!(line_of(&e).contains(wanted), "{obj:?}: wanted `{wanted}` in: {e}");
    }
    for (mtl, wanted) in [
        ("newmtl\n", "mtl:1: `newmtl`: needs a name"),
        ("newmtl a\nKd 1 2\n", "mtl:2: `Kd`: needs 3 numbers, got 2"),
        ("newmtl a\nKd nan 0 0\n", "mtl:2: `Kd`: must be finite"),
        ("newmtl a\nNs 1e39\n", "mtl:2: `Ns`: must be finite, at most 3.4028235e38 in magnitude"),
        ("newmtl a\nKd xyz a\n", "mtl:2: `Kd`: needs 3 numbers after `xyz`"),
        ("newmtl a\nNs x\n", "mtl:2: `Ns`: needs a number"),
        ("newmtl a\nillum 99\n", "mtl:2: `illum`: must be 0 to 10"),
        ("Kd 1 1 1\n", "mtl:1: `Kd`: stands before any `newmtl`"),
    ] {
        let e = load(OBJ, mtl).unwrap_err();
        assert!(line_of(&e).contains(wanted), "{mtl:?}: wanted `{wanted}` in: {e}");
    }
}

/// The number or colour that a material has, as a comparison that must hold of it.
type Taken = fn(&MaterialParams) -> bool;

#[test]
fn numbers_of_an_mtl_outside_their_range_are_cut_and_said() {
    let of = |body: &str| {
        let s = load(&format!("mtllib room.mtl\n{SQUARE}usemtl m\nf 1 2 3\n"), body).unwrap();
        (s.materials[0].1.clone(), s.warnings)
    };
    let coat = "Ks 1 1 1\n";
    let glass = "illum 7\n";
    let cases: [(&str, &str, &str, Taken); 26] = [
        ("", "illum -1", "`illum` -1 is not a whole number from 0 to 10: 2 is taken", |p| {
            p.model == Model::Diffuse
        }),
        (
            "Kd 0 0 0\nKs 1 1 1\n",
            "illum 2.5",
            "`illum` 2.5 is not a whole number from 0 to 10: 2 is taken",
            |p| p.model == Model::Plastic,
        ),
        ("", "Pr 5", "`Pr` 5 is not in [0, 1]: 1 is taken", |p| p.roughness == 1.0),
        ("", "Pr -1", "`Pr` -1 is not in [0, 1]: 0 is taken", |p| p.roughness == 0.0),
        ("", "Pm 1.5", "`Pm` 1.5 is not in [0, 1]: 1 is taken", |p| p.model == Model::Conductor),
        ("", "Pm -0.5", "`Pm` -0.5 is not in [0, 1]: 0 is taken", |p| p.metallic == 0.0),
        ("", "Ns -3", "`Ns` -3 is not in [0, 1000000]: 0 is taken", |p| p.roughness == 1.0),
        ("", "Ns 1e9", "`Ns` 1e9 is not in [0, 1000000]: 1000000 is taken", |p| {
            (0.03..0.04).contains(&p.roughness)
        }),
        ("", "d 2", "`d` 2 is not in [0, 1]: 1 is taken", |p| p.opacity == 1.0),
        ("", "d -1", "`d` -1 is not in [0, 1]: 1 is taken", |p| p.opacity == 1.0),
        ("", "d -0.5", "`d` -0.5 is not in [0, 1]: 0 is taken", |p| p.opacity == 0.0),
        ("", "Tr 3", "`Tr` 3 is not in [0, 1]: 1 is taken", |p| p.opacity == 0.0),
        ("", "Tr -1", "`Tr` -1 is not in [0, 1]: 0 is taken", |p| p.opacity == 1.0),
        ("", "Ke -1 0 2", "`Ke` [-1, 0, 2] is not at least 0: [0, 0, 2] is taken", |p| {
            p.emission == Vec3::new(0.0, 0.0, 2.0)
        }),
        (glass, "Tf -1 0 1", "`Tf` [-1, 0, 1] is not in [0, 1]: [0, 0, 1] is taken", |p| {
            p.base_color == Vec3::Z
        }),
        (glass, "Tf 2 1 1", "`Tf` [2, 1, 1] is not in [0, 1]: [1, 1, 1] is taken", |p| {
            p.base_color == Vec3::ONE
        }),
        (glass, "Ni 5", "`Ni` 5 is not in [1, 4]: 4 is taken", |p| p.ior == 4.0),
        (glass, "Ni 1e9", "`Ni` 1e9 is not in [1, 4]: 4 is taken", |p| p.ior == 4.0),
        (coat, "Ni 5", "`Ni` 5 is not in [1, 4]: 4 is taken", |p| p.ior == 4.0),
        ("", "Kd 2 0.5 0.5", "`Kd` [2, 0.5, 0.5] is not in [0, 1]: [1, 0.5, 0.5] is taken", |p| {
            p.base_color == Vec3::new(1.0, 0.5, 0.5)
        }),
        ("", "Kd -1 0.5 0.5", "`Kd` [-1, 0.5, 0.5] is not in [0, 1]: [0, 0.5, 0.5] is taken", |p| {
            p.base_color == Vec3::new(0.0, 0.5, 0.5)
        }),
        ("Kd 0 0 0\nillum 3\n", "Ks 2 1 1", "`Ks` [2, 1, 1] is not in [0, 1]: [1, 1, 1] is taken", |p| {
            p.model == Model::Conductor && p.base_color == Vec3::ONE
        }),
        ("Kd 1 1 1\n", "Ks -1 0 0", "`Ks` [-1, 0, 0] is not in [0, 1]: [0, 0, 0] is taken", |p| {
            p.model == Model::Diffuse
        }),
        ("Pr 2\nPr 0.5\n", "Pm 7", "`Pm` 7 is not in [0, 1]: 1 is taken", |p| p.roughness == 0.5),
        ("", "Pr 1e30", "`Pr` 1e30 is not in [0, 1]: 1 is taken", |p| p.roughness == 1.0),
        ("", "Kd 1e30", "`Kd` [1e30, 1e30, 1e30] is not in [0, 1]: [1, 1, 1] is taken", |p| {
            p.base_color == Vec3::ONE
        }),
    ];
    for (before, line, wanted, is_taken) in cases {
        let (p, warnings) = of(&format!("newmtl m\n{before}{line}\n"));
        let wanted = format!("material `m`: {wanted}");
        let n = warnings.iter().filter(|w| w.ends_with(&wanted)).count();
        assert!(n == 1 && is_taken(&p), "`{line}`: wanted once `{wanted}` in: {warnings:?}; {p:?}");
    }
    // What programs write for their own reasons, and roundings, are not worth a word.
    for quiet in [
        "Ns 1000",
        "Ns 100000",
        "Kd 1.0005 1 1",
        "Kd 1 1 1\nKs 1 1 1\nNi 1",
        "Ni 50",
        "Tf 2 2 2",
        "Ni -1",
        "d 1.00001",
        "Ns -1\nPr 0.5",
    ] {
        let (_, warnings) = of(&format!("newmtl m\n{quiet}\n"));
        assert!(warnings.is_empty(), "`{quiet}`: {warnings:?}");
    }
    // Blender's exporter has ranges of its own, and writes -1 for what it does not know.
    for (line, wanted) in [
        ("Ns 1000.0001", 0),
        ("Ns 1002", 0),
        ("Ns 2000", 1),
        ("Ns -1\nPr -1\nPm -1\nKs -1 -1 -1\nNi -1\nd -1\nTf -1 -1 -1\nillum -1", 0),
        ("Pr -0.5", 1),
        ("Pr 2\nPm 0\nKs 2 2 2\nNi 5\nd 2\nTf 0 0 0\nillum 2.5\nKe -1 0 0\nKd 2 0 0", 7),
        ("Pm 2\nNi 5", 1),
        ("Tf 2 2 2", 1),
    ] {
        let (_, warnings) = of(&format!("# Blender 4.2.0 MTL File: 'None'\nnewmtl m\n{line}\n"));
        assert_eq!(
            warnings.iter().filter(|w| w.contains("is taken")).count(),
            wanted,
            "{line}: {warnings:?}"
        );
    }
}

#[test]
fn what_is_no_scene_is_one_line() {
    let room = Room::new();
    room.write("empty.obj", "");
    room.write("empty.toml", TOML);
    room.write("binary.obj", (0..=255).cycle().take(10_000).collect::<Vec<u8>>());
    room.write("binary.toml", TOML);
    std::fs::create_dir(room.path("folder.obj")).unwrap();
    for (scene, wanted) in [
        ("empty.obj", "empty.obj: no triangle in this file"),
        ("binary.obj", "binary.obj: no triangle in this file"),
        ("folder.obj", "folder.obj: is a directory"),
        ("rom.obj", "rom.obj: no such scene, and none in scenes/ either; did you mean `room.obj`?"),
        ("/no/such.obj", "/no/such.obj: no such scene"),
        ("room.toml", "room.toml: a scene is a Wavefront .obj or a glTF .glb/.gltf file"),
    ] {
        for command in ["run", "render"] {
            let error = room.fail_at_once(&[command, scene]);
            assert!(error.contains(wanted), "wanted `{wanted}` in: {error}");
        }
    }
}

/// The material `m` of an MTL, with images beside it, and the warnings.
fn textured(mtl: &str, images: &[(&str, image::DynamicImage)]) -> (MaterialParams, Vec<String>) {
    let obj = format!("mtllib room.mtl\n{SQUARE}vt 0 0\nusemtl m\nf 1/1 2/1 3/1\n");
    let room = Room::with(&obj, mtl, TOML);
    for (name, image) in images {
        image.save(room.path(name)).unwrap();
    }
    let s = obj::load(&room.path("room.obj"), CREASE).unwrap_or_else(|e| panic!("{mtl}: {e}"));
    (s.materials[0].1.clone(), s.warnings)
}

fn flat(rgba: [u8; 4]) -> image::DynamicImage {
    image::RgbaImage::from_pixel(2, 2, image::Rgba(rgba)).into()
}

#[test]
fn maps_and_numbers_of_an_mtl_reach_the_material() {
    let gray = ("g.png", flat([128, 128, 128, 255]));
    let half = 128.0 / 255.0;
    let of = |body: &str| {
        let (p, warnings) = textured(&format!("newmtl m\n{body}"), std::slice::from_ref(&gray));
        assert!(warnings.is_empty(), "{body}: {warnings:?}");
        p
    };
    let value = |map: &Option<ScalarMap>| map.as_ref().map(|m| m.sample(Vec2::ZERO));
    let p = of("Ks .5 .5 .5\nmap_Ks g.png\nPr 0.1\nmap_Pr g.png\nPm 0\nmap_Pm g.png\n");
    assert_eq!((p.model, p.specular, p.roughness, p.metallic), (Model::Plastic, 1.0, 1.0, 1.0));
    assert_eq!([&p.specular_map, &p.roughness_map, &p.metallic_map].map(value), [Some(half); 3]);
    let p = of("Kd 0 0 0\nKs 1 .5 .5\nillum 3\nmap_Ks g.png\n");
    assert!(p.model == Model::Conductor && p.base_color.y == 0.5);
    assert!((p.texture.unwrap().sample(Vec2::ZERO).x - 0.216).abs() < 1e-3);
    // An image without its number counts in full.
    assert_eq!(of("map_Kd g.png\n").base_color.x, 1.0);
    assert_eq!(of("Kd .5 .5 .5\nmap_Kd g.png\n").base_color.x, 0.5);
    let p = of("Ke 3 2 1\n");
    assert!(p.emission == Vec3::new(3.0, 2.0, 1.0) && p.emission_texture.is_none() && !p.emission_two_sided);
    assert!(
        of("map_Ke g.png\n").emission == Vec3::ONE && of("Ke 0 0 0\nmap_Ke g.png\n").emission == Vec3::ONE
    );
    assert_eq!((of("d 0.3\n").opacity, of("Tr 0.75\n").opacity), (0.3, 0.25));
    assert_eq!(of("Tr 0.5\nd 1\n").opacity, 1.0);
    let p = of("illum 7\nd 0.3\nmap_d g.png\n");
    assert!(p.model == Model::Thin && p.opacity == 1.0 && p.opacity_map.is_none());
    let p = of("map_Kd -s 2 4 -o 0.25 g.png\n");
    let t = p.texture.unwrap().transform();
    assert_eq!(t.transform_point2(Vec2::ONE), Vec2::new(2.25, 4.0));
}

/// As 3ds Max and others write what an image covers.
#[test]
fn an_image_below_which_the_number_is_black_counts_alone() {
    let images = [("g.png", flat([128, 128, 128, 255]))];
    let (p, _) = textured("newmtl m\nKd 0 0 0\nKe 0 0 0\nmap_Kd g.png\nmap_Ke g.png\n", &images);
    assert_eq!((p.base_color, p.emission), (Vec3::ONE, Vec3::ONE));
    let (p, _) = textured("newmtl m\nKd 0.5 0 0\nKe 2 0 0\nmap_Kd g.png\nmap_Ke g.png\n", &images);
    assert_eq!((p.base_color, p.emission), (Vec3::X * 0.5, Vec3::X * 2.0));
    let (p, _) = textured("newmtl m\nKd 0 0 0\nKe 0 0 0\n", &images);
    assert_eq!((p.base_color, p.emission), (Vec3::ZERO, Vec3::ZERO));
}

#[test]
fn opacity_is_the_alpha_that_varies_or_else_the_red() {
    let mut leaf = image::RgbaImage::from_pixel(2, 2, image::Rgba([40, 200, 10, 255]));
    leaf.put_pixel(0, 0, image::Rgba([40, 200, 10, 0]));
    let images = [("leaf.png", leaf.into()), ("mask.png", flat([51, 0, 0, 255]))];
    let (p, warnings) = textured("newmtl m\nmap_Kd leaf.png\nmap_d leaf.png\nd 0.5\n", &images);
    assert!(warnings.is_empty(), "{warnings:?}");
    let m = Material::new("m".into(), p, &mut Coats::default());
    let (hole, leaf) = (m.opacity(Vec2::new(0.25, 0.75)), m.opacity(Vec2::new(0.75, 0.25)));
    assert!(m.is_translucent() && hole == 0.0 && leaf == 0.5, "{hole} {leaf}");
    let (p, _) = textured("newmtl m\nmap_d mask.png\n", &images);
    assert!((p.opacity_map.unwrap().sample(Vec2::ZERO) - 0.2).abs() < 1e-6);
    let (p, _) = textured("newmtl m\nmap_d -imfchan g mask.png\n", &images);
    assert_eq!(p.opacity_map.unwrap().sample(Vec2::ZERO), 0.0);
    // A mask without holes costs nothing.
    let (p, _) = textured("newmtl m\nmap_d white.png\n", &[("white.png", flat([255; 4]))]);
    assert!(!Material::new("m".into(), p, &mut Coats::default()).is_translucent());
}

#[test]
fn bump_maps_that_hold_normals_are_told_from_heights() {
    let images = [("n.png", flat([120, 135, 250, 255])), ("h.png", flat([200, 200, 200, 255]))];
    let of = |body: &str| textured(&format!("newmtl m\n{body}"), &images).0.relief;
    let normals = |r: Option<Relief>| match r {
        Some(Relief::NormalMap { scale, .. }) => scale,
        r => panic!("{r:?}"),
    };
    let heights = |r: Option<Relief>| match r {
        Some(Relief::BumpMap { scale, .. }) => scale,
        r => panic!("{r:?}"),
    };
    assert_eq!(normals(of("map_Bump -bm 0.7 n.png\n")), 0.7);
    assert_eq!(normals(of("norm h.png\n")), 1.0);
    assert_eq!(heights(of("bump h.png\n")), 0.01);
    assert_eq!(heights(of("map_bump -bm 4 h.png\n")), 0.04);
    assert_eq!(heights(of("bump -imfchan b n.png\n")), 0.01);
    assert!(of("bump -bm 0 h.png\n").is_none());
}

/// What Blender 4.2 and 2.9 write for known parameters of the principled shader.
#[test]
fn files_of_blender_mean_the_parameters_of_its_shader() {
    let images = [("g.png", flat([128, 128, 128, 255]))];
    let of = |header: &str, body: &str| {
        let (p, warnings) = textured(&format!("{header}\n\nnewmtl m\n{body}"), &images);
        assert!(warnings.is_empty(), "{body}: {warnings:?}");
        p
    };
    const NEW: &str = "# Blender 4.2.0 MTL File: 'None'\n# www.blender.org";
    const OLD: &str = "# Blender MTL File: 'None'\n# Material Count: 1";
    // The default material: roughness 0.5, specular 0.5.
    let body = "Ns 250.000000\nKa 1 1 1\nKd 0.8 0.8 0.8\nKs 0.5 0.5 0.5\nKe 0 0 0\nNi 1.45\nd 1\nillum 2\n";
    let p = of(NEW, body);
    assert_eq!((p.model, p.specular, p.metallic, p.opacity, p.ior), (Model::Plastic, 1.0, 0.0, 1.0, 1.45));
    assert!((p.roughness - 0.5).abs() < 1e-6 && p.emission == Vec3::ZERO);
    let p = of(OLD, &body.replace("250", "225"));
    assert!((p.roughness - 0.5).abs() < 1e-6);
    // Roughness 0.2, metallic 1; then 0.3.
    let metal =
        |ka: f32| format!("Ns 640\nKa {ka} {ka} {ka}\nKd 0.9 0.6 0.3\nKs 0.5 0.5 0.5\nd 1\nillum 3\n");
    let p = of(NEW, &metal(1.0));
    assert!(p.model == Model::Conductor && (p.roughness - 0.2).abs() < 1e-6);
    let p = of(NEW, &metal(0.3));
    assert!(p.model == Model::Plastic && p.metallic == 0.3);
    assert_eq!(of(NEW, &format!("{}Pm 0.6\nPr 0.1\n", metal(0.3))).metallic, 0.6);
    assert_eq!(of(NEW, &format!("{}Pm 0.6\nPr 0.1\n", metal(0.3))).roughness, 0.1);
    // Alpha 0.4, which is no glass; transmission, which is.
    let p = of(NEW, "Ns 250\nKa 1 1 1\nKd 0.8 0.8 0.8\nKs 0.5 0.5 0.5\nNi 1.45\nd 0.4\nillum 9\n");
    assert!(p.model == Model::Plastic && p.opacity == 0.4);
    let p = of(
        NEW,
        "Ns 250\nKa 1 1 1\nKd 1 1 1\nKs 0.5 0.5 0.5\nNi 1.33\nd 0.4\nillum 9\nPr 0\nPm 0\nPs 0\nPc 0\nPcr 0.03\nTf 1 1 1\naniso 0\nanisor 0\n",
    );
    assert!(p.model == Model::Thin && p.opacity == 1.0 && p.ior == 1.33 && p.roughness == 0.0);
    // No specular; specular 0.2.
    assert_eq!(of(NEW, "Ns 250\nKa 1 1 1\nKs 0 0 0\nillum 1\n").model, Model::Diffuse);
    assert!((of(NEW, "Ka 1 1 1\nKs 0.2 0.2 0.2\nillum 2\n").specular - 0.4).abs() < 1e-6);
    // Images stand for the numbers, which are then not written.
    let p = of(
        NEW,
        "Ka 1 1 1\nNi 1.45\nd 1\nillum 2\nmap_Kd g.png\nmap_Ks g.png\nmap_Ns g.png\nmap_refl g.png\n",
    );
    assert_eq!((p.base_color.x, p.specular, p.roughness, p.metallic), (1.0, 2.0, 1.0, 1.0));
    assert!(p.specular_map.is_some() && p.roughness_map.is_some() && p.metallic_map.is_some());
    // The old exporter writes the numbers below the images as well.
    let p = of(OLD, "Ka 1 1 1\nKd 0.8 0.8 0.8\nKe 0 0 0\nillum 2\nmap_Kd g.png\nmap_Ke g.png\nrefl g.png\n");
    assert_eq!((p.base_color.x, p.emission, p.metallic), (1.0, Vec3::ONE, 1.0));
    assert!(p.texture.is_some() && p.emission_texture.is_some() && p.metallic_map.is_some());
    // Values that mean absent.
    let p = of(
        NEW,
        "Ns -1\nKa -1 -1 -1\nKs -1 -1 -1\nd -1\nNi -1\nPm -1\nPr -1\nTf -1 -1 -1\nillum -1\n"
            .replace("Ks -1 -1 -1\n", "")
            .as_str(),
    );
    assert_eq!((p.model, p.roughness, p.metallic, p.opacity, p.ior), (Model::Plastic, 0.5, 0.0, 1.0, 1.5));
}

#[test]
fn high_dynamic_range_images_are_textures() {
    let (width, height) = (4, 3);
    let image = image::Rgb32FImage::from_pixel(width, height, image::Rgb([7.5, 0.25, -1.0]));
    let (p, warnings) = textured("newmtl m\nmap_Ke a.exr\n", &[("a.exr", image.into())]);
    let said = "12 numbers are negative and read as 0; the first, -1, is at column 0, row 0";
    assert!(matches!(warnings.as_slice(), [only] if only.contains(said)), "{warnings:?}");
    assert_eq!(p.emission_texture.unwrap().sample(Vec2::splat(0.4)), Vec3::new(7.5, 0.25, 0.0));
}

#[test]
fn a_header_cannot_make_the_loader_allocate() {
    // A PNG that claims 60000² texels of 16 bits.
    let mut png = Vec::new();
    image::RgbImage::new(1, 1)
        .write_to(&mut std::io::Cursor::new(&mut png), image::ImageFormat::Png)
        .unwrap();
    let crc = |data: &[u8]| {
        !data.iter().fold(!0_u32, |c, &b| {
            (0..8).fold(c ^ u32::from(b), |c, _| if c & 1 == 1 { c >> 1 ^ 0xedb8_8320 } else { c >> 1 })
        })
    };
    png[16..24].copy_from_slice(&[0, 0, 0xea, 0x60, 0, 0, 0xea, 0x60]);
    png[24] = 16;
    let sum = crc(&png[12..29]);
    png[29..33].copy_from_slice(&sum.to_be_bytes());
    let room = Room::with(
        &format!("mtllib room.mtl\n{SQUARE}usemtl m\nf 1 2 3\n"),
        "newmtl m\nmap_Kd a.png\n",
        TOML,
    );
    room.write("a.png", png);
    let e = obj::load(&room.path("room.obj"), CREASE).unwrap_err();
    let text = format!("{e}: {}", std::error::Error::source(&e).map(ToString::to_string).unwrap_or_default());
    assert!(text.contains("a.png: cannot read the texture") && text.contains("imit"), "{text}");
}

#[test]
fn the_sidecar_overrides_what_the_mtl_says_of_a_material() {
    let of = |mtl: &str, keys: &str| {
        let mtl = MTL.replace("newmtl red\n", &format!("newmtl red\n{mtl}"));
        let toml = format!("{TOML}\n[materials.red]\n{keys}\n");
        let loaded = import::load(&Room::with(OBJ, &mtl, &toml).path("room.obj")).unwrap();
        loaded.scene.materials.into_iter().find(|m| m.name == "red").unwrap()
    };
    let m = of("", "metallic = 0.25\nspecular = 0.5\nopacity = 0.75\nemission = [1, 2, 3]");
    assert_eq!((m.metallic(), m.specular(), m.opacity(Vec2::ZERO)), (0.25, 0.5, 0.75));
    assert!(m.is_translucent() && m.is_emissive() && m.emission_tint() == Vec3::new(1.0, 2.0, 3.0));
    // A model is pure unless the sidecar itself says otherwise.
    let m = of("Pm 0.4\nd 0.5\n", "model = \"dielectric\"");
    assert!(m.model() == Model::Dielectric && !m.is_translucent());
    let m = of("", "model = \"dielectric\"\nreflected = [0.1, 0.2, 0.3]\ntransmitted = [1, 0.5, 0]");
    assert_eq!(m.glass_tint().reflected, Vec3::new(0.1, 0.2, 0.3));
    assert_eq!(m.glass_tint().transmitted, Vec3::new(1.0, 0.5, 0.0));
    assert_eq!(
        of("", "model = \"conductor\"\nedge_tint = [0.5, 0.5, 1]").edge_tint(),
        Vec3::new(0.5, 0.5, 1.0)
    );
    let m = of("Pm 0.4\nd 0.5\n", "model = \"diffuse\"");
    assert!(m.metallic() == 0.0 && m.opacity(Vec2::ZERO) == 0.5);
    assert_eq!(of("", "model = \"plastic\"\nmetallic = 0.1").metallic(), 0.1);
}
