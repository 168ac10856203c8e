//! All that a simulation needs to go on elsewhere, as bytes: settings, and the state as a snapshot.
//!
//! Magic, versions of the layout and of the solver, dimension, content as postcard writes it, checksum; little-endian.

use serde::{Deserialize, Serialize};

use crate::error::MpmError;
use crate::initial::Particles;
use crate::linalg::Vector;
use crate::settings::SolverSettings;
use crate::snapshot::{Reader, fnv1a};
use crate::solver::Solver;
use crate::substep::Substeps;
use crate::upsampling::{CoarseParticles, Upsampler, UpsamplingConstants};
use crate::version::SOLVER_VERSION;

const MAGIC: &[u8; 8] = b"HMPMPLAY";
/// Version of the layout of start files.
const START_VERSION: u32 = 4;
/// Magic, both versions, dimension.
const HEADER: usize = 8 + 4 + 4 + 4;
const CHECKSUM: usize = 8;

/// What a start file contains.
pub struct Start<const D: usize> {
    pub solver: Solver<D>,
    /// The particles that are shown, in coarse mode.
    pub upsampler: Option<Upsampler<D>>,
    /// The solver of the same scene that does a failed frame again, at each material's own step.
    pub safe: Option<Solver<D>>,
}

#[derive(Serialize, Deserialize)]
struct Content<const D: usize> {
    settings: SolverSettings<D>,
    /// Index into the materials of each particle, and number of its body.
    materials: Vec<u8>,
    bodies: Vec<u32>,
    snapshot: Vec<u8>,
    shown: Option<Shown<D>>,
    /// Whether a frame that fails is done again at each material's own step.
    redoes: bool,
}

/// The particles that are shown in coarse mode.
#[derive(Serialize, Deserialize)]
struct Shown<const D: usize> {
    settings: SolverSettings<D>,
    constants: UpsamplingConstants,
    count: usize,
    snapshot: Vec<u8>,
}

impl<const D: usize> Solver<D> {
    /// The solver as bytes, with the particles that it is shown by. `redoes` asks for `Start::safe`.
    #[expect(clippy::missing_panics_doc, reason = "every setting can be written")]
    pub fn start(&self, upsampler: Option<&Upsampler<D>>, redoes: bool) -> Vec<u8> {
        let mut content = Content {
            settings: on_one_thread(self.settings()),
            materials: vec![0; self.count()],
            bodies: vec![0; self.count()],
            snapshot: self.snapshot(),
            shown: upsampler.map(|upsampler| Shown {
                settings: on_one_thread(upsampler.settings()),
                constants: upsampler.constants(),
                count: upsampler.count(),
                snapshot: upsampler.snapshot(),
            }),
            redoes,
        };
        self.write_materials(&mut content.materials);
        self.write_bodies(&mut content.bodies);
        let mut out = MAGIC.to_vec();
        for number in [START_VERSION, SOLVER_VERSION, D as u32] {
            out.extend_from_slice(&number.to_le_bytes());
        }
        let mut out = postcard::to_extend(&content, out).expect("every setting can be written");
        let checksum = fnv1a(&out);
        out.extend_from_slice(&checksum.to_le_bytes());
        out
    }
}

impl<const D: usize> Start<D> {
    /// What `Solver::start` wrote; it goes on with the same bits, on one thread.
    pub fn read(data: &[u8]) -> Result<Self, MpmError> {
        check(data, D as u32)?;
        let body = &data[HEADER..data.len() - CHECKSUM];
        let content: Content<D> = postcard::from_bytes(body)
            .map_err(|error| refuse(format!("its content cannot be read: {error}")))?;
        let grid = (content.settings.resolution, content.settings.cells);
        let placeholder = Placeholder::new(&content.settings, &content.materials);
        let particles = placeholder.particles(&content.materials, Some(&content.bodies));
        let safe = content.redoes.then(|| {
            let substeps = Substeps::Cfl(None);
            Solver::new(
                SolverSettings {
                    substeps,
                    ..content.settings.clone()
                },
                particles,
            )
        });
        let mut solver = Solver::new(content.settings, particles)?;
        solver.restore(&content.snapshot)?;
        let upsampler = content.shown.map(|shown| shown.upsampler(grid));
        Ok(Self {
            solver,
            upsampler: upsampler.transpose()?,
            safe: safe.transpose()?,
        })
    }
}

impl<const D: usize> Shown<D> {
    fn upsampler(&self, coarse_grid: (usize, [usize; D])) -> Result<Upsampler<D>, MpmError> {
        let materials = vec![0; self.count];
        let placeholder = Placeholder::new(&self.settings, &materials);
        let nothing = CoarseParticles {
            ids: &[],
            x: &[],
            affine: None,
            mass: &[],
            rigid: &[],
        };
        let mut upsampler = Upsampler::new(
            &self.settings,
            coarse_grid,
            self.constants,
            placeholder.particles(&materials, None),
            &nothing,
        )?;
        upsampler.restore(&self.snapshot)?;
        Ok(upsampler)
    }
}

/// Particles in one place, until a snapshot is restored.
struct Placeholder {
    x: Vec<f32>,
    v: Vec<f32>,
    ones: Vec<f32>,
}

impl Placeholder {
    fn new<const D: usize>(settings: &SolverSettings<D>, materials: &[u8]) -> Self {
        let middle: Vector<D> = (settings.walls.lower + settings.walls.upper) * 0.5;
        let count = materials.len();
        Self {
            x: middle.as_slice().repeat(count),
            v: vec![0.0; count * D],
            ones: vec![1.0; count],
        }
    }

    fn particles<'a>(&'a self, material: &'a [u8], body: Option<&'a [u32]>) -> Particles<'a> {
        Particles {
            x: &self.x,
            v: &self.v,
            material,
            mass: &self.ones,
            volume: &self.ones,
            volume_ratio: None,
            body,
        }
    }
}

fn on_one_thread<const D: usize>(settings: &SolverSettings<D>) -> SolverSettings<D> {
    SolverSettings {
        threads: 1,
        ..settings.clone()
    }
}

/// Refuses what is no undamaged start file of this version and dimension.
fn check(data: &[u8], dim: u32) -> Result<(), MpmError> {
    if data.len() < HEADER + CHECKSUM || &data[..8] != MAGIC {
        return Err(refuse(
            "these bytes are no start file of hybridmpm, or cut off",
        ));
    }
    let (body, checksum) = data.split_at(data.len() - CHECKSUM);
    let mut reader = Reader { rest: &body[8..] };
    let (version, solver, its_dim) = (reader.u32(), reader.u32(), reader.u32());
    if version != START_VERSION {
        return Err(refuse(format!(
            "it has version {version}, this build reads version {START_VERSION}: write it anew with the hybridmpm \
             that this build belongs to"
        )));
    }
    if fnv1a(body).to_le_bytes() != checksum {
        return Err(refuse(
            "its checksum does not match: it is damaged or cut off",
        ));
    }
    if solver != SOLVER_VERSION {
        return Err(refuse(format!(
            "it was made for version {solver} of the solver and would go on differently with this build's version \
             {SOLVER_VERSION}: write it anew with the hybridmpm that this build belongs to"
        )));
    }
    if its_dim != dim {
        return Err(refuse(format!(
            "it is of a scene in {its_dim}D, and this build plays those in {dim}D"
        )));
    }
    Ok(())
}

fn refuse(reason: impl Into<String>) -> MpmError {
    MpmError::Start {
        reason: reason.into(),
    }
}
