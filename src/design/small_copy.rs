//! The small copy of a run's basis, compared with it.

use std::io;

use glam::UVec2;

use super::{
    search::spread,
    seeds::{Purpose, seed_for},
    setup::Setup,
};
use crate::{
    audit::{
        live::{Facts, Live, Shares},
        stored::{About, runs},
    },
    lighting::Lighting,
    math::display::luminance,
    transport::{TransportBasis, compact::Compact},
};

/// Lightings in which a small copy is compared with its basis, besides the start: more see more of what its user
/// may set. Each takes 4 ms on the fruit basket.
const COMPARED: u32 = 16;

/// Mean luminance of the pictures that are compared: middle grey.
const COMPARED_MEAN: f64 = 0.18;

/// A small copy of a basis, with what it is of; `fixed` is the lighting of what does not vary.
pub fn of(basis: &TransportBasis, fixed: &Lighting, setup: Setup) -> io::Result<Live> {
    let copy = Compact::new(basis)?;
    let variables = setup.variables;
    let spread = spread(COMPARED, variables.len(), seed_for(setup.options.seed, Purpose::Copy) as u32);
    let points = spread.chain([variables.start()]);
    let measure = setup.options.measure.of_luminance();
    let lightings: Vec<Lighting> = points
        .map(|u| {
            let x = variables.lighting(fixed.clone(), &variables.decode(&u));
            // Where all is white or black, nothing differs.
            let rgb = basis.picture(&x).rgb;
            let mean = rgb.iter().map(|&c| luminance(c)).sum::<f64>() / rgb.len().max(1) as f64;
            Lighting { exposure: if mean > 0.0 { COMPARED_MEAN / mean } else { x.exposure }, ..x }
        })
        .collect();
    let error = copy.open()?.error(basis, &lightings, measure);
    let about = About::new(setup.scene, fixed, setup.aovs, variables, measure);
    let about = about.with_colors(setup.scene, basis.layout());
    let mask = reduced_mask(&about.mask(), basis.layout().size, copy.header.reduction);
    let about = About { mask: runs(&mask), ..about };
    let [width, height] = copy.header.size.map(|n| n as usize);
    let weights = setup.options.weights.as_ref().map(|weights| Shares::new(&weights.at(width, height)));
    Ok(Live { copy, facts: Facts { about, authored: setup.fitted.lighting.clone(), weights, error } })
}

/// A mask of blocks of `factor` × `factor` pixels: a block is the object's when most of its pixels are.
fn reduced_mask(mask: &[bool], size: UVec2, factor: u32) -> Vec<bool> {
    let small = size / factor;
    let block = |i: u32| {
        let at = UVec2::new(i % small.x, i / small.x) * factor;
        let inside = (0..factor * factor).map(|k| at + UVec2::new(k % factor, k / factor));
        2 * inside.filter(|p| mask[(p.y * size.x + p.x) as usize]).count() >= (factor * factor) as usize
    };
    (0..small.element_product()).map(block).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_block_is_the_objects_when_most_of_it_is() {
        // Two blocks of 2 × 2 in a row, and a column that fills none.
        let mask = [true, true, false, false, true, true, false, true, false, true];
        assert_eq!(reduced_mask(&mask, UVec2::new(5, 2), 2), [true, false]);
        assert_eq!(reduced_mask(&mask, UVec2::new(5, 2), 1), mask);
    }
}
