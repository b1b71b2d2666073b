//! `where`: a map of where a lamp would help.

use std::path::PathBuf;

use anyhow::bail;
use clap::Args;
use glam::{UVec2, Vec3};
use image::{Rgb, RgbImage};

use super::{
    common::{
        CameraArgs, ConfinementArgs, MatchArgs, TransportArgs, ViewArgs, load_lit_scene, parse_size, say_look,
    },
    output::print,
    progress::Console,
};
use crate::{
    audit::write_whole,
    design::{
        Reporter,
        render::Renderer,
        rig::{self, Map, Place, Spot, Survey},
    },
    figures::canvas::{Anchor, Canvas, INK, text},
    files::{atomic::probe, csv_file},
    film::exr::{ExrImage, ExrPart, write_exr},
    math::{Measure, display::LuminanceMode},
    photo::Look,
};

/// Show where one lamp more would help
///
/// Draws the directions around the subject, from above and unrolled: blue where a lamp would
/// lower f_q, the deeper the more; red where its light only raises it; grey where none may
/// stand. What one lamp would do is measured at several radiances of it, with all other
/// lights as they are.
///
/// A file that ends in .csv has a line for each place; one that ends in .exr has the unrolled
/// map in numbers.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    lightopt-embree where --target low-key -o where.png fruit_basket.obj\n  \
    lightopt-embree where --lights runs/dark/lights.toml -o where.csv fruit_basket.obj")]
pub struct MapArgs {
    /// Scene: Wavefront OBJ or glTF, with its sidecar
    #[arg(value_name = "SCENE")]
    pub scene: PathBuf,

    /// Where the scene's files may lie.
    #[command(flatten)]
    pub confinement: ConfinementArgs,

    /// The look: high-key, low-key, a target file, a photograph, or LIBRARY.toml#CLASS
    #[arg(long, value_name = "NAME|FILE", default_value = "high-key")]
    pub target: String,

    /// What of a photograph is matched.
    #[command(flatten)]
    pub matched: MatchArgs,

    /// Present lighting, as `run` writes it [default: the scene's own]
    #[arg(long, value_name = "FILE")]
    pub lights: Option<PathBuf>,

    /// File to write: .png, .csv or .exr
    #[arg(short, long, value_name = "FILE", default_value = "where.png")]
    pub output: PathBuf,

    /// Size of the working pictures, of which half is measured
    #[arg(long, value_name = "WxH", value_parser = parse_size, default_value = "128x96")]
    pub work_size: UVec2,

    /// View through which the pictures are seen.
    #[command(flatten)]
    pub view: ViewArgs,

    /// Camera of the scene file.
    #[command(flatten)]
    pub camera: CameraArgs,

    /// Light transport.
    #[command(flatten)]
    pub transport: TransportArgs,
}

/// Upper bound of the memory, bytes: that of `run`.
const MEMORY: u64 = 2 << 30;
/// Columns and rows of the unrolled map in numbers: two degrees a pixel, from the zenith to the nadir.
const GRID: (usize, usize) = (180, 90);
/// Angle from a place within which a direction is shown as it, degrees: that between neighbouring places.
const NEAR: f32 = 11.0;
/// Width and height of the drawing, pixels: both maps with their margins and titles.
const DRAWING: (u32, u32) = (920, 380);
/// Side of the map from above, pixels.
const ABOVE: u32 = 300;
/// Width and height of the unrolled map, pixels: 1.6 to a degree.
const UNROLLED: (u32, u32) = (560, 280);

/// Runs the subcommand.
///
/// # Errors
/// When the scene, the lighting or the look is wrong, or nothing can be rendered or written.
pub fn map(args: &MapArgs) -> anyhow::Result<()> {
    let look = Look::resolve(&args.target, None)?;
    say_look(&look);
    let ending = args.output.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    if !["png", "csv", "exr"].contains(&ending.as_str()) {
        bail!("{}: the map must end in .png, .csv or .exr", args.output.display());
    }
    probe(&args.output)?;
    let console = Console::new();
    let map = args.transport.in_pool(|| {
        let (options, given) = (args.camera.options(args.confinement), (args.lights.as_deref(), None));
        let (loaded, lighting, view) = load_lit_scene(&args.scene, options, given, |w| console.note(w))?;
        let luminance = LuminanceMode::Srgb;
        let view = args.view.of_scene(view, &loaded, |w| console.note(w));
        let target =
            look.into_target(luminance, args.work_size.max_element() as usize, args.matched.get())?;
        let measure = Measure { view, luminance, color: target.needs_color() };
        let (integrator, sampler) = (args.transport.integrator(), args.transport.sampler);
        let renderer = Renderer { integrator, sampler, measure };
        let survey = Survey {
            target: &target,
            lighting: &lighting,
            constraints: &loaded.constraints,
            renderer,
            work_size: args.work_size,
            memory: MEMORY,
            seed: args.transport.seed,
        };
        Ok(rig::map(loaded.scene, survey, &console)?)
    });
    console.finish();
    let map = map?;
    match ending.as_str() {
        "csv" => write_whole(&args.output, table(&map)?)?,
        "exr" => write_exr(&args.output, &numbers(&map))?,
        _ => write_whole(&args.output, drawing(&map, &args.target)?)?,
    }
    let best = map.spots.iter().min_by(|a, b| a.f_q.total_cmp(&b.f_q));
    let best = best.map_or_else(String::new, |s| {
        format!(
            "; {:.4} with a lamp at azimuth {:.0}, elevation {:.0} degrees, {:.2} m away",
            s.f_q, s.place.azimuth, s.place.elevation, s.place.distance
        )
    });
    print(&format!("f_q {:.4} now{best}\n{}\n", map.f_q, args.output.display()))
}

