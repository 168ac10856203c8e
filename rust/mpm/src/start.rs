//! All that a solver needs to go on elsewhere, as bytes: the settings, and the state as a snapshot.
//!
//! Magic, versions of the layout and of the solver, dimension, content as postcard writes it, checksum; little-endian.

use serde::{Deserialize, Serialize};

use crate::error::MpmError;
use crate::initial::Particles;
use crate::linalg::Vector;
use crate::settings::SolverSettings;
use crate::snapshot::{Reader, fnv1a};
use crate::solver::Solver;
use crate::version::SOLVER_VERSION;

const MAGIC: &[u8; 8] = b"HMPMPLAY";
/// Version of the layout of start files.
const START_VERSION: u32 = 1;
/// Magic, both versions, dimension.
const HEADER: usize = 8 + 4 + 4 + 4;
const CHECKSUM: usize = 8;

#[derive(Serialize, Deserialize)]
struct Content<const D: usize> {
    settings: SolverSettings<D>,
    /// Index into the materials of each particle, and number of its body.
    materials: Vec<u8>,
    bodies: Vec<u32>,
    snapshot: Vec<u8>,
}

impl<const D: usize> Solver<D> {
    /// The solver as bytes.
    #[expect(clippy::missing_panics_doc, reason = "every setting can be written")]
    pub fn start(&self) -> Vec<u8> {
        let mut settings = self.settings().clone();
        settings.threads = 1;
        let mut content = Content {
            settings,
            materials: vec![0; self.count()],
            bodies: vec![0; self.count()],
            snapshot: self.snapshot(),
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

    /// The solver that `start` wrote; it goes on with the same bits, on one thread.
    pub fn from_start(data: &[u8]) -> Result<Self, MpmError> {
        check(data, D as u32)?;
        let body = &data[HEADER..data.len() - CHECKSUM];
        let content: Content<D> = postcard::from_bytes(body)
            .map_err(|error| refuse(format!("its content cannot be read: {error}")))?;
        let count = content.materials.len();
        // The snapshot has the state; until it is restored, all particles lie in one place.
        let middle: Vector<D> = (content.settings.walls.lower + content.settings.walls.upper) * 0.5;
        let particles = Particles {
            x: &middle.as_slice().repeat(count),
            v: &vec![0.0; count * D],
            material: &content.materials,
            mass: &vec![1.0; count],
            volume: &vec![1.0; count],
            volume_ratio: None,
            body: Some(&content.bodies),
        };
        let mut solver = Self::new(content.settings, particles)?;
        solver.restore(&content.snapshot)?;
        Ok(solver)
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
