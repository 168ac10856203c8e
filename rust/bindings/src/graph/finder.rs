//! What finds edges, whatever the dimension.

use std::sync::Mutex;

use neighbors::{GraphError, GraphSettings, Search, VerletList};
use threads::Pool;

/// Something that finds the edges first and writes them when there is room.
pub trait Finder: Send + Sync {
    fn radius(&self) -> f32;
    fn find(&mut self, x: &[f32], fixed: Option<&[bool]>, pool: &Pool)
    -> Result<usize, GraphError>;
    fn starts(&self) -> &[u32];
    fn write_senders(&self, into: &mut [u32], pool: &Pool);
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
        // Never waited for: where another call holds the lock, a new search is soon made.
        let spare = SPARE.try_lock().ok();
        let fits = spare.and_then(|mut spare| spare.take_if(|search| search.dim() == dim));
        fits.unwrap_or_else(|| Self::new(dim))
    }

    /// Leaves it for another call.
    pub fn give_back(self) {
        let capacity = either!(&self.dim, search => search.capacity());
        if capacity <= SPARE_EDGES
            && let Ok(mut spare) = SPARE.try_lock()
        {
            *spare = Some(self);
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
        pool: &Pool,
    ) -> Result<usize, GraphError> {
        let settings = &self.settings;
        either!(&mut self.dim, search => search.find(x, fixed, settings, pool))
    }
    fn starts(&self) -> &[u32] {
        either!(&self.dim, search => search.starts())
    }
    fn write_senders(&self, into: &mut [u32], pool: &Pool) {
        either!(&self.dim, search => search.write_senders(into, pool));
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
        pool: &Pool,
    ) -> Result<usize, GraphError> {
        either!(&mut self.dim, list => list.find(x, fixed, pool))
    }
    fn starts(&self) -> &[u32] {
        either!(&self.dim, list => list.starts())
    }
    fn write_senders(&self, into: &mut [u32], pool: &Pool) {
        either!(&self.dim, list => list.write_senders(into, pool));
    }
}
