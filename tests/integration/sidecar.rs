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
        ("vfov = 45.0\n", "", "`camera.vfov`: is missing, and room.obj has no camera that has it"),
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
    let without = |from: &str, to: &str| {
        let (a, b) = (TOML.find(from).unwrap(), to.is_empty().then_some(TOML.len()));
        let b = b.unwrap_or_else(|| TOML.find(to).unwrap());
        let room = Room::with(OBJ, MTL, &format!("{}{}", &TOML[..a], &TOML[b..]));
        room.fail_at_once(&["run", "room.obj"])
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
        ("schema = 1", "schema = 1\nexposure = 0.0", "`exposure`: must be > 0, got 0"),
        ("schema = 1", "schema = 1\nexposure = nan", "`exposure`: must be > 0, got NaN"),
        (
            "schema = 1",
            "schema = 1\ncrease_angle = -1.0",
            "`crease_angle`: must be in [0, 180] degrees, got -1",
        ),
        ("45.0", "180.0", "`camera.vfov`: must be in (0, 180) degrees, got 180"),
        ("[24, 18]", "[24, 18]\nshift = [0.0, 11.0]", "`camera.shift`: must be from -10 to 10, got [0, 11]"),
        ("[24, 18]", "[0, 18]", "`camera.size`: must be at least 1 x 1"),
        ("[24, 18]", "[65536, 65536]", "`camera.size`: must be at least 1 x 1 and at most"),
        ("[0.0, 1.0, 3.0]", "[0.0, inf, 3.0]", "`camera.position`: must be finite"),
        ("[0.0, 0.5, 0.0]", "[0.0, 1.0, 3.0]", "`camera.look_at`: must differ from `position`"),
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
            "`lights.fill.radiance`: must be >= 0 and at most 1e15, got inf",
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
            "`materials.red.emission`: channels must be >= 0, got [1.0, -1.0, 0.0]",
        ),
        (
            "[[lights]]",
            "[materials.red]\nbase_color = [2, 0, 0]\n[[lights]]",
            "`materials.red.base_color`: channels",
        ),
    ]);
}

/// What the room with one more light is answered with.
fn error_of_light(keys: &str) -> String {
    let room = Room::with(OBJ, MTL, &format!("{TOML}[[lights]]\nname = \"x\"\n{keys}\n"));
    room.write("none.png", "no picture");
    image::RgbImage::new(4, 2).save(room.path("black.png")).unwrap();
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
