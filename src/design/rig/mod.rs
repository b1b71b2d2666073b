//! Rigs: lamps that the program places.
//!
//! Lamps do not block light, so that *where* a lamp stands is one more thing that a transport basis keeps apart:
//! a [carrier](carrier) holds the pictures of hundreds of lamps, and a rig is [chosen](choose) among them. Its
//! lamps are then lights of the scene like any other, and the ordinary search finds their radiances and sizes.
//!
//! | file | what |
//! | --- | --- |
//! | `set` | subject, floor, backdrop and camera: where a lamp may stand |
//! | `places` | the lamps among which a rig is chosen |
//! | `carrier` | their pictures, rendered together |
//! | `choose` | which of them, and how bright |
//! | `describe`, `plan` | what a photographer would say of them, and draw |
//! | `run` | a whole run whose lamps the program places |

mod carrier;
mod choose;
mod describe;
mod lamp;
pub mod places;
mod plan;
mod run;
mod set;

use std::time::Instant;

use self::{
    carrier::{Carrier, Commission},
    choose::{Choice, Chooser},
};
use super::{
    Reporter, RunError,
    seeds::{Purpose, seed_for},
};
use crate::{
    audit::{
        lights::LightsFile,
        placed::{Description, Role},
    },
    integrator::View,
    light::Light,
    lighting::Lighting,
    scene::Scene,
    variables::{Constraints, Fitted, LightConstraints, bounds},
};

pub use describe::in_words;
pub use lamp::{Beam, Lamp};
pub use run::{Order, run};
pub use set::{Ground, Place, Set};

/// Samples that every lamp has in a pixel of the carrier. Set by reasoning.
const SAMPLES: u32 = 3;
/// Sizes between which a lamp may vary, while it stays where it may stand.
const SIZES: [f32; 2] = [0.25, 4.0];
/// Halvings of the range of the largest size.
const HALVINGS: u32 = 6;

/// Lamps of a scene that the program placed: its last lights.
#[derive(Clone, Debug)]
pub struct Rig {
    /// The lamps with their names and roles, in the order of the lights.
    pub lamps: Vec<PlacedLamp>,
    /// Lamps at most that were asked for.
    pub most: usize,
    /// Whether the lights of the scene's files were left out.
    pub without_lights: bool,
    /// The set on which they stand.
    pub ground: Ground,
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
    /// Its place, seen from the subject.
    pub place: Place,
    /// Height of its middle above the floor, metres.
    pub height: f32,
    /// Radiance with which it was chosen, W·m⁻²·sr⁻¹.
    pub radiance: f64,
    /// Least and largest size that it may have where it stands.
    pub sizes: [f32; 2],
}

/// Finds a rig for every look of a run; returns them with the scene, which has its own lights again.
///
/// # Errors
/// When there is no room for a lamp, or a render fails.
pub fn find(scene: Scene, order: &Order, reporter: &impl Reporter) -> Result<(Vec<Rig>, Scene), RunError> {
    let Order { authored, constraints, options, .. } = *order;
    let own_lights = scene.lights.clone();
    let camera = scene.camera.resized(options.work_size);
    let (own, lamps) = {
        let view = View { scene: &scene, camera: &camera };
        let own = Fitted::of_any(view, authored, constraints)?;
        own.notes.iter().for_each(|note| reporter.note(note));
        let set = Set::new(view, constraints.movement).ok_or(RunError::NoSubject)?;
        (own, places::all(&set))
    };
    if lamps.is_empty() {
        return Err(RunError::NoPlace);
    }
    let seed = seed_for(options.seed, Purpose::Places);
    let commission = Commission { own: &own, constraints, options, samples: SAMPLES, seed };
    let clock = Instant::now();
    let (carrier, scene) = Carrier::render(scene, lamps, commission, reporter)?;
    reporter.note(&format!("places rendered in {:.2} s", clock.elapsed().as_secs_f64()));
    let clock = Instant::now();
    reporter.stage("choosing lamps", None);
    let choices = choose(&carrier, order, reporter)?;
    reporter.note(&format!("lamps chosen in {:.2} s", clock.elapsed().as_secs_f64()));
    let scene = scene.with_lights(own_lights);
    let view = View { scene: &scene, camera: &camera };
    let set = Set::new(view, constraints.movement).ok_or(RunError::NoSubject)?;
    let rigs = choices.iter().map(|choice| rig(choice, &carrier, &set, view, order)).collect();
    Ok((rigs, scene))
}

