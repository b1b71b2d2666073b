//! Pictures in the formats of other programs: the right numbers, or a line that says why not.

use std::fs;
use std::path::{Path, PathBuf};

use assert_cmd::Command;
use image::{GrayAlphaImage, ImageBuffer, LumaA, Rgba, RgbaImage};
use lightopt_embree::film::exr::{ExrImage, ExrPart, read_exr, write_exr};
use lightopt_embree::film::image_file::{MaskImage, read_mask};
use predicates::prelude::PredicateBooleanExt;
use predicates::str::contains;
use serde_json::Value;

use crate::room::{program, refused};

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/pictures").join(name)
}

fn evaluate(file: &Path, mask: &Path) -> Command {
    let mut command = program(Path::new("."));
    command.args(["evaluate", "--json", "--target", "high-key", "--mask"]).args([mask, file]);
    command
}

/// Brightness of object and background, f_q, and what was said.
fn measured(command: &mut Command) -> ([f64; 2], f64, String) {
    let output = command.assert().success().get_output().clone();
    let json: Value = serde_json::from_slice(&output.stdout).unwrap();
    let value = |term: &str| json["terms"][term]["value"].as_f64().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    ([value("meanObj"), value("meanBack")], json["f_q"].as_f64().unwrap(), said)
}

#[test]
fn every_kind_of_file_gives_its_right_numbers() {
    for (file, object, background) in [
        ("rgb8.png", 0.5125, 0.2000),
        ("rgb16.tif", 0.5125, 0.2000),
        ("plain.exr", 0.7157, 0.4845),
        ("rgb32-unsigned.tif", 0.5125, 0.2000),
        ("premultiplied.tif", 0.2544, 0.1000),
        ("premultiplied-twin-straight.tif", 0.3701, 0.1360),
        ("bigtiff.tif", 0.5125, 0.2000),
        ("targa.tga", 0.5125, 0.2000),
        ("grey-float.tif", 0.7354, 0.7354),
        ("gamma-1.png", 0.7157, 0.4845),
        ("albedo-before-beauty.exr", 0.2478, 0.1517),
        ("acescg.exr", 0.1863, 0.3492),
        ("flat-and-deep.exr", 0.7157, 0.4845),
        ("exposure-2.hdr", 0.5371, 0.2773),
    ] {
        let ([obj, back], ..) = measured(&mut evaluate(&data(file), &data("mask.png")));
        assert!(
            (obj - object).abs() < 1e-4 && (back - background).abs() < 1e-4,
            "{file}: {obj:.4} / {back:.4}"
        );
    }
}

#[test]
fn codecs_that_are_not_decoded_are_named_with_the_cure() {
    for (file, codec) in [("zstd.exr", "ZSTD"), ("lj2k.exr", "LJ2K"), ("htj2k256.exr", "HTJ2K256")] {
        refused(&mut evaluate(&data(file), &data("mask.png")), &[file, codec, "save it again with ZIP"]);
    }
}

/// Linear colours at a quarter and three quarters of the width.
fn colours(file: &str, options: &[&str]) -> Result<[[f32; 3]; 2], String> {
    use lightopt_embree::picture::{Picture, Purpose, Reading};
    let reading = Reading { layer: options.first().copied(), ..Reading::of(Purpose::Light) };
    let picture = Picture::read(&data(file), &reading)
        .map_err(|e| std::error::Error::source(&e).map(ToString::to_string).unwrap_or_default())?;
    let row = picture.height / 2 * picture.width;
    Ok([picture.width / 4, 3 * picture.width / 4].map(|x| picture.over_black(row + x)))
}

fn close(got: [[f32; 3]; 2], want: [[f32; 3]; 2]) -> bool {
    got.as_flattened().iter().zip(want.as_flattened()).all(|(a, b)| (a - b).abs() < 1e-3)
}

#[test]
fn the_flat_picture_is_found_among_deep_parts_views_layers_and_unknown_codecs() {
    let picture = [[0.8, 0.4, 0.2], [0.2; 3]];
    for file in ["deep-first.exr", "deep-between.exr", "zstd-beside.exr", "views-channels.exr"] {
        let got = colours(file, &[]).unwrap();
        assert!(close(got, picture), "{file}: {got:?}");
    }
    for (file, layer) in [("views-right-first.exr", "left"), ("views-channels.exr", "left")] {
        assert!(close(colours(file, &[layer]).unwrap(), picture), "{file}");
    }
    let dark = picture.map(|c| c.map(|v| v * 0.1));
    for (file, layer) in [
        ("deep-between.exr", "albedo"),
        ("zstd-beauty.exr", "ALBEDO"),
        ("views-right-first.exr", "rgba.right"),
    ] {
        assert!(close(colours(file, &[layer]).unwrap(), dark), "{file}");
    }
    assert!(colours("deep-only.exr", &[]).unwrap_err().contains("deep EXR data only"));
    assert!(colours("zstd-beauty.exr", &[]).unwrap_err().contains("ZSTD"));
    let strange = colours("deep-between.exr", &["beuaty"]).unwrap_err();
    assert!(strange.contains("`beuaty`; choose `beauty`"), "{strange}");
}

