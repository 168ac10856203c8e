//! Lines found one by one and many at a time.

use super::*;
use crate::boundary::contact::{Contact, ContactKind, Walls};
use crate::boundary::motion::Motion;
use crate::boundary::shape::Shape;

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
