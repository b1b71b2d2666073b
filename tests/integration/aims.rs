//! Groups, weights and fronts as users meet them.

use std::fs;

use lightopt_embree::film::exr::read_exr;
use serde_json::Value;

use crate::room::{QUICK, Room, names};

fn json(bytes: &[u8]) -> Value {
    serde_json::from_slice(bytes).unwrap()
}

/// A room with a kept basis of a run with these options, and the name of the basis.
fn kept(options: &[&str]) -> (Room, String, Value) {
    let room = Room::new();
    let run = ["run", "room.obj", "--out", "r", "--cache", "bases", "--json"];
    let told = json(&room.succeed(&[&run[..], &QUICK, options].concat()).stdout);
    let basis = room.path("bases").join(&names(&room.path("bases"))[0]);
    (room, basis.to_str().unwrap().to_owned(), told)
}

#[test]
fn a_group_is_one_variable_of_its_name() {
    let (room, basis, told) = kept(&["--group", "warm=key,fill", "--free", "radiance"]);
    assert_eq!(told["x"].as_object().unwrap().keys().collect::<Vec<_>>(), ["warm.radiance"]);
    let lights = |text: &str| {
        room.write("l.toml", format!("schema = 1\n{text}"));
        room.succeed(&["relight", &basis, "--lights", "l.toml", "-o", "a.exr"]);
        read_exr(&room.path("a.exr")).unwrap().beauty().unwrap()
    };
    let of = |name: &str, radiance: f64| format!("[[lights]]\nname = \"{name}\"\nradiance = {radiance}\n");
    let group = lights(&of("warm", 4.0));
    // The lights keep the ratio that they have, 8 to 5.
    let each = lights(&(of("key", 4.0) + &of("fill", 2.5)));
    assert_eq!(group, each);
    room.succeed(&["scan", &basis, "--variable", "warm.radiance", "--steps", "3", "-o", "s.csv"]);
    let table = fs::read_to_string(room.path("s.csv")).unwrap();
    assert!(table.starts_with("warm.radiance,f_q"), "{table}");
    let error = room.fail(&[&["run", "room.obj", "--group", "key=key,fill"][..], &QUICK].concat());
    assert!(error.contains("group key=key,fill") && error.contains("called `key`"), "{error}");
}

/// The optimum under a ratio is that of dense scans along it, with sizes that are given and with a free one: no
/// value of any variable is better where the others are as found. Both look at the same samples, of which there
/// are enough that the search needs no finer basis: in another basis f_q is least elsewhere, by its noise.
#[test]
fn a_run_under_a_ratio_finds_what_a_scan_finds() {
    for n_free in [1, 2] {
        let room = Room::new();
        let options = ["--ratio", "fill=key/4", "--free", "radiance,size", "--spp", "64", "--keep-basis"];
        let run = ["run", "room.obj", "--out", "r", "--json", "--work-size", "16x12", "--size", "24x18"];
        let last = ["--final-spp", "4", "--tolerance", "0.002"];
        let locked = ["--lock", "fill.size", "--lock", "key.size"];
        let output = room.succeed(&[&run[..], &options, &last, &locked[..6 - 2 * n_free]].concat());
        assert!(!String::from_utf8_lossy(&output.stderr).contains("anew"), "a finer basis was needed");
        let told = json(&output.stdout);
        let found = told["x"].as_object().unwrap();
        assert_eq!(found.len(), n_free, "{found:?}");
        let basis = room.path("r/transport.basis");
        for (name, value) in found {
            let scan = ["scan", basis.to_str().unwrap(), "--variable", name, "--steps", "400", "-o", "s.csv"];
            room.succeed(&[&scan[..], &["--lights", "r/lights.toml"]].concat());
            let table = fs::read_to_string(room.path("s.csv")).unwrap();
            let row = |line: &str| line.split(',').take(2).map(|v| v.parse().unwrap()).collect::<Vec<f64>>();
            let rows: Vec<Vec<f64>> = table.lines().skip(1).map(row).collect();
            let least = rows.iter().min_by(|a, b| a[1].total_cmp(&b[1])).unwrap();
            let most = rows.iter().map(|row| row[1]).fold(0.0, f64::max);
            let value = value.as_f64().unwrap();
            let off = |row: &Vec<f64>| (row[0] - value).abs();
            let at = rows.iter().min_by(|a, b| off(a).total_cmp(&off(b))).unwrap();
            assert!(at[1] < least[1] + 2e-3, "{name} found at {value}: {at:?}, least {least:?}");
            assert!(name != "key.radiance" || most > least[1] + 0.2, "{least:?} {most}");
        }
    }
}

