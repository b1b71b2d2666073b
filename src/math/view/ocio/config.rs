//! Configurations, read by the crate `ocio`.

use std::path::Path;

use ocio::{
    Config, CpuProcessor, DisplayViewTransform, LoggingLevel, TransformDirection,
    config::logging::set_logging_level,
};

use super::{OcioError, OcioView, PREFIX};

/// Names under which configurations have linear light with the primaries of Rec.709: those of the
/// configurations for ACES, of Blender's, and of older ones.
const LINEAR_REC709: [&str; 8] = [
    "lin_rec709_scene",
    "Linear Rec.709 (sRGB)",
    "lin_rec709",
    "lin_rec709_srgb",
    "Linear Rec.709",
    "Utility - Linear - Rec.709",
    "Utility - Linear - sRGB",
    "lin_srgb",
];
/// The role of the light in which a configuration's users render.
const SCENE_LINEAR: &str = "scene_linear";
/// The role by which configurations tell what their colours are.
const INTERCHANGE: &str = "aces_interchange";
/// Encodings of displays whose code values are no light of an sRGB display.
const HIGH_DYNAMIC_RANGE: &str = "hdr-video";

/// From linear Rec.709 to the code values of a display, in one or two parts.
pub(super) struct Transform(Vec<CpuProcessor>);

impl Transform {
    /// Transforms colours in their place.
    pub fn apply(&self, pixels: &mut [[f32; 4]]) {
        self.0.iter().for_each(|part| part.apply_pixels(pixels));
    }
}

impl OcioView {
    /// A view of the configuration at `path`; `of_display` is `DISPLAY:VIEW`.
    pub(super) fn load(name: &str, path: &Path, of_display: Option<&str>) -> Result<Self, OcioError> {
        // What is wrong is an error, and what is merely odd in a studio's configuration is the studio's matter.
        set_logging_level(LoggingLevel::None);
        let failed = |error: &dyn std::fmt::Display| {
            let message = error.to_string().split_whitespace().collect::<Vec<_>>().join(" ");
            OcioError::Config { name: name.to_owned(), message }
        };
        let path = path.to_string_lossy();
        let config = Config::create_from_file(&path).map_err(|e| failed(&e))?;
        let [display, view] = chosen(name, &config, of_display)?;
        let mut notes = Vec::new();

        let display_space = config.display_view_color_space_name(&display, &view);
        let of_display = [display_space, display.as_str()];
        let encodings =
            of_display.map(|space| config.get_color_space(space).map(|s| s.encoding().to_owned()));
        if encodings.iter().flatten().any(|encoding| encoding == HIGH_DYNAMIC_RANGE) {
            let message =
                format!("the display `{display}` has a high dynamic range; pictures here are for sRGB");
            return Err(failed(&message));
        }
        if !display.to_lowercase().contains("srgb") {
            notes.push(format!(
                "view {view}: the code values of the display `{display}` are measured and written as those of an sRGB \
                 display"
            ));
        }

        let known = LINEAR_REC709.into_iter().find(|space| config.has_color_space(space));
        let mut parts = Vec::new();
        if known.is_none() {
            let to_scene_linear = config.has_role(INTERCHANGE).then(|| {
                Config::get_processor_from_builtin_color_space(LINEAR_REC709[0], &config, SCENE_LINEAR)
            });
            match to_scene_linear {
                Some(processor) => parts.push(processor.map_err(|e| failed(&e))?.default_cpu_processor()),
                None => notes.push(format!(
                    "view {view}: the configuration names no linear Rec.709; its role {SCENE_LINEAR} is taken for it"
                )),
            }
        }
        let src = known.unwrap_or(SCENE_LINEAR).to_owned();
        let transform =
            DisplayViewTransform { src, display: display.clone(), view: view.clone(), ..Default::default() };
        let processor = config
            .get_processor_for_transform(&transform.into(), TransformDirection::Forward)
            .map_err(|e| failed(&e))?;
        parts.push(processor.default_cpu_processor());
        let name = format!("{PREFIX}{path}:{display}:{view}");
        Ok(Self { name, view, notes, transform: Transform(parts) })
    }
}

/// Display and view of a configuration.
fn chosen(name: &str, config: &Config, of_display: Option<&str>) -> Result<[String; 2], OcioError> {
    let unknown = |given: &str, what, allowed: Vec<String>| OcioError::Unknown {
        name: name.to_owned(),
        given: given.to_owned(),
        what,
        allowed: if allowed.is_empty() { "none".into() } else { allowed.join(", ") },
    };
    // Those that are not active can be named, too.
    let displays: Vec<String> =
        (0..config.num_displays_all()).map(|i| config.display_all(i).to_owned()).collect();
    let Some(of_display) = of_display else {
        let display = config.default_display();
        let view = config.default_view(&display);
        if display.is_empty() || view.is_empty() {
            return Err(unknown("", "display and view", displays));
        }
        return Ok([display, view]);
    };
    // Names may have colons.
    let fits = |display: &&String| {
        of_display.strip_prefix(display.as_str()).is_some_and(|rest| rest.is_empty() || rest.starts_with(':'))
    };
    let Some(display) = displays.iter().filter(fits).max_by_key(|display| display.len()) else {
        let given = of_display.split(':').next().unwrap_or_default();
        return Err(unknown(given, "display of the configuration", displays));
    };
    let views: Vec<String> = (0..config.num_views(display)).map(|i| config.view(display, i)).collect();
    let given = of_display[display.len()..].trim_start_matches(':');
    if !config.has_view(display, given) {
        return Err(unknown(given, "view of that display", views));
    }
    Ok([display.clone(), given.to_owned()])
}
