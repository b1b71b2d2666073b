//! Class signatures, and how well they tell the classes' photographs apart.

use crate::math::stats::median;
use crate::objective::histogram::{BINS, Cumulated, f_hist};
use crate::objective::signature::library::Method;
use crate::objective::{Term, Values};

use super::barycentre::Quantiles;

/// A normal sample's standard deviation in units of its median absolute deviation.
const MAD_TO_SIGMA: f64 = 1.4826;

/// Distance above the median, in such standard deviations, that makes an outlier.
const OUTLIER_SIGMAS: f64 = 3.0;

/// What a photograph is to learning.
#[derive(Clone, Debug)]
pub struct Measured {
    /// Its cumulated histogram.
    pub cumulated: Cumulated,
    /// What the scalar terms measure of it, when its main object is known.
    pub values: Option<Values>,
}

/// How a photograph stands to the classes, itself left out of its own.
#[derive(Clone, Debug, PartialEq)]
pub struct Judged {
    /// Distance to each class's signature, eq. (8); `None` to that of a class that has no
    /// other photograph.
    pub distances: Vec<Option<f64>>,
    /// The nearest class; `None` when a distance is missing.
    pub nearest: Option<usize>,
    /// Whether it is unlike the rest of its class.
    pub outlier: bool,
}

/// What was learned of a class.
#[derive(Clone, Debug, PartialEq)]
pub struct Learned {
    /// Its signature.
    pub signature: Cumulated,
    /// Its photographs, in order.
    pub photos: Vec<Judged>,
    /// Distance to the own class above which a photograph is an outlier: the median of the
    /// class's distances and three standard deviations, these from the median absolute
    /// deviation. `None` with a single photograph.
    pub outlier_above: Option<f64>,
    /// Mean of what the scalar terms measure, when all photographs have masks.
    pub values: Option<Values>,
}

/// Learns the signature of each class from its photographs, at least one each.
#[must_use]
pub fn learn(classes: &[Vec<Measured>], method: Method) -> Vec<Learned> {
    let histograms: Vec<Vec<Cumulated>> =
        classes.iter().map(|photos| photos.iter().map(|p| p.cumulated).collect()).collect();
    let signatures: Vec<Cumulated> = histograms.iter().map(|h| combine(h, method)).collect();
    let each = classes.iter().zip(&histograms).enumerate();
    each.map(|(own, (photos, histograms))| {
        let without = leave_one_out(histograms, method);
        let mut judged: Vec<Judged> = histograms
            .iter()
            .zip(&without)
            .map(|(q, without)| judge(q, own, without.as_ref(), &signatures))
            .collect();
        let outlier_above = mark_outliers(&mut judged, own);
        Learned { signature: signatures[own], photos: judged, outlier_above, values: mean_values(photos) }
    })
    .collect()
}

/// Photographs of class `row` whose nearest class is `column`, as `[row][column]`.
#[must_use]
pub fn confusion(classes: &[Learned]) -> Vec<Vec<usize>> {
    let row = |class: &Learned| {
        let mut counts = vec![0; classes.len()];
        for nearest in class.photos.iter().filter_map(|p| p.nearest) {
            counts[nearest] += 1;
        }
        counts
    };
    classes.iter().map(row).collect()
}

fn judge(q: &Cumulated, own: usize, without: Option<&Cumulated>, signatures: &[Cumulated]) -> Judged {
    let distance = |class: usize| {
        let p = if class == own { without } else { Some(&signatures[class]) };
        p.map(|p| f_hist(p, q))
    };
    let distances: Vec<Option<f64>> = (0..signatures.len()).map(distance).collect();
    let known: Option<Vec<f64>> = distances.iter().copied().collect();
    let nearest = known.and_then(|d| (0..d.len()).min_by(|&a, &b| d[a].total_cmp(&d[b])));
    Judged { distances, nearest, outlier: false }
}

fn mark_outliers(photos: &mut [Judged], own: usize) -> Option<f64> {
    let distances: Vec<f64> = photos.iter().filter_map(|p| p.distances[own]).collect();
    let middle = median(&distances)?;
    let deviations: Vec<f64> = distances.iter().map(|d| (d - middle).abs()).collect();
    let above = middle + OUTLIER_SIGMAS * MAD_TO_SIGMA * median(&deviations)?;
    for photo in photos {
        photo.outlier = photo.distances[own].is_some_and(|d| d > above);
    }
    Some(above)
}

fn combine(histograms: &[Cumulated], method: Method) -> Cumulated {
    match method {
        Method::Mean => mean(histograms.iter(), histograms.len()),
        Method::Barycentre => Quantiles::new(histograms).barycentre(),
    }
}

