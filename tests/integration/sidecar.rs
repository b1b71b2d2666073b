//! The sidecar's errors: one line with file, key and what is allowed.

use crate::room::{MTL, OBJ, Room, TOML};

/// What a sidecar with `from` replaced by `to` is answered with.
fn error_of(from: &str, to: &str) -> String {
    assert!(TOML.contains(from), "{from}");
    let room = Room::with(OBJ, MTL, &TOML.replacen(from, to, 1));
    let error = room.fail_at_once(&["render", "room.obj", "--spp", "1", "-o", "a.png"]);
    assert!(!room.path("a.png").exists());
    error
}

fn check(cases: &[(&str, &str, &str)]) {
    for (from, to, wanted) in cases {
        let error = error_of(from, to);
        assert!(error.contains(wanted), "`{from}` -> `{to}`: wanted `{wanted}` in: {error}");
    }
}

#[test]
fn unknown_keys_and_values_are_answered_with_line_and_the_nearest() {
    check(&[
        (
            "schema = 1",
            "schema = 1\nexposre = 2",
            "room.toml:2: unknown key `exposre`; did you mean `exposure`?",
        ),
        ("[camera]", "[camra]", "room.toml:2: unknown key `camra`; did you mean `camera`?"),
        ("vfov", "fov", "room.toml:5: unknown key `fov`; did you mean `vfov`?"),
        ("objects", "object", "room.toml:8: unknown key `object`; did you mean `objects`?"),
        ("radius", "raduis", "room.toml:20: unknown key `raduis`; did you mean `radius`?"),
        (
            "\"sphere\"",
            "\"spere\"",
            "room.toml:18: `lights.type`: unknown value `spere`; did you mean `sphere`?",
        ),
        ("radius", "free = [\"sise\"]\nradius", "`lights.free`: unknown value `sise`; did you mean `size`?"),
        (
            "[[lights]]",
            "[materials.red]\nmodle = 1\n[[lights]]",
            "unknown key `modle`; did you mean `model`?",
        ),
        (
            "[[lights]]",
            "[materials.red]\nmodel = \"plastik\"\n[[lights]]",
            "room.toml:10: `materials.red.model`: unknown value `plastik`; did you mean `plastic`?",
        ),
        (
            "[[lights]]",
            "[background]\nvalue = 1\n[[lights]]",
            "unknown key `value`; did you mean `value_range`?",
        ),
    ]);
}

#[test]
fn wrong_types_are_answered_with_line_and_key() {
    check(&[
        ("45.0", "\"45\"", "room.toml:5: `camera.vfov`: invalid type: string \"45\", expected a number"),
        ("[24, 18]", "[24]", "room.toml:6: `camera.size`: invalid length 1"),
        ("[24, 18]", "[24, -18]", "room.toml:6: `camera.size`: invalid value"),
        ("[24, 18]", "[24.5, 18]", "room.toml:6: `camera.size`: invalid type"),
        ("[\"box\"]", "\"box\"", "room.toml:8: `main_object.objects`: invalid type"),
        ("[\"box\"]", "[\n  \"box\",\n  7,\n]", "room.toml:10: `main_object.objects`: invalid type"),
        ("radius = 0.1", "radius = true", "room.toml:20: `lights.radius`: invalid type"),
        ("radius = 0.1", "free = [1]\nradius = 0.1", "room.toml:20: `lights.free`: "),
        ("schema = 1", "schema = ", "room.toml:1: "),
        ("schema = 1", "schema = 1\nschema = 1", "room.toml:2: duplicate key"),
    ]);
}

