//! A simulation, and the memory for what a page reads.

use guidance::{Followed, Present, Push};
use mpm::{CoarseParticles, Force, MpmError, Pull, Solver, Start, Upsampler, Vector};
use sha2::{Digest, Sha256};

use crate::dimension::D;
#[cfg(not(feature = "space"))]
use crate::drawing::{Drawing, State};

/// What a page reads of all particles.
#[derive(Clone, Copy)]
pub enum Quantity {
    Positions,
    Velocities,
    Masses,
    /// Of the particles that are simulated, which in coarse mode are fewer than those shown.
    SimulatedPositions,
    Pressures,
    VolumeRatios,
}

/// One simulation.
pub struct Player {
    solver: Solver<D>,
    upsampler: Option<Upsampler<D>>,
    /// The solver that does failed frames again.
    safe: Option<Solver<D>>,
    /// The pull of the frame in progress, for that one.
    pulled: Option<Pull<D>>,
    following: Option<Followed<D>>,
    numbers: Vec<f32>,
    doubles: Vec<f64>,
    bytes: Vec<u8>,
}

/// The particles that are simulated, as the upsampler takes them.
struct Simulated {
    x: Vec<f32>,
    affine: Vec<f32>,
    mass: Vec<f32>,
    rigid: Vec<[f64; 13]>,
}

impl Simulated {
    fn of(solver: &Solver<D>) -> Self {
        let count = solver.count();
        let mut found = Self {
            x: vec![0.0; count * D],
            affine: vec![0.0; count * D * D],
            mass: vec![0.0; count],
            rigid: solver.rigid().collect(),
        };
        solver.write_positions(&mut found.x);
        solver.write_affine(&mut found.affine);
        solver.write_masses(&mut found.mass);
        found
    }

    fn particles<'a>(&'a self, solver: &'a Solver<D>) -> CoarseParticles<'a> {
        CoarseParticles {
            ids: solver.ids(),
            x: &self.x,
            affine: Some(&self.affine),
            mass: &self.mass,
            rigid: &self.rigid,
        }
    }
}

impl Player {
    pub fn open(data: &[u8]) -> Result<Self, MpmError> {
        let start = Start::read(data)?;
        Ok(Self {
            solver: start.solver,
            upsampler: start.upsampler,
            safe: start.safe,
            pulled: None,
            following: None,
            numbers: Vec::new(),
            doubles: Vec::new(),
            bytes: Vec::new(),
        })
    }

    /// Lets particles follow ways from now on.
    pub fn follow(&mut self, data: &[u8]) -> Result<(), String> {
        self.following = Some(Followed::read(data).map_err(|error| error.to_string())?);
        Ok(())
    }

    /// Lets the fluid fill an outline or follow an arrow from now on.
    #[cfg(not(feature = "space"))]
    pub fn draw(&mut self, drawing: Drawing) -> Result<(), String> {
        let reason = |error: MpmError| error.to_string();
        let x = self.read(Quantity::Positions).map_err(reason)?.to_vec();
        let v = self.read(Quantity::Velocities).map_err(reason)?.to_vec();
        let mass = self.read(Quantity::Masses).map_err(reason)?.to_vec();
        let obstacles = &self.solver.settings().obstacles;
        let placed: Vec<_> = obstacles.iter().map(|one| one.at(self.time())).collect();
        let distance = |x: &[f64; D]| {
            let x = Vector::from_fn(|axis, _| x[axis] as f32);
            let away = placed.iter().map(|one| f64::from(one.distance(&x)));
            away.fold(f64::INFINITY, f64::min)
        };
        let state = State {
            frame: self.frame(),
            present: Present {
                ids: self.ids(),
                x: x.as_chunks().0,
                v: v.as_chunks().0,
            },
            mass: &mass,
        };
        let followed = drawing.followed(state, |points| points.iter().map(distance).collect())?;
        self.following = Some(followed);
        Ok(())
    }

    /// Number of particles that are shown.
    pub fn count(&self) -> usize {
        self.ids().len()
    }

    /// Number of particles that are simulated.
    pub fn simulated(&self) -> usize {
        self.solver.count()
    }

    /// Permanent numbers of the particles that are shown, ascending.
    pub fn ids(&self) -> &[u64] {
        match &self.upsampler {
            Some(upsampler) => upsampler.ids(),
            None => self.solver.ids(),
        }
    }

    pub fn frame(&self) -> u64 {
        self.solver.frame()
    }

    pub fn frame_dt(&self) -> f32 {
        self.solver.settings().frame_dt
    }