/// The signature without each photograph; `None` when there is no other.
fn leave_one_out(histograms: &[Cumulated], method: Method) -> Vec<Option<Cumulated>> {
    let n = histograms.len();
    if n < 2 {
        return vec![None; n];
    }
    match method {
        Method::Mean => (0..n)
            .map(|i| {
                let others = histograms.iter().enumerate().filter(|&(j, _)| j != i).map(|(_, h)| h);
                Some(mean(others, n - 1))
            })
            .collect(),
        Method::Barycentre => {
            let quantiles = Quantiles::new(histograms);
            (0..n).map(|i| Some(quantiles.without(i))).collect()
        }
    }
}

fn mean<'a>(histograms: impl Iterator<Item = &'a Cumulated>, n: usize) -> Cumulated {
    let mut out = [0.0; BINS];
    for histogram in histograms {
        for (out, q) in out.iter_mut().zip(histogram) {
            *out += q;
        }
    }
    out.map(|sum| sum / n as f64)
}

fn mean_values(photos: &[Measured]) -> Option<Values> {
    let all: Option<Vec<Values>> = photos.iter().map(|p| p.values).collect();
    let all = all.filter(|all| !all.is_empty())?;
    let sum = |term: Term| all.iter().map(|values| values[term as usize]).sum::<Option<f64>>();
    Some(Term::ALL.map(|term| Some(sum(term)? / all.len() as f64)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::objective::special::beta_cdf;

    fn photo(a: f64, b: f64) -> Measured {
        let cumulated = std::array::from_fn(|i| beta_cdf((i + 1) as f64 / BINS as f64, a, b));
        let value = |term| if term == Term::MeanObj { a / 10.0 } else { 0.3 };
        Measured { cumulated, values: Some(Term::ALL.map(|term| Some(value(term)))) }
    }

    fn bright() -> Vec<Measured> {
        vec![photo(8.0, 2.0), photo(7.5, 2.1), photo(8.3, 1.9), photo(8.1, 2.2)]
    }

    fn dark() -> Vec<Measured> {
        vec![photo(1.0, 9.0), photo(1.1, 8.6), photo(0.9, 9.5)]
    }

    #[test]
    fn the_mean_is_the_mean_and_classes_that_differ_are_told_apart() {
        for method in [Method::Mean, Method::Barycentre] {
            let learned = learn(&[bright(), dark()], method);
            assert_eq!(confusion(&learned), [[4, 0], [0, 3]]);
            assert!(learned.iter().flat_map(|c| &c.photos).all(|p| !p.outlier));
            let brightness = |values: Option<Values>| values.unwrap()[Term::MeanObj as usize].unwrap();
            let mean = bright().iter().map(|p| brightness(p.values)).sum::<f64>() / 4.0;
            assert_eq!(brightness(learned[0].values), mean);
        }
        let learned = learn(&[bright()], Method::Mean);
        let want = bright().iter().map(|p| p.cumulated[200]).sum::<f64>() / 4.0;
        assert_eq!(learned[0].signature[200], want);
    }

    #[test]
    fn a_photograph_does_not_count_for_its_own_class() {
        // Counted, a class of two that has little in common would claim each of its own.
        let classes = [vec![photo(1.0, 20.0), photo(20.0, 1.0)], vec![photo(5.0, 5.0)]];
        for method in [Method::Mean, Method::Barycentre] {
            let learned = learn(&classes, method);
            assert_eq!(confusion(&learned)[0], [0, 2]);
            let own = learned[0].photos[0].distances[0].unwrap();
            let direct = f_hist(&classes[0][1].cumulated, &classes[0][0].cumulated);
            assert!((own - direct).abs() < 1e-9, "{own} {direct}");
        }
    }

    #[test]
    fn a_stranger_is_an_outlier_of_its_class() {
        let mut photos = bright();
        photos.push(photo(1.0, 9.0));
        let learned = learn(&[photos], Method::Mean);
        let outliers: Vec<bool> = learned[0].photos.iter().map(|p| p.outlier).collect();
        assert_eq!(outliers, [false, false, false, false, true]);
    }

    #[test]
    fn a_single_photograph_is_learned_but_not_judged() {
        let learned = learn(&[vec![photo(5.0, 5.0)], dark()], Method::Mean);
        assert_eq!(learned[0].photos[0].distances[0], None);
        assert_eq!((learned[0].photos[0].nearest, learned[0].outlier_above), (None, None));
        assert_eq!(confusion(&learned), [[0, 0], [0, 3]]);
        assert_eq!(learned[0].signature, photo(5.0, 5.0).cumulated);
    }
}
