//! Vectors of the grid, in single precision and D dimensions, as those of rigid bodies, and back.

use rigid::{Matrix3, Moving, Placed, Rates, Rotation, Vector3};

use crate::boundary::Pose;
use crate::linalg::{Matrix, Vector};

pub fn double<const D: usize>(v: &Vector<D>) -> Vector3 {
    Vector3::from_fn(|axis, _| if axis < D { f64::from(v[axis]) } else { 0.0 })
}

pub fn single<const D: usize>(v: &Vector3) -> Vector<D> {
    Vector::from_fn(|axis, _| v[axis] as f32)
}

pub fn single_matrix<const D: usize>(matrix: &Matrix3) -> Matrix<D> {
    Matrix::from_fn(|row, column| matrix[(row, column)] as f32)
}

/// The matrix whose product with an arm is the cross product with it.
pub fn spin_matrix<const D: usize>(w: &Vector3) -> Matrix<D> {
    single_matrix(&w.cross_matrix())
}

/// Where a body is after `dt` [s] with the velocities that it has.
pub fn pose_of<const D: usize>(moving: &Moving, dt: f32) -> Pose<D> {
    let dt = f64::from(dt);
    let turn = rigid::turned(&moving.placed.turn, &(moving.w * dt));
    Pose::of_body(
        single(&(moving.placed.x + moving.v * dt)),
        single_matrix(turn.to_rotation_matrix().matrix()),
        single(&moving.v),
        spin_matrix(&moving.w),
    )
}

/// Where a body is by its numbers, as `numbers_of` has them.
pub fn pose_of_numbers<const D: usize>(numbers: &[f64; 13]) -> Pose<D> {
    let three = |first: usize| Vector3::from_column_slice(&numbers[first..first + 3]);
    let turn = nalgebra::Quaternion::new(numbers[3], numbers[4], numbers[5], numbers[6]);
    let moving = Moving {
        placed: Placed {
            x: three(0),
            turn: Rotation::new_unchecked(turn),
        },
        v: three(7),
        w: three(10),
        support: Rates::NONE,
    };
    pose_of(&moving, 0.0)
}