#[test]
fn luminance_with_chroma_and_named_colour_spaces_become_rec709() {
    let picture = [[0.8, 0.4, 0.2], [0.2; 3]];
    assert!(close(colours("luminance-chroma-zip.exr", &[]).unwrap(), picture));
    assert!(colours("luminance-chroma-b44.exr", &[]).unwrap_err().contains("save it again as R, G, B"));
    // [BT709] from Rec.2020, computed with the matrices of BT.2087.
    let wide = colours("lin_rec2020_scene.exr", &[]).unwrap();
    assert!(close(wide, [[1.0788, 0.3518, 0.1690], [0.2; 3]]), "{wide:?}");
    let strange = colours("pq_rec2020_display.exr", &[]).unwrap_err();
    assert!(strange.contains("`pq_rec2020_display` is not known"), "{strange}");
    let display = colours("blender-display-encoded.exr", &[]).unwrap();
    assert!(close(display, [[0.3; 3]; 2]), "{display:?}");
}

#[test]
fn the_part_that_is_called_beauty_is_measured_and_said() {
    let mask = data("parts-mask.png");
    let (_, beauty, silent) = measured(&mut evaluate(&data("parts-beauty.exr"), &mask));
    let (_, f_q, said) = measured(&mut evaluate(&data("parts.exr"), &mask));
    assert_eq!((f_q, silent.as_str()), (beauty, ""));
    assert!(said.contains("parts.exr: of its layers `beauty` is read, not `albedo`"), "{said}");
    assert!(said.contains("--layer NAME chooses another"), "{said}");
    let (_, albedo, said) = measured(evaluate(&data("parts.exr"), &mask).args(["--layer", "albedo"]));
    assert!((albedo - 0.973).abs() < 1e-3 && said.is_empty(), "{albedo} {said}");
    let mut wrong = evaluate(&data("parts.exr"), &mask);
    refused(wrong.args(["--layer", "diffuse"]), &["`diffuse`", "`albedo`, `beauty`"]);
}

#[test]
fn the_layer_that_shows_everything_is_found_whatever_stands_before_it() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("a.exr");
    let rgb: Vec<[f32; 3]> = (0..32 * 24).map(|i| [[0.8, 0.4, 0.2], [0.2; 3]][i % 32 / 16]).collect();
    let other = vec![[0.01; 3]; rgb.len()];
    for [before, whole] in [
        ["albedo_rgb", "main"],
        ["DiffuseFilter", "FinalImage"],
        ["shadow", "sss_all"],
        ["key.specular", "Final"],
        ["world_position", "comp"],
    ] {
        let parts = vec![ExrPart::rgb(before, &other), ExrPart::rgb(whole, &rgb)];
        write_exr(&path, &ExrImage { width: 32, height: 24, parts, lightopt: None }).unwrap();
        let (means, _, said) = measured(&mut evaluate(&path, &data("mask.png")));
        assert!(means.iter().all(|m| *m > 0.4), "{before} {whole}: {means:?}");
        assert!(said.contains(&format!("`{whole}` is read, not `{before}`")), "{said}");
    }
}

#[test]
fn a_picture_in_one_channel_is_grey() {
    // Means of the sRGB-encoded `V` inside and outside of the mask, by OpenEXR's own reader.
    let ([obj, back], _, said) =
        measured(&mut evaluate(&data("blender-bw.exr"), &data("blender-bw-mask.png")));
    assert!((obj - 0.310_895).abs() < 1e-6 && (back - 0.269_259).abs() < 1e-6, "{obj} {back}");
    assert_eq!(said, "");
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("a.exr");
    // Left and right half, and what sRGB makes of them.
    let (linear, encoded) = ([0.8, 0.2], [0.906_332, 0.484_529]);
    let grey: Vec<f32> = (0..32 * 24).map(|i| linear[usize::from(i % 32 >= 16)]).collect();
    let rgb: Vec<[f32; 3]> = grey.iter().map(|&v| [v; 3]).collect();
    let f_q = |part: ExrPart| {
        write_exr(&path, &ExrImage { width: 32, height: 24, parts: vec![part], lightopt: None }).unwrap();
        let (means, f_q, said) = measured(&mut evaluate(&path, &data("mask.png")));
        assert!(means.iter().zip(encoded).all(|(m, e)| (m - e).abs() < 1e-6), "{means:?}");
        assert_eq!(said, "");
        f_q
    };
    let of_rgb = f_q(ExrPart::rgb("picture", &rgb));
    for channel in ["V", "Y"] {
        assert_eq!(f_q(ExrPart::single("picture", channel, grey.clone())), of_rgb, "{channel}");
    }
}

