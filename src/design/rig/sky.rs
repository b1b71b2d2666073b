//! Surroundings that the program chooses: which picture of a folder, and how far it is turned.
//!
//! Surroundings add up as lamps do, so that a carrier holds many of them, each at many turns. Those that promise most
//! there, in small pictures of reduced maps, are turned by less and less, and then rendered: f_q of these renders
//! decides.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use super::{
    Order, Rig,
    carrier::{Candidate, Carrier, Commission},
    choose::{Choice, Chooser},
    set::Set,
    unused_name,
};
use crate::{
    audit::placed::Placed,
    design::{
        Job, Reporter, RunError,
        deadline::Deadline,
        render::{Budget, Renderer},
        seeds::{Purpose, seed_for},
    },
    files::csv_file,
    import::radiance_map::{self, MAX_MAP_WIDTH},
    integrator::{View, aov},
    light::{Environment, Light, LightColor, RadianceMap, Shape, Surroundings},
    lighting::{Lighting, SamplingPlan},
    math::{Rgb, hash::hash_words},
    photo::weights::Weights,
    scene::Scene,
    variables::{Constraints, Fitted, LightConstraints},
};

/// Turns of every map that are compared first, so that neighbours are 22.5 degrees apart.
const TURNS: u32 = 16;
/// Steps, in degrees, by which the best are turned to and fro: halves of the angle between neighbours, so that
/// every turn is within 1.4 degrees of one, also when the second best of the first ones was taken for the best.
const STEPS: [f32; 3] = [11.25, 5.625, 2.8125];
/// Samples of a pixel in a carrier at least: with as few as suffice to choose among hundreds of lamps a known
/// turn of 104 degrees was found as 97.5.
const LEAST_SPP: u32 = 64;
/// Width to which maps are reduced while they are compared, texels of .7 degrees: a quarter of the least step.
const COMPARED_WIDTH: usize = 512;
/// Candidates that are lit as well as can be, of those whose price is least.
const LIT: usize = 32;
/// Candidates that go on to be turned and rendered.
const BEST: usize = 10;
/// Least angle between two of these with one map, degrees.
const APART: f32 = 40.0;
/// Samples of a pixel in the renders that decide, all replicates together: an error of f_q of about .01 on the
/// fruit basket, which the run that follows brings down.
const CHECK_SPP: u32 = 32;
/// Replicates of these.
const REPLICATES: u32 = 4;

/// A picture of surroundings.
#[derive(Clone, Debug)]
pub struct SkyFile {
    /// Path of the picture.
    pub path: PathBuf,
    /// The picture, reduced.
    map: Arc<RadianceMap>,
}

impl SkyFile {
    /// Reads a picture to compare it with others, with what is worth a warning.
    ///
    /// # Errors
    /// As [`radiance_map::read`].
    pub fn read(path: &Path) -> Result<(Self, Vec<String>), radiance_map::MapError> {
        let (map, mut warnings) = radiance_map::read(path, COMPARED_WIDTH)?;
        // Reduced it is only here.
        warnings.retain(|warning| !warning.contains(": reduced to "));
        Ok((Self { path: path.to_owned(), map: Arc::new(map) }, warnings))
    }

    /// Name of the file without its folder.
    fn name(&self) -> String {
        self.path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
    }
}

/// A map at a turn.
#[derive(Clone, Debug)]
struct Sky {
    /// Index of its file.
    file: usize,
    /// Angle about the vertical, degrees, anticlockwise as seen from above.
    turn: f32,
    map: Arc<RadianceMap>,
}

impl Candidate for Sky {
    const IS_CLEAR: bool = false;

    fn light(&self, name: String) -> Light {
        light(name, &self.map, self.turn)
    }

    fn of(&self) -> Option<usize> {
        None
    }
}

fn light(name: String, map: &Arc<RadianceMap>, turn: f32) -> Light {
    let (map, rotation) = (Some(map.clone()), turn.to_radians());
    Light {
        name,
        shape: Shape::Environment(Environment { map, rotation, scene: Surroundings::default() }),
        color: Rgb::ONE,
        picture_color: LightColor::Recorded,
        temperature: None,
        radiance: 1.0,
        size: 1.0,
        camera_visible: true,
        occludes: false,
    }
}

/// Surroundings that were chosen: the last light of the scene.
#[derive(Clone, Debug)]
pub struct PlacedSky {
    /// The light, with the radiance with which it was chosen.
    pub light: Light,
    /// Path of its picture.
    path: PathBuf,
    /// Angle about the vertical, degrees.
    turn: f32,
    /// All that were rendered, best first.
    pub ranking: Vec<Ranked>,
}