#[test]
fn what_is_missing_is_named() {
    check(&[
        ("schema = 1\n", "", "room.toml:1: missing field `schema`"),
        ("vfov = 45.0\n", "", "`camera.vfov`: is missing, and room.obj has no camera"),
        ("name = \"fill\"\n", "", "room.toml:16: missing field `name`"),
        ("type = \"sphere\"\n", "", "`lights.fill.type`: is missing, and room.obj has no light of this name"),
        ("radius = 0.1\n", "", "`lights.fill.radius`: a sphere light needs this key"),
        ("half_extents = [0.2, 0.15]\n", "", "`lights.key.half_extents`: a rectangle light needs this key"),
        ("look_at = [0.0, 0.3, 0.0]\n", "", "`lights.key.look_at`: a rectangle light needs this key"),
        ("\"sphere\"", "\"disk\"", "`lights.fill.look_at`: a disk light needs this key"),
        ("\"sphere\"", "\"spot\"", "`lights.fill.angle`: a spot light needs this key"),
        (
            "objects = [\"box\"]",
            "",
            "`main_object`: names no triangle; give `objects`, `materials` or `inside`",
        ),
    ]);
    // Without lights `run` places some.
    let without = |from: &str, to: &str| {
        let (a, b) = (TOML.find(from).unwrap(), to.is_empty().then_some(TOML.len()));
        let b = b.unwrap_or_else(|| TOML.find(to).unwrap());
        let room = Room::with(OBJ, MTL, &format!("{}{}", &TOML[..a], &TOML[b..]));
        room.fail_at_once(&["render", "room.obj"])
    };
    let error = without("[camera]", "[main_object]");
    assert!(error.contains("room.toml:1: missing field `camera`"), "{error}");
    let error = without("[main_object]", "[[lights]]");
    assert!(error.contains("room.toml:1: missing field `main_object`"), "{error}");
    let error = without("[[lights]]", "");
    assert!(error.contains("room.toml: `lights`: the scene has no lights"), "{error}");
}

