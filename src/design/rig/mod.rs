//! Rigs: lamps that the program places.
//!
//! Lamps do not block light, so that *where* a lamp stands is one more thing that a transport basis keeps apart:
//! a carrier holds the pictures of hundreds of lamps, and a rig is chosen among them. Its
//! lamps are then lights of the scene like any other, and the ordinary search finds their radiances and sizes.
//!
//! | file | what |
//! | --- | --- |
//! | `set` | subject, floor, backdrop and camera: where a lamp may stand |
//! | `places` | the lamps among which a rig is chosen |
//! | `carrier` | their pictures, rendered together |
//! | `choose` | which of them, and how bright |
//! | `describe`, `plan` | what a photographer would say of them, and draw |
//! | `map`, `chart` | where a lamp would help, and its drawing |
//! | `sky` | pictures of surroundings, and how far they are turned |
//! | `run` | a whole run whose lamps or surroundings the program chooses |

mod carrier;
pub mod chart;
mod choose;
mod describe;
mod lamp;
mod map;
pub mod places;
mod plan;
mod run;
mod set;
mod sky;

use std::path::Path;

use glam::Vec3;

use self::{
    carrier::{Carrier, Commission},
    chart::Chart,
    choose::{Choice, Chooser},
    plan::Plan,
};
use super::{Job, Reporter, RunError, deadline::Deadline};
use crate::{
    audit::{
        MAPS, PLAN,
        lights::LightsFile,
        placed::{Description, Role},
        write_whole,
    },
    film::exr::write_exr,
    integrator::View,
    light::Light,
    lighting::{Lighting, MAX_RADIANCE},
    math::hash::hash_words,
    scene::Scene,
    variables::{Constraints, Fitted, FreeKinds, LightConstraints, bounds},
};

pub use describe::in_words;
pub use lamp::{Beam, Lamp};
pub use map::{Map, Spot, Survey, map};
pub use run::{Order, run};
pub use set::{Ground, Place, Set, direction};
pub use sky::{PlacedSky, SkyFile};

/// Steps of the rounds in which the lamps that were chosen are moved by a little, degrees. The first is that of
/// the cells; set by reasoning.
const STEPS: [f32; 2] = [10.0, 4.0];
/// Sizes between which a lamp may vary, while it stays where it may stand.
const SIZES: [f32; 2] = [0.25, 4.0];
/// Largest radiance over that with which a lamp was chosen: the inverse square of its least size.
const HEADROOM: f64 = 16.0;
/// Halvings of the range of the largest size.
const HALVINGS: u32 = 6;

/// Lamps of a scene that the program placed: its last lights.
#[derive(Clone, Debug)]
pub struct Rig {
    /// The lamps with their names and roles, in the order of the lights.
    pub lamps: Vec<PlacedLamp>,
    /// Surroundings that were chosen in the place of lamps.
    pub sky: Option<PlacedSky>,
    /// Lamps at most that were asked for.
    pub most: usize,
    /// Whether the lights of the scene's files were left out.
    pub without_lights: bool,
    /// The set on which they stand.
    pub ground: Ground,
    /// Where a lamp more would help: at the start, and with the lamps that were chosen.
    pub maps: Vec<Map>,
}

/// A lamp that the program placed.
#[derive(Clone, Debug)]
pub struct PlacedLamp {
    /// Name of its light.
    pub name: String,
    /// What it is for.
    pub role: Role,
    /// The lamp, at size 1.
    pub lamp: Lamp,
    /// Place of the lamp, seen from the subject.
    pub place: Place,
    /// Height of its middle above the floor, metres.
    pub height: f32,
    /// Place where a light of the scene stood that was moved.
    pub moved_from: Option<Vec3>,
    /// Radiance with which it was chosen, W·m⁻²·sr⁻¹.
    pub radiance: f64,
    /// Size with which it was chosen.
    pub size: f32,
    /// Constraints on its variables, with the sizes that it may have where it stands.
    pub constraints: LightConstraints,
}

