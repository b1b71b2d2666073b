//! The integrators there are, and what the rest of the program asks of each.

use serde::{Deserialize, Serialize};

use crate::lighting::SampleCounts;

/// The closed set of integrators.
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
    /// Every integrator, in the order in which the help lists them.
    pub const ALL: [Self; 2] = [Self::Bdpt, Self::Path];

    /// The word for it in records, and the flag that asks for it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Path => "path",
            Self::Bdpt => "bdpt",
        }
    }

    /// What it is and what it is best for, as a phrase for the help.
    #[must_use]
    pub fn help(self) -> &'static str {
        match self {
            Self::Path => "Unidirectional path tracing: best for diffuse scenes with large lights",
            Self::Bdpt => "Bidirectional path tracing (the default): best for glossy scenes and small lights",
        }
    }

    /// Number of light subpaths that `samples` camera subpaths bring with them; each may be splatted
    /// at every vertex, which a film has to have memory for.
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
