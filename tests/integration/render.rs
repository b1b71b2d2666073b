//! `lightopt-embree render`.

use lightopt_embree::film::exr::{ExrImage, read_exr};
use lightopt_embree::film::image_file;
use predicates::str::contains;

use crate::room::{MTL, OBJ, Room, TOML, names};

fn part<'a>(exr: &'a ExrImage, name: &str) -> Vec<(&'a str, &'a [f32])> {
    let part = exr.parts.iter().find(|p| p.name == name).unwrap_or_else(|| panic!("no part `{name}`"));
    part.channels.iter().map(|(n, v)| (n.as_str(), v.as_slice())).collect()
}

#[test]
fn an_exr_holds_the_beauty_first_and_the_lights_sum_to_it() {
    let room = Room::with(OBJ, MTL, &TOML.replace("\"fill\"", "\"fill 1./a\""));
    let output = room.succeed(&["render", "room.obj", "--spp", "8"]);
    assert!(output.stdout.is_empty());
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!(stderr, "rendering\nwrote room.exr\n");

    let exr = read_exr(&room.path("room.exr")).unwrap();
    assert_eq!((exr.width, exr.height), (24, 18));
    let parts: Vec<&str> = exr.parts.iter().map(|p| p.name.as_str()).collect();
    let lights = ["light.key", "light.fill 1./a"];
    assert_eq!(parts[..6], ["rgb", "luminance", "mask", "albedo", "normal", "depth"]);
    assert_eq!(parts[6..], lights);
    let channels = |name| part(&exr, name).iter().map(|(n, _)| *n).collect::<Vec<_>>();
    let sorted = |name| {
        let mut c = channels(name);
        c.sort_unstable();
        c
    };
    assert_eq!(sorted("rgb"), ["B", "G", "R"]);
    assert_eq!(sorted("normal"), ["X", "Y", "Z"]);
    assert_eq!(channels("depth"), ["Z"]);

    for (i, (name, beauty)) in part(&exr, "rgb").into_iter().enumerate() {
        let shares = lights.map(|l| part(&exr, l)[i]);
        assert!(shares.iter().all(|(n, v)| *n == name && v.iter().any(|&x| x > 0.0)));
        for (p, &whole) in beauty.iter().enumerate() {
            let sum = shares[0].1[p] + shares[1].1[p];
            assert!((sum - whole).abs() <= 1e-5 * whole.max(1e-3), "{sum} {whole}");
        }
    }
    let mask = part(&exr, "mask")[0].1;
    assert!(mask.iter().all(|&m| m == 0.0 || m == 1.0) && mask.contains(&0.0) && mask.contains(&1.0));
    let stored = exr.lightopt.unwrap();
    assert_eq!((stored["spp"].as_u64(), stored["seed"].as_u64()), (Some(8), Some(0)));
}

#[test]
fn options_change_what_they_say() {
    let room = Room::new();
    let render = |name: &str, options: &[&str]| {
        let mut arguments = vec!["render", "room.obj", "--spp", "4", "-o", name];
        arguments.extend(options);
        room.succeed(&arguments);
        std::fs::read(room.path(name)).unwrap()
    };
    let plain = render("a.exr", &[]);
    assert!(plain == render("b.exr", &["--bdpt", "--threads", "1", "--max-depth", "8"]));
    assert!(plain != render("c.exr", &["--path"]));
    assert!(plain != render("d.exr", &["--seed", "1"]));
    assert!(plain != render("e.exr", &["--sampler", "halton"]));
    assert!(plain != render("f.exr", &["--max-depth", "2"]));
    render("g.exr", &["--size", "5x7"]);
    let g = read_exr(&room.path("g.exr")).unwrap();
    assert_eq!((g.width, g.height), (5, 7));

    let png = |name: &str, exposure: &str| {
        render(name, &["--exposure", exposure]);
        image::open(room.path(name)).unwrap().into_rgb8()
    };
    let (dark, bright) = (png("a.png", "0.5"), png("B.PNG", "2"));
    assert_eq!(dark.dimensions(), (24, 18));
    let sum = |i: &image::RgbImage| i.as_raw().iter().map(|&v| u64::from(v)).sum::<u64>();
    assert!(sum(&dark) < sum(&bright));
}

