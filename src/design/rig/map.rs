//! Where a lamp would help: f_q with one lamp more, place by place.

use glam::{UVec2, Vec3};

use super::{
    carrier::{Carrier, Commission},
    choose::{Choice, Chooser, Offer},
    lamp::Lamp,
    places,
    set::{Ground, Place, Set},
};
use crate::{
    design::{
        Reporter, RunError,
        render::Renderer,
        seeds::{Purpose, seed_for},
    },
    integrator::View,
    lighting::Lighting,
    objective::Target,
    scene::Scene,
    variables::{Constraints, Fitted, FreeKinds},
};

/// Samples that every lamp has in a pixel: more than for a choice, since the map is looked at.
const SAMPLES: u32 = 6;

/// What is surveyed for a lamp more.
#[derive(Clone, Copy, Debug)]
pub struct Survey<'a> {
    /// Look that is sought.
    pub target: &'a Target,
    /// Present lighting of the scene's lights.
    pub lighting: &'a Lighting,
    /// Constraints of the scene's author.
    pub constraints: &'a Constraints,
    /// Integrator, sampler and measure of luminance.
    pub renderer: Renderer,
    /// Size of the working pictures, of which those that are measured are reductions, pixels.
    pub work_size: UVec2,
    /// Upper bound of the memory, bytes.
    pub memory: u64,
    /// Seed of the samples.
    pub seed: u64,
}

/// Where a lamp would help.
#[derive(Clone, Debug)]
pub struct Map {
    /// f_q of the present lighting, of reduced pictures.
    pub f_q: f64,
    /// Places of lamps, with what each would do.
    pub spots: Vec<Spot>,
    /// Places of the present lights that have one, by name.
    pub lights: Vec<(String, Place)>,
}

/// A place of a lamp, with what it would do.
#[derive(Clone, Copy, Debug)]
pub struct Spot {
    /// The lamp.
    pub lamp: Lamp,
    /// Where it stands.
    pub place: Place,
    /// f_q with the lamp at the best of some radiances, or without it.
    pub f_q: f64,
    /// That radiance, W·m⁻²·sr⁻¹.
    pub radiance: f64,
    /// Change of f_q by a little light of the lamp.
    pub change: f64,
}

/// Maps where a lamp would help.
///
/// # Errors
/// When there is no room for a lamp, or the render fails.
pub fn map(scene: Scene, survey: Survey, reporter: &impl Reporter) -> Result<Map, RunError> {
    let Survey { target, lighting, constraints, renderer, work_size, memory, seed } = survey;
    let camera = scene.camera.resized(work_size);
    let view = View { scene: &scene, camera: &camera };
    let own = Fitted::of_any(view, lighting, constraints)?;
    let set = Set::new(view, constraints.movement).ok_or(RunError::NoSubject)?;
    let lamps = places::all(&set);
    if lamps.is_empty() {
        return Err(RunError::NoPlace);
    }
    let ground = set.ground();
    let lights: Vec<(String, Vec3)> = scene
        .lights
        .iter()
        .filter_map(|light| Some((light.name.clone(), Lamp::of_light(light, 1.0)?.position)))
        .collect();
    let free = FreeKinds::named(&["radiance"]);
    let seed = seed_for(seed, Purpose::Places);
    let commission = Commission {
        own: &own,
        constraints,
        renderer,
        work_size,
        free: &free,
        memory,
        weights: None,
        samples: SAMPLES,
        least_spp: 1,
        seed,
    };
    let (carrier, _) = Carrier::render(scene, lamps, commission, reporter)?;
    let objectives = carrier.objectives(target)?;
    let chooser = Chooser { carrier: &carrier, objectives, cancelled: &|| false };
    let present = chooser.choice((0..carrier.n_own).collect(), &own.lighting);
    Ok(Map::of(&chooser, &present, &ground, &lights))
}

impl Map {
    /// What every lamp of a carrier would do that is added to a choice, on a set where the present lights stand at the
    /// places given by name, metres.
    pub(super) fn of<C: Fn() -> bool + Sync>(
        chooser: &Chooser<Lamp, C>,
        present: &Choice,
        ground: &Ground,
        lights: &[(String, Vec3)],
    ) -> Self {
        let (f_q, offers) = chooser.offers(present);
        let spot = |offer: &Offer| {
            let lamp = *chooser.carrier.lamp(offer.light);
            let place = ground.place(lamp.position);
            Spot { lamp, place, f_q: offer.f_q, radiance: offer.radiance, change: offer.change }
        };
        let lights = lights.iter().map(|(name, p)| (name.clone(), ground.place(*p)));
        Self { f_q, spots: offers.iter().map(spot).collect(), lights: lights.collect() }
    }
}
