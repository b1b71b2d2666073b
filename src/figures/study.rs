//! Studies: scenes with what is free in them, and the outcomes of their runs.

use image::RgbImage;

use crate::{design::attainable::Reach, objective::Evaluation, variables::FreeKinds};

/// Names of the looks, which are those of their built-in targets.
pub const LOOKS: [&str; 2] = ["high-key", "low-key"];

/// A scene that is lit for both looks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Study {
    /// Name of the scene in tables.
    pub title: &'static str,
    /// Path of the scene file below the directory of scenes.
    pub scene: &'static str,
    /// Whether the background's value is free, in addition to radiance and size of the lights.
    pub background: bool,
    /// Name of the directory of its runs, below that of all runs.
    pub directory: &'static str,
}

/// Studies of the paper, and those of girl and creature with the background's value free.
pub const STUDIES: [Study; 6] = [
    study("Girl", GIRL, false, "girl"),
    study("Creature", CREATURE, false, "creature"),
    study(BASKET_TITLE, BASKET, false, "fruit-basket"),
    study("Girl", GIRL, true, "girl-background"),
    study("Creature", CREATURE, true, "creature-background"),
    study(BASKET_TITLE, BASKET, true, "fruit-basket-background"),
];

/// Path of the girl's scene file below the directory of scenes.
const GIRL: &str = "fetched/girl.obj";
/// Path of the creature's scene file below the directory of scenes.
const CREATURE: &str = "fetched/creature.obj";
/// Name of the fruit basket in tables.
pub const BASKET_TITLE: &str = "Fruit basket";

const fn study(title: &'static str, scene: &'static str, background: bool, directory: &'static str) -> Study {
    Study { title, scene, background, directory }
}

/// Path of the fruit basket's scene file below the directory of scenes.
pub const BASKET: &str = "fruit_basket.obj";

impl Study {
    /// Kinds of variables that are free.
    #[must_use]
    pub fn free(&self) -> FreeKinds {
        FreeKinds::named(if self.background {
            &["radiance", "size", "background"]
        } else {
            &["radiance", "size"]
        })
    }

    /// Word for whether the background's value is free: `free` or `fixed`.
    #[must_use]
    pub fn background_word(&self) -> &'static str {
        if self.background { "free" } else { "fixed" }
    }
}

/// Outcome of the run of a study for one look.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The study.
    pub study: Study,
    /// Index of the look in [`LOOKS`].
    pub look: usize,
    /// f_q at the start.
    pub f_q_initial: f64,
    /// f_q and terms of the lights found, at the working size, corrected for noise bias.
    pub found: Evaluation,
    /// Half width of the 95 % interval of that f_q, with the noise correction.
    pub error: f64,
    /// f_q of the final picture, at full size.
    pub f_q_final: f64,
    /// Range of each term within reach of the lights, including the lights found.
    pub reach: Vec<Reach>,
    /// Reason why the result may not be what was meant.
    pub caution: Option<String>,
    /// Picture at the start, encoded for display.
    pub initial: RgbImage,
    /// Picture of the lights found, encoded for display.
    pub last: RgbImage,
}