/// Finds a rig for every look of a run; returns them with the scene, which has those of its own lights that stay
/// where they are.
///
/// # Errors
/// When there is no room for a lamp, or a render fails.
fn find(
    scene: Scene,
    order: &Order,
    deadline: Deadline,
    reporter: &impl Reporter,
) -> Result<(Vec<Rig>, Scene), RunError> {
    let Order { constraints, options, .. } = *order;
    let camera = scene.camera.resized(options.work_size);
    let set = Set::new(View { scene: &scene, camera: &camera }, constraints.movement);
    let (company, mut lamps) = {
        let set = set.ok_or(RunError::NoSubject)?;
        let company = Company::new(&set, &scene, order);
        let mut lamps: Vec<Lamp> = company.movable.iter().map(|own| own.lamp).collect();
        lamps.extend(company.movable.iter().flat_map(|own| places::moved(&set, &own.lamp)));
        if order.most > 0 {
            lamps.extend(places::all(&set));
        } else if lamps.is_empty() {
            reporter.note("none of the lights may be moved: all stay where they are");
            let rig = Rig::empty(order, set.ground());
            return Ok((vec![rig; options.jobs.len()], scene));
        }
        (company, lamps)
    };
    lamps.extend(&company.staged);
    if lamps.is_empty() {
        return Err(RunError::NoPlace);
    }
    let scene = scene.with_lights(company.fixed.clone());
    let authored = Lighting { exposure: order.authored.exposure, ..Lighting::authored(&scene) };
    let own = Fitted::of_any(View { scene: &scene, camera: &camera }, &authored, &company.constraints)?;
    own.notes.iter().for_each(|note| reporter.note(note));
    let commission = Commission::of_run(&own, &company.constraints, options);
    let start = Lit::of_own(&company, &own.lighting);
    let (carrier, mut scene) = Carrier::render(scene, lamps, commission, reporter)?;
    reporter.stage("choosing lamps", None);
    let is_over = || reporter.cancelled() || deadline.has_passed(Deadline::PLACING);
    let staged = Lit::of_staged(&company, &own.lighting, order);
    let mut looks = choose(&carrier, [&start, &staged], order, &is_over, reporter)?;
    let everywhere = carrier;
    let mut last = None;
    for (round, step) in STEPS.into_iter().enumerate() {
        scene = scene.with_lights(company.fixed.clone());
        let view = View { scene: &scene, camera: &camera };
        let lamps = around(&Set::new(view, constraints.movement).ok_or(RunError::NoSubject)?, &looks, step);
        if lamps.is_empty() || is_over() {
            break;
        }
        let seed = hash_words(&[commission.seed, round as u64 + 1]);
        let carrier;
        (carrier, scene) = Carrier::render(scene, lamps, Commission { seed, ..commission }, reporter)?;
        looks = slide(&carrier, &looks, order, &is_over, reporter)?;
        last = Some(carrier);
    }
    let scene = scene.with_lights(company.fixed.clone());
    let view = View { scene: &scene, camera: &camera };
    let set = Set::new(view, constraints.movement).ok_or(RunError::NoSubject)?;
    let last = last.as_ref().unwrap_or(&everywhere);
    let rig = |(lit, job): (&Lit, &Job)| {
        let maps = maps(&everywhere, &start, last, lit, job, (&company, &set))?;
        Ok(Rig { maps, ..rig(lit, &company, &set, view, order) })
    };
    let rigs = looks.iter().zip(&order.options.jobs).map(rig).collect::<Result<_, RunError>>()?;
    Ok((rigs, scene))
}

/// The scene's own lights.
struct Company {
    /// Lights that stay where they are.
    fixed: Vec<Light>,
    /// Constraints of these, and of the scene.
    constraints: Constraints,
    /// Lights that may be moved.
    movable: Vec<Movable>,
    /// Lights that were staged, as lamps at their sizes; none where one may not stand where it does.
    staged: Vec<Lamp>,
}