#[test]
fn values_out_of_range_are_answered_with_what_is_allowed() {
    check(&[
        ("schema = 1", "schema = 2", "`schema`: this program reads version 1, the file says 2"),
        ("schema = 1", "schema = 1\nexposure = 0.0", "`exposure`: must be from 1e-12 to 1e12, got 0"),
        ("schema = 1", "schema = 1\nexposure = nan", "`exposure`: must be from 1e-12 to 1e12, got NaN"),
        (
            "schema = 1",
            "schema = 1\ncrease_angle = -1.0",
            "`crease_angle`: must be in [0, 180] degrees, got -1",
        ),
        ("45.0", "180.0", "`camera.vfov`: must be from 0.001 to 179.9 degrees, got 180"),
        ("[24, 18]", "[24, 18]\nshift = [0.0, 11.0]", "`camera.shift`: must be from -10 to 10, got [0, 11]"),
        ("[24, 18]", "[0, 18]", "`camera.size`: must be at least 1 x 1"),
        ("[24, 18]", "[65536, 65536]", "`camera.size`: must be at least 1 x 1 and at most"),
        ("[0.0, 1.0, 3.0]", "[0.0, inf, 3.0]", "`camera.position`: must be finite"),
        ("[0.0, 0.5, 0.0]", "[0.0, 1.0, 3.0]", "`camera.look_at`: must differ from `position`"),
        ("[24, 18]", "[24, 18]\nup = [0, 0, 0]", "`camera.up`: must not be zero nor lie along the direction"),
        ("[24, 18]", "[24, 18]\nup = [0, 1, 6]", "in which the camera looks, got [0, 1, 6]"),
        ("[24, 18]", "[24, 18]\nup = [0, nan, 1]", "`camera.up`: must be finite, got [0, NaN, 1]"),
        ("[24, 18]", "[24, 18]\nup = [0, 1]", "room.toml:7: `camera.up`: invalid length 2"),
        ("[24, 18]", "[24, 18]\nup = \"z\"", "room.toml:7: `camera.up`: invalid type"),
        ("radius = 0.1", "radius = -0.1", "`lights.fill.radius`: must be > 0, got -0.1"),
        ("radius = 0.1", "radius = 0.1\nsize = 0.0", "`lights.fill.size`: must be > 0, got 0"),
        ("[0.2, 0.15]", "[0.2, nan]", "`lights.key.half_extents`: must be > 0, got NaN"),
        ("[0.0, 0.3, 0.0]", "[0.5, 1.8, 0.8]", "`lights.key.look_at`: must differ from `position`"),
        ("[0.0, 0.3, 0.0]", "[0.0, 0.3, 0.0]\nup = [nan, 0, 0]", "`lights.key.up`: must be finite"),
        ("[-0.8, 1.2, 0.8]", "[nan, 1.2, 0.8]", "`lights.fill.position`: must be finite"),
        (
            "radiance = 5.0",
            "radiance = -5.0",
            "`lights.fill.radiance`: must be >= 0 and at most 1e15, got -5",
        ),
        (
            "radiance = 5.0",
            "radiance = 1e39",
            "`lights.fill.radiance`: must be >= 0 and at most 1e15, got 1e39",
        ),
        ("radiance = 5.0", "radiance_max = 0.0", "`lights.fill.radiance_max`: must be > 0, got 0"),
        ("radiance = 5.0", "size_range = [2.0, 1.0]", "`lights.fill.size_range`: must be 0 < min <= max"),
        (
            "radiance = 5.0",
            "color = [0.0, 0.0, 0.0]",
            "`lights.fill.color`: channels must be >= 0 and not all 0",
        ),
        (
            "radiance = 5.0",
            "look_at = [0, 0, 0]",
            "`lights.fill.look_at`: only for a rectangle, disk, spot or distant light",
        ),
        ("radiance = 8.0", "radius = 1.0", "`lights.key.radius`: only for a disk, sphere or spot"),
        ("name = \"fill\"", "name = \"key\"", "`lights.key`: two lights have this name"),
        ("name = \"fill\"", "name = \"\"", "`lights[2].name`: must be"),
        ("name = \"fill\"", "name = \"\u{5149}\"", "`lights[2].name`: must be"),
        (
            "[[lights]]",
            "[background]\nvalue_range = [1.0, 0.5]\n[[lights]]",
            "`background.value_range`: must be 0",
        ),
        (
            "[[lights]]",
            "[materials.red]\nior = 0.5\n[[lights]]",
            "`materials.red.ior`: must be in (1, 4], got 0.5",
        ),
        (
            "[[lights]]",
            "[materials.red]\nroughness = 2\n[[lights]]",
            "`materials.red.roughness`: must be in [0, 1]",
        ),
        (
            "[[lights]]",
            "[materials.red]\nmetallic = -0.1\n[[lights]]",
            "`materials.red.metallic`: must be in [0, 1], got -0.1",
        ),
        (
            "[[lights]]",
            "[materials.red]\nspecular = nan\n[[lights]]",
            "`materials.red.specular`: must be in [0, 1], got NaN",
        ),
        (
            "[[lights]]",
            "[materials.red]\nopacity = 1.5\n[[lights]]",
            "`materials.red.opacity`: must be in [0, 1], got 1.5",
        ),
        (
            "[[lights]]",
            "[materials.red]\nemission = [1, -1, 0]\n[[lights]]",
            "`materials.red.emission`: channels must be >= 0 and at most 1e15, got [1, -1, 0]",
        ),
        (
            "[[lights]]",
            "[materials.red]\nbase_color = [2, 0, 0]\n[[lights]]",
            "`materials.red.base_color`: channels",
        ),
    ]);
}