    /// Advances by frames. `hand` is empty, or a hand that pushes: its point, its velocity, its radius and the largest
    /// acceleration [g]; or one that pulls: the number of a rigid body, grip, target, reach and strength.
    pub fn advance(&mut self, frames: usize, hand: &[f64]) -> Result<(), String> {
        if let Some([body, numbers @ ..]) = hand.first_chunk::<{ 2 * D + 3 }>() {
            let vector = |first| Vector::from_fn(|axis, _| numbers[first + axis] as f32);
            let pull = Pull {
                body: *body as usize,
                grip: vector(0),
                target: vector(D),
                reach: numbers[2 * D] as f32,
                strength: numbers[2 * D + 1] as f32,
            };
            return self.advance_pulled(frames, pull);
        }
        let push = match hand.first_chunk::<{ 2 * D + 2 }>() {
            None => None,
            Some(hand) => {
                let vector = |first| std::array::from_fn(|axis| hand[first + axis]);
                let push = Push::new(vector(0), vector(D), hand[2 * D], hand[2 * D + 1]);
                Some(push.map_err(|error| error.to_string())?)
            }
        };
        for _ in 0..frames {
            let force = self.force(push.as_ref())?;
            self.advance_forced(force.as_deref())
                .map_err(|error| error.to_string())?;
        }
        Ok(())
    }

    fn advance_pulled(&mut self, frames: usize, pull: Pull<D>) -> Result<(), String> {
        for _ in 0..frames {
            let force = self.force(None)?;
            self.pulled = Some(pull);
            let pulled = self.solver.pull(pull);
            let done = pulled.and_then(|()| self.advance_forced(force.as_deref()));
            self.pulled = None;
            done.map_err(|error| error.to_string())?;
        }
        Ok(())
    }

    fn advance_forced(&mut self, force: Option<&[f32]>) -> Result<(), MpmError> {
        match (force, &mut self.upsampler) {
            (None, _) => self.advance_frame(Force::None)?,
            (Some(force), None) => self.advance_frame(Force::Held(force))?,
            (Some(force), Some(upsampler)) => {
                let gathered = upsampler.gather_force(force)?;
                self.advance_frame(Force::Held(&gathered))?;
            }
        }
        self.update_shown()
    }

    /// Accelerations of the particles that are shown, of ways and hand together; None where there are neither.
    fn force(&mut self, push: Option<&Push<D>>) -> Result<Option<Vec<f32>>, String> {
        if push.is_none() && self.following.is_none() {
            return Ok(None);
        }
        let read = |player: &mut Self, quantity| match player.read(quantity) {
            Ok(numbers) => Ok(numbers.as_chunks::<D>().0.to_vec()),
            Err(error) => Err(error.to_string()),
        };
        let x = read(self, Quantity::Positions)?;
        let v = read(self, Quantity::Velocities)?;
        let frame = self.frame();
        let mut force = None;
        if let Some(mut following) = self.following.take() {
            let (ids, x, v) = (self.ids(), &x[..], &v[..]);
            let led = following.force(frame, Present { ids, x, v });
            self.following = Some(following);
            force = led.map_err(|error| error.to_string())?;
        }
        if let Some(push) = push {
            let all = force.get_or_insert_with(|| vec![[0.0; D]; x.len()]);
            push.add_to(all, &x, &v, self.frame_dt());
        }
        Ok(force.map(Vec::into_flattened))
    }

    /// Advances the particles that are simulated; as the library does, a frame that fails at a coarse level's step is
    /// done again at the safe one.
    fn advance_frame(&mut self, force: Force<'_>) -> Result<(), MpmError> {
        match (self.solver.advance(1, force, |_, _| ()), &mut self.safe) {
            (Err(_), Some(safe)) => {
                safe.restore(&self.solver.snapshot())?;
                if let Some(pull) = self.pulled {
                    safe.pull(pull)?;
                }
                safe.advance(1, force, |_, _| ())?;
                self.solver.restore(&safe.snapshot())
            }
            (done, _) => done,
        }
    }

    fn update_shown(&mut self) -> Result<(), MpmError> {
        let (solver, frame) = (&self.solver, self.solver.frame());
        match &mut self.upsampler {
            Some(shown) if frame.is_multiple_of(shown.every()) && frame > shown.frame() => {
                shown.update(&Simulated::of(solver).particles(solver), frame)
            }
            _ => Ok(()),
        }
    }

