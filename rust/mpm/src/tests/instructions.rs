//! The bits of a simulation do not depend on the vector instructions of the processor.

use super::common::{Bodies, elastic, liquid, run, sand, settings, water};
use crate::{Instructions, Sleep};

/// The state after some frames of two bodies that fall into each other, in each set of instructions.
fn check<const D: usize>(resolution: usize, transfer_loss: Option<f32>) {
    let cell = 1.0 / resolution as f32;
    for (lower, upper) in [(water(), sand()), (sand(), elastic()), (liquid(), water())] {
        let place = |y: f32| {
            let corner = |high: f32| {
                std::array::from_fn(|axis| {
                    if axis == 1 {
                        y + high
                    } else {
                        0.3 + 1.3 * high
                    }
                })
            };
            (corner(0.0), corner(8.0 * cell))
        };
        let (low, high) = (place(0.1), place(0.1 + 9.0 * cell));
        let bodies = Bodies::default()
            .block::<D>(resolution, low.0, low.1, [0.7; D], 0)
            .block::<D>(resolution, high.0, high.1, [-2.0; D], 1);
        let mut settings = settings::<D>(resolution, vec![lower, upper]);
        settings.transfer_loss = transfer_loss;
        settings.sleep = Some(Sleep {
            speed: 0.05,
            frames: 10,
        });
        let states: Vec<_> = Instructions::ALL
            .into_iter()
            .filter(|set| set.available())
            .map(|set| {
                set.limit();
                let mut solver = bodies.solver(settings.clone());
                run(&mut solver, 12);
                (set, solver.snapshot())
            })
            .collect();
        for (set, state) in &states[1..] {
            assert!(*state == states[0].1, "{set:?} gives other bits in {D}D");
        }
    }
}

#[test]
fn a_simulation_gives_the_same_bits_with_all_instructions() {
    for transfer_loss in [None, Some(500.0)] {
        check::<2>(64, transfer_loss);
        check::<3>(32, transfer_loss);
    }
}