/// A light of the scene that may be moved.
struct Movable {
    light: Light,
    /// The lamp that it is now, at its own size.
    lamp: Lamp,
    constraints: LightConstraints,
}

impl Company {
    fn new(set: &Set, scene: &Scene, order: &Order) -> Self {
        let mut company = Self {
            fixed: Vec::new(),
            constraints: Constraints { lights: Vec::new(), ..order.constraints.clone() },
            movable: Vec::new(),
            staged: Vec::new(),
        };
        let staged = order.staged.iter().map(|light| Some(places::of_light(set, light)?.scaled(light.size)));
        let staged = staged.collect::<Option<Vec<Lamp>>>().unwrap_or_default();
        if staged.iter().all(|lamp| set.allows(lamp)) {
            company.staged = staged;
        }
        for (light, constraints) in scene.lights.iter().zip(&order.constraints.lights) {
            let may_move = order.moves && constraints.free.contains("radiance") && !constraints.stays;
            match places::of_light(set, light).filter(|_| may_move) {
                Some(lamp) => {
                    let lamp = Lamp { of: Some(company.movable.len()), ..lamp.scaled(light.size) };
                    let (light, constraints) = (light.clone(), constraints.clone());
                    company.movable.push(Movable { light, lamp, constraints });
                }
                None => {
                    company.fixed.push(light.clone());
                    company.constraints.lights.push(constraints.clone());
                }
            }
        }
        company
    }
}

/// Lamps with the lighting in which they were chosen.
struct Lit {
    lamps: Vec<Lamp>,
    /// Lighting of the fixed lights, then of the lamps.
    lighting: Lighting,
    /// Mean luminance that each brings to the object and to the background.
    means: Vec<[f64; 2]>,
}

impl Lit {
    /// The scene's own lights as they are.
    fn of_own(company: &Company, fixed: &Lighting) -> Self {
        let mut lighting = fixed.clone();
        lighting.radiance.extend(company.movable.iter().map(|own| f64::from(own.light.radiance)));
        lighting.size.extend(company.movable.iter().map(|_| 1.0));
        let lamps = company.movable.iter().map(|own| own.lamp).collect();
        Self { lamps, means: vec![[0.0; 2]; lighting.n_lights()], lighting }
    }

    /// The lights that were staged, as they are.
    fn of_staged(company: &Company, fixed: &Lighting, order: &Order) -> Self {
        let mut lighting = fixed.clone();
        lighting.radiance.extend(order.staged.iter().map(|light| f64::from(light.radiance)));
        lighting.size.extend(order.staged.iter().map(|_| 1.0));
        Self { lamps: company.staged.clone(), means: vec![[0.0; 2]; lighting.n_lights()], lighting }
    }

    /// A choice among the lamps of a carrier.
    fn new(choice: &Choice, carrier: &Carrier) -> Self {
        let lighting = carrier.part(&choice.lights).lighting(&choice.u);
        let lamps = choice.lights[carrier.n_own..].iter().map(|&light| *carrier.lamp(light)).collect();
        Self { lamps, means: carrier.means(&choice.lights, &lighting.radiance), lighting }
    }

    /// The choice in a carrier that has these lamps among its own.
    fn choice<C: Fn() -> bool + Sync>(&self, chooser: &Chooser<Lamp, C>) -> Choice {
        let carrier = chooser.carrier;
        let place = |lamp: &Lamp| carrier.lamps.iter().position(|other| other == lamp);
        let places = self.lamps.iter().filter_map(place).map(|k| carrier.n_own + k);
        chooser.choice((0..carrier.n_own).chain(places).collect(), &self.lighting)
    }
}

