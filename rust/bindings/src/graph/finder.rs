//! A search of either dimension, kept for the next graph.

use std::sync::Mutex;

use neighbors::{GraphError, GraphSettings, Search};
use threads::Pool;

/// A search in 2D or 3D; edges are found first and written once there is memory for them.
pub struct Finder {
    search: Dimension,
    settings: GraphSettings,
}

enum Dimension {
    Two(Search<2>),
    Three(Search<3>),
}

/// Calls the same method in either dimension.
macro_rules! either {
    ($search:expr, $each:ident => $call:expr) => {
        match $search {
            Dimension::Two($each) => $call,
            Dimension::Three($each) => $call,
        }
    };
}

/// A search that belongs to no graph: allocating its memory anew would take as long as finding a small graph.
static SPARE: Mutex<Option<Finder>> = Mutex::new(None);

/// Most edges that the spare search has memory for.
const SPARE_EDGES: usize = 1 << 23;

impl Finder {
    pub fn new(dim: usize) -> Self {
        Self {
            search: if dim == 2 {
                Dimension::Two(Search::new())
            } else {
                Dimension::Three(Search::new())
            },
            settings: GraphSettings::new(0.0),
        }
    }

    /// The spare search, or a new one.
    pub fn borrowed(dim: usize) -> Self {
        // The lock is only tried: a new search is made sooner than another call releases it.
        let spare = SPARE.try_lock().ok();
        let fits = spare.and_then(|mut spare| spare.take_if(|finder| finder.dim() == dim));
        fits.unwrap_or_else(|| Self::new(dim))
    }

    /// Makes this the spare search.
    pub fn give_back(self) {
        let capacity = either!(&self.search, search => search.capacity());
        if capacity <= SPARE_EDGES
            && let Ok(mut spare) = SPARE.try_lock()
        {
            *spare = Some(self);
        }
    }

    pub fn set(&mut self, settings: GraphSettings) {
        self.settings = settings;
    }

    pub fn dim(&self) -> usize {
        match self.search {
            Dimension::Two(_) => 2,
            Dimension::Three(_) => 3,
        }
    }

    pub fn radius(&self) -> f32 {
        self.settings.radius
    }

    pub fn find(
        &mut self,
        x: &[f32],
        fixed: Option<&[bool]>,
        pool: &Pool,
    ) -> Result<usize, GraphError> {
        let settings = &self.settings;
        either!(&mut self.search, search => search.find(x, fixed, settings, pool))
    }

    pub fn starts(&self) -> &[u32] {
        either!(&self.search, search => search.starts())
    }

    pub fn write_senders(&self, into: &mut [u32], pool: &Pool) {
        either!(&self.search, search => search.write_senders(into, pool));
    }
}
