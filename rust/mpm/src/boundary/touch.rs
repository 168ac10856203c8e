//! Where material touches a surface, from the masses of the nodes of a line across it; see `wall_contact`.

use super::contact::ContactKind;
use super::wall_fill::cumulative;
use crate::grid::SMALLEST_MASS;

/// Distance from a surface at which contact begins [cells], of what flows. It must include material at rest on a wall, whose
/// lowest particles are up to a third of a cell away. With a larger one a coarse grid would stop material earlier than a
/// fine one.
const REACH: f64 = 0.45;
/// The same of elastic bodies. With a larger one a round body stands on a flat and does not roll.
const ELASTIC_REACH: f64 = 0.07;
/// Distance up to which they may come nearer within a substep [cells]. If each line held what comes within reach, a round body
/// would climb each line that it rolls onto. Faces are rough by as much, because particles are points.
const ELASTIC_REST: f64 = -0.06;
/// What comes nearer by less in a substep rests within reach [cells]: a body that rests does not sink, nor slip meanwhile.
const RESTING_BELOW: f64 = 3.0e-5;
/// The same where material cannot leave. It must include what hangs and is stretched, up to strains of tens of percent.
const HELD_REACH: f64 = 0.9;
/// Where what flows comes to rest on rigid bodies [cells]. If it was held wherever it is within reach, a film without material would
/// stay below a body that came down on it, as thick as it happened to be then. It lies slightly inside the surface: a block
/// of 500 kg/m^3 floats 0.4 % deeper than with 0.
const BODY_REST: f64 = -0.02;
/// Time in which it comes nearer there [s], and in which it is moved back. Masses of nodes fluctuate: if it came nearer within a
/// substep and was never moved back, each line that once holds too little would let material in, and bodies would sink deeper with
/// time. If it was moved back as fast as it comes, it would lie too far from flat faces.
const SETTLING: f32 = 0.2;
const MOVING_BACK: f32 = 2.5;
/// Distance from where it rests [cells] that sets the largest speed at which it is moved back: the line of a film on a body has the
/// masses of one with far too much material.
const MOVED_BACK: f64 = 0.1;
/// An elastic body's outer node is taken for empty where the surface lies at least so far from the middle node towards the inner
/// one [cells], and the mass that it has over that of the middle one is less than this part of the same of their weights. As the
/// light node that it is there it would take most of the change, and a round body would sink and slip where it rolls.
const LIGHT_BEYOND: f64 = 0.05;
const LIGHT: f32 = 0.3;

/// Where material touches a surface, from the mass of the middle node of a line over that of the inner one [-].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Touch {
    /// Where it begins to touch.
    from: f32,
    /// Where it is at rest.
    rest: f32,
    /// Distance for each unit that it lacks of `rest` [m]; 0 where it is at rest at once.
    pub distance: f32,
    /// What comes nearer by less in a substep rests where it is [m].
    resting_below: f32,
    /// Time in which it comes nearer [s]; less than a substep counts as one.
    settling: f32,
    /// What it has more than `rest` counts up to this [-]; with 0 it is never moved back.
    surplus: f32,
    /// Mass of the outer node over that of the middle one, and over the same of their weights, below which it is taken for empty.
    light: f32,
}

impl Touch {
    /// Whether the outer node may be taken for empty.
    #[inline(always)]
    pub fn may_be_light(&self) -> bool {
        self.light > 0.0
    }

    /// Whether the outer node is taken for empty, by the masses and weights of the outer and the middle node.
    #[inline(always)]
    pub fn is_light(&self, mass: [f32; 2], weights: [f32; 2]) -> bool {
        mass[0] * weights[1] < self.light * (mass[1] * weights[0])
    }

    /// Whether material with these masses of the middle and the inner node touches.
    #[inline(always)]
    pub fn touches(&self, middle: f32, inner: f32) -> bool {
        middle >= self.from * inner
    }

    /// Speed at which material that touches may come nearer in a substep of `dt` [s], with the masses of the middle and the
    /// inner node; below 0 that at which it is moved back [m/s].
    #[inline(always)]
    pub fn closing(&self, middle: f32, inner: f32, dt: f32) -> f32 {
        let inner = inner.max(SMALLEST_MASS);
        let lacking = (self.rest * inner - middle).max(-self.surplus * inner);
        let time = if lacking < 0.0 {
            MOVING_BACK
        } else {
            dt.max(self.settling)
        };
        lacking * self.distance / (inner * time)
    }

    /// Speed towards the surface up to which material rests where it is [m/s].
    #[inline(always)]
    pub fn resting_speed(&self, dt: f32) -> f32 {
        self.resting_below / dt
    }
}

/// Distances of the outer, middle and inner node from a surface between them [cells], by their weights there.
pub(super) fn heights([outer, _, inner]: [f32; 3]) -> [f32; 3] {
    let face = inner - outer;
    [-1.0 - face, -face, 1.0 - face]
}