/// The red of Display P3 has .2290 of the luminance of white; clipped to sRGB it would have .2126 of it, and a
/// meanObj of .4984.
#[test]
fn a_profile_counts_and_does_not_clip() {
    let ([obj, back], _, said) = measured(&mut evaluate(&data("display-p3.png"), &data("mask.png")));
    assert!((obj - 0.5158).abs() < 3e-4 && (back - 0.2).abs() < 1e-4, "{obj} {back}");
    assert!(said.is_empty(), "{said}");
}

#[test]
fn the_object_is_where_a_mask_with_transparency_is_opaque() {
    let picture = data("object-picture.png");
    let (_, f_q, _) = measured(&mut evaluate(&picture, &data("object-mask.png")));
    for mask in ["object-cutout.png", "object-white.png"] {
        assert_eq!(measured(&mut evaluate(&picture, &data(mask))).1, f_q, "{mask}");
    }
}

#[test]
fn transparency_marks_the_object_in_every_format() {
    let directory = tempfile::tempdir().unwrap();
    let path = |name: &str| directory.path().join(name);
    let is_object = |i: u32| i % 5 == 1 || i > 30;
    let mask = MaskImage { width: 8, height: 6, object: (0..48).map(is_object).collect() };
    // A dark object on what would be white.
    let cutout: RgbaImage = ImageBuffer::from_fn(8, 6, |x, y| match is_object(8 * y + x) {
        true => Rgba([20, 30, 10, 255]),
        false => Rgba([255, 255, 255, 0]),
    });
    let opaque: RgbaImage = ImageBuffer::from_fn(8, 6, |x, y| match is_object(8 * y + x) {
        true => Rgba([255, 255, 255, 255]),
        false => Rgba([0, 0, 0, 255]),
    });
    for name in ["a.png", "a.webp", "a.tga", "a.tiff"] {
        for picture in [&cutout, &opaque] {
            picture.save(path(name)).unwrap();
            assert_eq!(read_mask(&path(name)).unwrap(), mask, "{name}");
        }
    }
    let grey: GrayAlphaImage = ImageBuffer::from_fn(8, 6, |x, y| {
        let p = cutout.get_pixel(x, y);
        LumaA([p[0], p[3]])
    });
    grey.save(path("grey.png")).unwrap();
    assert_eq!(read_mask(&path("grey.png")).unwrap(), mask);

    let channel = |c: usize, of: &RgbaImage| of.pixels().map(|p| f32::from(p[c]) / 255.0).collect();
    for (picture, premultiplied) in [(&cutout, true), (&opaque, false)] {
        let mut channels: Vec<(String, Vec<f32>)> = ["R", "G", "B", "A"]
            .iter()
            .enumerate()
            .map(|(c, n)| ((*n).to_owned(), channel(c, picture)))
            .collect();
        if premultiplied {
            let alpha = channels[3].1.clone();
            channels.iter_mut().for_each(|(_, s)| s.iter_mut().zip(&alpha).for_each(|(v, a)| *v *= a));
        }
        let parts = vec![ExrPart { name: "rgba".into(), channels }];
        write_exr(&path("a.exr"), &ExrImage { width: 8, height: 6, parts, lightopt: None }).unwrap();
        assert_eq!(read_mask(&path("a.exr")).unwrap(), mask);
    }
}

