//! Learning of a signature for each class of photographs, and how well the signatures tell
//! the classes apart.

use crate::math::stats::median;
use crate::objective::histogram::{BINS, Cumulated, f_hist};
use crate::objective::signature::library::Method;
use crate::objective::{Term, Values};

use super::barycentre::Quantiles;

/// Standard deviation of a normal distribution in units of its median absolute deviation,
/// 1/Φ⁻¹(3/4).
const MAD_TO_SIGMA: f64 = 1.4826;

/// Distance above the median, in standard deviations, from which a photograph is an outlier:
/// the customary three, which 0.13 % of normal samples exceed.
const OUTLIER_SIGMAS: f64 = 3.0;

/// The measurements of a photograph that signatures are learned from.
#[derive(Clone, Debug)]
pub struct Measured {
    /// Cumulated histogram of the photograph's display luminance.
    pub cumulated: Cumulated,
    /// Shares of its pixels in the bins of chroma.
    pub palette: Vec<f64>,
    /// What the scalar terms measure of the photograph, when its main object is known.
    pub values: Option<Values>,
}

/// Distances of a photograph to the classes, with the photograph left out of its own class.
#[derive(Clone, Debug, PartialEq)]
pub struct Judged {
    /// Distance to the signature of each class, eq. (8); `None` for the photograph's own class
    /// when it has no other photograph.
    pub distances: Vec<Option<f64>>,
    /// Index of the nearest class; `None` when a distance is missing.
    pub nearest: Option<usize>,
    /// Whether the photograph is unlike the rest of its class, see
    /// [`Learned::outlier_above`].
    pub outlier: bool,
}

/// The signature learned for a class, and how its photographs compare with it.
#[derive(Clone, Debug, PartialEq)]
pub struct Learned {
    /// Cumulated histogram that is the signature of the class.
    pub signature: Cumulated,
    /// Photographs of the class, in the order given.
    pub photos: Vec<Judged>,
    /// Distance to its own class above which a photograph is an outlier: the median of the
    /// distances in the class plus three standard deviations, estimated from the median
    /// absolute deviation. `None` with a single photograph.
    pub outlier_above: Option<f64>,
    /// Mean of the shares of chroma of the photographs.
    pub palette: Vec<f64>,
    /// Means of what the scalar terms measure over the photographs, when all have masks.
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
        Learned {
            signature: signatures[own],
            photos: judged,
            outlier_above,
            palette: mean_palette(photos),
            values: mean_values(photos),
        }
    })
    .collect()
}

/// The confusion matrix of the classes: number of photographs of class `row` whose nearest
/// class is `column`, as `[row][column]`.
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

/// Distances of a photograph of class `own` to the signatures, to its own class `without` it.
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

/// Marks the photographs that are outliers of their class `own`; returns the distance above
/// which they are.
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

/// The signature of a class from the histograms of its photographs.
fn combine(histograms: &[Cumulated], method: Method) -> Cumulated {
    match method {
        Method::Mean => mean(histograms.iter(), histograms.len()),
        Method::Barycentre => Quantiles::new(histograms).barycentre(),
    }
}

/// The signatures of a class with one photograph left out, by photograph; `None` when there
/// is no other.
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

fn mean_palette(photos: &[Measured]) -> Vec<f64> {
    let n = photos.iter().map(|p| p.palette.len()).min().unwrap_or(0);
    (0..n).map(|i| photos.iter().map(|p| p.palette[i]).sum::<f64>() / photos.len() as f64).collect()
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
        Measured { cumulated, palette: Vec::new(), values: Some(Term::ALL.map(|term| Some(value(term)))) }
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