/// Velocities, relative to the surface and along one axis, of nodes with these masses and distances from it, once it holds them.
///
/// What is held at a surface shears along it: v = s d, with s = sum(m d v) / sum(m d^2), the nearest such flow by momentum. All
/// forces on the nodes then act on s as on the layer itself, so the plane without slip is the surface, wherever that lies between
/// the nodes. If only the velocity at the surface was held, the outer node, which has little mass, would take most of the change.
#[inline(always)]
pub(super) fn shear(mass: [f32; 3], heights: [f32; 3], v: [f32; 3]) -> [f32; 3] {
    let moments: [f32; 3] = std::array::from_fn(|step| mass[step] * heights[step]);
    let inertia: f32 = (0..3).map(|step| moments[step] * heights[step]).sum();
    let turning: f32 = (0..3).map(|step| moments[step] * v[step]).sum();
    let none = inertia <= 0.0;
    let rate = turning / if none { 1.0 } else { inertia };
    std::array::from_fn(|step| {
        if none | (mass[step] <= SMALLEST_MASS) {
            v[step]
        } else {
            rate * heights[step]
        }
    })
}

/// Where it touches what flows, and what is elastic. The surface lies at `face` [cells] from the middle node towards the inner
/// one, and its normal has this part along the line; `dx` is the size of a cell [m]. Where no body is `elastic` the second is
/// the first.
pub(super) fn touching(
    face: f64,
    normal: f64,
    kind: ContactKind,
    dx: f64,
    (elastic, is_rigid_body): (bool, bool),
) -> [Touch; 2] {
    let ratio = |reach: f64| {
        let face = face + reach / normal;
        (cumulative(-face) / cumulative(1.0 - face)) as f32
    };
    let held_from = |reach: f64| Touch {
        from: ratio(reach),
        rest: 0.0,
        distance: 0.0,
        resting_below: 0.0,
        settling: 0.0,
        surplus: 0.0,
        light: 0.0,
    };
    // Held from `rest` on; until then it comes nearer.
    let approaching = |reach: f64, rest: f64| {
        let (held, at_rest) = (held_from(reach), ratio(rest));
        Touch {
            rest: at_rest,
            distance: ((reach - rest) * dx) as f32 / (at_rest - held.from),
            ..held
        }
    };
    if kind != ContactKind::Separating {
        let held = Touch {
            light: 1.0,
            ..held_from(HELD_REACH)
        };
        return [held; 2];
    }
    let flowing = if is_rigid_body {
        let settling = approaching(REACH, BODY_REST);
        Touch {
            // It comes nearer, or is moved back, whichever way it moves.
            resting_below: f32::NEG_INFINITY,
            settling: SETTLING,
            surplus: (MOVED_BACK * dx) as f32 / settling.distance,
            ..settling
        }
    } else {
        held_from(REACH)
    };
    if !elastic {
        return [flowing; 2];
    }
    let resting_below = (RESTING_BELOW * dx) as f32;
    let elastic = Touch {
        resting_below,
        light: if face > LIGHT_BEYOND { LIGHT } else { 0.0 },
        ..approaching(ELASTIC_REACH, ELASTIC_REST)
    };
    [flowing, elastic]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Speeds of a line that has `part` too little and too much for rest, as what is elastic and as what flows.
    fn speeds(part: f32, dt: f32, is_rigid_body: bool) -> [[f32; 2]; 2] {
        let kind = ContactKind::Separating;
        let lines = touching(0.2, 0.9, kind, 1.0 / 64.0, (true, is_rigid_body));
        let of = |touch: Touch, lack: f32| touch.closing(touch.rest - lack, 1.0, dt);
        [1, 0].map(|body| [part, -part].map(|lack| of(lines[body], lack)))
    }

    /// Masses of nodes fluctuate about those at rest. If only shortfalls counted, each would let water in to stay.
    #[test]
    fn what_flows_at_rigid_bodies_is_moved_back_where_there_is_too_much() {
        let [elastic, [nearer, back]] = speeds(0.01, 1.0e-4, true);
        let times = SETTLING / MOVING_BACK;
        assert!(nearer > 0.0 && (nearer * times + back).abs() < 1.0e-6);
        assert_eq!([nearer, back], speeds(0.01, 1.0e-3, true)[1]);
        assert!(elastic[0] > 0.0 && elastic[1] == 0.0);
        // Not in proportion where there is much too much, as in a film.
        let [_, [_, most]] = speeds(0.5, 1.0e-4, true);
        let largest = (MOVED_BACK / 64.0) as f32 / MOVING_BACK;
        assert!((most + largest).abs() < 1.0e-3 * largest);
        assert_eq!(speeds(0.01, 1.0e-4, false)[1], [0.0, 0.0]);
    }
}