/// Surroundings with what they give.
#[derive(Clone, Debug)]
pub struct Ranked {
    /// Name of the picture.
    pub name: String,
    /// Angle about the vertical, degrees.
    pub turn: f32,
    /// Factor on its radiance.
    pub radiance: f64,
    /// f_q in the small pictures.
    pub promised: f64,
    /// f_q of a render, and the half width of its 95 % interval with the size of the noise correction.
    pub f_q: [f64; 2],
}

impl PlacedSky {
    /// The surroundings as they are written.
    #[must_use]
    pub fn placed(&self) -> Placed {
        // A path that holds wherever the run directory is.
        let path = self.path.canonicalize().unwrap_or_else(|_| self.path.clone());
        Placed::environment(path.to_string_lossy().into_owned(), f64::from(self.turn))
    }

    /// The surroundings in one line.
    #[must_use]
    pub fn in_words(&self) -> String {
        format!("{}, turned {:.1}\u{b0}", self.path.display(), self.turn)
    }

    /// The ranking as a comma-separated table.
    ///
    /// # Errors
    /// Never but for memory.
    pub fn table(&self) -> Result<Vec<u8>, csv::Error> {
        let header = ["rank", "environment", "rotation", "radiance", "f_q_promised", "f_q", "f_q_error"];
        let row = |(k, r): (usize, &Ranked)| {
            let [f_q, error] = r.f_q;
            let numbers = [r.radiance, r.promised, f_q, error].map(|x| format!("{x:.6}"));
            let [radiance, promised, f_q, error] = numbers;
            [(k + 1).to_string(), r.name.clone(), r.turn.to_string(), radiance, promised, f_q, error]
        };
        let rows = self.ranking.iter().enumerate().map(row);
        csv_file::encode(std::iter::once(header.map(str::to_owned)).chain(rows))
    }
}

/// A candidate with the lighting in which it does best.
#[derive(Clone, Debug)]
struct Lit {
    sky: Sky,
    /// Lighting of the scene's own lights, then of the surroundings.
    lighting: Lighting,
    f_q: f64,
}

impl Lit {
    fn new(choice: &Choice, carrier: &Carrier<Sky>) -> Option<Self> {
        let lighting = carrier.part(&choice.lights).lighting(&choice.u);
        let sky = carrier.lamp(*choice.lights.last()?).clone();
        Some(Self { sky, lighting, f_q: choice.f_q })
    }

    /// Whether another has the same map at nearly the same turn, or neither of both shines.
    fn is_like(&self, other: &Self) -> bool {
        let is_dark = |lit: &Self| lit.lighting.radiance.last() == Some(&0.0);
        if is_dark(self) && is_dark(other) {
            return true;
        }
        let turn = (self.sky.turn - other.sky.turn).rem_euclid(360.0);
        self.sky.file == other.sky.file && turn.min(360.0 - turn) < APART
    }
}

