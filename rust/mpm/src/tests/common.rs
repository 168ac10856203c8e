//! Scenes for the tests: lattices of particles in the default box.

use crate::{
    Contact, ContactKind, Force, Material, MpmError, Obstacle, Openings, Particles, Solver,
    SolverSettings, Substeps, Vector, Walls,
};

pub const FRAME: f32 = 0.0025;
pub const GRAVITY: f32 = 9.81;
pub const BULK_MODULUS: f32 = 277_778.0;

pub fn water() -> Material {
    Material::water(1000.0, BULK_MODULUS, 0.25, 0.0, true).unwrap()
}

pub fn sand() -> Material {
    Material::sand(1000.0, 1.0e6, 0.2, 45.0, 0.5, true).unwrap()
}

pub fn elastic() -> Material {
    Material::elastic(1000.0, 1.0e6, 0.2, 0.5).unwrap()
}

/// A liquid that thins as it is sheared, from a yield stress on.
pub fn liquid() -> Material {
    Material::liquid(1000.0, BULK_MODULUS, [5.0, 20.0, 0.6], 0.25, 10.0, true).unwrap()
}

/// Settings of the default box: walls at 0.1 and 0.9, gravity along the second axis.
pub fn settings<const D: usize>(resolution: usize, materials: Vec<Material>) -> SolverSettings<D> {
    let contact = Contact {
        kind: ContactKind::Separating,
        friction: None,
    };
    let (lower, upper) = (Vector::from_element(0.1), Vector::from_element(0.9));
    let walls = Walls::uniform(lower, upper, contact);
    SolverSettings {
        resolution,
        cells: [resolution; D],
        frame_dt: FRAME,
        gravity: Vector::from_fn(|axis, _| if axis == 1 { -GRAVITY } else { 0.0 }),
        walls,
        contact_friction: None,
        transfer_loss: None,
        materials,
        obstacles: Vec::<Obstacle<D>>::new(),
        rigid: Vec::new(),
        openings: Openings::NONE,
        substeps: Substeps::Cfl(None),
        sleep: None,
        threads: 1,
    }
}

/// Positions, velocities and materials of bodies, to be handed to a solver.
#[derive(Clone, Default)]
pub struct Bodies {
    pub x: Vec<f32>,
    pub v: Vec<f32>,
    pub material: Vec<u8>,
    pub volume: Vec<f32>,
    pub volume_ratio: Vec<f32>,
    pub body: Vec<u32>,
}

impl Bodies {
    /// A block of two particles per cell and axis that fills its box exactly.
    pub fn block<const D: usize>(
        mut self,
        resolution: usize,
        lower: [f32; D],
        upper: [f32; D],
        velocity: [f32; D],
        material: u8,
    ) -> Self {
        let per_axis: [usize; D] = std::array::from_fn(|axis| {
            ((upper[axis] - lower[axis]) * 2.0 * resolution as f32).round() as usize
        });
        let spacing: [f32; D] =
            std::array::from_fn(|axis| (upper[axis] - lower[axis]) / per_axis[axis] as f32);
        let body = self.body.last().map_or(0, |last| last + 1);
        for flat in 0..per_axis.iter().product() {
            let mut rest: usize = flat;
            for axis in 0..D {
                let site = rest % per_axis[axis];
                rest /= per_axis[axis];
                self.x
                    .push(lower[axis] + (site as f32 + 0.5) * spacing[axis]);
            }
            self.v.extend(velocity);
            self.material.push(material);
            self.volume.push(spacing.iter().product());
            self.volume_ratio.push(1.0);
            self.body.push(body);
        }
        self
    }

    /// The sites of a block that lie in a ball.
    pub fn ball<const D: usize>(
        mut self,
        resolution: usize,
        center: [f32; D],
        radius: f32,
        velocity: [f32; D],
        material: u8,
    ) -> Self {
        let (lower, upper) = (center.map(|x| x - radius), center.map(|x| x + radius));
        let block = Self::default().block(resolution, lower, upper, velocity, material);
        let body = self.body.last().map_or(0, |last| last + 1);
        for (site, x) in block.x.chunks(D).enumerate() {
            let from_center = x.iter().zip(center).map(|(x, center)| (x - center).powi(2));
            if from_center.sum::<f32>() < radius * radius {
                self.x.extend(x);
                self.v.extend(velocity);
                self.material.push(material);
                self.volume.push(block.volume[site]);
                self.volume_ratio.push(1.0);
                self.body.push(body);
            }
        }
        self
    }

    /// The particles that lie where a test says.
    pub fn only<const D: usize>(mut self, lies: impl Fn(&Vector<D>) -> bool) -> Self {
        let kept: Vec<bool> = (self.x.chunks(D))
            .map(|x| lies(&Vector::from_column_slice(x)))
            .collect();
        let mut of_numbers = kept.iter().flat_map(|kept| [*kept; D]);
        self.x.retain(|_| of_numbers.next() == Some(true));
        let mut of_numbers = kept.iter().flat_map(|kept| [*kept; D]);
        self.v.retain(|_| of_numbers.next() == Some(true));
        let mut each = kept.iter();
        self.material.retain(|_| each.next() == Some(&true));
        let mut each = kept.iter();
        self.volume.retain(|_| each.next() == Some(&true));
        let mut each = kept.iter();
        self.volume_ratio.retain(|_| each.next() == Some(&true));
        let mut each = kept.iter();
        self.body.retain(|_| each.next() == Some(&true));
        self
    }

    pub fn solver<const D: usize>(&self, settings: SolverSettings<D>) -> Solver<D> {
        self.try_solver(settings).unwrap()
    }

    pub fn try_solver<const D: usize>(
        &self,
        settings: SolverSettings<D>,
    ) -> Result<Solver<D>, MpmError> {
        let mass: Vec<f32> = (self.volume.iter().zip(&self.material))
            .map(|(volume, &material)| volume * settings.materials[usize::from(material)].density)
            .collect();
        let particles = Particles {
            x: &self.x,
            v: &self.v,
            material: &self.material,
            mass: &mass,
            volume: &self.volume,
            volume_ratio: Some(&self.volume_ratio),
            body: Some(&self.body),
        };
        Solver::new(settings, particles)
    }
}

pub fn run<const D: usize>(solver: &mut Solver<D>, frames: usize) {
    solver.advance(frames, Force::None, |_, _| ()).unwrap();
}

pub fn positions<const D: usize>(solver: &Solver<D>) -> Vec<f32> {
    let mut x = vec![0.0; solver.count() * D];
    solver.write_positions(&mut x);
    x
}

pub fn velocities<const D: usize>(solver: &Solver<D>) -> Vec<f32> {
    let mut v = vec![0.0; solver.count() * D];
    solver.write_velocities(&mut v);
    v
}
