//! Volumes on the grid, and the whole pass on small sets of particles.

use super::VolumeCorrection;
use super::correct::Rooms;
use super::lanes::{PRESSURE, SHARING, SMOOTH, VOLUME};
use super::smooth::{smooth_across_planes, smooth_planes};
use super::spread::{empty, spread};
use crate::boundary::{Contact, ContactKind, Obstacle, Obstacles, Shape, Walls};
use crate::grid::{Grid, Layout, Window};
use crate::linalg::{Matrix, Vector};
use crate::material::{Constitutive, Material, Model, Water};
use crate::particles::{Activity, Group, MaterialGroup, Particle, Slab, Sorter, bands};
use threads::Team;

const RESOLUTION: usize = 32;
const DX: f32 = 1.0 / RESOLUTION as f32;
const WATER: Water = Water {
    bulk_modulus: 1.0e5,
    tension: 0.0,
    volume_correction: true,
};
const CONTACT: Contact = Contact {
    kind: ContactKind::Separating,
    friction: None,
};

/// Sorted particles of water, and the grid that they touch.
struct Scene<const D: usize> {
    groups: Vec<MaterialGroup<D>>,
    slabs: Vec<Slab>,
    grid: Grid<D>,
    team: Team,
}

impl<const D: usize> Scene<D> {
    fn new(particles: &[Particle<D, f32>]) -> Self {
        Self::of(vec![MaterialGroup::Water(Group::new(
            WATER, 0.0, particles,
        ))])
    }

    fn of(mut groups: Vec<MaterialGroup<D>>) -> Self {
        let mut grid = Grid::new(Layout::unit(RESOLUTION), false);
        let (team, mut sorter) = (Team::new(1).unwrap(), Sorter::default());
        let slabs = sorter.sort(&mut groups, &grid.layout, &[], &team);
        let bands = bands(&slabs, grid.layout.planes());
        grid.activate(&bands, |planes| sorter.places(planes), &team);
        Self {
            groups,
            slabs,
            grid,
            team,
        }
    }

    fn window(&mut self) -> Window<'_, D> {
        let planes = 0..self.grid.layout.planes();
        let windows = self.grid.windows(std::iter::once(planes));
        windows.into_iter().next().expect("one window")
    }

    fn spread(&mut self, with_volume: bool, shares: bool) {
        let group = self.groups[0].clone();
        let MaterialGroup::Water(group) = &group else {
            unreachable!()
        };
        let blocks = &group.awake.blocks;
        spread(blocks, &WATER, with_volume, shares, &mut self.window());
    }

    fn smooth(&mut self) {
        let planes = 1..self.grid.layout.planes() - 1;
        let mut window = self.window();
        smooth_planes(&mut window);
        smooth_across_planes(&mut window, planes);
    }

    /// Sum over all nodes, times the volume of a cell.
    fn sum(&self, lane: usize) -> f64 {
        let cell = f64::from(DX).powi(D as i32);
        let lanes = self.grid.nodes.iter().map(|node| node.to_array()[lane]);
        lanes.map(f64::from).sum::<f64>() * cell
    }
}

fn walls<const D: usize>() -> Walls<D> {
    Walls::uniform(
        Vector::from_element(0.1),
        Vector::from_element(0.9),
        CONTACT,
    )
}

/// Four particles a cell, apart by `spacing` times their distance at rest, from 0.3 to 0.7, that are sheared at
/// 14/s. `ratio` gives the J of each by its number.
fn square(spacing: f32, ratio: impl Fn(usize) -> f32) -> Vec<Particle<2, f32>> {
    square_from(0.3, spacing, ratio)
}

/// The same, from another corner.
fn square_from(corner: f32, spacing: f32, ratio: impl Fn(usize) -> f32) -> Vec<Particle<2, f32>> {
    let distance = 0.5 * DX * spacing;
    let count = (0.4 / distance) as usize;
    let place = |k: usize| corner + distance * (k as f32 + 0.5);
    let cells = (0..count).flat_map(|i| (0..count).map(move |j| (i, j)));
    cells
        .enumerate()
        .map(|(id, (i, j))| {
            let x = Vector::<2>::new(place(i), place(j));
            particle(id, x, ratio(id))
        })
        .collect()
}