/// The lamps of every look: the best that are found from the `start`, or those that were staged where they are better.
fn choose(
    carrier: &Carrier,
    [start, staged]: [&Lit; 2],
    order: &Order,
    cancelled: &(impl Fn() -> bool + Sync),
    reporter: &impl Reporter,
) -> Result<Vec<Lit>, RunError> {
    let mut looks = Vec::new();
    for job in &order.options.jobs {
        let objectives = carrier.objectives(&job.target)?;
        let chooser = Chooser { carrier, objectives, cancelled };
        let rigs = chooser.rigs(&start.choice(&chooser), order.most)?;
        let costs: Vec<String> = rigs
            .iter()
            .map(|rig| format!("{:.3} with {}", rig.f_q, rig.lights.len() - carrier.n_own))
            .collect();
        let look = job.target.name();
        reporter.note(&format!("{look}: f_q {} lamps", costs.join(", ")));
        let mut best = choose::as_few_as_it_takes(&rigs, order.options.tolerance).cloned();
        if !staged.lamps.is_empty() {
            let Choice { lights, u, .. } = staged.choice(&chooser);
            let staged = chooser.polished(lights, &u)?;
            let is_better = best.as_ref().is_some_and(|best| best.f_q < staged.f_q);
            let word = if is_better { "placed anew" } else { "begin there" };
            reporter.note(&format!(
                "{look}: f_q {:.3} with the lights that were staged: lamps {word}",
                staged.f_q
            ));
            best = best.filter(|_| is_better).or(Some(staged));
        }
        looks.push(Lit::new(&best.ok_or(RunError::NoPlace)?, carrier));
    }
    Ok(looks)
}

/// The lamps of all looks with their small moves, each once.
fn around(set: &Set, looks: &[Lit], step: f32) -> Vec<Lamp> {
    let mut lamps: Vec<Lamp> = Vec::new();
    for lamp in looks.iter().flat_map(|lit| &lit.lamps) {
        for lamp in std::iter::once(*lamp).chain(places::near(set, lamp, step)) {
            if !lamps.contains(&lamp) {
                lamps.push(lamp);
            }
        }
    }
    lamps
}

/// The looks with their lamps exchanged for near ones.
fn slide(
    carrier: &Carrier,
    looks: &[Lit],
    order: &Order,
    cancelled: &(impl Fn() -> bool + Sync),
    reporter: &impl Reporter,
) -> Result<Vec<Lit>, RunError> {
    let each = looks.iter().zip(&order.options.jobs);
    each.map(|(lit, job)| {
        let objectives = carrier.objectives(&job.target)?;
        let chooser = Chooser { carrier, objectives, cancelled };
        let rigs = chooser.rigs(&lit.choice(&chooser), 0)?;
        let choice = rigs.first().ok_or(RunError::NoPlace)?;
        reporter.note(&format!("{}: f_q {:.3} with lamps moved by a little", job.target.name(), choice.f_q));
        Ok(Lit::new(choice, carrier))
    })
    .collect()
}

/// Where a lamp more would help a look: at the start, and beside the lamps that were chosen in the `last` carrier, which
/// is left out where its pictures have another size than those of the lamps `everywhere`.
fn maps(
    everywhere: &Carrier,
    start: &Lit,
    last: &Carrier,
    lit: &Lit,
    job: &Job,
    (company, set): (&Company, &Set),
) -> Result<Vec<Map>, RunError> {
    let ground = set.ground();
    let map = |carrier: &Carrier, lit: &Lit| -> Result<Map, RunError> {
        let chooser = Chooser { carrier, objectives: carrier.objectives(&job.target)?, cancelled: &|| false };
        let place = |lamp: &Lamp| {
            let own = lamp.of.map(|i| company.movable[i].light.name.clone());
            (own.unwrap_or_default(), lamp.position)
        };
        let lights: Vec<(String, Vec3)> = lit.lamps.iter().map(place).collect();
        let mut map = Map::of(&chooser, &lit.choice(&chooser), &ground, &lights);
        // Lamps that were added for their light alone are no places to offer.
        map.spots.retain(|spot| everywhere.lamps.contains(&spot.lamp));
        Ok(map)
    };
    let is_chosen = |&light: &usize| lit.lamps.contains(last.lamp(light));
    let chosen: Vec<usize> = (last.n_own..last.n_own + last.lamps.len()).filter(is_chosen).collect();
    let joined = everywhere.joined(last, &chosen);
    let mut maps = vec![map(everywhere, start)?];
    maps.extend(joined.map(|joined| map(&joined, lit)).transpose()?);
    Ok(maps)
}

