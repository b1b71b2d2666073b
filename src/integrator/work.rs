//! What the paths of a render cost, counted.

use std::{iter::Sum, ops::AddAssign};

/// Work of some samples of a render. It is counted and not timed, so that what is decided by it is the same on
/// every machine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Samples, each with what a camera ray and its film position cost.
    pub samples: u64,
    /// Edges of camera and light subpaths.
    pub edges: u64,
    /// Samples of lights as seen from a vertex.
    pub light_samples: u64,
    /// Connections of two vertices, or of one and the lens.
    pub connections: u64,
}

impl Work {
    /// Estimated time of the work, relative to that of an edge.
    #[must_use]
    pub fn cost(&self) -> f64 {
        let counts = [self.samples, self.edges, self.light_samples, self.connections];
        counts.iter().zip(COSTS).map(|(&count, cost)| count as f64 * cost).sum()
    }
}

impl AddAssign for Work {
    fn add_assign(&mut self, other: Self) {
        self.samples += other.samples;
        self.edges += other.edges;
        self.light_samples += other.light_samples;
        self.connections += other.connections;
    }
}

impl Sum for Work {
    fn sum<I: Iterator<Item = Self>>(each: I) -> Self {
        each.fold(Self::default(), |mut sum, work| {
            sum += work;
            sum
        })
    }
}

/// Time of a sample, an edge, a light sample and a connection, relative to that of an edge.
const COSTS: [f64; 4] = [0.6, 1.0, 0.5, 0.45];