#[test]
fn numbers_that_are_too_large_or_too_small_are_shown_as_written() {
    let material = |key: &str| format!("[materials.red]\n{key}\n[[lights]]");
    let camera = |key: &str| format!("[24, 18]\n{key}");
    let light = |key: &str| format!("radiance = 5.0\n{key}");
    let backdrop = |key: &str, value: &str| {
        let keys = "front = 2\nback = 2\nwidth = 2\nheight = 2\n";
        let given = format!("{key} = ");
        let kept: String =
            keys.lines().filter(|l| !l.starts_with(&given)).map(|l| format!("{l}\n")).collect();
        format!("[backdrop]\n{kept}{key} = {value}\n[[lights]]")
    };
    let lengths = "must be from 1e-18 to 1.844e18, got 1e40";
    let f32s = "must be from 1.1754944e-38 to 3.4028235e38, got";
    for (from, to, wanted) in [
        (
            "schema = 1",
            "schema = 1\nexposure = 1e40".into(),
            "`exposure`: must be from 1e-12 to 1e12, got 1e40",
        ),
        (
            "schema = 1",
            "schema = 1\nexposure = 1e-40".into(),
            "`exposure`: must be from 1e-12 to 1e12, got 1e-40",
        ),
        ("schema = 1", "schema = 1\nscale = 1e40".into(), &format!("`scale`: {f32s} 1e40")),
        ("schema = 1", "schema = 1\nscale = 1e-40".into(), &format!("`scale`: {f32s} 1e-40")),
        (
            "schema = 1",
            "schema = 1\nscale = 1e30".into(),
            "`scale`: no triangle is left of those that are 1e30 as",
        ),
        (
            "schema = 1",
            "schema = 1\ncrease_angle = 1e40".into(),
            "`crease_angle`: must be in [0, 180] degrees, got 1e40",
        ),
        ("45.0", "1e40".into(), "`camera.vfov`: must be from 0.001 to 179.9 degrees, got 1e40"),
        ("45.0", "179.99999999".into(), "to 179.9 degrees, got 179.99999999"),
        (
            "[24, 18]",
            camera("up = [0, 1e40, 0]"),
            "`camera.up`: must be at most 1.844e18 in magnitude, got [0, 1e40, 0]",
        ),
        ("[24, 18]", camera("shift = [1e40, 0]"), "`camera.shift`: must be from -10 to 10, got [1e40, 0]"),
        ("[24, 18]", camera("aperture_radius = 1e40"), &format!("`camera.aperture_radius`: {lengths}")),
        (
            "[24, 18]",
            camera("aperture_radius = 1.0\nfocus_distance = 1e40"),
            &format!("`camera.focus_distance`: {lengths}"),
        ),
        (
            "[0.0, 1.0, 3.0]",
            "[1e300, 1.0, 3.0]".into(),
            "`camera.position`: must be at most 1.844e18 in magnitude, got [1e300, 1, 3]",
        ),
        (
            "[-0.8, 1.2, 0.8]",
            "[-1e300, 1.2, 0.8]".into(),
            "`lights.fill.position`: must be at most 1.844e18 in magnitude, got [-1e300, 1.2, 0.8]",
        ),
        (
            "[0.0, 0.3, 0.0]",
            "[0, 0, 0]\nup = [1e40, 0, 0]".into(),
            "`lights.key.up`: must be at most 1.844e18 in magnitude, got [1e40, 0, 0]",
        ),
        ("[0.2, 0.15]", "[0.2, 1e40]".into(), &format!("`lights.key.half_extents`: {lengths}")),
        ("radius = 0.1", "radius = 1e40".into(), &format!("`lights.fill.radius`: {lengths}")),
        (
            "radius = 0.1",
            "radius = 1e-40".into(),
            "`lights.fill.radius`: must be from 1e-18 to 1.844e18, got 1e-40",
        ),
        ("radiance = 5.0", light("size = 1e40"), &format!("`lights.fill.size`: {f32s} 1e40")),
        (
            "radiance = 5.0",
            light("size = 1e30"),
            "`lights.fill.size`: must give a length from 1e-18 to 1.844e18 m, gives 1e29",
        ),
        (
            "radiance = 5.0",
            light("size_range = [1, 1e40]"),
            &format!("`lights.fill.size_range`: {f32s} 1e40"),
        ),
        (
            "radiance = 5.0",
            light("size_range = [1e-50, 1]"),
            &format!("`lights.fill.size_range`: {f32s} 1e-50"),
        ),
        ("radiance = 5.0", light("radiance_max = 1e40"), "`lights.fill.radiance_max`: "),
        (
            "radiance = 5.0",
            light("radiance_max = 1e20"),
            "`lights.fill.radiance_max`: must be >= 0 and at most 1e15, got 1e20",
        ),
        (
            "radiance = 5.0",
            "radiance = 1e40".into(),
            "`lights.fill.radiance`: must be >= 0 and at most 1e15, got 1e40",
        ),
        (
            "radiance = 5.0",
            light("color = [1e40, 0, 0]"),
            "`lights.fill.color`: channels must be >= 0 and not all 0, at most 1e15, got [1e40, 0, 0]",
        ),
        (
            "[[lights]]",
            "[background]\nvalue_range = [0, 1e40]\n[[lights]]".into(),
            "`background.value_range`: must be 0 <= min <= max, max at most 3.4028235e38, got [0, 1e40]",
        ),
        ("[[lights]]", material("ior = 1e40"), "`materials.red.ior`: must be in (1, 4], got 1e40"),
        (
            "[[lights]]",
            material("roughness = 1e40"),
            "`materials.red.roughness`: must be in [0, 1], got 1e40",
        ),
        (
            "[[lights]]",
            material("base_color = [1e40, 0, 0]"),
            "`materials.red.base_color`: channels must be in [0, 1], got [1e40, 0, 0]",
        ),
        (
            "[[lights]]",
            material("emission = [1e18, 0, 0]"),
            "room.toml: `materials.red.emission`: channels must be >= 0 and at most 1e15, got [1e18, 0, 0]",
        ),
        ("[[lights]]", backdrop("front", "1e40"), &format!("`backdrop.front`: {lengths}")),
        (
            "[[lights]]",
            backdrop("radius", "1e40"),
            "`backdrop.radius`: must be > 0 and at most `back` and `height`, got 1e40",
        ),
        (
            "[[lights]]",
            backdrop("base_color", "[1e40, 0, 0]"),
            "`backdrop.base_color`: channels must be in [0, 1], got [1e40, 0, 0]",
        ),
    ] {
        check(&[(from, to.as_str(), wanted)]);
    }
}