/// A white floor under a sky, seen from above.
fn write_sky_scene(directory: &Path, sky: &str) {
    fs::copy(data(sky), directory.join("sky.exr")).unwrap();
    fs::write(directory.join("a.mtl"), "newmtl m\nKd 1 1 1\n").unwrap();
    let quad = "mtllib a.mtl\no q\nv -1 0 -1\nv -1 0 1\nv 1 0 1\nv 1 0 -1\nusemtl m\nf 1 2 3 4\n";
    fs::write(directory.join("a.obj"), quad).unwrap();
    let sidecar = "schema = 1\n[camera]\nposition = [0, 3, 0]\nlook_at = [0, 0, 0]\nup = [0, 0, -1]\nvfov = 20\n\
                   size = [16, 16]\n[main_object]\nobjects = [\"*\"]\n[[lights]]\nname = \"env\"\n\
                   type = \"environment\"\nimage = \"sky.exr\"\n";
    fs::write(directory.join("a.toml"), sidecar).unwrap();
}

fn render(directory: &Path, options: &[&str]) -> Command {
    let mut command = program(directory);
    command.args(["render", "--spp", "64", "-o", "out.exr", "a.obj"]).args(options);
    command
}

#[test]
fn a_sky_with_a_bad_pixel_is_refused_by_name_and_a_tiny_negative_is_black() {
    let directory = tempfile::tempdir().unwrap();
    write_sky_scene(directory.path(), "sky-inf.exr");
    let wanted = ["a.toml", "lights.env.image", "sky.exr", "the pixel at column 10, row 4 is inf"];
    refused(&mut render(directory.path(), &[]), &wanted);
    write_sky_scene(directory.path(), "sky-negative.exr");
    let said = "sky.exr: 3 values are negative and read as 0; the least, -0.00001, is at column 10, row 4";
    render(directory.path(), &[]).assert().success().stderr(contains(said));
}

#[test]
fn a_display_encoded_sky_shines_as_it_was_saved() {
    let directory = tempfile::tempdir().unwrap();
    write_sky_scene(directory.path(), "blender-display-encoded.exr");
    render(directory.path(), &["--max-depth", "2"]).assert().success();
    let rgb = read_exr(&directory.path().join("out.exr")).unwrap().beauty().unwrap();
    let mean = rgb.as_flattened().iter().sum::<f32>() / rgb.as_flattened().len() as f32;
    assert!((mean - 0.3).abs() < 1e-3, "{mean}");
}

/// Radiance has multiplied its pixels with all EXPOSURE lines together: 1 is stored, 1/8 is the sky.
#[test]
fn the_exposure_of_a_radiance_sky_is_undone() {
    let directory = tempfile::tempdir().unwrap();
    write_sky_scene(directory.path(), "plain.exr");
    let sidecar = fs::read_to_string(directory.path().join("a.toml")).unwrap();
    fs::write(directory.path().join("a.toml"), sidecar.replace("sky.exr", "sky.hdr")).unwrap();
    for (lines, radiance) in [("", 1.0), ("EXPOSURE=2\n", 0.5), ("EXPOSURE=2\nEXPOSURE= 4.0\n", 0.125)] {
        let mut sky = format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n{lines}\n-Y 2 +X 4\n").into_bytes();
        (0..8).for_each(|_| sky.extend([128, 128, 128, 129]));
        fs::write(directory.path().join("sky.hdr"), sky).unwrap();
        render(directory.path(), &["--max-depth", "2"]).assert().success().stderr(contains("EXPOSURE").not());
        let rgb = read_exr(&directory.path().join("out.exr")).unwrap().beauty().unwrap();
        let mean = rgb.as_flattened().iter().sum::<f32>() / rgb.as_flattened().len() as f32;
        // The floor is white and sees nothing but the sky.
        assert!((mean / radiance - 1.0).abs() < 3e-3, "{lines}: {mean}");
    }
}

#[test]
fn numbers_of_a_texture_that_are_none_are_counted() {
    let directory = tempfile::tempdir().unwrap();
    write_sky_scene(directory.path(), "plain.exr");
    fs::write(directory.path().join("a.mtl"), "newmtl m\nmap_Kd kd.exr\n").unwrap();
    let quad = "mtllib a.mtl\no q\nv -1 0 -1\nv -1 0 1\nv 1 0 1\nv 1 0 -1\nvt 0 0\nvt 1 1\nusemtl m\n\
                f 1/1 2/1 3/2 4/2\n";
    fs::write(directory.path().join("a.obj"), quad).unwrap();
    let mut rgb = vec![[0.5; 3]; 12];
    (rgb[6], rgb[7][1]) = ([f32::NAN; 3], f32::INFINITY);
    let parts = vec![ExrPart::rgb("kd", &rgb)];
    let image = ExrImage { width: 4, height: 3, parts, lightopt: None };
    write_exr(&directory.path().join("kd.exr"), &image).unwrap();
    let said = "kd.exr: 4 numbers are not finite and read as 0; the first, NaN, is at column 2, row 1";
    render(directory.path(), &[]).assert().success().stderr(contains(said));
}