/// The CSV: a header, then a line for each place.
fn table(map: &Map) -> Result<Vec<u8>, csv::Error> {
    let header = ["azimuth", "elevation", "distance", "beam", "radiance", "f_q", "change"].map(String::from);
    let line = |s: &Spot| {
        let beam = s.lamp.beam.map_or_else(String::new, |beam| (2.0 * beam.angle).to_string());
        let place = [s.place.azimuth, s.place.elevation, s.place.distance].map(|v| v.to_string());
        let [azimuth, elevation, distance] = place;
        let [radiance, f_q, change] = [s.radiance, s.f_q, s.change].map(|v| v.to_string());
        [azimuth, elevation, distance, beam, radiance, f_q, change]
    };
    csv_file::encode(std::iter::once(header).chain(map.spots.iter().map(line)))
}

/// The unrolled map in numbers: f_q with the best lamp in each direction, from the zenith down and from behind
/// over the left, the camera and the right; not a number where none may stand.
fn numbers(map: &Map) -> ExrImage {
    let (width, height) = GRID;
    let at = |i: usize| {
        let azimuth = ((i % width) as f32 + 0.5) / width as f32 * 360.0 - 180.0;
        let elevation = 90.0 - ((i / width) as f32 + 0.5) / height as f32 * 180.0;
        best_near(map, direction(azimuth, elevation)).map_or(f32::NAN, |spot| spot.f_q as f32)
    };
    let values: Vec<f32> = (0..width * height).map(at).collect();
    ExrImage { width, height, parts: vec![ExrPart::single("f_q", "Y", values)], lightopt: None }
}

/// Unit vector at two angles, degrees: +z toward the camera, +x to the right in the picture, +y up.
fn direction(azimuth: f32, elevation: f32) -> Vec3 {
    rig::direction([azimuth, elevation], Vec3::X, Vec3::Z)
}

/// The lamp near a direction with which f_q is least.
fn best_near(map: &Map, dir: Vec3) -> Option<&Spot> {
    let cos = NEAR.to_radians().cos();
    let near = |s: &&Spot| direction(s.place.azimuth, s.place.elevation).dot(dir) > cos;
    map.spots.iter().filter(near).min_by(|a, b| a.f_q.total_cmp(&b.f_q))
}

/// The PNG: from above, and unrolled.
fn drawing(map: &Map, target: &str) -> anyhow::Result<Vec<u8>> {
    let title = format!("f_q of {target}: {:.3} now; blue where a lamp would lower it", map.f_q);
    let mut canvas = Canvas::drawn(DRAWING, |area| {
        text(area, &title, (16, 18), 15, INK, Anchor::Left)?;
        text(area, "from above; the camera is below", (16, 44), 12, INK, Anchor::Left)?;
        let words = "unrolled: behind, left, camera, right, behind; zenith above";
        text(area, words, (340, 44), 12, INK, Anchor::Left)
    })?;
    let colours = Colours::of(map);
    let above = RgbImage::from_fn(ABOVE, ABOVE, |x, y| {
        let [right, down] = [x, y].map(|v| 2.0 * (v as f32 + 0.5) / ABOVE as f32 - 1.0);
        let r = (right * right + down * down).sqrt();
        if r > 1.0 {
            Rgb([255; 3])
        } else {
            colours.at(direction(right.atan2(down).to_degrees(), 90.0 - 100.0 * r))
        }
    });
    let unrolled = RgbImage::from_fn(UNROLLED.0, UNROLLED.1, |x, y| {
        let azimuth = (x as f32 + 0.5) / UNROLLED.0 as f32 * 360.0 - 180.0;
        colours.at(direction(azimuth, 90.0 - (y as f32 + 0.5) / UNROLLED.1 as f32 * 180.0))
    });
    canvas.paste(&above, 16, 60);
    canvas.paste(&unrolled, 340, 60);
    Ok(canvas.png()?)
}

/// Colours of a map: how much f_q may fall or rise at most by a lamp.
struct Colours<'a> {
    map: &'a Map,
    gain: f64,
    harm: f64,
}

impl<'a> Colours<'a> {
    fn of(map: &'a Map) -> Self {
        let most = |f: &dyn Fn(&Spot) -> f64| map.spots.iter().map(f).fold(1e-9, f64::max);
        Self { map, gain: most(&|s| map.f_q - s.f_q), harm: most(&|s| s.change) }
    }

    /// Colour of a direction: black where a light stands.
    fn at(&self, dir: Vec3) -> Rgb<u8> {
        let stands =
            |(_, place): &(String, Place)| direction(place.azimuth, place.elevation).dot(dir) > 0.9985;
        if self.map.lights.iter().any(stands) {
            return Rgb([0; 3]);
        }
        let Some(spot) = best_near(self.map, dir) else { return Rgb([225; 3]) };
        let fade = |amount: f64| (255.0 * (1.0 - amount.clamp(0.0, 1.0))) as u8;
        let gain = (self.map.f_q - spot.f_q) / self.gain;
        if gain > 0.01 {
            return Rgb([fade(gain), fade(0.7 * gain), 255]);
        }
        let harm = spot.change / self.harm;
        Rgb([255, fade(harm), fade(harm)])
    }
}