fn particle<const D: usize>(id: usize, x: Vector<D>, ratio: f32) -> Particle<D, f32> {
    let mut affine = Matrix::zeros();
    (affine[(0, 0)], affine[(1, 1)]) = (10.0, -10.0);
    Particle {
        x,
        v: Vector::zeros(),
        affine,
        mass: 1.0,
        volume: (0.5 * DX).powi(D as i32),
        id: id as u32,
        calm: 0.0,
        activity: Activity::Awake,
        state: ratio,
    }
}

/// J of all particles after one correction, by their numbers.
fn corrected(particles: &[Particle<2, f32>], obstacles: Vec<Obstacle<2>>) -> Vec<f32> {
    let mut scene = Scene::new(particles);
    let layout = scene.grid.layout;
    let obstacles = Obstacles::new(obstacles, &walls(), &layout);
    VolumeCorrection::new(&walls(), &layout, 5.0e-3).apply(
        &mut scene.groups,
        &scene.slabs,
        &mut scene.grid,
        &obstacles,
        5.0e-3,
        &scene.team,
    );
    let Some(MaterialGroup::Water(group)) = scene.groups.pop() else {
        unreachable!()
    };
    let mut ratios = vec![0.0; particles.len()];
    for p in group.particles() {
        ratios[p.id as usize] = p.state;
    }
    ratios
}

/// The numbers of the particles at least three cells inside a square.
fn inside(particles: &[Particle<2, f32>]) -> Vec<usize> {
    let deep = |x: f32| (0.3 + 3.0 * DX..0.7 - 3.5 * DX).contains(&x);
    let kept = particles
        .iter()
        .filter(|p| deep(p.x[0]) && deep(p.x[1]))
        .map(|p| p.id as usize)
        .collect::<Vec<_>>();
    assert!(kept.len() > 100);
    kept
}

/// Particles at places that look random, with J from 0.8 to 1.2.
fn scattered<const D: usize>() -> Vec<Particle<D, f32>> {
    let part = |k: usize, factor: f32| (k as f32 * factor).fract();
    (0..200)
        .map(|id| {
            let x = Vector::from_fn(|axis, _| {
                0.2 + 0.6 * part(id, [0.618_03, 0.754_88, 0.569_84][axis])
            });
            particle(id, x, 0.8 + 0.4 * part(id, 0.381_97))
        })
        .collect()
}

fn check_sums<const D: usize>() {
    let particles = scattered::<D>();
    let volumes = |value: &dyn Fn(f32) -> f32| -> f64 {
        let each = particles
            .iter()
            .map(|p| f64::from(p.volume * value(p.state)));
        each.sum()
    };
    let held = volumes(&|ratio| ratio);
    let rest = volumes(&|_| 1.0);
    let pressure = volumes(&|ratio| WATER.bulk_modulus * (1.0 - ratio));
    let close = |a: f64, b: f64, scale: f64| assert!((a - b).abs() < 1.0e-5 * scale, "{a} {b}");

    let mut scene = Scene::new(&particles);
    scene.spread(true, true);
    close(scene.sum(VOLUME), held, held);
    close(scene.sum(SHARING), rest, rest);
    close(
        scene.sum(PRESSURE),
        pressure,
        f64::from(WATER.bulk_modulus) * rest,
    );

    scene.smooth();
    close(scene.sum(SMOOTH), held, held);
    close(scene.sum(VOLUME), held, held);
    let before = scene.grid.nodes.clone();
    scene.grid.mark_dirty();
    let planes = 0..scene.grid.layout.planes();
    empty(&mut scene.window(), planes, false);
    scene.spread(true, true);
    scene.smooth();
    assert_eq!(
        scene.grid.nodes, before,
        "nothing is left over from the first time"
    );

    for (with_volume, shares) in [(true, false), (false, true), (false, false)] {
        let mut scene = Scene::new(&particles);
        scene.spread(with_volume, shares);
        assert_eq!(scene.sum(VOLUME) > 0.0, with_volume);
        assert_eq!(scene.sum(SHARING) > 0.0, shares);
        assert_eq!(scene.sum(PRESSURE) != 0.0, shares);
    }
}

#[test]
fn spreading_and_smoothing_keep_the_sums() {
    check_sums::<2>();
    check_sums::<3>();
}

#[test]
fn particles_of_one_pressure_make_that_pressure_on_all_nodes() {
    let mut particles = scattered::<2>();
    for p in &mut particles {
        p.state = 0.75;
    }
    let mut scene = Scene::new(&particles);
    scene.spread(true, true);
    for node in &scene.grid.nodes {
        let lanes = node.to_array();
        let pressure = lanes[SHARING] * 0.25 * WATER.bulk_modulus;
        assert!((lanes[PRESSURE] - pressure).abs() <= 1.0e-5 * pressure);
    }
}

