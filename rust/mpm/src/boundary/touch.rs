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
/// Where what flows comes to rest on rigid bodies [cells], in 2D and in 3D. If it was held wherever it is within reach, a film without
/// material would stay below a body that came down on it, as thick as it happened to be then. Masses of nodes fluctuate, and each
/// line that finds too little lets material come nearer: in 2D by more, as fewer particles are around a node. With these distances
/// blocks float at the level of their weight.
const BODY_REST: [f64; 2] = [0.1, 0.0];
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
    /// inner node [m/s].
    #[inline(always)]
    pub fn closing(&self, middle: f32, inner: f32, dt: f32) -> f32 {
        let inner = inner.max(SMALLEST_MASS);
        (self.rest * inner - middle).max(0.0) * self.distance / (inner * dt)
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

/// Where what flows comes to rest on rigid bodies [cells].
pub(super) fn body_rest<const D: usize>() -> f64 {
    BODY_REST[D - 2]
}

/// Where it touches what flows, and what is elastic. The surface lies at `face` [cells] from the middle node towards the inner
/// one, and its normal has this part along the line; `dx` is the size of a cell [m]. Where no body is `elastic` the second is
/// the first. `body_rest` is where material comes to rest on rigid bodies [cells], None of what is none.
pub(super) fn touching(
    face: f64,
    normal: f64,
    kind: ContactKind,
    dx: f64,
    (elastic, body_rest): (bool, Option<f64>),
) -> [Touch; 2] {
    let ratio = |reach: f64| {
        let face = face + reach / normal;
        (cumulative(-face) / cumulative(1.0 - face)) as f32
    };
    // Held from `rest` on, and until then as fast as it gets there within a substep.
    let approaching = |reach: f64, rest: f64| {
        let (from, at_rest) = (ratio(reach), ratio(rest));
        Touch {
            from,
            rest: at_rest,
            distance: ((reach - rest) * dx) as f32 / (at_rest - from),
            resting_below: 0.0,
            light: 0.0,
        }
    };
    let held_from = |reach: f64| Touch {
        from: ratio(reach),
        rest: 0.0,
        distance: 0.0,
        resting_below: 0.0,
        light: 0.0,
    };
    if kind != ContactKind::Separating {
        let held = Touch {
            light: 1.0,
            ..held_from(HELD_REACH)
        };
        return [held; 2];
    }
    let flowing = body_rest.map_or(held_from(REACH), |rest| approaching(REACH, rest));
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
