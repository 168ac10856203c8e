//! The safeguard's signal: how alike the accelerations of two successive windows of time are.
//!
//! For particle i with accelerations a_i, c_i = cos(a_i[t-2w : t-w], a_i[t-w : t]), each window flattened to one
//! vector. A step changes each scalar product by one pair that enters and one that leaves, so it costs the same
//! whatever the window. Sums are in double precision: what large numbers leave behind once they have left is
//! far below the noise floor.

mod snapshot;

use thiserror::Error;

/// Partial sums, so that a sum over particles is computed several at a time and always in one order.
const LANES: usize = 8;

/// Why a history could not be made or extended.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum SafeguardError {
    #[error("{name} must be {allowed}, got {value}")]
    Parameter {
        name: &'static str,
        allowed: &'static str,
        value: String,
    },
    #[error("x must have {expected} numbers, those of {particles} particles, got {got}")]
    Length {
        particles: usize,
        expected: usize,
        got: usize,
    },
    #[error("{0}")]
    Snapshot(&'static str),
}

/// Signal of the latest accelerations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Signal {
    /// Mean cosine over the active particles, those not calm in both windows; 1 where these are too few, None until both
    /// windows are full.
    pub cosine: Option<f32>,
    /// Mean cosine over all particles, 0 for one without acceleration; None until both windows are full.
    pub plain: Option<f32>,
    /// Share of the particles that are active [-].
    pub active: f32,
    /// Power mean of order 4 of the latest accelerations, which the largest dominate [m/s^2]; 0 before there are any.
    pub largest: f32,
}

/// Size of a history, and thresholds for calm particles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HistorySettings {
    pub particles: usize,
    /// D, 2 or 3.
    pub dim: usize,
    /// Accelerations in each of the two windows, w.
    pub window: usize,
    /// Time between two positions [s].
    pub dt: f32,
    /// Root mean square acceleration that a calm particle exceeds in neither window [m/s^2].
    pub calm_acceleration: f32,
    /// Share of the particles that must not be calm for the scene to count as active [-].
    pub min_active_share: f32,
}

/// Scalar products of the two windows of each particle.
#[derive(Debug, Clone, Default)]
struct Products {
    /// Product of the older with the newer window.
    across: Vec<f64>,
    older: Vec<f64>,
    newer: Vec<f64>,
}

impl Products {
    fn zeros(count: usize) -> Self {
        Self {
            across: vec![0.0; count],
            older: vec![0.0; count],
            newer: vec![0.0; count],
        }
    }
}

/// Accelerations of the last two windows, from positions that are pushed one after the other.
///
/// Vectors are kept axis by axis, and as many zeros behind the particles as fill the last lanes.
#[derive(Debug, Clone)]
pub struct AccelerationHistory {
    settings: HistorySettings,
    /// Numbers of one axis, those behind the particles included.
    stride: usize,
    /// Positions pushed so far.
    pushed: usize,
    /// The last two positions, then the one that an undo would need.
    positions: [Vec<f32>; 3],
    /// 2 w accelerations, the oldest of which the next one replaces.
    ring: Vec<Vec<f32>>,
    /// Acceleration that the latest one replaced.
    replaced: Vec<f32>,
    products: Products,
    /// Products before the latest step.
    before: Products,
    undoable: bool,
}

impl AccelerationHistory {
    pub fn new(settings: HistorySettings) -> Result<Self, SafeguardError> {
        let HistorySettings {
            particles,
            dim,
            window,
            dt,
            calm_acceleration,
            min_active_share,
        } = settings;
        let refuse = |name, allowed, value: String| {
            Err(SafeguardError::Parameter {
                name,
                allowed,
                value,
            })
        };
        if !(2..=3).contains(&dim) {
            return refuse("dim", "2 or 3", dim.to_string());
        }
        if !(1..=1000).contains(&window) {
            return refuse("window", "in [1, 1000]", window.to_string());
        }
        if !(dt > 0.0 && dt.is_finite()) {
            return refuse("dt", "finite and > 0 s", dt.to_string());
        }
        if !(calm_acceleration >= 0.0 && calm_acceleration.is_finite()) {
            return refuse(
                "calm_acceleration",
                "finite and >= 0 m/s^2",
                calm_acceleration.to_string(),
            );
        }
        if !(0.0..=1.0).contains(&min_active_share) {
            return refuse(
                "min_active_share",
                "in [0, 1]",
                min_active_share.to_string(),
            );
        }
        let stride = particles.next_multiple_of(LANES);
        let size = stride * dim;
        Ok(Self {
            settings,
            stride,
            pushed: 0,
            positions: std::array::from_fn(|_| vec![0.0; size]),
            ring: vec![vec![0.0; size]; 2 * window],
            replaced: vec![0.0; size],
            products: Products::zeros(stride),
            before: Products::zeros(stride),
            undoable: false,
        })
    }

    pub fn settings(&self) -> &HistorySettings {
        &self.settings
    }

    /// Whether both windows are full.
    pub fn is_full(&self) -> bool {
        self.pushed >= 2 * self.settings.window + 2
    }

    /// Takes the next positions, N x D numbers [m].
    pub fn push(&mut self, x: &[f32]) -> Result<Signal, SafeguardError> {
        let HistorySettings { particles, dim, .. } = self.settings;
        if x.len() != particles * dim {
            return Err(SafeguardError::Length {
                particles,
                expected: particles * dim,
                got: x.len(),
            });
        }
        self.positions.rotate_right(1);
        for (axis, latest) in self.positions[0]
            .chunks_exact_mut(self.stride.max(1))
            .enumerate()
        {
            for (latest, x) in latest.iter_mut().zip(x.chunks_exact(dim)) {
                *latest = x[axis];
            }
        }
        if self.pushed >= 2 {
            self.accelerate();
        }
        self.pushed += 1;
        self.undoable = true;
        Ok(self.signal())
    }

