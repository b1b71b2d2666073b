//! Which scenes are lit how, and what was found.

use image::RgbImage;

use crate::{design::attainable::Reach, objective::Evaluation, variables::FreeKinds};

/// The looks, by the names of their built-in targets.
pub const LOOKS: [&str; 2] = ["high-key", "low-key"];

/// A scene lit for both looks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Study {
    /// Name in tables.
    pub title: &'static str,
    /// Scene file, below the directory of scenes.
    pub scene: &'static str,
    /// Whether the background's value is free, besides radiance and size.
    pub background: bool,
    /// Directory of its runs, below that of all.
    pub directory: &'static str,
}

/// The runs of the paper, and those of girl and creature with the background free.
pub const STUDIES: [Study; 6] = [
    study("Girl", GIRL, false, "girl"),
    study("Creature", CREATURE, false, "creature"),
    study(BASKET_TITLE, BASKET, false, "fruit-basket"),
    study("Girl", GIRL, true, "girl-background"),
    study("Creature", CREATURE, true, "creature-background"),
    study(BASKET_TITLE, BASKET, true, "fruit-basket-background"),
];

const GIRL: &str = "fetched/girl.obj";
const CREATURE: &str = "fetched/creature.obj";
/// Name of the fruit basket.
pub const BASKET_TITLE: &str = "Fruit basket";

const fn study(title: &'static str, scene: &'static str, background: bool, directory: &'static str) -> Study {
    Study { title, scene, background, directory }
}

/// Scene file of the fruit basket.
pub const BASKET: &str = "fruit_basket.obj";

impl Study {
    /// What may vary.
    #[must_use]
    pub fn free(&self) -> FreeKinds {
        FreeKinds::named(if self.background {
            &["radiance", "size", "background"]
        } else {
            &["radiance", "size"]
        })
    }

    /// Whether the background varies, in a word.
    #[must_use]
    pub fn background_word(&self) -> &'static str {
        if self.background { "free" } else { "fixed" }
    }
}

/// What was found for a study and a look.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The study.
    pub study: Study,
    /// Index into [`LOOKS`].
    pub look: usize,
    /// f_q of the start.
    pub f_q_initial: f64,
    /// f_q and terms of what was found, at the working size, freed of noise bias.
    pub found: Evaluation,
    /// Half width of the 95 % interval of its f_q, with the noise correction.
    pub error: f64,
    /// f_q of the final picture.
    pub f_q_final: f64,
    /// What of each term the lights reach, the lights found among them.
    pub reach: Vec<Reach>,
    /// Why it may not be what was meant.
    pub caution: Option<String>,
    /// The picture at the start.
    pub initial: RgbImage,
    /// The picture found.
    pub last: RgbImage,
}
