//! What finds edges, whatever the dimension.

use std::sync::{Arc, Mutex, PoisonError};

use neighbors::{GraphError, GraphSettings, Search, VerletList};
use pyo3::prelude::*;
use team::Team;

use crate::error::config_error;

/// Something that finds the edges first and writes them when there is room.
pub trait Finder: Send + Sync {
    fn radius(&self) -> f32;
    fn find(&mut self, x: &[f32], fixed: Option<&[bool]>, team: &Team)
    -> Result<usize, GraphError>;
    fn starts(&self) -> &[u32];
    fn write_senders(&self, into: &mut [u32], team: &Team);
}

/// A search of each dimension, for one after the other.
pub struct Direct {
    dim: Dimension<Search<2>, Search<3>>,
    settings: GraphSettings,
}

pub enum Dimension<Two, Three> {
    Two(Two),
    Three(Three),
}

impl Direct {
    pub fn new(dim: usize) -> Self {
        Self {
            dim: if dim == 2 {
                Dimension::Two(Search::new())
            } else {
                Dimension::Three(Search::new())
            },
            settings: GraphSettings::new(0.0),
        }
    }

    pub fn set(&mut self, settings: GraphSettings) {
        self.settings = settings;
    }

    pub fn dim(&self) -> usize {
        match self.dim {
            Dimension::Two(_) => 2,
            Dimension::Three(_) => 3,
        }
    }
}

/// Calls the same method in each dimension.
macro_rules! either {
    ($dim:expr, $each:ident => $call:expr) => {
        match $dim {
            Dimension::Two($each) => $call,
            Dimension::Three($each) => $call,
        }
    };
}

/// A search that no graph keeps: to get its memory from the system again would take as long as a small graph does.
static SPARE: Mutex<Option<Direct>> = Mutex::new(None);

/// Most edges that the spare search has memory for.
const SPARE_EDGES: usize = 1 << 23;

impl Direct {
    /// The spare search, or a new one.
    pub fn borrowed(dim: usize) -> Self {
        let mut spare = SPARE.lock().unwrap_or_else(PoisonError::into_inner);
        let fits = spare.take_if(|search| search.dim() == dim);
        fits.unwrap_or_else(|| Self::new(dim))
    }

    /// Leaves it for another call.
    pub fn give_back(self) {
        let capacity = either!(&self.dim, search => search.capacity());
        if capacity <= SPARE_EDGES {
            *SPARE.lock().unwrap_or_else(PoisonError::into_inner) = Some(self);
        }
    }
}

impl Finder for Direct {
    fn radius(&self) -> f32 {
        self.settings.radius
    }
    fn find(
        &mut self,
        x: &[f32],
        fixed: Option<&[bool]>,
        team: &Team,
    ) -> Result<usize, GraphError> {
        let settings = &self.settings;
        either!(&mut self.dim, search => search.find(x, fixed, settings, team))
    }
    fn starts(&self) -> &[u32] {
        either!(&self.dim, search => search.starts())
    }
    fn write_senders(&self, into: &mut [u32], team: &Team) {
        either!(&self.dim, search => search.write_senders(into, team));
    }
}

/// Candidates of one dimension.
pub struct Candidates {
    dim: Dimension<VerletList<2>, VerletList<3>>,
    radius: f32,
}

impl Candidates {
    pub fn new(dim: usize, settings: GraphSettings, skin: f32) -> Result<Self, GraphError> {
        Ok(Self {
            dim: if dim == 2 {
                Dimension::Two(VerletList::new(settings, skin)?)
            } else {
                Dimension::Three(VerletList::new(settings, skin)?)
            },
            radius: settings.radius,
        })
    }

    pub fn dim(&self) -> usize {
        match self.dim {
            Dimension::Two(_) => 2,
            Dimension::Three(_) => 3,
        }
    }

    pub fn rebuilds(&self) -> u64 {
        either!(&self.dim, list => list.rebuilds())
    }
}

impl Finder for Candidates {
    fn radius(&self) -> f32 {
        self.radius
    }
    fn find(
        &mut self,
        x: &[f32],
        fixed: Option<&[bool]>,
        team: &Team,
    ) -> Result<usize, GraphError> {
        either!(&mut self.dim, list => list.find(x, fixed, team))
    }
    fn starts(&self) -> &[u32] {
        either!(&self.dim, list => list.starts())
    }
    fn write_senders(&self, into: &mut [u32], team: &Team) {
        either!(&self.dim, list => list.write_senders(into, team));
    }
}

/// The threads of the latest call that asked for several: starting new ones would take as long as a small graph does.
static TEAM: Mutex<Option<Arc<Team>>> = Mutex::new(None);

/// A team of so many threads. Calls at the same time share it: one has its help, the others work alone.
pub fn team(threads: usize) -> PyResult<Arc<Team>> {
    if threads == 0 {
        return Err(config_error("threads must be at least 1, got 0"));
    }
    let start = || {
        Team::new(threads).map(Arc::new).map_err(|error| {
            config_error(format!(
                "threads must be a number that the system grants: {error}"
            ))
        })
    };
    if threads == 1 {
        return start();
    }
    let mut latest = TEAM.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(team) = latest.as_ref().filter(|team| team.size() == threads) {
        return Ok(Arc::clone(team));
    }
    Ok(Arc::clone(latest.insert(start()?)))
}
