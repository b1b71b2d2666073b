//! One of the lightings that a run offers, to be rendered.

use std::path::Path;

use anyhow::{Context, bail};

use super::recorded::Recorded;
use crate::audit::pick_stem;

/// The lighting of a number, from 1, that a run directory offers: the record of the run with the lights of this one.
///
/// # Errors
/// When the directory is that of no run, its scene is not found, or it offers no such lighting.
pub(super) fn resolve(run: &Path, number: usize, say: impl Fn(&str)) -> anyhow::Result<Recorded> {
    let recorded = Recorded::of(run, say)?.with_context(|| format!("{}: no run directory", run.display()))?;
    let file = |n: usize| run.join(pick_stem(n)).with_extension("toml");
    let lights = file(number);
    if !lights.is_file() {
        let offered = (1..).take_while(|&n| file(n).is_file()).count();
        bail!("--pick {number}: {} offers {offered} lightings, from 1", run.display());
    }
    Ok(Recorded { lights, ..recorded })
}