/// Finds surroundings for every look of a run, in the place of those that the scene has; returns them with the scene,
/// which has its other lights.
///
/// # Errors
/// When the picture shows no main object, a render fails, or a map cannot be read any more.
pub(super) fn find(
    scene: Scene,
    order: &Order,
    deadline: Deadline,
    reporter: &impl Reporter,
) -> Result<(Vec<Rig>, Scene), RunError> {
    let Order { options, skies, .. } = *order;
    let camera = scene.camera.resized(options.work_size);
    let (fixed, constraints) = without_surroundings(&scene, order.constraints);
    let scene = scene.with_lights(fixed.clone());
    let authored = Lighting { exposure: order.authored.exposure, ..Lighting::authored(&scene) };
    let view = View { scene: &scene, camera: &camera };
    let ground = Set::new(view, constraints.movement).ok_or(RunError::NoSubject)?.ground();
    let own = Fitted::of_any(view, &authored, &constraints)?;
    own.notes.iter().for_each(|note| reporter.note(note));
    let commission = Commission::of_run(&own, &constraints, options);
    let every = |(file, sky): (usize, &SkyFile)| {
        let map = sky.map.clone();
        let n = if map.is_round() { 1 } else { TURNS };
        let turns = (0..n).map(|k| k as f32 * 360.0 / TURNS as f32);
        turns.map(move |turn| Sky { file, turn, map: map.clone() })
    };
    let all: Vec<Sky> = skies.iter().enumerate().flat_map(every).collect();
    let (carrier, mut scene) = Carrier::render(scene, all, commission.with_spp(LEAST_SPP), reporter)?;
    reporter.stage("choosing surroundings", None);
    let is_over = || reporter.cancelled() || deadline.has_passed(Deadline::PLACING);
    let start = |carrier: &Carrier<Sky>, job: &Job| -> Result<Vec<Lit>, RunError> {
        let objectives = carrier.objectives(&job.target)?;
        let chooser = Chooser { carrier, objectives, cancelled: &is_over };
        let own = chooser.choice((0..carrier.n_own).collect(), &own.lighting);
        let choices = chooser.with_one_more(&own, LIT)?;
        Ok(choices.iter().filter_map(|choice| Lit::new(choice, carrier)).collect())
    };
    let first = options.jobs.iter().map(|job| Ok(distinct(start(&carrier, job)?)));
    let mut looks: Vec<Vec<Lit>> = first.collect::<Result<_, RunError>>()?;
    for (round, step) in STEPS.into_iter().enumerate() {
        if is_over() {
            break;
        }
        let seed = hash_words(&[commission.seed, round as u64 + 1]);
        let carrier;
        (carrier, scene) = Carrier::render(
            scene.with_lights(fixed.clone()),
            around(&looks, step),
            Commission { seed, ..commission }.with_spp(LEAST_SPP),
            reporter,
        )?;
        for (look, job) in looks.iter_mut().zip(&options.jobs) {
            *look = turned(&carrier, look, step, job, &is_over)?;
        }
    }
    let names: Vec<String> = fixed.iter().map(|light| light.name.clone()).collect();
    let name = unused_name("environment", &names);
    let mut rigs = Vec::new();
    for (look, job) in looks.iter().zip(&options.jobs) {
        let checked = Checker { order, deadline, fixed: &fixed, name: &name, job };
        let sky;
        (sky, scene) = checked.best(look, scene, reporter)?;
        rigs.push(Rig { sky: Some(sky), ..Rig::empty(order, ground.clone()) });
    }
    Ok((rigs, scene.with_lights(fixed)))
}

/// The lights of a scene that are no surroundings, and the constraints of these.
fn without_surroundings(scene: &Scene, constraints: &Constraints) -> (Vec<Light>, Constraints) {
    let each = scene.lights.iter().zip(&constraints.lights);
    let stays = each.filter(|(light, _)| !matches!(light.shape, Shape::Environment(_)));
    let (lights, of_lights) = stays.map(|(light, c)| (light.clone(), c.clone())).unzip();
    (lights, Constraints { lights: of_lights, bonds: Vec::new(), ..constraints.clone() })
}

/// The best of some candidates, best first, without those that are like a better one.
fn distinct(candidates: Vec<Lit>) -> Vec<Lit> {
    let mut best: Vec<Lit> = Vec::new();
    for lit in candidates {
        if best.len() < BEST && !best.iter().any(|better| better.is_like(&lit)) {
            best.push(lit);
        }
    }
    best
}

/// A candidate with those turned to and fro by `step`, degrees.
fn neighbours(sky: &Sky, step: f32) -> impl Iterator<Item = Sky> {
    let n = if sky.map.is_round() { 1 } else { 3 };
    let turned = |by: f32| Sky { turn: (sky.turn + by).rem_euclid(360.0), ..sky.clone() };
    [0.0, -step, step].into_iter().take(n).map(turned)
}

/// The candidates of all looks and their neighbours, each once.
fn around(looks: &[Vec<Lit>], step: f32) -> Vec<Sky> {
    let mut all: Vec<Sky> = Vec::new();
    for sky in looks.iter().flatten().flat_map(|lit| neighbours(&lit.sky, step)) {
        if !all.iter().any(|other| is_same(other, &sky)) {
            all.push(sky);
        }
    }
    all
}

fn is_same(a: &Sky, b: &Sky) -> bool {
    a.file == b.file && a.turn == b.turn
}