    pub fn read(&mut self, quantity: Quantity) -> Result<&[f32], MpmError> {
        let length = match quantity {
            Quantity::Positions | Quantity::Velocities => self.count() * D,
            Quantity::Masses => self.count(),
            Quantity::SimulatedPositions => self.simulated() * D,
            Quantity::Pressures | Quantity::VolumeRatios => self.simulated(),
        };
        self.numbers.resize(length, 0.0);
        let (solver, out) = (&self.solver, &mut self.numbers[..]);
        let frame = solver.frame();
        match (quantity, &mut self.upsampler) {
            (Quantity::Positions, Some(shown)) => {
                shown.write_positions(&Simulated::of(solver).particles(solver), frame, out)?;
            }
            (Quantity::Velocities, Some(shown)) => {
                let mut v = vec![0.0; solver.count() * D];
                solver.write_velocities(&mut v);
                let simulated = Simulated::of(solver);
                shown.write_velocities(&simulated.particles(solver), &v, frame, out)?;
            }
            (Quantity::Masses, Some(shown)) => shown.write_masses(out),
            (Quantity::Positions | Quantity::SimulatedPositions, _) => solver.write_positions(out),
            (Quantity::Velocities, None) => solver.write_velocities(out),
            (Quantity::Masses, None) => solver.write_masses(out),
            (Quantity::Pressures, _) => solver.write_pressures(out),
            (Quantity::VolumeRatios, _) => solver.write_volume_ratios(out),
        }
        Ok(&self.numbers)
    }

    /// Where points of an obstacle at time 0 are now; those of an obstacle that does not exist stay.
    pub fn moved(&mut self, obstacle: usize, points: &[f32]) -> &[f32] {
        let placed = self.solver.settings().obstacles.get(obstacle);
        let placed = placed.map(|obstacle| obstacle.at(self.time()));
        self.numbers.clear();
        for point in points.chunks_exact(D) {
            let point = Vector::from_column_slice(point);
            let now = placed.map_or(point, |placed| placed.moved(&point));
            self.numbers.extend_from_slice(now.as_slice());
        }
        &self.numbers
    }

    /// Signed distance of points from the nearest obstacle, where that is now [m]; infinite without obstacles.
    pub fn distances(&mut self, points: &[f32]) -> &[f32] {
        let obstacles = &self.solver.settings().obstacles;
        let placed: Vec<_> = obstacles.iter().map(|one| one.at(self.time())).collect();
        self.numbers.clear();
        for point in points.chunks_exact(D) {
            let point = Vector::from_column_slice(point);
            let distances = placed.iter().map(|one| one.distance(&point));
            self.numbers.push(distances.fold(f32::INFINITY, f32::min));
        }
        &self.numbers
    }

    pub fn rigid_count(&self) -> usize {
        self.solver.settings().rigid.len()
    }

    /// 13 numbers of each rigid body, as `Solver::rigid` has them.
    pub fn rigid(&mut self) -> &[f64] {
        self.doubles.clear();
        self.doubles.extend(self.solver.rigid().flatten());
        &self.doubles
    }

    fn time(&self) -> f64 {
        self.frame() as f64 * f64::from(self.frame_dt())
    }

    /// Mean force and torque on each wall and obstacle over the latest frame; none before the first call and frame.
    pub fn forces(&mut self) -> &[f64] {
        self.solver.keep_forces();
        if let Some(safe) = &mut self.safe {
            safe.keep_forces();
        }
        let solver = match &self.safe {
            Some(safe) if safe.frame() == self.frame() => safe,
            _ => &self.solver,
        };
        self.doubles = solver
            .last_frame()
            .map_or_else(Vec::new, |frame| frame.forces);
        &self.doubles
    }

    pub fn materials(&mut self) -> &[u8] {
        self.bytes.resize(self.count(), 0);
        match &self.upsampler {
            Some(upsampler) => upsampler.write_materials(&mut self.bytes),
            None => self.solver.write_materials(&mut self.bytes),
        }
        &self.bytes
    }

    pub fn digest(&mut self) -> Result<&[u8], MpmError> {
        let mut hash = Sha256::new();
        for id in self.ids() {
            hash.update(id.to_le_bytes());
        }
        for quantity in [Quantity::Positions, Quantity::Velocities] {
            for number in self.read(quantity)? {
                hash.update(number.to_le_bytes());
            }
        }
        for number in self.solver.rigid().flatten() {
            hash.update(number.to_le_bytes());
        }
        self.bytes = hash.finalize().to_vec();
        Ok(&self.bytes)
    }
}
