//! Placements in space.

/// Three numbers.
pub type Vector3 = nalgebra::Vector3<f64>;
pub type Matrix3 = nalgebra::Matrix3<f64>;
pub type Rotation = nalgebra::UnitQuaternion<f64>;

/// A place and an orientation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placed {
    /// Where the solid's own origin is [m].
    pub x: Vector3,
    pub turn: Rotation,
}

impl Placed {
    /// Where the world's own frame is.
    pub const ORIGIN: Self = Self {
        x: Vector3::new(0.0, 0.0, 0.0),
        turn: Rotation::new_unchecked(nalgebra::Quaternion::new(1.0, 0.0, 0.0, 0.0)),
    };

    /// Where a point of the solid is [m].
    pub fn apply(&self, own: &Vector3) -> Vector3 {
        self.x + self.turn * own
    }

    /// The point of the solid that is at `x` [m].
    pub fn inverse(&self, x: &Vector3) -> Vector3 {
        self.turn.inverse() * (x - self.x)
    }

    /// Another solid as this one sees it.
    #[must_use]
    pub fn relative(&self, other: &Self) -> Self {
        Self {
            x: self.inverse(&other.x),
            turn: self.turn.inverse() * other.turn,
        }
    }
}

/// The turn that leads the y axis to a direction.
pub fn turn_of_y(direction: &Vector3) -> Rotation {
    let along = direction.normalize();
    let between = Vector3::y().cross(&along);
    let real = 1.0 + along.y;
    if real < 1.0e-9 {
        // Half a turn about x.
        return Rotation::new_unchecked(nalgebra::Quaternion::new(0.0, 1.0, 0.0, 0.0));
    }
    Rotation::new_normalize(nalgebra::Quaternion::new(
        real, between.x, between.y, between.z,
    ))
}

/// The turn of a rotation matrix, up to its rounding.
pub fn turn_of_matrix(matrix: &Matrix3) -> Rotation {
    let turn = nalgebra::Rotation3::from_matrix_unchecked(*matrix);
    Rotation::new_normalize(*Rotation::from_rotation_matrix(&turn).quaternion())
}

/// Two directions across a normal, in the plane the second one out of it.
pub fn across<const D: usize>(normal: &Vector3) -> [Vector3; 2] {
    if D == 2 {
        return [Vector3::new(-normal.y, normal.x, 0.0), Vector3::z()];
    }
    let other = if normal.x.abs() < 0.7 {
        Vector3::x()
    } else {
        Vector3::y()
    };
    let first = normal.cross(&other).normalize();
    [first, normal.cross(&first)]
}

/// Turns by a vector along the axis, of the angle's length [rad]. Sine and cosine are equal on all systems.
pub fn turned(turn: &Rotation, by: &Vector3) -> Rotation {
    let angle = by.norm();
    if angle == 0.0 {
        return *turn;
    }
    let (sine, cosine) = libm::sincos(0.5 * angle);
    let axis = by * (sine / angle);
    let step = nalgebra::Quaternion::new(cosine, axis.x, axis.y, axis.z);
    let whole = step * turn.quaternion();
    Rotation::new_unchecked(whole / whole.norm())
}