#[test]
fn a_turn_of_many_times_is_a_turn() {
    let sky = |rotation: &str| {
        let toml =
            format!("{TOML}[[lights]]\nname = \"sky\"\ntype = \"environment\"\nrotation = {rotation}\n");
        let room = Room::with(OBJ, MTL, &format!("{toml}image = \"sky.png\"\n"));
        image::RgbImage::from_fn(8, 4, |x, _| image::Rgb([32 * x as u8, 255, 0]))
            .save(room.path("sky.png"))
            .unwrap();
        room.succeed(&["render", "room.obj", "--spp", "1", "-o", "a.png"]);
        std::fs::read(room.path("a.png")).unwrap()
    };
    assert!(sky("3610") == sky("10") && sky("10") != sky("0"));
    // What is left of it is not what anyone meant, but it is a turn.
    sky("1e40");
}

#[test]
fn the_brightest_surface_and_light_are_rendered() {
    for (from, to) in [
        ("[[lights]]", "[materials.red]\nemission = [1e15, 1e15, 1e15]\n[[lights]]"),
        ("radiance = 5.0", "radiance = 1e15"),
    ] {
        let room = Room::with(OBJ, MTL, &TOML.replacen(from, to, 1));
        room.succeed(&["render", "room.obj", "--spp", "1", "-o", "a.png"]);
    }
}

#[test]
fn a_camera_is_named_by_a_word_or_a_number() {
    let wanted = "expected the name of a camera, or its number from 1";
    for (given, what) in [
        ("1.5", "invalid type: floating point `1.5`"),
        ("true", "invalid type: boolean `true`"),
        ("[1]", "invalid type: sequence"),
        ("0", "invalid value: integer `0`"),
        ("-2", "invalid value: integer `-2`"),
    ] {
        let error = error_of("[24, 18]", &format!("[24, 18]\nname = {given}"));
        assert_eq!(error, format!("error: room.toml:7: `camera.name`: {what}, {wanted}"));
    }
}

/// What the room with one more light is answered with.
fn error_of_light(keys: &str) -> String {
    let room = Room::with(OBJ, MTL, &format!("{TOML}[[lights]]\nname = \"x\"\n{keys}\n"));
    room.write("none.png", "no picture");
    image::RgbImage::new(4, 2).save(room.path("black.png")).unwrap();
    for (name, brightest) in [("sun.exr", 1e20), ("star.exr", 1e38)] {
        let sky = |x, y| image::Rgb([1.0, if (x, y) == (2, 1) { brightest } else { 1.0 }, 1.0]);
        image::Rgb32FImage::from_fn(4, 2, sky).save(room.path(name)).unwrap();
    }
    room.fail_at_once(&["render", "room.obj", "--spp", "1", "-o", "a.png"])
}

