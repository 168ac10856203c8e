//! Lines found one by one and many at a time.

use super::*;
use crate::boundary::contact::{Contact, ContactKind, Walls};
use crate::boundary::motion::{Motion, Pose};
use crate::boundary::shape::Shape;
use crate::linalg::Matrix;

fn check<const D: usize>() {
    let point = |at: [f32; 3]| Vector::<D>::from_fn(|axis, _| at[axis]);
    let (lower, upper) = (point([0.25, 0.2, 0.4]), point([0.6, 0.5, 0.75]));
    let shapes = [
        Shape::Ball {
            center: point([0.5, 0.4, 0.5]),
            radius: 0.2,
        },
        Shape::Box { lower, upper },
        Shape::Segment {
            start: lower,
            end: upper,
            thickness: 0.07,
        },
        Shape::Cylinder {
            start: lower,
            end: upper,
            radius: 0.1,
        },
        Shape::HalfSpace {
            point: lower,
            normal: (upper - lower).normalize(),
        },
    ];
    let layout = Layout::<D>::unit(32);
    let contact = Contact {
        kind: ContactKind::Separating,
        friction: None,
    };
    let walls = Walls::uniform(Vector::zeros(), Vector::repeat(1.0), contact);
    let spin: &[f32] = if D == 2 { &[1.0] } else { &[0.3, 0.5, 1.0] };
    let motion = Motion::new(point([0.1, 0.05, 0.0]), spin, lower, None).unwrap();
    for (shape, time) in shapes.into_iter().flat_map(|shape| {
        let at = move |time| (shape.clone(), time);
        [0.0, 0.31, 0.9].map(at)
    }) {
        let obstacle = Obstacle::new(shape, contact).unwrap().moving(motion);
        let mut solids = Solids::new(vec![obstacle], [].iter(), &walls, &layout);
        solids.poses = vec![Some(motion.pose(time))];
        let (mut batch, mut found) = (Batch::<D, MANY>::new(), std::array::from_fn(|_| Vec::new()));
        let (mut one, mut alone) = (Batch::<D, 1>::new(), std::array::from_fn(|_| Vec::new()));
        for memory in 0..layout.row_count() * layout.row_length {
            let mut node = layout.row_coordinates(memory / layout.row_length);
            node[D - 1] = memory % layout.row_length;
            if solids.distance(0, &layout.position(node)).0.abs() > 2.0 * layout.dx() {
                continue;
            }
            if batch.ends_before(0) {
                batch.find(&solids, true, |_| 0..D, &mut found);
            }
            batch.add(0, (node, memory), &layout);
            one.add(0, (node, memory), &layout);
            one.find(&solids, true, |_| 0..D, &mut alone);
        }
        batch.find(&solids, true, |_| 0..D, &mut found);
        assert!(found.iter().map(Vec::len).sum::<usize>() > 20);
        assert!(found == alone, "{:?} at {time} s", solids.list[0].shape);
    }
}

#[test]
fn lines_are_those_from_one_node_at_a_time() {
    check::<2>();
    check::<3>();
}

/// What passes through the lines of a round body of 6 cells that moves through a fluid at rest around it, over what it displaces [-].
fn leak<const D: usize>(shape: &Shape<D>, off: usize, place: [f32; 3]) -> f32 {
    let layout = Layout::<D>::unit(32);
    let (dx, contact) = (
        layout.dx(),
        Contact {
            kind: ContactKind::Separating,
            friction: None,
        },
    );
    let walls = Walls::uniform(Vector::zeros(), Vector::repeat(1.0), contact);
    let center = Vector::<D>::from_fn(|axis, _| 0.5 + place[axis] * dx);
    let velocity = Vector::<D>::from_fn(|axis, _| {
        if axis == off {
            0.0
        } else {
            [0.3, 1.0, 0.5][axis]
        }
    });
    let mut solids = Solids::new(Vec::new(), [shape].into_iter(), &walls, &layout);
    solids.place_bodies(
        [Pose::of_body(
            center,
            Matrix::identity(),
            velocity,
            Matrix::zeros(),
        )]
        .into_iter(),
    );
    // Potential flow around a ball in space or a disc in the plane across the axis `off`.
    let power = if off < D { 2 } else { D as i32 };
    let flow = |x: &Vector<D>| {
        let mut away = x - center;
        if off < D {
            away[off] = 0.0;
        }
        let (distance, outward) = (away.norm(), away.normalize());
        let part = (6.0 * dx / distance).powi(power) / (power - 1) as f32;
        (outward * (power as f32 * velocity.dot(&outward)) - velocity) * part
    };
    let (mut batch, mut found) = (Batch::<D, 1>::new(), std::array::from_fn(|_| Vec::new()));
    let coordinates = |memory: usize| {
        let mut node = layout.row_coordinates(memory / layout.row_length);
        node[D - 1] = memory % layout.row_length;
        node
    };
    for memory in 0..layout.row_count() * layout.row_length {
        let x = layout.position(coordinates(memory));
        if solids.distance(0, &x).0.abs() < 2.0 * dx && (off == D || (x[off] - 0.5).abs() < dx) {
            batch.add(0, (coordinates(memory), memory), &layout);
            batch.find(&solids, false, |_| 0..D, &mut found);
        }
    }
    let (mut through, mut displaced) = (0.0, 0.0);
    for (axis, line) in found
        .iter()
        .enumerate()
        .flat_map(|(axis, lines)| lines.iter().map(move |line| (axis, line)))
    {
        let (nodes, weights) = line.nodes();
        let normal = line.normal;
        let v: Vector<D> = nodes
            .iter()
            .zip(weights)
            .map(|(node, weight)| flow(&layout.position(coordinates(*node))) * weight)
            .sum();
        let (area, own) = (1.0 / normal[axis].abs(), velocity.dot(&normal));
        through += area * own * (v.dot(&normal) - own);
        displaced += area * own * own;
    }
    through / displaced
}

#[test]
fn fluid_moves_around_round_bodies_and_not_through_them() {
    let radius = 6.0 / 32.0;
    for place in [[0.0; 3], [0.2, 0.45, 0.7], [0.6, 0.1, 0.9]] {
        let ball = leak(
            &Shape::Ball {
                center: Vector::<3>::zeros(),
                radius,
            },
            3,
            place,
        );
        let disc = leak(
            &Shape::Ball {
                center: Vector::<2>::zeros(),
                radius,
            },
            2,
            place,
        );
        let along = Vector::<3>::z() * 0.2;
        let log = leak(
            &Shape::Cylinder {
                start: -along,
                end: along,
                radius,
            },
            2,
            place,
        );
        // At the surface itself 0.023, 0.013 and 0.013 of it would.
        for (name, part) in [("ball", ball), ("disc", disc), ("cylinder", log)] {
            assert!(part.abs() < 0.003, "{name} {place:?}: {part}");
        }
    }
}
