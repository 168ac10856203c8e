//! The stages of a substep, slab by slab on several threads.

use std::ops::Range;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

use super::g2p::{Nodes, Outcome, OwnView, Solids, Time, g2p};
use super::grid_update::{GridForces, accelerate_nodes, act_by_walls, grid_update};
use super::p2g::{Own, P2gStep, p2g};
use crate::boundary::{Bounds, ContactNodes, Reactions};
use crate::grid::{FieldView, FieldWindow, Grid, View, Window};
use crate::linalg::exp;
use crate::material::Constitutive;
use crate::particles::{
    COLOURS, CutGroup, MaterialGroup, Slab, bands, fresh_planes, unlocked, with_group,
};
use threads::{Step, Team, interrupted};

/// A part of a substep.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    P2g,
    /// Finds the directions of contact between bodies. Without this stage all bodies share one field.
    Slopes,
    /// The first part of the next stage, where there are rigid bodies.
    Accelerate,
    /// Finds what rigid bodies are about to meet.
    Probe,
    GridUpdate,
    /// Contact on lines of nodes along the first axis, which cross planes. Without obstacles it is part of the one before.
    Across,
    G2p,
}

impl Stage {
    pub const ALL: [Self; 5] = [
        Self::P2g,
        Self::Slopes,
        Self::GridUpdate,
        Self::Across,
        Self::G2p,
    ];

    /// With rigid bodies: up to what they are about to meet, and the rest.
    pub const TO_BODIES: [Self; 4] = [Self::P2g, Self::Slopes, Self::Accelerate, Self::Probe];
    pub const FROM_BODIES: [Self; 3] = [Self::GridUpdate, Self::Across, Self::G2p];

    /// The slabs that may go through it side by side, turn after turn. In G2P half of each takes its turn where there are
    /// few: threads wait less for the last.
    fn steps(self, slabs: usize) -> &'static [Step] {
        match self {
            Self::P2g | Self::Probe | Self::Across => &COLOURS,
            Self::G2p if slabs < FEW_SLABS => &[Step::ALL; 2],
            Self::Slopes | Self::Accelerate | Self::GridUpdate | Self::G2p => &[Step::ALL],
        }
    }
}

/// Fewer slabs are halved.
const FEW_SLABS: usize = 8;

/// From this number of particles on a stage takes so long that it may be interrupted between two slabs.
const MANY_PARTICLES: usize = 1 << 16;

/// Whether slabs should be left out, because the work of the thread that called for all of them is interrupted.
pub struct Interruption {
    is_long: bool,
    found: AtomicBool,
}

impl Interruption {
    pub fn new<const D: usize>(groups: &[MaterialGroup<D>]) -> Self {
        let count = |group: &MaterialGroup<D>| with_group!(group, group => group.len());
        Self {
            is_long: groups.iter().map(count).sum::<usize>() >= MANY_PARTICLES,
            found: AtomicBool::new(false),
        }
    }

    /// Whether it has been found, by this thread or another.
    pub fn is_found(&self) -> bool {
        if self.is_long && !self.found.load(Ordering::Relaxed) && interrupted() {
            self.found.store(true, Ordering::Relaxed);
        }
        self.found.load(Ordering::Relaxed)
    }
}

/// Largest exponent of what is lost in a substep, for which `exp` is exact.
const MOST_LOST: f32 = 80.0;
/// Smaller shares of a deviation are not kept.
const SMALLEST_SHARE: f32 = 1.0e-6;

/// Inputs of a substep besides particles and grid.
pub struct Substep<'a, const D: usize> {
    pub step: P2gStep<'a, D>,
    pub forces: GridForces<'a, D>,
    pub bounds: &'a Bounds<D>,
    /// Rate at which particles lose their deviations from the grid [1/s], where velocities before forces are kept.
    pub transfer_loss: f32,
    /// Whether obstacles or the order of particles are new.
    pub is_new: bool,
}

