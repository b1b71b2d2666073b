//! Named values of options. Their types know nothing of the command line: the words for them, which
//! are those of the records, and what the help says of each stand here.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};

use crate::{
    bench::{self, Peer},
    design::Gradient,
    figures::Part,
    sampler::SamplerKind,
};

/// A value of an option, the word for it, and what the help says of it.
pub type Choice<T> = (T, &'static str, &'static str);

/// Values of `--sampler`.
pub const SAMPLERS: [Choice<SamplerKind>; 2] = [
    (SamplerKind::Sobol, "sobol", "Owen-scrambled Sobol, the default"),
    (SamplerKind::Halton, "halton", "Owen-scrambled Halton (the paper's choice)"),
];

/// Values of `run --gradient`.
pub const GRADIENTS: [Choice<Gradient>; 2] = [
    (Gradient::Basis, "basis", "Exact, on the transport basis: one render, many starts"),
    (Gradient::Fd, "fd", "Forward differences of fresh renders, from one start (the paper's way)"),
];

/// Values of `figures --only`.
pub const PARTS: [Choice<Part>; 9] = [
    (Part::Fig2, "fig2", "One light at several sizes and fluxes"),
    (Part::Fig3, "fig3", "Girl and creature: start, high-key, low-key"),
    (
        Part::Background,
        "background",
        "Girl and creature when the background is free, which the paper does not show",
    ),
    (Part::Fig4, "fig4", "Fruit basket: start, high-key, low-key, its background as it is and free"),
    (Part::Table1, "table1", "Targets and weights"),
    (Part::Table2, "table2", "Terms found for every scene"),
    (Part::Table3, "table3", "Terms found when the background is free"),
    (Part::Gaps, "gaps", "What the lights can reach of every term, beside what was found"),
    (
        Part::Convergence,
        "convergence",
        "Paper mode and default mode compared: `f_q` as the search goes on, and seconds",
    ),
];

/// Values of `bench --only`.
pub const BENCH_PARTS: [Choice<bench::Part>; 2] = [
    (bench::Part::Efficiency, "efficiency", "Error and seconds of pictures, ours and theirs"),
    (bench::Part::Rays, "rays", "Rays a second inside our integrators, beside a bare loop of Embree"),
];

/// Values of `bench --peers`.
pub const PEERS: [Choice<Peer>; 1] = [(Peer::Mitsuba, "mitsuba", "Mitsuba 3")];

/// Parses the word for one of some values.
pub fn one_of<T: Copy + Send + Sync + 'static>(
    choices: &'static [Choice<T>],
) -> impl TypedValueParser<Value = T> {
    let possible = choices.iter().map(|&(_, word, help)| PossibleValue::new(word).help(help));
    PossibleValuesParser::new(possible).try_map(|given| {
        choices.iter().find(|(_, word, _)| *word == given).map(|choice| choice.0).ok_or("no such value")
    })
}

#[cfg(test)]
mod tests {
    use serde::Serialize;

    use super::*;

    fn words_are_those_of_the_records<T: Serialize>(choices: &[Choice<T>]) {
        for (value, word, _) in choices {
            assert_eq!(serde_json::json!(value), *word);
        }
    }

    #[test]
    fn options_and_records_use_the_same_words() {
        words_are_those_of_the_records(&SAMPLERS);
        words_are_those_of_the_records(&GRADIENTS);
        words_are_those_of_the_records(&PARTS);
        words_are_those_of_the_records(&BENCH_PARTS);
        words_are_those_of_the_records(&PEERS);
    }

    #[test]
    fn every_part_of_the_figures_can_be_asked_for() {
        assert_eq!(PARTS.map(|choice| choice.0), Part::ALL);
    }

    #[test]
    fn every_part_and_peer_of_the_benchmark_can_be_asked_for() {
        assert_eq!(BENCH_PARTS.map(|choice| choice.0), bench::Part::ALL);
        assert_eq!(PEERS.map(|choice| choice.0), Peer::ALL);
        assert!(BENCH_PARTS.iter().all(|(part, word, _)| part.name() == *word));
        assert!(PEERS.iter().all(|(peer, word, _)| peer.name() == *word));
    }
}