#[test]
fn a_lighting_is_applied_and_checked() {
    let room = Room::new();
    let error = |text: &str| {
        room.write("l.toml", text);
        room.fail_at_once(&["render", "room.obj", "--lights", "l.toml", "-o", "a.exr"])
    };
    for (text, wanted) in [
        (
            "schema = 1\n[[lights]]\nname = \"fil\"\nradiance = 1\n",
            "the scene has no light `fil`; did you mean `fill`?",
        ),
        (
            "schema = 1\n[[lights]]\nname = \"zz\"\nradiance = 1\n",
            "the scene has no light `zz`; it has key, fill",
        ),
        (
            "schema = 1\n[[lights]]\nname = \"fill\"\nradiance = -1\n",
            "l.toml: `lights.fill.radiance`: must be >= 0 and at most 1e15, got -1",
        ),
        (
            "schema = 1\n[[lights]]\nname = \"fill\"\nradiance = 1\nsize = 0\n",
            "l.toml: `lights.fill.size`: must be > 0, got 0",
        ),
        ("schema = 1\n[[lights]]\nname = \"fill\"\n", "l.toml:2: missing field `radiance`"),
        ("schema = 1\n[background]\nvalue = 9.0\n", "l.toml: `background.value`: must be in [0, 1.4285"),
        ("schema = 1\nexposure = 0\n", "l.toml: `exposure`: must be from 1e-12 to 1e12, got 0"),
        ("schema = 2\n", "l.toml: `schema`: this program reads version 1, the file says 2"),
        ("schema = 1\nlihgts = 1\n", "l.toml:2: unknown key `lihgts`; did you mean `lights`?"),
    ] {
        let error = error(text);
        assert!(error.contains(wanted), "wanted `{wanted}` in: {error}");
    }
    let missing = room.fail_at_once(&["render", "room.obj", "--lights", "no.toml", "-o", "a.exr"]);
    assert!(missing.contains("no.toml: cannot read the lighting"), "{missing}");

    room.write("off.toml", "schema = 1\n[[lights]]\nname = \"fill\"\nradiance = 0\n");
    room.succeed(&["render", "room.obj", "--lights", "off.toml", "-o", "a.exr", "--spp", "2"]);
    let exr = read_exr(&room.path("a.exr")).unwrap();
    assert!(part(&exr, "light.fill").iter().all(|(_, v)| v.iter().all(|&x| x == 0.0)));
    assert!(part(&exr, "light.key").iter().any(|(_, v)| v.iter().any(|&x| x > 0.0)));
}

#[test]
fn impossible_outputs_fail_before_the_work() {
    let room = Room::new();
    std::fs::create_dir(room.path("folder.exr")).unwrap();
    let before = names(room.directory.path());
    for (output, wanted) in [
        ("a.jpg", "a.jpg: the output must end in .exr or .png"),
        ("a", "a: the output must end in .exr or .png"),
        ("no/a.exr", "no: no such directory"),
        ("room.obj/a.exr", "room.obj: no such directory"),
        ("folder.exr", "folder.exr: cannot create the file"),
    ] {
        let error = room.fail_at_once(&["render", "room.obj", "-o", output]);
        assert!(error.contains(wanted), "wanted `{wanted}` in: {error}");
    }
    assert_eq!(names(room.directory.path()), before);
}

#[test]
fn wrong_usage_is_code_2() {
    let room = Room::new();
    for (arguments, wanted) in [
        (vec!["--path", "--bdpt"], "cannot be used with"),
        (vec!["--size", "640"], "WIDTHxHEIGHT"),
        (vec!["--size", "0x5"], "WIDTHxHEIGHT"),
        (vec!["--size", "65536x65536"], "at most"),
        (vec!["--spp", "0"], "whole number from 1"),
        (vec!["--spp", "2.5"], "whole number from 1"),
        (vec!["--max-depth", "0"], "1..=32"),
        (vec!["--threads", "0"], "1.."),
        (vec!["--seed", "-1"], "--seed"),
        (vec!["--exposure", "-2"], "above 0"),
        (vec!["--sampler", "sobool"], "sobol"),
        (vec!["--outptu", "a.exr"], "--output"),
    ] {
        let mut all = vec!["render", "room.obj"];
        all.extend(&arguments);
        room.command(&all).assert().code(2).stdout("").stderr(contains(wanted));
    }
    room.command(&["render"]).assert().code(2).stderr(contains("<SCENE>"));
    room.command(&[]).assert().code(2);
    assert!(!room.path("room.exr").exists());
}

#[test]
fn an_exposure_out_of_range_is_refused_in_one_line_that_names_the_option() {
    let room = Room::new();
    for command in [&["run", "room.obj"][..], &["render", "room.obj"], &["evaluate", "a.png"]] {
        for value in ["1.0001e12", "1e13", "1e-13", "1e400", "inf", "nan", "bright"] {
            let failed =
                room.command(&[command, &["--exposure", value]].concat()).assert().code(2).stdout("");
            let said = String::from_utf8(failed.get_output().stderr.clone()).unwrap();
            let wanted = format!(
                "error: invalid value '{value}' for '--exposure <FACTOR>': must be a number above 0, from 1e-12 to 1e12"
            );
            assert_eq!(said.lines().next(), Some(&*wanted));
            // All there is besides is where help is found.
            let rest: Vec<&str> = said.lines().skip(1).filter(|line| !line.is_empty()).collect();
            assert_eq!(rest, ["For more information, try '--help'."]);
        }
    }
    assert_eq!(names(room.directory.path()), ["room.mtl", "room.obj", "room.toml"]);
}