fn check_lights(kind: &str, cases: &[(&str, &str)]) {
    for (keys, wanted) in cases {
        let error = error_of_light(&format!("type = \"{kind}\"\n{keys}"));
        let wanted = format!("room.toml: `lights.x.{wanted}");
        assert!(error.contains(&wanted), "{kind} `{keys}`: wanted `{wanted}` in: {error}");
    }
}

#[test]
fn surroundings_are_nowhere_and_have_a_picture() {
    check_lights(
        "environment",
        &[
            (
                "position = [0, 0, 0]",
                "position`: only for a rectangle, disk, sphere, spot, point or distant light",
            ),
            ("look_at = [0, 0, 0]", "look_at`: only for"),
            ("up = [0, 1, 0]", "up`: only for a rectangle"),
            ("radius = 1", "radius`: only for a disk, sphere or spot"),
            ("size = 1", "size`: only for a light with a size"),
            ("size_range = [1, 2]", "size_range`: only for a light with a size"),
            ("free = [\"size\"]", "free`: `size` is only for a light with a size"),
            ("occludes = true", "occludes`: only for a rectangle, disk or sphere (a mesh always does)"),
            ("material = \"red\"", "material`: only for a mesh"),
            ("rotation = inf", "rotation`: must be finite, got inf"),
            ("image = \"\"", "image`: must name a picture"),
            ("image = \"no.exr\"", "image`: no.exr: cannot open the picture: No such file"),
            ("image = \"none.png\"", "image`: none.png: cannot read it as a picture"),
            ("image = \"black.png\"", "image`: black.png: needs values >= 0, not all 0"),
            (
                "image = \"sun.exr\"",
                "image`: sun.exr: the pixel at column 2, row 1 is 1e20; a radiance is finite and at most 1e15",
            ),
            (
                "image = \"star.exr\"",
                "image`: star.exr: the pixel at column 2, row 1 is 1e38; a radiance is finite and at most 1e15",
            ),
        ],
    );
    check_lights(
        "rectangle",
        &[
            ("image = \"a.exr\"", "image`: only for an environment"),
            ("rotation = 1", "rotation`: only for an environment"),
        ],
    );
}

#[test]
fn parallel_light_has_a_direction_and_no_size() {
    check_lights(
        "distant",
        &[
            ("", "look_at`: a distant light needs this key"),
            ("look_at = [0, 0, 0]", "look_at`: must differ from `position`, which is the origin"),
            ("look_at = [0, -1, 0]\nradius = 1", "radius`: only for"),
            ("look_at = [0, -1, 0]\nangle = 1", "angle`: only for a spot"),
            ("look_at = [0, -1, 0]\nsize = 2", "size`: only for a light with a size"),
            ("look_at = [0, -1, 0]\noccludes = true", "occludes`: only for"),
        ],
    );
}

#[test]
fn a_mesh_is_a_material_that_the_scene_has() {
    check_lights(
        "mesh",
        &[
            ("", "material`: a mesh needs this key"),
            ("material = \"rde\"", "material`: no `rde` in room.obj; did you mean `red`?"),
            ("material = \"red\"\nposition = [0, 0, 0]", "position`: only for"),
            ("material = \"red\"\nhalf_extents = [1, 1]", "half_extents`: only for a rectangle"),
            ("material = \"red\"\noccludes = true", "occludes`: only for"),
            ("material = \"red\"\nfree = [\"radiance\", \"size\"]", "free`: `size` is only for"),
        ],
    );
    let two =
        "type = \"mesh\"\nmaterial = \"red\"\n[[lights]]\nname = \"y\"\ntype = \"mesh\"\nmaterial = \"red\"";
    let error = error_of_light(two);
    assert!(error.contains("`lights.y.material`: another light has the material `red`"), "{error}");
    // No face has it.
    let room = Room::with(
        OBJ,
        &format!("{MTL}newmtl bulb\nKd 0 0 0\n"),
        &format!("{TOML}[[lights]]\nname = \"x\"\ntype = \"mesh\"\nmaterial = \"bulb\"\n"),
    );
    let error = room.fail_at_once(&["render", "room.obj", "-o", "a.png"]);
    assert!(error.contains("`lights.x.material`: no triangle has the material `bulb`"), "{error}");
}

