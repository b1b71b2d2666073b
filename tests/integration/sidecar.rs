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
        ("vfov = 45.0\n", "", "room.toml:2: missing field `vfov`"),
        ("name = \"fill\"\n", "", "room.toml:16: missing field `name`"),
        ("type = \"sphere\"\n", "", "room.toml:16: missing field `type`"),
        ("radius = 0.1\n", "", "`lights.fill.radius`: a sphere light needs this key"),
        ("half_extents = [0.2, 0.15]\n", "", "`lights.key.half_extents`: a rectangle light needs this key"),
        ("look_at = [0.0, 0.3, 0.0]\n", "", "`lights.key.look_at`: a rectangle light needs this key"),
        ("\"sphere\"", "\"disk\"", "`lights.fill.look_at`: a disk light needs this key"),
        ("\"sphere\"", "\"spot\"", "`lights.fill.angle`: a spot light needs this key"),
        ("objects = [\"box\"]", "", "`main_object`: names no triangle; give `objects` or `materials`"),
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
        ("radiance = 5.0", "radiance = -5.0", "`lights.fill.radiance`: must be >= 0, got -5"),
        ("radiance = 5.0", "radiance = 1e39", "`lights.fill.radiance`: must be >= 0, got inf"),
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