#[test]
fn a_full_box_is_full_beside_its_walls_when_smoothed_too() {
    let layout = Layout::<2>::unit(RESOLUTION);
    let rooms = Rooms::new(&walls(), &layout);
    let per_side = (0.8 / (0.5 * DX)) as usize;
    let place = |k: usize| 0.1 + 0.5 * DX * (k as f32 + 0.5);
    let particles: Vec<_> = (0..per_side * per_side)
        .map(|id| {
            particle(
                id,
                Vector::<2>::new(place(id / per_side), place(id % per_side)),
                1.0,
            )
        })
        .collect();
    let mut scene = Scene::new(&particles);
    let ranges: Vec<_> = scene.grid.active_ranges().collect();
    let coordinates = |index: usize| {
        let mut node = layout.row_coordinates(index / layout.row_length);
        node[1] = index % layout.row_length;
        node
    };
    let within = |index: &usize| index % layout.row_length < layout.columns();
    for index in ranges.iter().cloned().flatten().filter(within) {
        let mut value = scene.grid.nodes[index].to_array();
        value[VOLUME] = rooms.fine.at_node(coordinates(index));
        scene.grid.nodes[index] = value.into();
    }
    scene.grid.mark_dirty();
    scene.smooth();
    for index in ranges.into_iter().flatten().filter(within) {
        let smooth = scene.grid.nodes[index].to_array()[SMOOTH];
        let room = rooms.smooth.at_node(coordinates(index));
        assert!((smooth - room).abs() < 1.0e-6, "{smooth} {room}");
    }
}

#[test]
fn a_block_in_order_stays_as_it_is_up_to_its_free_surfaces() {
    let ratios = corrected(&square(1.0, |_| 1.0), Vec::new());
    assert!(
        ratios.iter().all(|ratio| (ratio - 1.0).abs() < 2.0e-3),
        "{ratios:?}"
    );
}

#[test]
fn matter_with_room_around_it_gives_its_false_pressure_away() {
    let particles = square(1.06, |_| 0.95);
    let ratios = corrected(&particles, Vec::new());
    for k in inside(&particles) {
        // A quarter, 50/s in 5 ms, of 1 - 0.95 / 1.06^2 - 0.03.
        assert!((ratios[k] / 0.95 - 1.031).abs() < 2.0e-3, "{}", ratios[k]);
    }
}

#[test]
fn crowded_matter_gains_pressure() {
    let particles = square(0.95, |_| 1.0);
    let ratios = corrected(&particles, Vec::new());
    for k in inside(&particles) {
        // A tenth, 20/s in 5 ms, of 1 / 0.95^2 - 1.01.
        assert!((ratios[k] - 0.9902).abs() < 1.0e-3, "{}", ratios[k]);
    }
}

#[test]
fn neighbours_share_their_pressure() {
    let particles = square(1.0, |id| if id % 2 == 0 { 0.99 } else { 0.97 });
    let ratios = corrected(&particles, Vec::new());
    for k in inside(&particles) {
        // Each loses two fifths, 80/s in 5 ms, of what it deviates by from the mean of 0.98.
        let shared = if k % 2 == 0 { 0.986 } else { 0.974 };
        assert!((ratios[k] - shared).abs() < 1.0e-3, "{}", ratios[k]);
    }
}

#[test]
fn spray_and_matter_at_rest_are_left_alone() {
    let far_apart = square(3.0, |_| 0.9);
    assert!(
        corrected(&far_apart, Vec::new())
            .iter()
            .all(|&ratio| (ratio - 0.9).abs() < 1.0e-6)
    );
    let mut still = square(0.9, |id| if id % 2 == 0 { 0.9 } else { 1.1 });
    for p in &mut still {
        p.affine *= 0.01;
    }
    let before: Vec<f32> = still.iter().map(|p| p.state).collect();
    assert_eq!(corrected(&still, Vec::new()), before);
}

