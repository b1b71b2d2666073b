//! Queries that were made, to be made again.

use std::sync::{Mutex, PoisonError};

use embree4_sys as sys;
use rayon::prelude::*;

use super::{Accel, Ray};

/// Collects the queries of an [`Accel`].
#[derive(Debug, Default)]
pub(super) struct Recorder(Mutex<Vec<sys::lo_query>>);

impl Recorder {
    /// Adds a query: for any hit, or for the closest one.
    #[cold]
    pub(super) fn add(&self, ray: &Ray, any_hit: bool) {
        let mut queries = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        queries.push(sys::lo_query { ray: ray.to_sys(), any_hit });
    }
}

/// Queries in the order in which they were made.
#[derive(Clone, Default)]
pub struct Tape(Vec<sys::lo_query>);

/// Queries that a thread makes again before it takes others: enough that what it takes to hand them out does
/// not show, few enough that no thread waits for another.
const CHUNK: usize = 16_384;

impl Tape {
    /// Number of queries.
    #[must_use]
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Whether there are no queries.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Number of queries for any hit, as shadow rays are; the others are for the closest one.
    #[must_use]
    pub fn n_any_hit(&self) -> usize {
        self.0.iter().filter(|q| q.any_hit).count()
    }
}

impl Accel {
    /// Records all queries from now on. Those of several threads come in no particular order.
    pub fn record(&mut self) {
        self.recorder = Some(Recorder::default());
    }

    /// Records no more queries, and returns those that were made since [`Self::record`].
    #[must_use]
    pub fn recorded(&mut self) -> Tape {
        let queries = self.recorder.take().map(|r| r.0.into_inner());
        Tape(queries.unwrap_or_else(|| Ok(Vec::new())).unwrap_or_else(PoisonError::into_inner))
    }

    /// Makes all queries of a tape again, in the current rayon pool, and returns how many of them hit: the
    /// bare work of Embree, in a loop that does nothing else.
    #[must_use]
    pub fn replay(&self, tape: &Tape) -> usize {
        let chunk = |queries: &[sys::lo_query]| {
            // SAFETY: `raw` is a committed scene; the slice outlives the call, which checks each ray.
            unsafe { sys::lo_accel_replay(self.raw.as_ptr(), queries.as_ptr(), queries.len()) }
        };
        tape.0.par_chunks(CHUNK).map(chunk).sum()
    }
}