/// The rig of some lamps, with their names.
fn rig(lit: &Lit, company: &Company, set: &Set, view: View, order: &Order) -> Rig {
    let n_own = company.fixed.len();
    let roles = describe::roles(&lit.lamps, &lit.means[n_own..], set);
    let mut names: Vec<String> = view.scene.lights.iter().map(|l| l.name.clone()).collect();
    names.extend(company.movable.iter().map(|own| own.light.name.clone()));
    let mut lamps = Vec::new();
    for ((lamp, role), &radiance) in lit.lamps.iter().zip(roles).zip(&lit.lighting.radiance[n_own..]) {
        let own = lamp.of.map(|i| &company.movable[i]);
        let name = own.map_or_else(|| unused_name(role.word(), &names), |own| own.light.name.clone());
        names.push(name.clone());
        let size = own.map_or(1.0, |own| own.light.size);
        let bounds = sizes(lamp, set, view).map(|s| s * size);
        let constraints = own.map_or_else(
            || LightConstraints {
                // Colours that a run frees, lamps have too.
                free: order.constraints.free.clone().union(&FreeKinds::named(&["color", "color_rgb"])),
                radiance_max: largest_radiance(radiance),
                ..LightConstraints::default()
            },
            |own| own.constraints.clone(),
        );
        let size_range = constraints.size_range.map_or(bounds, |[a, b]| [a.min(bounds[1]), b.min(bounds[1])]);
        lamps.push(PlacedLamp {
            name,
            role,
            lamp: lamp.scaled(1.0 / size),
            place: set.place(lamp.position),
            height: lamp.position.y - set.floor,
            moved_from: own.map(|own| own.lamp.position),
            radiance,
            size: size.clamp(size_range[0], size_range[1]),
            constraints: LightConstraints { size_range: Some(size_range), ..constraints },
        });
    }
    Rig { lamps, ..Rig::empty(order, set.ground()) }
}

/// Upper bound of the radiance of a lamp that was chosen with a radiance: with it the lamp has the same flux at its
/// least size, or [`HEADROOM`] times as much at its own.
fn largest_radiance(chosen: f64) -> Option<f32> {
    let most = (HEADROOM * chosen).min(f64::from(MAX_RADIANCE)) as f32;
    (most > 0.0).then_some(most)
}

/// A name that none of `names` is: the word, with a number if need be.
fn unused_name(word: &str, names: &[String]) -> String {
    let numbered = (2..).map(|n| format!("{word} {n}"));
    let mut all = std::iter::once(word.to_owned()).chain(numbered);
    all.find(|name| !names.contains(name)).unwrap_or_default()
}

/// Least and largest size of a lamp at which it may stand where it does.
fn sizes(lamp: &Lamp, set: &Set, view: View) -> [f32; 2] {
    let [least, mut above] = SIZES;
    let of_geometry = bounds::size_range(view, &lamp.light(String::new())).map_or(above, |[_, most]| most);
    above = above.min(of_geometry);
    let mut below = above.min(1.0);
    if set.allows(&lamp.scaled(above)) {
        return [least.min(above), above];
    }
    for _ in 0..HALVINGS {
        let middle = 0.5 * (below + above);
        if set.allows(&lamp.scaled(middle)) { below = middle } else { above = middle }
    }
    [least.min(below), below]
}