/// The lamps of every look.
fn choose(carrier: &Carrier, order: &Order, reporter: &impl Reporter) -> Result<Vec<Choice>, RunError> {
    let Order { options, most, .. } = *order;
    let mut choices = Vec::new();
    for job in &options.jobs {
        let cancelled = || reporter.cancelled();
        let chooser =
            Chooser { carrier, objectives: carrier.objectives(&job.target)?, cancelled: &cancelled };
        let rigs = chooser.rigs(most)?;
        let costs: Vec<String> = rigs.iter().map(|rig| format!("{:.3}", rig.f_q)).collect();
        reporter.note(&format!("{}: f_q with 1, 2, ... lamps: {}", job.target.name(), costs.join(", ")));
        let choice = choose::as_few_as_it_takes(&rigs, options.tolerance).ok_or(RunError::NoPlace)?;
        choices.push(choice.clone());
    }
    Ok(choices)
}

/// The rig of a choice, with the names of its lamps.
fn rig(choice: &Choice, carrier: &Carrier, set: &Set, view: View, order: &Order) -> Rig {
    let part = carrier.part(&choice.lights);
    let lighting = part.lighting(&choice.u);
    let means = carrier.means(&choice.lights, &lighting.radiance);
    let roles = describe::roles(choice, carrier, &means, set);
    let mut names: Vec<String> = view.scene.lights.iter().map(|l| l.name.clone()).collect();
    let mut lamps = Vec::new();
    for (k, role) in (carrier.n_own..choice.lights.len()).zip(roles) {
        let lamp = carrier.lamps[choice.lights[k] - carrier.n_own];
        let mut name = role.word().to_owned();
        let mut n = 1;
        while names.contains(&name) {
            n += 1;
            name = format!("{} {n}", role.word());
        }
        names.push(name.clone());
        let place = set.place(lamp.position);
        let height = lamp.position.y - set.floor;
        let sizes = sizes(&lamp, set, view);
        lamps.push(PlacedLamp { name, role, lamp, place, height, radiance: lighting.radiance[k], sizes });
    }
    Rig { lamps, most: order.most, without_lights: order.without_lights, ground: set.ground() }
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
    /// The lights of the lamps, with the radiance with which they were chosen.
    pub fn lights(&self) -> impl Iterator<Item = Light> {
        self.lamps.iter().map(|placed| Light {
            radiance: placed.radiance as f32,
            ..placed.lamp.light(placed.name.clone())
        })
    }

    /// The constraints of a scene's author, with those of the lamps added.
    #[must_use]
    pub fn constrained(&self, own: &Constraints) -> Constraints {
        let mut constraints = own.clone();
        constraints.lights.extend(self.lamps.iter().map(|placed| LightConstraints {
            free: own.free.clone(),
            size_range: Some(placed.sizes),
            ..LightConstraints::default()
        }));
        constraints
    }
}

impl Rig {
    /// The lamps with what a photographer sets up for each in a lighting of the scene.
    #[must_use]
    pub fn described(&self, scene: &Scene, lighting: &Lighting) -> Vec<(&PlacedLamp, Description)> {
        let first = scene.lights.len() - self.lamps.len();
        let at = |k: usize| (lighting.radiance[first + k], lighting.size[first + k]);
        let each = self.lamps.iter().enumerate();
        each.map(|(k, lamp)| (lamp, lamp.description(at(k).0, at(k).1))).collect()
    }

    /// Adds to the file of a lighting where the lamps stand and what a photographer sets up.
    pub fn describe(&self, file: &mut LightsFile, scene: &Scene, lighting: &Lighting) {
        file.without_lights = self.without_lights;
        for (lamp, description) in self.described(scene, lighting) {
            for setting in file.lights.iter_mut().filter(|setting| setting.name == lamp.name) {
                setting.placed = Some(lamp.placed(scene.origin));
                setting.setup = Some(description.clone());
            }
        }
    }

    /// The plan of the set in a lighting of the scene, as an SVG file.
    #[must_use]
    pub fn plan(&self, scene: &Scene, lighting: &Lighting) -> String {
        plan::svg(&self.ground, &self.described(scene, lighting))
    }
}
