//! Kinds of integrators, and what the rest of the program asks of each.

use serde::{Deserialize, Serialize};

use crate::lighting::SampleCounts;

/// Closed set of integrators.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum IntegratorKind {
    /// Path tracing from the camera, with next-event estimation.
    Path,
    /// Bidirectional path tracing.
    #[default]
    Bdpt,
}

impl IntegratorKind {
    /// All integrators, in the order in which the help lists them.
    pub const ALL: [Self; 2] = [Self::Bdpt, Self::Path];

    /// Word for the integrator in records, and in the flag that asks for it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Path => "path",
            Self::Bdpt => "bdpt",
        }
    }

    /// Description of the integrator and of the scenes for which it is best, as a phrase for the help.
    #[must_use]
    pub fn help(self) -> &'static str {
        match self {
            Self::Path => "Unidirectional path tracing: best for diffuse scenes with large lights",
            Self::Bdpt => "Bidirectional path tracing (the default): best for glossy scenes and small lights",
        }
    }

    /// Number of light subpaths that come with `samples` camera subpaths. Each of their vertices may
    /// contribute to the film, which needs memory for that.
    #[must_use]
    pub fn light_subpaths(self, samples: u64, counts: SampleCounts) -> u64 {
        match self {
            Self::Path => 0,
            Self::Bdpt => samples.div_ceil(u64::from(counts.camera_subpaths)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_name_an_integrator_as_its_flag_does() {
        for kind in IntegratorKind::ALL {
            assert_eq!(serde_json::json!(kind), kind.name());
        }
    }
}