impl Rig {
    /// A rig without lamps.
    fn empty(order: &Order, ground: Ground) -> Self {
        let Order { most, without_lights, .. } = *order;
        Self { lamps: Vec::new(), sky: None, most, without_lights, ground, maps: Vec::new() }
    }

    /// The lights of the lamps and surroundings, with the radiances and sizes with which they were chosen.
    pub fn lights(&self) -> impl Iterator<Item = Light> {
        let light = |p: &PlacedLamp| Light {
            radiance: p.radiance as f32,
            size: p.size,
            ..p.lamp.light(p.name.clone())
        };
        self.lamps.iter().map(light).chain(self.sky.iter().map(|sky| sky.light.clone()))
    }

    /// The constraints of the lights that stay where they are, with those of the lamps added.
    #[must_use]
    pub fn constrained(&self, fixed: &[Light], order: &Order) -> Constraints {
        let own = order.constraints;
        let names = order.own_names.iter().zip(&own.lights);
        let of_fixed = names.filter(|(name, _)| fixed.iter().any(|light| light.name == **name));
        let lights = of_fixed.map(|(_, constraints)| constraints.clone());
        let of_lamps = self.lamps.iter().map(|placed| placed.constraints.clone());
        let of_sky = self.sky.iter().map(|sky| sky.constraints(order));
        Constraints { lights: lights.chain(of_lamps).chain(of_sky).collect(), ..own.clone() }
    }

    /// The lamps with what a photographer sets up for each in a lighting of the scene.
    #[must_use]
    pub fn described(&self, scene: &Scene, lighting: &Lighting) -> Vec<(&PlacedLamp, Description)> {
        let first = scene.lights.len() - self.lamps.len();
        let at = |k: usize| (lighting.radiance[first + k], lighting.size[first + k]);
        let each = self.lamps.iter().enumerate();
        each.map(|(k, lamp)| (lamp, lamp.description(at(k).0, at(k).1))).collect()
    }

    /// Adds to the file of a lighting where the lamps stand, what a photographer sets up, and the surroundings.
    pub fn describe(&self, file: &mut LightsFile, scene: &Scene, lighting: &Lighting) {
        file.without_lights = self.without_lights;
        for (lamp, description) in self.described(scene, lighting) {
            for setting in file.lights.iter_mut().filter(|setting| setting.name == lamp.name) {
                setting.placed = Some(lamp.placed(scene.origin));
                setting.setup = Some(description.clone());
            }
        }
        if let Some(sky) = &self.sky {
            let setting = file.lights.iter_mut().find(|setting| setting.name == sky.light.name);
            setting.into_iter().for_each(|setting| setting.placed = Some(sky.placed()));
        }
    }

    /// Writes the plan of the set in a lighting of the scene into a run directory.
    ///
    /// # Errors
    /// When it cannot be drawn or written.
    pub fn write_plan(&self, scene: &Scene, lighting: &Lighting, run: &Path) -> Result<(), RunError> {
        let plan = Plan { ground: &self.ground, lamps: self.described(scene, lighting) };
        write_whole(&run.join(PLAN), plan.svg()?)?;
        Ok(write_whole(&run.join(PLAN).with_extension("png"), plan.png()?)?)
    }

    /// Writes the maps of where a lamp would help into the directory of a run with a look of that name.
    ///
    /// # Errors
    /// When one cannot be drawn or written.
    pub fn write_maps(&self, look: &str, run: &Path) -> Result<(), RunError> {
        for (stem, map) in MAPS.iter().zip(&self.maps) {
            let path = run.join(stem);
            let chart = Chart::of(map);
            write_whole(&path.with_extension("png"), chart.drawing(look)?)?;
            write_whole(&path.with_extension("csv"), chart::table(map)?)?;
            write_exr(&path.with_extension("exr"), &chart.numbers())?;
        }
        Ok(())
    }
}