#[test]
fn help_and_version_go_to_standard_output() {
    let room = Room::new();
    for (command, wanted) in
        [("run", "--max-evaluations <N>"), ("render", "--lights <FILE>"), ("evaluate", "--mask <FILE>")]
    {
        room.command(&[command, "--help"]).assert().code(0).stderr("").stdout(contains(wanted));
        room.command(&["help", command]).assert().code(0).stdout(contains(wanted));
    }
    room.command(&["--version"]).assert().code(0).stdout(contains(env!("CARGO_PKG_VERSION")));
    room.command(&["--help"]).assert().code(0).stdout(contains("evaluate"));
}

#[test]
fn the_light_is_the_same_at_the_largest_exposure() {
    let room = Room::new();
    let picture = |exposure: &str, name: &str| {
        room.succeed(&["render", "room.obj", "--spp", "4", "--exposure", exposure, "-o", name]);
        image_file::read_image(&room.path(name)).unwrap().rgb
    };
    let (one, largest) = (picture("1", "a.exr"), picture("1e12", "b.exr"));
    // In units of white the splats are 10¹² times as large; the sums differ by their rounding, 2⁻³² of white.
    for (a, b) in one.as_flattened().iter().zip(largest.as_flattened()) {
        assert!((a - b).abs() <= 1e-6 * a.max(1e-2), "{a} {b}");
    }
    assert!(one.as_flattened().iter().any(|v| *v > 0.1));
}

#[test]
fn a_sphere_smaller_than_the_rounding_of_its_place_is_a_point() {
    let mean = |light: &str| {
        let (before, _) = TOML.split_once("[[lights]]").unwrap();
        let light = format!(
            "[[lights]]\nname = \"l\"\nposition = [-0.8, 1.2, 0.8]\n{light}\ncamera_visible = false\n"
        );
        let room = Room::with(OBJ, MTL, &format!("{before}{light}"));
        room.succeed(&["render", "room.obj", "--spp", "256", "-o", "a.exr"]);
        let rgb = image_file::read_image(&room.path("a.exr")).unwrap().rgb;
        rgb.as_flattened().iter().sum::<f32>() / rgb.as_flattened().len() as f32
    };
    // The intensity πR²L; what differs is noise.
    let point = mean(&format!("type = \"point\"\nradiance = {}", std::f64::consts::PI));
    for (radius, radiance) in [("1e-4", "1e8"), ("1e-7", "1e14")] {
        let sphere = mean(&format!("type = \"sphere\"\nradius = {radius}\nradiance = {radiance}"));
        assert!((sphere / point - 1.0).abs() < 5e-3, "{radius}: {sphere} {point}");
    }
}

#[test]
fn lights_out_of_range_are_shown_as_written() {
    let room = Room::new();
    for (lights, wanted) in [
        ("exposure = 1e40", "`exposure`: must be from 1e-12 to 1e12, got 1e40"),
        (
            "[[lights]]\nname = \"key\"\nradiance = 1e40",
            "`lights.key.radiance`: must be >= 0 and at most 1e15, got 1e40",
        ),
        (
            "[[lights]]\nname = \"key\"\nradiance = 1\nsize = 1e40",
            "`lights.key.size`: must be from 1.1754944e-38 to 3.4028235e38, got 1e40",
        ),
        ("[background]\nvalue = 1e40", "`background.value`: must be in [0, "),
    ] {
        room.write("l.toml", format!("schema = 1\n{lights}\n"));
        let error = room.fail(&["render", "room.obj", "--lights", "l.toml", "--spp", "1", "-o", "a.png"]);
        assert!(error.contains(wanted) && error.ends_with("got 1e40"), "{error}");
    }
}

#[test]
fn a_surface_that_shines_beyond_all_measure_is_named() {
    let room = Room::with(OBJ, &format!("{MTL}Ke 3e38 3e38 3e38\n"), TOML);
    let error = room.fail(&["render", "room.obj", "--spp", "1", "-o", "a.png"]);
    let start = "error: room.obj: `red`: its radiance must be >= 0 and at most 1e15, got ";
    assert!(error.starts_with(start), "{error}");
}