/// Each candidate of a look exchanged for its best neighbour; best first.
fn turned(
    carrier: &Carrier<Sky>,
    look: &[Lit],
    step: f32,
    job: &Job,
    cancelled: &(impl Fn() -> bool + Sync),
) -> Result<Vec<Lit>, RunError> {
    let objectives = carrier.objectives(&job.target)?;
    let chooser = Chooser { carrier, objectives, cancelled };
    let mut best = Vec::new();
    for lit in look {
        let mut ends = Vec::new();
        for sky in neighbours(&lit.sky, step) {
            let Some(place) = carrier.lamps.iter().position(|other| is_same(other, &sky)) else { continue };
            let lights = (0..carrier.n_own).chain([carrier.n_own + place]).collect();
            let start = chooser.choice(lights, &lit.lighting);
            ends.extend(Lit::new(&chooser.polished(start.lights, &start.u)?, carrier));
        }
        best.extend(ends.into_iter().min_by(|a, b| a.f_q.total_cmp(&b.f_q)));
    }
    best.sort_by(|a, b| a.f_q.total_cmp(&b.f_q));
    Ok(best)
}

/// Renders of the candidates of a look, with their maps as they are.
struct Checker<'a> {
    order: &'a Order<'a>,
    deadline: Deadline,
    /// Lights of the scene that stay.
    fixed: &'a [Light],
    /// Name of the light.
    name: &'a str,
    job: &'a Job,
}

impl Checker<'_> {
    /// The candidate of least f_q, with the ranking of all, and the scene with other lights.
    fn best(
        &self,
        look: &[Lit],
        mut scene: Scene,
        reporter: &impl Reporter,
    ) -> Result<(PlacedSky, Scene), RunError> {
        let mut best: Option<(f64, PlacedSky)> = None;
        let mut ranking = Vec::new();
        for (k, lit) in look.iter().enumerate() {
            let is_over = reporter.cancelled() || self.deadline.has_passed(Deadline::SEARCH);
            if is_over && best.is_some() {
                break;
            }
            reporter.stage(&format!("rendering surroundings {} of {}", k + 1, look.len()), None);
            let file = &self.order.skies[lit.sky.file];
            let (map, _) = radiance_map::read(&file.path, MAX_MAP_WIDTH).map_err(RunError::Surroundings)?;
            let radiance = lit.lighting.radiance.last().copied().unwrap_or(1.0);
            let light = light(self.name.to_owned(), &Arc::new(map), lit.sky.turn);
            let light = Light { radiance: radiance as f32, ..light };
            scene = scene.with_lights(self.fixed.iter().chain([&light]).cloned().collect());
            let f_q = self.measure(&scene, &lit.lighting, reporter)?;
            let (name, turn) = (file.name(), lit.sky.turn);
            ranking.push(Ranked { name, turn, radiance, promised: lit.f_q, f_q });
            if best.as_ref().is_none_or(|(least, _)| f_q[0] < *least) {
                let path = file.path.clone();
                best = Some((f_q[0], PlacedSky { light, path, turn, ranking: Vec::new() }));
            }
        }
        let (_, mut sky) = best.ok_or(RunError::NoPlace)?;
        ranking.sort_by(|a, b| a.f_q[0].total_cmp(&b.f_q[0]));
        for r in &ranking {
            let [f_q, error] = r.f_q;
            reporter.note(&format!(
                "{}: {} turned {:.1}\u{b0}: f_q {f_q:.3} ± {error:.3}",
                self.job.target.name(),
                r.name,
                r.turn
            ));
        }
        sky.ranking = ranking;
        Ok((sky, scene))
    }

    /// f_q of a scene, and its error.
    fn measure(
        &self,
        scene: &Scene,
        lighting: &Lighting,
        reporter: &impl Reporter,
    ) -> Result<[f64; 2], RunError> {
        let options = self.order.options;
        let camera = scene.camera.resized(options.work_size);
        let view = View { scene, camera: &camera };
        let renderer =
            Renderer { integrator: options.integrator, sampler: options.sampler, measure: options.measure };
        let seed = seed_for(options.seed, Purpose::Places);
        let budget = Budget { seed, spp: CHECK_SPP, n_replicates: REPLICATES };
        let plan = SamplingPlan::for_picture(lighting);
        let picture = renderer.render(view, lighting, &plan, budget, reporter)?;
        let [width, height] = options.work_size.to_array().map(|n| n as usize);
        let mask = aov::trace(view, lighting.value as f32).mask;
        let weights = options.weights.as_ref();
        let objective = Weights::objective(weights, &self.job.target, [width, height], &mask)?;
        let estimate = picture.measure(&objective)?.estimate;
        Ok([estimate.evaluation.f_q, estimate.error_bar()])
    }
}

impl PlacedSky {
    /// Constraints on the variables of the light.
    pub(super) fn constraints(&self, order: &Order) -> LightConstraints {
        LightConstraints { free: order.constraints.free.clone(), ..LightConstraints::default() }
    }
}
