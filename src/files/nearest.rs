//! The known name closest to a misspelt one, for "did you mean …?".

/// The candidate most similar to `word`, the first of several that are alike; `None` when
/// none is similar enough to be meant. Case does not count.
#[must_use]
pub fn nearest<'a>(word: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    // Jaro-Winkler similarity from which a candidate is offered: typing errors in the names
    // of keys stay above, unrelated words below.
    const MEANT: f64 = 0.7;
    // Similarity that words differing by one edit have at least: nearly the same word.
    const ONE_SLIP: f64 = 0.9;
    let lower = word.to_lowercase();
    let mut best: Option<(f64, &str)> = None;
    for candidate in candidates {
        let candidate_lower = candidate.to_lowercase();
        let mut score = strsim::jaro_winkler(&lower, &candidate_lower);
        // One edit in a short word, such as two letters swapped, weighs too much with Jaro.
        if lower.chars().count() >= 3 && strsim::osa_distance(&lower, &candidate_lower) == 1 {
            score = score.max(ONE_SLIP);
        }
        if score >= MEANT && best.is_none_or(|(b, _)| score > b) {
            best = Some((score, candidate));
        }
    }
    best.map(|(_, candidate)| candidate)
}

/// The question whether the candidate `nearest` was meant, to follow an unknown name in a message; empty
/// without a candidate.
#[must_use]
pub fn did_you_mean(nearest: Option<&str>) -> String {
    nearest.map(|n| format!(", did you mean `{n}`?")).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::nearest;

    #[test]
    fn slips_are_recognised_and_strangers_are_not() {
        let known = ["t_meanObj", "t_meanBack", "weights", "signature"];
        assert_eq!(nearest("t_meanobj", known), Some("t_meanObj"));
        assert_eq!(nearest("t_mean_back", known), Some("t_meanBack"));
        assert_eq!(nearest("wieghts", known), Some("weights"));
        assert_eq!(nearest("qq", known), None);
        assert_eq!(nearest("bxo", ["wall", "box", "floor"]), Some("box"));
    }
}