    /// Takes the latest push back; only one can be. False where there is none.
    pub fn undo(&mut self) -> bool {
        if !self.undoable {
            return false;
        }
        self.undoable = false;
        self.pushed -= 1;
        self.positions.rotate_left(1);
        if self.pushed >= 2 {
            let slot = self.slot(0);
            std::mem::swap(&mut self.ring[slot], &mut self.replaced);
            std::mem::swap(&mut self.products, &mut self.before);
        }
        true
    }

    /// Place in the ring of the acceleration that the next position gives, `ago` steps before.
    fn slot(&self, ago: usize) -> usize {
        let length = self.ring.len();
        (self.pushed - 2 + length - ago) % length
    }

    /// Puts the acceleration between the last three positions into the ring, and updates the products.
    fn accelerate(&mut self) {
        let (newest, middle) = (self.slot(0), self.slot(self.settings.window));
        std::mem::swap(&mut self.replaced, &mut self.ring[newest]);
        std::mem::swap(&mut self.products, &mut self.before);
        let [acceleration, middle] = self
            .ring
            .get_disjoint_mut([newest, middle])
            .expect("two slots of a ring of 2 w");
        let per_square = 1.0 / (self.settings.dt * self.settings.dt);
        let [x, latest, earlier] = &self.positions;
        for (((a, x), latest), earlier) in acceleration.iter_mut().zip(x).zip(latest).zip(earlier) {
            *a = ((x - latest) - (latest - earlier)) * per_square;
        }
        let (products, before) = (&mut self.products, &self.before);
        products.across.copy_from_slice(&before.across);
        products.older.copy_from_slice(&before.older);
        products.newer.copy_from_slice(&before.newer);
        let stride = self.stride.max(1);
        let axes = acceleration
            .chunks_exact(stride)
            .zip(middle.chunks_exact(stride))
            .zip(self.replaced.chunks_exact(stride));
        for ((enters, passes), leaves) in axes {
            let sums = products
                .across
                .iter_mut()
                .zip(&mut products.older)
                .zip(&mut products.newer);
            let vectors = enters.iter().zip(passes).zip(leaves);
            for (((across, older), newer), ((&enters, &passes), &leaves)) in sums.zip(vectors) {
                let [enters, passes, leaves] = [enters, passes, leaves].map(f64::from);
                *across += passes * enters - leaves * passes;
                *older += passes * passes - leaves * leaves;
                *newer += enters * enters - passes * passes;
            }
        }
    }

    fn signal(&self) -> Signal {
        let HistorySettings {
            particles,
            window,
            calm_acceleration,
            min_active_share,
            ..
        } = self.settings;
        let threshold = calm_acceleration * calm_acceleration * window as f32;
        let mut plain = [0.0f32; LANES];
        let mut moving = [0.0f32; LANES];
        let mut active = [0.0f32; LANES];
        let Products {
            across,
            older,
            newer,
        } = &self.products;
        let blocks = across
            .as_chunks::<LANES>()
            .0
            .iter()
            .zip(older.as_chunks::<LANES>().0)
            .zip(newer.as_chunks::<LANES>().0);
        for ((across, older), newer) in blocks {
            for i in 0..LANES {
                // Rounding may turn a zero into a small negative number.
                let (o, n) = (older[i].max(0.0) as f32, newer[i].max(0.0) as f32);
                let length = o.sqrt() * n.sqrt();
                let ratio = across[i] as f32 / if length > 0.0 { length } else { 1.0 };
                let cosine = if length > 0.0 {
                    ratio.clamp(-1.0, 1.0)
                } else {
                    0.0
                };
                let awake = if (o > threshold) | (n > threshold) {
                    1.0
                } else {
                    0.0
                };
                plain[i] += cosine;
                moving[i] += cosine * awake;
                active[i] += awake;
            }
        }
        let count = particles.max(1) as f64;
        let total = |lanes: [f32; LANES]| lanes.iter().copied().map(f64::from).sum::<f64>();
        let (active, full) = (total(active), self.is_full());
        let cosine = if active / count >= f64::from(min_active_share) && active > 0.0 {
            total(moving) / active
        } else {
            1.0
        };
        Signal {
            cosine: full.then_some(cosine as f32),
            plain: full.then_some((total(plain) / count) as f32),
            active: (active / count) as f32,
            largest: self.largest(),
        }
    }

    fn largest(&self) -> f32 {
        let HistorySettings { particles, dim, .. } = self.settings;
        if self.pushed < 3 || particles == 0 {
            return 0.0;
        }
        let a = &self.ring[(self.pushed - 3) % self.ring.len()];
        let mut sums = [0.0f32; LANES];
        for start in (0..self.stride).step_by(LANES) {
            let mut squares = [0.0f32; LANES];
            for axis in 0..dim {
                let block = &a[axis * self.stride + start..][..LANES];
                for i in 0..LANES {
                    squares[i] += block[i] * block[i];
                }
            }
            for i in 0..LANES {
                sums[i] += squares[i] * squares[i];
            }
        }
        let sum: f64 = sums.iter().copied().map(f64::from).sum();
        (sum / particles as f64).sqrt().sqrt() as f32
    }
}

#[cfg(test)]
mod tests;
