//! Pearson's χ² test of samples against a density over a rectangle.
//!
//! The cells are those of a k-d tree of pilot samples, so that they are small
//! where the density is large, however sharp it is; the density is integrated
//! over each by adaptive quadrature.

use super::quadrature::integrate;

/// A rectangle of the plane.
#[derive(Clone, Copy, Debug)]
pub struct Rect {
    pub lo: [f64; 2],
    pub hi: [f64; 2],
}

impl Rect {
    fn split(self, axis: usize, at: f64) -> (Self, Self) {
        let (mut a, mut b) = (self, self);
        a.hi[axis] = at;
        b.lo[axis] = at;
        (a, b)
    }
}

/// A partition of a rectangle.
pub struct Partition {
    nodes: Vec<Node>,
    pub cells: Vec<Rect>,
}

enum Node {
    Cell(usize),
    Split { axis: usize, at: f64, below: usize, above: usize },
}

impl Partition {
    /// Splits `domain` at the medians of `pilot` samples until `depth` levels
    /// are done; `first` are splits (axis, position) made before.
    pub fn new(domain: Rect, pilot: &[[f64; 2]], depth: u32, first: &[(usize, f64)]) -> Self {
        let mut p = Self { nodes: Vec::new(), cells: Vec::new() };
        p.build(domain, pilot.to_vec(), depth, first);
        p
    }

    fn build(&mut self, rect: Rect, mut pilot: Vec<[f64; 2]>, depth: u32, first: &[(usize, f64)]) -> usize {
        let id = self.nodes.len();
        let (axis, at, rest) = if let Some((&(axis, at), rest)) = first.split_first() {
            (axis, at, rest)
        } else {
            let axis = (depth % 2) as usize;
            pilot.sort_by(|a, b| a[axis].total_cmp(&b[axis]));
            let at = pilot.get(pilot.len() / 2).map_or(f64::NAN, |x| x[axis]);
            (axis, at, first)
        };
        if (depth == 0 && first.is_empty()) || !(rect.lo[axis] < at && at < rect.hi[axis]) {
            self.nodes.push(Node::Cell(self.cells.len()));
            self.cells.push(rect);
            return id;
        }
        self.nodes.push(Node::Cell(usize::MAX));
        let (a, b) = rect.split(axis, at);
        let (pa, pb): (Vec<_>, Vec<_>) = pilot.into_iter().partition(|x| x[axis] < at);
        let depth = if first.is_empty() { depth - 1 } else { depth };
        let below = self.build(a, pa, depth, rest);
        let above = self.build(b, pb, depth, rest);
        self.nodes[id] = Node::Split { axis, at, below, above };
        id
    }

    /// The cell of a point.
    pub fn find(&self, x: [f64; 2]) -> usize {
        let mut node = 0;
        loop {
            match self.nodes[node] {
                Node::Cell(i) => return i,
                Node::Split { axis, at, below, above } => node = if x[axis] < at { below } else { above },
            }
        }
    }

    /// Integrals of `N` functions over every cell. Errors stay far below what
    /// 10⁶ samples of a density can show.
    pub fn integrals<const N: usize>(&self, f: &impl Fn([f64; 2]) -> [f64; N]) -> Vec<[f64; N]> {
        let tolerance = 1e-4 / self.cells.len() as f64;
        self.cells.iter().map(|c| integrate(c.lo, c.hi, tolerance, f)).collect()
    }
}

/// Samples counted per cell; the last count is of samples that are absorbed.
#[derive(Clone)]
pub struct Counts {
    pub cells: Vec<u64>,
    pub absorbed: u64,
}

impl Counts {
    pub fn new(partition: &Partition) -> Self {
        Self { cells: vec![0; partition.cells.len()], absorbed: 0 }
    }

    /// p value of the counts under the cells' probabilities; what is missing
    /// to one is the probability of absorption.
    ///
    /// Cells that expect fewer than ten samples are pooled. Probabilities that
    /// sum to more than one have the p value zero.
    pub fn p_value(&self, probabilities: &[f64]) -> f64 {
        let n = (self.cells.iter().sum::<u64>() + self.absorbed) as f64;
        let missing = 1.0 - probabilities.iter().sum::<f64>();
        if missing < -1e-3 {
            return 0.0;
        }
        let mut cells: Vec<(f64, f64)> =
            self.cells.iter().zip(probabilities).map(|(&c, &p)| (c as f64, p * n)).collect();
        cells.push((self.absorbed as f64, missing.max(0.0) * n));
        cells.sort_by(|a, b| b.1.total_cmp(&a.1));
        let mut pooled: Vec<(f64, f64)> = Vec::new();
        for (count, expected) in cells {
            match pooled.last_mut() {
                Some(last) if expected < 10.0 && last.1 < 20.0 => {
                    last.0 += count;
                    last.1 += expected;
                }
                _ => pooled.push((count, expected)),
            }
        }
        // The smallest cells may not have filled a pool.
        if pooled.len() > 1 && pooled.last().is_some_and(|c| c.1 < 10.0) {
            let rest = pooled.pop().unwrap();
            let last = pooled.last_mut().unwrap();
            last.0 += rest.0;
            last.1 += rest.1;
        }
        assert!(pooled.len() >= 2, "{n} samples are too few to tell anything about their distribution");
        let statistic: f64 = pooled.iter().map(|(c, e)| (c - e).powi(2) / e).sum();
        upper_gamma((pooled.len() - 1) as f64 / 2.0, statistic / 2.0)
    }
}

/// Level of each of `n` tests for a family-wise level `alpha` (Šidák).
pub fn sidak_level(alpha: f64, n: usize) -> f64 {
    -f64::exp_m1(f64::ln_1p(-alpha) / n as f64)
}

/// Regularised upper incomplete gamma function Q(a, x). [DLMF] 8.11.4, 8.9.2.
fn upper_gamma(a: f64, x: f64) -> f64 {
    if x <= 0.0 {
        return 1.0;
    }
    let front = (a * x.ln() - x - libm::lgamma(a)).exp();
    if x < a + 1.0 {
        let (mut term, mut sum, mut k) = (1.0 / a, 1.0 / a, a);
        while term > 1e-15 * sum {
            k += 1.0;
            term *= x / k;
            sum += term;
        }
        return 1.0 - front * sum;
    }
    // Modified Lentz algorithm.
    let mut b = x + 1.0 - a;
    let mut c = 1e300;
    let mut d = 1.0 / b;
    let mut h = d;
    for i in 1..10_000 {
        let i = f64::from(i);
        let an = -i * (i - a);
        b += 2.0;
        d = 1.0 / (an * d + b);
        c = b + an / c;
        h *= d * c;
        if (d * c - 1.0).abs() < 1e-14 {
            break;
        }
    }
    front * h
}

#[test]
fn tail_probabilities_match_tables() {
    // χ² quantiles: 1 degree at 0.95, 10 at 0.99, 100 at 0.999.
    for (k, x, p) in [(1.0, 3.841_459, 0.05), (10.0, 23.209_251, 0.01), (100.0, 149.449_253, 0.001)] {
        let q = upper_gamma(k / 2.0, x / 2.0);
        assert!((q / p - 1.0).abs() < 1e-5, "{k} {q}");
    }
    // For whole a it is a Poisson distribution function, [DLMF] 8.4.10.
    let poisson: f64 =
        (0..50).map(|k| (f64::from(k) * 40.0_f64.ln() - 40.0 - libm::lgamma(f64::from(k) + 1.0)).exp()).sum();
    assert!((upper_gamma(50.0, 40.0) - poisson).abs() < 1e-10);
}
