//! The report of a run, lightings to choose from, comparisons and plots.

use std::{
    fs,
    path::Path,
    process::{Command, Stdio},
};

use base64::prelude::{BASE64_STANDARD, Engine};
use lightopt_embree::{
    audit::{live::Live, stored::About},
    lighting::Lighting,
    math::Measure,
    objective::Target,
    transport::{TransportBasis, compact::Compact},
};
use predicates::str::contains;
use serde_json::Value;

use crate::room::{Room, Running, names, wait_for};

/// A small run with its basis; with `more` options.
fn run(room: &Room, more: &[&str]) {
    let options =
        ["run", "room.obj", "--work-size", "24x18", "--size", "24x18", "--final-spp", "4", "--keep-basis"];
    room.succeed(&[&options, more].concat());
}

/// The data in a page.
fn data(page: &Path) -> Value {
    let text = fs::read_to_string(page).unwrap();
    let (_, rest) = text.split_once("id=\"data\">").unwrap();
    serde_json::from_str(rest.split_once("</script>").unwrap().0).unwrap()
}

/// A lighting of the record.
fn lighting(value: &Value) -> Lighting {
    serde_json::from_value(value.clone()).unwrap()
}

/// Pixels of display luminance that two pictures of a lighting, by the basis and by its copy, differ by at most.
fn difference(run: &Path, copy: &Compact, x: &Lighting) -> f64 {
    let (basis, about) = TransportBasis::load(&run.join("transport.basis")).unwrap();
    let about: About = serde_json::from_value(about).unwrap();
    copy.open().unwrap().error(&basis, std::slice::from_ref(x), about.measure()).largest
}

#[test]
fn the_page_has_the_basis_in_it_to_the_stated_error_and_names_no_place_in_a_network() {
    let room = Room::new();
    run(&room, &["--out", "a"]);
    let directory = room.path("a");
    let page = data(&directory.join("report.html"));
    let live = Live::load(&directory.join("live.basis")).unwrap();
    // What the page decodes is what stands in the file, byte for byte.
    let codes = page["bases"][0]["codes"].as_array().unwrap();
    let decoded: Vec<Vec<u8>> =
        codes.iter().map(|c| BASE64_STANDARD.decode(c.as_str().unwrap()).unwrap()).collect();
    let header = serde_json::from_value(page["bases"][0]["copy"].clone()).unwrap();
    let copy = Compact { header, codes: decoded };
    assert_eq!(copy, live.copy);
    let stated = page["bases"][0]["error"]["largest"].as_f64().unwrap();
    assert!(stated > 0.0 && stated < 0.05, "{stated}");
    let look = &page["looks"][0];
    for name in ["start", "found"] {
        let largest = difference(&directory, &copy, &lighting(&look["result"][name]));
        assert!(largest <= stated.max(0.01), "{name}: {largest}, stated {stated}");
    }
    // f_q of the copy's picture is that of the basis's.
    let (basis, about) = TransportBasis::load(&directory.join("transport.basis")).unwrap();
    let about: About = serde_json::from_value(about).unwrap();
    let objective = about.objective(&Target::resolve("high-key").unwrap(), &basis).unwrap();
    let x = lighting(&look["result"]["found"]);
    let f_q = |rgb: &[[f32; 3]]| objective.evaluate(&about.measure().encode_image(rgb, x.exposure)).f_q;
    let [a, b] = [f_q(&basis.picture(&x).rgb), f_q(&copy.open().unwrap().picture(&x))];
    assert!((a - b).abs() < 5e-3, "{a} {b}");

    let text = fs::read_to_string(directory.join("report.html")).unwrap();
    let text = text.replace("http://www.w3.org/2000/svg", "");
    assert!(!text.contains("http://") && !text.contains("https://"));
    assert!(text.contains("default-src 'none'"));
    assert_eq!(page["running"], false);
    let command = look["command"].as_str().unwrap();
    assert!(command.starts_with("lightopt-embree run room.obj --work-size 24x18"), "{command}");
}

#[test]
fn a_report_is_made_again_from_its_directory_without_the_scene() {
    let room = Room::new();
    run(&room, &["--out", "a"]);
    let before = fs::read(room.path("a/report.html")).unwrap();
    fs::remove_file(room.path("a/report.html")).unwrap();
    fs::remove_file(room.path("room.obj")).unwrap();
    room.command(&["report", "a"]).assert().success().stdout(contains("a/report.html"));
    assert!(before == fs::read(room.path("a/report.html")).unwrap());
    room.write("empty/notes.txt", "");
    assert!(room.fail_at_once(&["report", "empty"]).contains("empty: no run directory"));
    fs::write(room.path("a/live.basis"), b"LIGHTOPTLIVE?").unwrap();
    let damaged = room.fail_at_once(&["report", "a"]);
    assert!(damaged.contains("a/live.basis") && damaged.contains("not a whole copy"), "{damaged}");
}