impl<const D: usize> Substep<'_, D> {
    fn time(&self) -> Time {
        let dt = self.step.dt;
        let kept = exp(-(self.transfer_loss * dt).min(MOST_LOST));
        Time {
            dt,
            // Smaller shares would lead to subnormal numbers, which are slow.
            kept: if kept > SMALLEST_SHARE { kept } else { 0.0 },
        }
    }

    /// Runs consecutive stages on sorted particles and the grid.
    ///
    /// A slab enters a stage when it and its two neighbours have finished the one before: it touches planes of these only.
    /// Slabs further away are not waited for. Each slab adds to reactions of its own.
    pub fn run(
        &self,
        stages: &[Stage],
        groups: &mut [MaterialGroup<D>],
        slabs: &[Slab],
        grid: &mut Grid<D>,
        reactions: &mut [Reactions<D>],
        team: &Team,
    ) -> Outcome {
        let bands = bands(slabs, grid.layout.planes());
        let meets = stages.contains(&Stage::Slopes) || !stages.contains(&Stage::P2g);
        let meet = grid.fields.meet() && meets;
        let across = self.forces.obstacles.act_across();
        let stages = stages.iter().filter(|stage| match stage {
            Stage::Slopes => meet,
            Stage::Across => across,
            _ => true,
        });
        let grid = grid.shared();
        let interruption = Interruption::new(groups);
        let groups: Vec<_> = groups.iter_mut().map(cut).collect();
        let outcomes: Vec<_> = slabs.iter().map(|_| Mutex::new(Outcome::NOTHING)).collect();
        let reactions: Vec<_> = reactions.iter_mut().map(Mutex::new).collect();
        let of_stage = |stage: Stage| {
            let steps = stage.steps(slabs.len());
            let numbered = steps.iter().enumerate();
            numbered.map(move |(turn, &step)| ((stage, turn, steps.len()), step))
        };
        let (stages, steps): (Vec<_>, Vec<_>) = stages.copied().flat_map(of_stage).unzip();
        let costs: Vec<_> = slabs.iter().map(|slab| slab.cost).collect();
        team.in_steps(&costs, &steps, |number, slab| {
            if interruption.is_found() {
                return;
            }
            let reach = slabs[slab].reach();
            // The planes within reach belong to the slab and its neighbours.
            match stages[number] {
                (Stage::P2g, ..) => {
                    // SAFETY: concurrent slabs have one colour, and so no plane in common.
                    let window = &mut unsafe { grid.window(reach.clone()) };
                    window.clear(fresh_planes(slabs, slab));
                    // SAFETY: as above.
                    let mut fields = meet.then(|| unsafe { grid.fields.window(reach) });
                    if let Some(fields) = &mut fields {
                        fields.clear(fresh_planes(slabs, slab));
                    }
                    for group in &groups {
                        group.p2g(slab, window, fields.as_mut(), self.step);
                    }
                }
                (Stage::Slopes, ..) => {
                    let band = bands[slab].clone();
                    let around = band.start.saturating_sub(1)..band.end + 1;
                    // SAFETY: bands of slabs are disjoint.
                    let slopes = unsafe { grid.fields.slopes(band) };
                    // SAFETY: all slabs in reach only read nodes in this stage.
                    let view = unsafe { grid.view(around.clone()) };
                    // SAFETY: as above.
                    let fields = unsafe { grid.fields.view(around) };
                    self.forces.meeting.find_slopes(slopes, view, fields);
                }
                (Stage::Accelerate, ..) => {
                    // SAFETY: bands of slabs are disjoint.
                    let window = &mut unsafe { grid.window(bands[slab].clone()) };
                    // SAFETY: as above; no slab is thinner than what lies around, and neighbours have written their slopes.
                    let fields = meet.then(|| unsafe { grid.fields.meeting(bands[slab].clone()) });
                    accelerate_nodes(window, &mut { fields }, grid.fields.map(), &self.forces);
                }
                (Stage::GridUpdate, ..) => {
                    let band = bands[slab].clone();
                    let mut nodes = ContactNodes {
                        // SAFETY: bands of slabs are disjoint.
                        window: unsafe { grid.window(band.clone()) },
                        // SAFETY: as above; no slab is thinner than what lies around, and neighbours have written their slopes.
                        fields: meet.then(|| unsafe { grid.fields.meeting(band) }),
                        kinds: grid.fields.map(),
                        friction: &self.forces.material_friction,
                        reactions: &mut unlocked(&reactions[slab]),
                    };
                    let work = grid_update(&mut nodes, &self.forces);
                    unlocked(&outcomes[slab]).obstacle_work += work;
                }
                (stage @ (Stage::Probe | Stage::Across), ..) => {
                    let band = bands[slab].clone();
                    let planes = [planes_across(&bands, slab), band.clone()];
                    let reach = reach.start..reach.end.max(band.end);
                    let mut nodes = ContactNodes {
                        // SAFETY: concurrent slabs have one colour, and so no plane in common.
                        window: unsafe { grid.window(reach.clone()) },
                        // SAFETY: as above.
                        fields: meet.then(|| unsafe { grid.fields.window(reach) }),
                        kinds: grid.fields.map(),
                        friction: &self.forces.material_friction,
                        reactions: &mut unlocked(&reactions[slab]),
                    };
                    let obstacles = self.forces.obstacles;
                    if stage == Stage::Probe {
                        obstacles.probe(&mut nodes, planes);
                        return;
                    }
                    let work = obstacles.apply_across(&mut nodes, planes);
                    unlocked(&outcomes[slab]).obstacle_work += work;
                    // SAFETY: as above, and the windows before are no longer in use.
                    nodes.window = unsafe { grid.window(band.clone()) };
                    // SAFETY: as above.
                    nodes.fields = meet.then(|| unsafe { grid.fields.window(band) });
                    act_by_walls(&mut nodes, &self.forces, &[true]);
                }
                (Stage::G2p, part, parts) => {
                    // SAFETY: all slabs in reach only read in this stage.
                    let view = unsafe { grid.view(reach.clone()) };
                    // SAFETY: as above.
                    let fields = meet.then(|| unsafe { grid.fields.view(reach) });
                    let outcome = &mut *unlocked(&outcomes[slab]);
                    let reactions = &mut unlocked(&reactions[slab]);
                    let part = (part, parts);
                    for group in &groups {
                        let found = group.g2p(slab, part, view, fields, self, reactions);
                        *outcome = outcome.and(found);
                    }
                }
            }
        });
        // In the order of the slabs, on which the sum of the work depends.
        let outcomes = outcomes.iter().map(|outcome| *unlocked(outcome));
        outcomes.fold(Outcome::NOTHING, Outcome::and)
    }
}