#[test]
fn only_a_spot_may_be_a_point_and_then_has_no_size() {
    let spot = |keys: &str| format!("position = [0, 1, 0]\nlook_at = [0, 0, 0]\nangle = 30\n{keys}");
    let cases = [
        ("", "radius`: a spot light needs this key"),
        ("radius = -1", "radius`: must be >= 0, got -1"),
        ("radius = nan", "radius`: must be >= 0, got NaN"),
        ("radius = 0\nsize = 2", "size`: only for a light with a size"),
        ("radius = 0\nsize_range = [1, 2]", "size_range`: only for a light with a size"),
        ("radius = 0\nfree = [\"size\"]", "free`: `size` is only for"),
        ("radius = 0\nsoftness = 2", "softness`: must be in [0, 1], got 2"),
        ("radius = 0\noccludes = true", "occludes`: only for"),
    ];
    let cases = cases.map(|(keys, wanted)| (spot(keys), wanted));
    check_lights("spot", &cases.each_ref().map(|(keys, wanted)| (keys.as_str(), *wanted)));
    check_lights("sphere", &[("position = [0, 1, 0]\nradius = 0", "radius`: must be > 0, got 0")]);
    check_lights("point", &[("position = [0, 1, 0]\nup = [0, 1, 0]", "up`: only for a rectangle")]);
    check_lights("point", &[("position = [0, 1, 0]\nsize = 2", "size`: only for a light with a size")]);
    check_lights("point", &[("position = [0, 1e30, 0]", "position`: must be at most 1.8")]);
}

#[test]
fn a_light_that_stops_rays_keeps_its_size() {
    check(&[
        (
            "radiance = 5.0",
            "occludes = true\nfree = [\"size\"]",
            "`lights.fill.occludes`: a light that stops rays has no free size",
        ),
        (
            "radiance = 5.0",
            "occludes = true\nsize_range = [1, 2]",
            "`lights.fill.occludes`: a light that stops rays has no free size",
        ),
        ("radiance = 5.0", "occludes = 1", "room.toml:21: `lights.occludes`: invalid type"),
    ]);
}

#[test]
fn a_lens_has_a_radius_and_a_distance() {
    for (keys, wanted) in [
        ("aperture_radius = 0", "`camera.aperture_radius`: must be > 0, got 0"),
        ("aperture_radius = -0.1", "`camera.aperture_radius`: must be > 0, got -0.1"),
        ("aperture_radius = nan", "`camera.aperture_radius`: must be > 0, got NaN"),
        ("focus_distance = 1", "`camera.focus_distance`: needs `aperture_radius`"),
        ("aperture_radius = 0.1\nfocus_distance = 0", "`camera.focus_distance`: must be > 0, got 0"),
    ] {
        let error = error_of("vfov = 45.0", &format!("vfov = 45.0\n{keys}"));
        assert!(error.contains(wanted), "`{keys}`: wanted `{wanted}` in: {error}");
    }
}

#[test]
fn names_that_the_scene_lacks_are_answered_with_those_it_has() {
    check(&[
        ("\"box\"", "\"bxo\"", "`main_object.objects`: no `bxo` in room.obj; did you mean `box`?"),
        ("\"box\"", "\"zzz\"", "no `zzz` in room.obj, which has box, floor, wall"),
        ("\"box\"", "\"zz*\"", "`main_object.objects`: no `zz*` in room.obj"),
        (
            "objects = [\"box\"]",
            "materials = [\"rde\"]",
            "`main_object.materials`: no `rde` in room.obj; did you mean `red`?",
        ),
        (
            "[[lights]]",
            "[background]\nmaterials = [\"flor\"]\n[[lights]]",
            "`background.materials`: no `flor` in room.obj; did you mean `floor`?",
        ),
        (
            "[[lights]]",
            "[materials.wal]\n[[lights]]",
            "`materials`: no `wal` in room.obj; did you mean `wall`?",
        ),
    ]);
}
