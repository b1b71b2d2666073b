//! Tables of what a rough surface does on the whole to light from a direction:
//! functions of the cosine to the normal and, where it varies, of the roughness.

use rayon::prelude::*;

use super::microfacet::Ggx;

/// Nodes in √cos θ, which lie close where albedos bend, at grazing directions. White
/// surfaces are then within 8e-4 of white at cosines from 0.05 (1.2e-3 with half as many).
const N_NODES: usize = 64;
/// Rows in roughness, where it varies: white is within 1.1e-3 (2e-3 with 33 rows).
const N_ROUGHNESS: usize = 49;

/// A function of cos θ ≥ 0, for facets of one slope or of any.
#[derive(Clone, Debug)]
pub(super) struct Table {
    /// A row twice, or as many as there are roughnesses.
    rows: Vec<Row>,
}

#[derive(Clone, Debug)]
struct Row {
    nodes: [f32; N_NODES],
    /// Mean of the interpolant over projected solid angle.
    average: f32,
}

impl Row {
    fn new(nodes: [f32; N_NODES]) -> Self {
        // 2 ∫ f(μ) μ dμ = 4 ∫ f(x²) x³ dx, and f is linear in x between nodes: as the mean
        // is exactly that of what is looked up, interpolation neither adds nor takes energy.
        let x = |i: usize| i as f64 / (N_NODES - 1) as f64;
        let cell = |i: usize| {
            let (a, b) = (x(i), x(i + 1));
            let (f_a, f_b) = (f64::from(nodes[i]), f64::from(nodes[i + 1]));
            let slope = (f_b - f_a) / (b - a);
            (f_a - slope * a) * (b.powi(4) - a.powi(4)) + slope * 0.8 * (b.powi(5) - a.powi(5))
        };
        let average = (0..N_NODES - 1).map(cell).sum::<f64>() as f32;
        Self { nodes, average }
    }
}

impl Table {
    /// Tabulates `f(ggx, cos)` for one distribution.
    pub fn new(ggx: Ggx, f: impl Fn(Ggx, f32) -> f32 + Sync) -> Self {
        let Self { rows } = Self::of_rows(&[ggx], f);
        Self { rows: [rows.clone(), rows].concat() }
    }

    /// Tabulates `f(ggx, cos)` for distributions of every slope from [`Ggx::MIN_ALPHA`] to 1.
    pub fn of_any_slope(f: impl Fn(Ggx, f32) -> f32 + Sync) -> Self {
        let roughness = |i: usize| i as f32 / (N_ROUGHNESS - 1) as f32;
        let ggx = |i| Ggx::new((roughness(i) * roughness(i)).max(Ggx::MIN_ALPHA));
        Self::of_rows(&(0..N_ROUGHNESS).map(ggx).collect::<Vec<_>>(), f)
    }

    fn of_rows(rows: &[Ggx], f: impl Fn(Ggx, f32) -> f32 + Sync) -> Self {
        /// In place of cos θ = 0, where no facet is seen but edge-on.
        const GRAZING: f32 = 1e-4;
        let value = |k: usize| {
            let x = (k % N_NODES) as f32 / (N_NODES - 1) as f32;
            f(rows[k / N_NODES], (x * x).max(GRAZING))
        };
        let values: Vec<f32> = (0..rows.len() * N_NODES).into_par_iter().map(value).collect();
        let rows = values.as_chunks().0.iter().map(|nodes| Row::new(*nodes)).collect();
        Self { rows }
    }

    /// The function for facets of slope `alpha`, which a table of one slope ignores.
    pub fn row(&self, alpha: f32) -> TableRow<'_> {
        let (i, t) = match self.rows.len() {
            N_ROUGHNESS => {
                let Place { i, t } = Place::new(alpha.sqrt(), N_ROUGHNESS);
                (i, t)
            }
            _ => (0, 0.0),
        };
        let (pairs, _) = self.rows[i..].as_chunks();
        let rows: &[Row; 2] = &pairs[0];
        let average =
            if t == 0.0 { rows[0].average } else { rows[0].average * (1.0 - t) + rows[1].average * t };
        TableRow { rows, t, average }
    }
}

/// A function of the cosine alone.
#[derive(Clone, Copy, Debug)]
pub(super) struct TableRow<'a> {
    rows: &'a [Row; 2],
    /// How far it is from one row to the other, in [0, 1].
    t: f32,
    /// Mean over projected solid angle, 2 ∫ f(μ) μ dμ.
    pub average: f32,
}

impl TableRow<'_> {
    /// Value at a cosine.
    pub fn at(&self, cos: Cosine) -> f32 {
        let Place { i, t } = cos.0;
        let look_up = |row: &Row| row.nodes[i] * (1.0 - t) + row.nodes[i + 1] * t;
        let value = look_up(&self.rows[0]);
        if self.t == 0.0 { value } else { value * (1.0 - self.t) + look_up(&self.rows[1]) * self.t }
    }
}

/// Where a cosine lies in every table.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cosine(Place);

impl Cosine {
    /// Place of the cosine `cos` between the normal and a direction on either side.
    pub fn new(cos: f32) -> Self {
        Self(Place::new(cos.abs().sqrt(), N_NODES))
    }
}

/// A place between two of equidistant nodes.
#[derive(Clone, Copy, Debug)]
struct Place {
    i: usize,
    t: f32,
}

impl Place {
    /// `x` in [0, 1] among `n` nodes.
    fn new(x: f32, n: usize) -> Self {
        let x = x.clamp(0.0, 1.0) * (n - 1) as f32;
        let i = (x as usize).min(n - 2);
        Self { i, t: x - i as f32 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_average_is_that_of_what_is_looked_up() {
        let table = Table::of_any_slope(|ggx, cos| (3.0 * cos).sin() + ggx.alpha() * cos.sqrt());
        let row = table.row(0.3);
        let n = 100_000;
        let mean = (0..n)
            .map(|i| {
                let mu = (f64::from(i) + 0.5) / f64::from(n);
                2.0 * mu * f64::from(row.at(Cosine::new(mu as f32))) / f64::from(n)
            })
            .sum::<f64>();
        assert!((mean - f64::from(row.average)).abs() < 1e-6, "{mean} {}", row.average);
    }
}