/// The planes at which lines begin that a slab treats in a stage across planes: one later, so that their nodes are within reach.
fn planes_across(bands: &[Range<usize>], slab: usize) -> Range<usize> {
    let band = &bands[slab];
    let last = slab + 1 == bands.len();
    let start = if slab == 0 { 0 } else { band.start + 1 };
    start..if last { band.end } else { band.end + 1 }
}

/// A group of any material, cut into slabs.
trait Cut<const D: usize>: Sync {
    fn p2g(
        &self,
        slab: usize,
        window: &mut Window<'_, D>,
        fields: Option<&mut FieldWindow<'_, D>>,
        step: P2gStep<'_, D>,
    );
    /// For one of `parts` parts of the slab.
    fn g2p(
        &self,
        slab: usize,
        part: (usize, usize),
        grid: View<'_, D>,
        fields: Option<FieldView<'_, D>>,
        substep: &Substep<'_, D>,
        reactions: &mut Reactions<D>,
    ) -> Outcome;
}

fn cut<const D: usize>(group: &mut MaterialGroup<D>) -> Box<dyn Cut<D> + '_> {
    with_group!(group, group => Box::new(CutGroup::of(group)))
}

impl<const D: usize, M: Constitutive<D>> Cut<D> for CutGroup<'_, D, M> {
    fn p2g(
        &self,
        slab: usize,
        window: &mut Window<'_, D>,
        fields: Option<&mut FieldWindow<'_, D>>,
        step: P2gStep<'_, D>,
    ) {
        // Most slabs have no slots, and are quicker without.
        let mut fields = fields.filter(|fields| !fields.slots.is_empty());
        for blocks in [&**self.awake(slab), self.border(slab)] {
            let own = fields.as_deref_mut().map(|fields| Own {
                fields,
                field: self.field,
            });
            p2g(blocks, self.material, self.wall_friction, window, own, step);
        }
    }

    fn g2p(
        &self,
        slab: usize,
        (part, parts): (usize, usize),
        grid: View<'_, D>,
        fields: Option<FieldView<'_, D>>,
        substep: &Substep<'_, D>,
        reactions: &mut Reactions<D>,
    ) -> Outcome {
        let solids = Solids {
            bounds: substep.bounds,
            obstacles: substep.forces.obstacles,
            are_new: substep.is_new,
        };
        let awake = &mut self.awake(slab);
        let cut = |part: usize| part * awake.len() / parts;
        let range = cut(part)..cut(part + 1);
        let blocks = &mut awake[range];
        let (material, friction) = (self.material, self.wall_friction);
        let fields = fields.filter(|fields| !fields.nodes.is_empty());
        let own = fields.map(|fields| OwnView {
            fields,
            field: self.field,
        });
        g2p(
            blocks,
            material,
            friction,
            Nodes { grid, own },
            solids,
            reactions,
            substep.time(),
        )
    }
}