#[test]
fn bad_files_of_a_folder_are_listed_and_left_out() {
    let directory = tempfile::tempdir().unwrap();
    for class in ["high", "low"] {
        fs::create_dir(directory.path().join(class)).unwrap();
        for (file, copy) in [("rgb8.png", "a.png"), ("targa.tga", "b.tga")] {
            fs::copy(data(file), directory.path().join(class).join(copy)).unwrap();
        }
    }
    fs::write(directory.path().join("low/broken.tga"), "no picture").unwrap();
    fs::write(directory.path().join("low/broken.jpg"), "no picture").unwrap();
    fs::copy(data("parts.exr"), directory.path().join("high/p.exr")).unwrap();
    fs::copy(data("parts.exr"), directory.path().join("high/q.exr")).unwrap();
    let learn = |classes: &[&str]| {
        let mut command = program(directory.path());
        command.args(["learn-signature", "-o", "s.toml", "--json"]).args(classes);
        command
    };
    let output =
        learn(&["--class", "high=high", "--class", "low=low"]).assert().success().get_output().clone();
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(said.lines().count(), 3, "{said}");
    assert!(said.contains("low/broken.tga: cannot read it as a picture: the TGA is damaged"), "{said}");
    assert!(
        said.contains("low/broken.jpg: cannot read it as a picture: its content is in no known"),
        "{said}"
    );
    assert!(said.contains("high/p.exr: of its layers") && said.contains("with 1 more of the class"));
    let json: Value = serde_json::from_slice(&output.stdout).unwrap();
    let files = |class: usize| json["classes"][class]["count"].as_u64();
    assert_eq!((files(0), files(1)), (Some(4), Some(2)));

    fs::create_dir(directory.path().join("bad")).unwrap();
    fs::write(directory.path().join("bad/a.png"), "no picture").unwrap();
    refused(&mut learn(&["--class", "bad=bad"]), &["class `bad`: none of its pictures", "bad/a.png"]);
}

#[test]
fn a_radiance_picture_without_rows_is_refused_everywhere() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("empty.hdr");
    for size in ["-Y 0 +X 4", "-Y 4 +X 0", "-Y 0 +X 0"] {
        fs::write(&path, format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n{size}\n")).unwrap();
        let wanted = ["empty.hdr", "the picture has no pixels"];
        refused(&mut evaluate(&path, &data("mask.png")), &wanted);
        refused(&mut evaluate(&data("rgb8.png"), &path), &wanted);
        refused(program(directory.path()).args(["classify", "empty.hdr"]), &wanted);
        let class = ["learn-signature", "--class", "a=.", "-o", "s.toml"];
        refused(program(directory.path()).args(class), &wanted);
        write_sky_scene(directory.path(), "plain.exr");
        refused(program(directory.path()).args(["run", "a.obj", "--target", "empty.hdr"]), &wanted);
        let sidecar = fs::read_to_string(directory.path().join("a.toml")).unwrap();
        fs::write(directory.path().join("a.toml"), sidecar.replace("sky.exr", "empty.hdr")).unwrap();
        refused(&mut render(directory.path(), &[]), &wanted);
        fs::remove_file(directory.path().join("sky.exr")).unwrap();
    }
}

#[test]
fn what_is_no_file_is_refused_without_waiting() {
    let directory = tempfile::tempdir().unwrap();
    refused(&mut evaluate(directory.path(), &data("mask.png")), &["no regular file"]);
    refused(&mut evaluate(Path::new("/dev/zero"), &data("mask.png")), &["/dev/zero", "no regular file"]);
    refused(&mut evaluate(&data("rgb8.png"), Path::new("/dev/zero")), &["/dev/zero", "no regular file"]);
}

#[test]
fn pictures_in_formats_that_are_not_read_are_called_by_their_names() {
    let directory = tempfile::tempdir().unwrap();
    let gif = directory.path().join("a.gif");
    fs::write(&gif, "GIF89a with nothing behind it").unwrap();
    let wanted = ["a.gif", "it is a GIF, which is not read; save it as PNG"];
    refused(&mut evaluate(&gif, &data("mask.png")), &wanted);
    refused(&mut evaluate(&data("rgb8.png"), &gif), &wanted);
    let mut target = program(directory.path());
    target.args(["evaluate", "--target", "a.gif", "--mask"]).args([data("mask.png"), data("rgb8.png")]);
    refused(&mut target, &wanted);
}