#[test]
fn weights_take_the_place_of_the_mask() {
    let room = Room::new();
    let weights = image::GrayImage::from_fn(48, 36, |x, y| image::Luma([(5 * x + y) as u8]));
    weights.save(room.path("w.png")).unwrap();
    let run = ["run", "room.obj", "--out", "r", "--weights", "w.png", "--json"];
    let told = json(&room.succeed(&[&run[..], &QUICK].concat()).stdout);
    let evaluate = ["evaluate", "r/final.exr", "--json"];
    let again = json(&room.succeed(&[&evaluate[..], &["--weights", "w.png"]].concat()).stdout);
    assert_eq!(again["f_q"], told["f_q_final"]);
    let by_mask = json(&room.succeed(&evaluate).stdout);
    assert_ne!(by_mask["f_q"], told["f_q_final"]);
    let black = image::GrayImage::new(4, 4);
    black.save(room.path("b.png")).unwrap();
    let error = room.fail(&[&evaluate[..2], &["--weights", "b.png"]].concat());
    assert!(error.contains("meanObj"), "{error}");
}

#[test]
fn a_front_is_a_table_a_plot_and_pictures() {
    let (room, basis, _) = kept(&[]);
    let aims =
        ["scan", &basis, "--pareto", "meanObj,watts", "--target", "low-key", "--steps", "4", "-o", "f.csv"];
    room.succeed(&aims);
    let table = fs::read_to_string(room.path("f.csv")).unwrap();
    assert!(table.starts_with("meanObj,watts,key.radiance"), "{table}");
    let row = |line: &str| line.split(',').take(2).map(|v| v.parse::<f64>().unwrap()).collect::<Vec<_>>();
    let rows: Vec<Vec<f64>> = table.lines().skip(1).map(row).collect();
    assert!(rows.windows(2).all(|w| w[0][0] < w[1][0] && w[0][1] > w[1][1]), "{table}");
    for name in ["f.png", "f-01.png", "f-01.toml"] {
        assert!(room.path(name).exists(), "{name}");
    }
    room.succeed(&["relight", &basis, "--lights", "f-01.toml", "-o", "a.png"]);
    let error = room.fail(&["scan", &basis, "--pareto", "meanObj,wats", "-o", "f.csv"]);
    assert!(error.contains("--pareto wats: neither a term (meanObj"), "{error}");
}

#[test]
fn a_photograph_in_cmyk_is_refused_with_the_way_out() {
    // The header of a JPEG of four components up to its scan.
    let mut bytes = b"\xff\xd8\xff\xc0\0\x14\x08\0\x01\0\x01\x04".to_vec();
    bytes.extend([1, 0x11, 0, 2, 0x11, 0, 3, 0x11, 0, 4, 0x11, 0]);
    bytes.extend([0xff, 0xda, 0, 14, 4, 1, 0, 2, 0, 3, 0, 4, 0, 0, 63, 0]);
    let room = Room::new();
    room.write("a.jpg", bytes);
    let error = room.fail_at_once(&["evaluate", "a.jpg", "--target", "low-key", "--mask", "a.jpg"]);
    assert!(error.contains("CMYK") && error.contains("convert it to sRGB by its profile"), "{error}");
}
