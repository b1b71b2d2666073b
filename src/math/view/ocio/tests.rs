//! Views of a small studio's configuration against PyOpenColorIO (`tests/ocio/reference.py`).

use std::path::PathBuf;

use super::*;

/// The folder of the configuration.
fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/ocio")
}

#[cfg(not(feature = "ocio"))]
#[test]
fn without_the_feature_it_is_said_how_to_get_it() {
    let error = OcioView::open("ocio:studio.ocio", &folder()).unwrap_err().to_string();
    assert!(error.starts_with("view `ocio:studio.ocio`: ") && error.contains("--features ocio"), "{error}");
}

#[test]
fn a_configuration_that_is_not_there_is_named_with_the_form() {
    let error = OcioView::open("ocio:none.ocio:sRGB:Film", &folder()).unwrap_err().to_string();
    assert!(error.contains("none.ocio: no such file; the form is ocio:CONFIG"), "{error}");
}

#[cfg(feature = "ocio")]
mod with_the_feature {
    use glam::Vec3;

    use super::*;
    use crate::math::{ViewTransform, hash::hash_words};

    fn open(of_display: &str) -> &'static OcioView {
        OcioView::open(&format!("ocio:studio.ocio{of_display}"), &folder()).unwrap()
    }

    fn fails(name: &str) -> String {
        let error = OcioView::open(name, &folder()).unwrap_err().to_string();
        assert!(error.starts_with(&format!("view `{name}`: ")) && !error.contains('\n'), "{error}");
        error
    }

    #[test]
    fn shown_is_what_pyopencolorio_shows() {
        let mut rows = csv::Reader::from_path(folder().join("reference.csv")).unwrap();
        let mut n = 0;
        for row in rows.records() {
            let row = row.unwrap();
            let view = open(&format!(":{}:{}", &row[0], &row[1]));
            let number = |i: usize| row[i].parse::<f64>().unwrap();
            let rgb = [2, 3, 4].map(number);
            let wanted = DVec3::from_array([5, 6, 7].map(number)).clamp(DVec3::ZERO, DVec3::ONE);
            let off = (view.codes(DVec3::from_array(rgb)) - wanted).abs().max_element();
            assert!(255.0 * off < 0.001, "{view:?} {rgb:?}: {off}");
            let written = ViewTransform::Ocio(view).encode(rgb.map(|v| v as f32 / 2.0), 2.0);
            assert!((DVec3::from_array(written) - wanted).abs().max_element() < 1e-5, "{view:?} {rgb:?}");
            n += 1;
        }
        assert_eq!(n, 4 * 19);
    }

    /// Derivatives by another step, with which a table of 65 values has other kinks; in the plain view each
    /// channel is its own light up to white.
    #[test]
    fn derivatives_are_those_of_the_view() {
        let value = |words: &[u64]| (11.0 * (hash_words(words) as f64 / 2_f64.powi(64)) - 8.0).exp2();
        for name in [":sRGB:Film", ":sRGB:Plain", ":sRGB:Film: warm"] {
            let view = open(name);
            let (mut sum, mut n) = (0.0, 0.0);
            for i in 0..400 {
                let rgb = DVec3::new(value(&[i, 0]), value(&[i, 1]), value(&[i, 2]));
                let (shown, slopes) = view.display(rgb);
                assert_eq!(shown, ViewTransform::Ocio(view).shown(rgb));
                for c in 0..3 {
                    let h = 0.01 * rgb[c];
                    let step = h * DVec3::AXES[c];
                    let [more, less] = [rgb + step, rgb - step].map(|c| ViewTransform::Ocio(view).shown(c));
                    let off = ((more - less) / (2.0 * h) - slopes.col(c)).abs() * rgb[c];
                    sum += off.element_sum();
                    n += 3.0;
                    if name == ":sRGB:Plain" && (rgb - 0.98).abs().min_element() > 0.05 {
                        let exact = if rgb[c] < 0.98 { DVec3::AXES[c] } else { DVec3::ZERO };
                        let off = (slopes.col(c) - exact).abs() * rgb[c];
                        assert!(off.max_element() < 4e-3 * rgb[c].max(0.1), "{rgb} {c} {slopes}");
                    }
                }
            }
            // Where the plain view clips, differences by unequal steps differ; there the exact slopes are known.
            assert!(name == ":sRGB:Plain" || sum / n < 2e-4, "{name}: {}", sum / n);
        }
    }

    /// On the edge of what has light, steps go inwards.
    #[test]
    fn black_and_one_channel_have_derivatives() {
        for rgb in [DVec3::ZERO, DVec3::X, DVec3::new(0.0, 1e-6, 40.0)] {
            let (shown, slopes) = open(":sRGB:Film: warm").display(rgb);
            assert!(shown.is_finite() && slopes.is_finite(), "{rgb}: {shown} {slopes}");
            assert!((0..3).all(|c| slopes.col(c)[c] >= 0.0), "{rgb}: {slopes}");
        }
        let nothing = ViewTransform::Ocio(open("")).encode([f32::NAN; 3], 1.0);
        assert_eq!(nothing, ViewTransform::Ocio(open("")).encode([0.0; 3], 1.0));
    }

    #[test]
    fn names_are_whole_and_come_back() {
        let view = open("");
        assert_eq!(view.view(), "Film");
        assert!(Path::new(&view.name()[PREFIX.len()..]).is_absolute());
        assert!(view.name().ends_with("studio.ocio:sRGB:Film"), "{view:?}");
        assert!(std::ptr::eq(view, open(":sRGB:Film")));
        // A view whose name has a colon.
        let warm = ViewTransform::Ocio(open(":sRGB:Film: warm"));
        assert_ne!(warm, ViewTransform::Ocio(view));
        let text = serde_json::to_string(&warm).unwrap();
        assert_eq!(serde_json::from_str::<ViewTransform>(&text).unwrap(), warm);
        assert!(view.notes().is_empty());
        let [note] = open(":Projector:Film").notes() else { panic!("a note") };
        assert!(note.contains("of the display `Projector` are measured"), "{note}");
    }

    #[test]
    fn what_is_wrong_is_said_in_a_line() {
        let error = fails("ocio:studio.ocio:sRGB:Fil");
        assert!(
            error.contains("`Fil` is no view of that display; it has Film, Plain, Film: warm"),
            "{error}"
        );
        let error = fails("ocio:studio.ocio:Monitor:Film");
        assert!(error.contains("`Monitor` is no display of the configuration; it has sRGB, Pro"), "{error}");
        assert!(fails("ocio:studio.ocio:Television:Plain").contains("high dynamic range"));
        let error = fails("ocio:reference.csv");
        assert!(error.contains("reference.csv"), "{error}");
        assert!(fails("ocio:ocio://none").contains("built-in"));
    }

    /// Configurations without names for what light is: by their interchange role, or by the role of rendering.
    #[test]
    fn linear_light_is_found_in_what_the_configuration_says() {
        let directory = tempfile::tempdir().unwrap();
        let text = std::fs::read_to_string(folder().join("studio.ocio")).unwrap();
        let luts = folder().join("luts").display().to_string();
        let text = text.replace("search_path: luts", &format!("search_path: {luts}"));
        let grey = Vec3::splat(0.18).as_dvec3();
        let red = DVec3::new(0.5, 0.0, 0.0);
        let shown = |text: &str, name: &str| {
            std::fs::write(directory.path().join(name), text).unwrap();
            let view = OcioView::open(&format!("ocio:{name}:sRGB:Plain"), directory.path()).unwrap();
            (view.codes(grey), view.codes(red), view.notes().len())
        };
        let (of_grey, of_red, notes) = shown(&text, "a.ocio");
        assert!(notes == 0 && of_red.y < 0.01, "{of_red}");
        // Its scene-linear light is taken for Rec.709, which changes colours and not greys.
        let bare = text.replace("  aces_interchange: Archive\n", "");
        let (of_grey_too, of_red, notes) = shown(&bare, "b.ocio");
        assert!((of_grey - of_grey_too).abs().max_element() < 1e-4 && notes == 1);
        assert!(of_red.x > 0.8, "{of_red}");
        // A space by one of the usual names.
        let named = bare.replace("    name: Archive\n", "    name: Archive\n    aliases: [lin_srgb]\n");
        assert_eq!(shown(&named, "c.ocio").2, 0);
    }

    #[test]
    fn tables_are_near_the_view() {
        let tables = open(":sRGB:Film").tables();
        assert_eq!((tables.side.pow(3), tables.curve.len()), (tables.values.len(), 4097));
        let [grey, below, stops] = tables.scale;
        let linear = |i: usize| grey * (stops * i as f64 / (tables.side - 1) as f64 - below).exp2();
        let at = [20, 21, 22];
        let value = tables.values[at[0] + tables.side * (at[1] + tables.side * at[2])];
        let codes = open(":sRGB:Film").codes(DVec3::from_array(at.map(linear)));
        assert!((DVec3::from_array(value.map(f64::from)) - codes).abs().max_element() < 1e-6);
    }
}