#[test]
fn all_looks_stand_in_one_page_and_share_a_basis() {
    let room = Room::new();
    run(&room, &["--targets", "low-key,high-key", "--out", "both"]);
    let page = data(&room.path("both/report.html"));
    let names: Vec<&str> =
        page["looks"].as_array().unwrap().iter().map(|l| l["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["low-key", "high-key"], "in the order in which they were asked for");
    assert_eq!(page["bases"].as_array().unwrap().len(), 1);
    assert!(page["looks"].as_array().unwrap().iter().all(|l| l["basis"] == 0));
    run(&room, &["--targets", "low-key,high-key", "--lamps", "1", "--out", "lamps"]);
    let page = data(&room.path("lamps/report.html"));
    let looks: Vec<(&str, &Value)> = page["looks"]
        .as_array()
        .unwrap()
        .iter()
        .map(|l| (l["name"].as_str().unwrap(), &l["basis"]))
        .collect();
    assert_eq!(looks, [("low-key", &Value::from(0)), ("high-key", &Value::from(1))], "each with its lamps");
    let one = data(&room.path("both/high-key/report.html"));
    assert_eq!((one["looks"].as_array().unwrap().len(), &one["looks"][0]["basis"]), (1, &Value::from(0)));
}

#[test]
fn lightings_to_choose_from_differ_and_are_as_good_as_said() {
    let room = Room::new();
    run(&room, &["--out", "a"]);
    let page = data(&room.path("a/report.html"));
    let (result, picks) = (&page["looks"][0]["result"], &page["looks"][0]["picks"]);
    let each = picks["each"].as_array().unwrap();
    assert!(!each.is_empty(), "the room has several lightings that do");
    let (within, different) = (picks["within"].as_f64().unwrap(), picks["different"].as_f64().unwrap());
    let best = result["f_q"].as_f64().unwrap() + result["f_q_error"].as_f64().unwrap();
    let (basis, about) = TransportBasis::load(&room.path("a/transport.basis")).unwrap();
    let about: About = serde_json::from_value(about).unwrap();
    let mut shown: Vec<Vec<f64>> = Vec::new();
    for pick in each {
        let f_q = pick["f_q"].as_f64().unwrap();
        assert!(f_q <= best + within, "{f_q} {best}");
        assert!(pick["distance"].as_f64().unwrap() >= different);
        let x = lighting(&pick["lighting"]);
        shown.push(about.measure().encode_image(&basis.picture(&x).rgb, x.exposure));
        let file = pick["lights"].as_str().unwrap();
        assert!(room.path("a").join(file).is_file());
    }
    // Whole pictures differ by at least as much as those reduced by averaging, up to the curve of the display.
    for (i, a) in shown.iter().enumerate() {
        for b in &shown[..i] {
            let square: f64 = a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum();
            assert!((square / a.len() as f64).sqrt() > 0.8 * different);
        }
    }
    let sheet = image::open(room.path("a/contact.png")).unwrap();
    assert!(sheet.width() > 256);
    room.succeed(&["render", "--pick", "2", "a", "--spp", "1"]);
    assert_eq!(image::image_dimensions(room.path("a/pick-2.png")).unwrap(), (24, 18));
    let missing = room.fail_at_once(&["render", "--pick", "12", "a"]);
    if each.len() < 11 {
        assert!(missing.contains("offers"), "{missing}");
    }
}

#[test]
fn runs_are_compared_and_plotted() {
    let room = Room::new();
    run(&room, &["--targets", "low-key,high-key", "--out", "both"]);
    room.succeed(&["compare", "both", "-o", "page.html"]);
    let page = fs::read_to_string(room.path("page.html")).unwrap();
    assert!(page.contains("2 runs compared") && page.contains("room: low-key") && page.contains("f_q found"));
    for what in ["convergence", "terms", "histogram", "scan"] {
        for ending in ["svg", "png", "pdf"] {
            let file = format!("{what}.{ending}");
            room.succeed(&["plot", "both/high-key", "--what", what, "-o", &file]);
        }
        let svg = fs::read_to_string(room.path(format!("{what}.svg"))).unwrap();
        assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>") && svg.contains("high-key"));
        assert_eq!(image::image_dimensions(room.path(format!("{what}.png"))).unwrap(), (800, 500));
        let pdf = fs::read(room.path(format!("{what}.pdf"))).unwrap();
        assert!(pdf.starts_with(b"%PDF-") && pdf.ends_with(b"%%EOF\n") && pdf.len() < 100_000);
    }
    let gif = room.fail_at_once(&["plot", "both/high-key", "--what", "scan", "-o", "x.gif"]);
    assert!(gif.contains("x.gif: a plot ends in .svg, .pdf or .png"), "{gif}");
    let nowhere = room.fail_at_once(&["plot", "both/high-key", "--what", "scan", "-o", "none/x.svg"]);
    assert!(nowhere.contains("none/x.svg"), "{nowhere}");
    let several = room.fail_at_once(&["plot", "both", "--what", "scan", "-o", "x.svg"]);
    assert!(several.contains("several looks"), "{several}");
}

#[test]
fn paper_mode_has_a_report_without_lights_to_move() {
    let room = Room::new();
    let options =
        ["run", "room.obj", "--gradient", "fd", "--work-size", "16x12", "--size", "24x18", "--spp", "4"];
    room.succeed(&[&options[..], &["--final-spp", "4", "--max-evaluations", "3", "--out", "a"]].concat());
    let page = data(&room.path("a/report.html"));
    assert!(page["bases"].as_array().unwrap().is_empty() && page["looks"][0]["basis"].is_null());
    let steps = page["looks"][0]["iterations"].as_array().unwrap();
    assert!(
        !steps.is_empty()
            && steps.iter().all(|s| s["image"].as_str().unwrap().starts_with("data:image/jpeg"))
    );
    assert!(!names(&room.path("a")).contains(&"contact.png".to_owned()));
}

/// Colours that vary, a look that asks for them, and a view other than srgb: what is offered, recorded and plotted has
/// them too.
#[test]
fn a_look_of_colours_has_them_in_its_page_and_its_lightings() {
    let room = Room::new();
    let look = ["--target", "moonlight", "--view", "agx", "--free", "radiance,size,color"];
    run(&room, &[&look[..], &["--out", "a"]].concat());
    let page = data(&room.path("a/report.html"));
    let look = &page["looks"][0];
    let found = lighting(&look["result"]["found"]);
    assert_eq!((found.color.len(), &page["bases"][0]["white"]), (2, &serde_json::json!([true, true])));
    // The copy shows them: its picture is that of the basis.
    let live = Live::load(&room.path("a/live.basis")).unwrap();
    let (basis, about) = TransportBasis::load(&room.path("a/transport.basis")).unwrap();
    let about: About = serde_json::from_value(about).unwrap();
    let measure = Measure { color: true, ..about.measure() };
    let target = Target::resolve("moonlight").unwrap();
    let [whole, small] = [about.objective(&target, &basis).unwrap(), live.objective(&target).unwrap()];
    let (a, b) = (basis.picture(&found).rgb, live.copy.open().unwrap().picture(&found));
    let [a, b] = [(whole, a), (small, b)]
        .map(|(objective, rgb)| objective.evaluate(&measure.encode_image(&rgb, found.exposure)).f_q);
    assert!((a - b).abs() < 5e-3, "{a} {b}");
    // So do the steps, and what is offered; both differ in colour.
    let steps = look["iterations"].as_array().unwrap();
    assert!(steps.iter().all(|step| lighting(&step["lighting"]).color.len() == 2));
    let picks = look["picks"]["each"].as_array().unwrap();
    assert!(!picks.is_empty() && picks.iter().all(|pick| lighting(&pick["lighting"]).color.len() == 2));
    room.succeed(&["render", "--pick", "2", "a", "--spp", "1"]);
    for term in ["aObj", "bObj", "aBack", "bBack"] {
        let listed = look["terms"].as_array().unwrap().iter().find(|t| t["name"] == term).unwrap();
        assert!(listed["least"].as_f64().unwrap() < 0.0);
    }
    room.succeed(&["plot", "a", "--what", "scan", "-o", "scan.svg"]);
    let svg = fs::read_to_string(room.path("scan.svg")).unwrap();
    assert!(svg.contains("key.color_temperature"));
}

#[test]
fn the_page_has_weights_ties_and_places_before() {
    let room = Room::new();
    let weights = image::GrayImage::from_fn(48, 36, |x, y| image::Luma([(5 * x + y) as u8]));
    weights.save(room.path("w.png")).unwrap();
    run(&room, &["--weights", "w.png", "--group", "both=key,fill", "--out", "a"]);
    let page = data(&room.path("a/report.html"));
    let live = Live::load(&room.path("a/live.basis")).unwrap();
    let shares = live.facts.weights.as_ref().unwrap().read(24 * 18).unwrap();
    // Twice as large and averaged: 5 (2x + ½) + 2y + ½, of 255.
    assert!((shares[24 + 3] - (5.0 * 6.5 + 2.5) / 255.0).abs() < 0.005, "{}", shares[27]);
    assert!(page["bases"][0]["weights"].is_string());
    assert_eq!(page["bases"][0]["ties"].as_array().unwrap().len(), 1);
    // In every step the lights of the group keep their ratio.
    let of = |x: &Lighting| x.radiance[1] / x.radiance[0];
    let look = &page["looks"][0];
    let ratio = of(&lighting(&look["result"]["found"]));
    let steps = look["iterations"].as_array().unwrap();
    assert!(steps.len() > 1);
    let radiances: Vec<f64> = steps.iter().map(|step| lighting(&step["lighting"]).radiance[0]).collect();
    assert!(radiances.iter().any(|r| *r != radiances[0]), "{radiances:?}");
    assert!(steps.iter().all(|step| (of(&lighting(&step["lighting"])) / ratio - 1.0).abs() < 1e-9));
    run(&room, &["--move-lights", "--out", "b"]);
    let moved = data(&room.path("b/report.html"));
    let lights = moved["looks"][0]["result"]["lights"].as_array().unwrap();
    let key = lights.iter().find(|light| light["name"] == "key").unwrap();
    let place: Vec<f64> = serde_json::from_value(key["moved_from"].clone()).unwrap();
    assert!(place.iter().zip([0.5, 1.8, 0.8]).all(|(a, b)| (a - b).abs() < 1e-5), "{place:?}");
    assert_ne!(key["moved_from"], key["position"]);
    assert!(moved["looks"][0]["plan"].as_str().unwrap().starts_with("data:image/svg+xml"));
}

#[test]
fn the_page_has_the_surroundings_that_were_tried_and_fronts() {
    let room = Room::new();
    fs::copy(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/mitsuba/scenes/sky.hdr"), room.path("sky.hdr"))
        .unwrap();
    run(&room, &["--environments", "sky.hdr", "--out", "a"]);
    let scan =
        ["scan", "a/transport.basis", "--pareto", "meanObj,watts", "--steps", "3", "-o", "a/front.csv"];
    room.succeed(&scan);
    room.succeed(&["report", "a"]);
    let page = data(&room.path("a/report.html"));
    let tried = page["looks"][0]["environments"].as_array().unwrap();
    assert_eq!(tried[0][0], "rank");
    assert!(tried.len() > 1 && tried[1][1] == "sky.hdr", "{tried:?}");
    let fronts = page["looks"][0]["fronts"].as_array().unwrap();
    assert_eq!(fronts.len(), 1);
    assert_eq!(fronts[0]["aims"], serde_json::json!(["meanObj", "watts"]));
    assert!(fronts[0]["pictures"].as_array().unwrap().iter().all(|p| p["image"].is_string()));
}

/// A run that was killed while it rendered its pictures has a page of the lights found.
#[test]
fn a_killed_run_has_a_page_that_can_be_made_again() {
    let room = Room::new();
    let options = ["run", "room.obj", "--work-size", "24x18", "--size", "640x480", "--final-spp", "4096"];
    let options = [&options[..], &["--final-noise", "0", "--out", "a"]].concat();
    let mut command = Command::new(assert_cmd::cargo::cargo_bin("lightopt-embree"));
    command.current_dir(room.directory.path()).args(options).stdout(Stdio::null()).stderr(Stdio::null());
    let mut child = Running(command.spawn().unwrap());
    let page = room.path("a/report.html");
    wait_for(|| page.is_file());
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(room.path("a/found.png").is_file() && !room.path("a/final.png").is_file());
    assert_eq!(data(&page)["running"], true);
    room.succeed(&["report", "a"]);
    let again = data(&page);
    assert_eq!(again["running"], false, "nobody makes it complete");
    assert!(
        again["looks"][0]["pictures"]["final"].is_null() && !again["looks"][0]["pictures"]["found"].is_null()
    );
    fs::remove_file(room.path("a/result.json")).unwrap();
    let early = room.fail_at_once(&["report", "a"]);
    assert!(early.contains("no `result.json`"), "{early}");
}