#[test]
fn grains_that_press_leave_no_voids() {
    let material = Material::sand(1600.0, 1.6e6, 0.2, 40.0, 0.5, true);
    let Model::Sand(sand) = material.unwrap().model else {
        unreachable!()
    };
    // Log of the volume gained by one correction, of grains with a quarter of their volume around them.
    let gained = |ratio: f32, rate: f32| -> Vec<f32> {
        let state = Constitutive::<2>::initial_state(&sand, ratio);
        let apart = square(2.0, |_| ratio);
        let grains: Vec<_> = (apart.iter())
            .map(|p| Particle {
                x: p.x,
                v: p.v,
                affine: p.affine * rate,
                mass: p.mass,
                volume: p.volume,
                id: p.id,
                calm: p.calm,
                activity: p.activity,
                state,
            })
            .collect();
        let mut scene = Scene::of(vec![MaterialGroup::Sand(Group::new(sand, 0.0, &grains))]);
        let walls = walls();
        let obstacles = Obstacles::new(Vec::new(), &walls, &scene.grid.layout);
        VolumeCorrection::new(&walls, &scene.grid.layout, 5.0e-3).apply(
            &mut scene.groups,
            &scene.slabs,
            &mut scene.grid,
            &obstacles,
            5.0e-3,
            &scene.team,
        );
        let Some(MaterialGroup::Sand(group)) = scene.groups.pop() else {
            unreachable!()
        };
        let mut gains = vec![0.0; apart.len()];
        for p in group.particles() {
            gains[p.id as usize] = p.state.volume_gain - state.volume_gain;
        }
        let deep = |p: &&Particle<2, f32>| p.x.iter().all(|x| (0.4..0.6).contains(x));
        let gains: Vec<_> = (apart.iter().filter(deep))
            .map(|p| gains[p.id as usize])
            .collect();
        assert!(gains.len() > 30);
        gains
    };
    // A quarter, 50/s in 5 ms, of 1 - 0.95 / 4 - 0.03; a tenth of that at a rate of strain of 0.12/s.
    let quarter = 0.25 * (0.97 - 0.95 / 4.0);
    let slow = 0.12 / 14.142;
    for (rate, part) in [(1.0, 1.0), (slow, 0.1)] {
        for gain in gained(0.95, rate) {
            assert!((gain - part * quarter).abs() < 0.02 * part, "{gain} {part}");
        }
    }
    // Those that do not press are spray.
    assert!(gained(1.05, 1.0).iter().all(|gain| *gain == 0.0));
}

#[test]
fn a_wall_is_no_free_surface() {
    let at_the_wall = |spacing: f32, ratio: f32| -> Vec<f32> {
        let particles = square_from(0.1, spacing, |_| ratio);
        let all = corrected(&particles, Vec::new());
        let lowest = |p: &&Particle<2, f32>| p.x[1] < 0.1 + 0.5 * DX && p.x[0] < 0.3;
        particles
            .iter()
            .filter(lowest)
            .map(|p| all[p.id as usize])
            .collect()
    };
    let (void, crowded) = (at_the_wall(1.06, 0.95), at_the_wall(0.9, 1.0));
    assert!(
        void.len() > 10 && void.iter().all(|&ratio| ratio > 0.96),
        "{void:?}"
    );
    assert!(
        crowded.len() > 10 && crowded.iter().all(|&ratio| ratio < 0.99),
        "{crowded:?}"
    );
}

#[test]
fn an_obstacle_takes_room() {
    let ground = Obstacle {
        shape: Shape::HalfSpace {
            point: Vector::<2>::new(0.5, 0.3),
            normal: Vector::<2>::new(0.0, 1.0),
        },
        contact: CONTACT,
        motion: None,
    };
    let lowest = |p: &Particle<2, f32>| p.x[1] < 0.3 + 0.5 * DX && (0.4..0.6).contains(&p.x[0]);
    let ratios = |spacing: f32, obstacles: Vec<Obstacle<2>>| -> Vec<f32> {
        let particles = square(spacing, |_| 1.0);
        let all = corrected(&particles, obstacles);
        let numbers = particles.iter().filter(|p| lowest(p));
        numbers.map(|p| all[p.id as usize]).collect()
    };
    let in_order = ratios(1.0, vec![ground.clone()]);
    assert!(
        in_order.len() > 10 && in_order.iter().all(|ratio| (ratio - 1.0).abs() < 4.0e-3),
        "{in_order:?}"
    );
    let crowded = ratios(0.9, vec![ground]);
    assert!(crowded.iter().all(|&ratio| ratio < 0.99), "{crowded:?}");
    let at_a_surface = ratios(0.9, Vec::new());
    assert!(
        at_a_surface.iter().all(|&ratio| ratio == 1.0),
        "{at_a_surface:?}"
    );
}
