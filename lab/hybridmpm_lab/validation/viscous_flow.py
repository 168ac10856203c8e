"""Viscous liquids and pastes: in a channel, between plates, as a puddle, and as a slump that stops."""

import numpy as np

from hybridmpm.mpm import MpmSolver
from hybridmpm.scene import Box, BoxObstacle, Liquid, Motion, Scene, Wall, WallFaces, Walls
from hybridmpm_lab.validation.case import Check, Curve, Floats, Panel, Result

LIQUIDS = {
    "Newtonian": (Liquid(viscosity=100), 4.0),
    "Bingham": (Liquid(viscosity=100, yield_stress=80), 3.2),
    "n = 0.5": (Liquid(viscosity=120, flow_index=0.5), 3.2),
}
"""Liquids of the channel with the gravity along it [m/s^2]."""
CHANNEL = 0.1
"""Width of the channel [m], a ninth of its length: its free ends are slowed less, and pull at the middle."""
_FINE, _PLACES = 192, (0.0, 0.35, 0.7)  # its grid [cells/m]; where its lower wall lies beyond a node [cells]
_PROFILE, _SPREAD = 0.03, 0.1  # accepted relative errors [-]
_WIDTH, _RESOLUTION, _G = 0.2, 128, 9.81  # of the other flows [m], [cells/m], [m/s^2]
_SPEED, _VISCOSITY = 0.2, 100.0  # of one plate against the other [m/s]; of what is between them [Pa s]
_SIDE = 0.2  # of the square that becomes a puddle [m]
_FRONT, _ROUND = 1.411, 0.894  # Huppert's constants of planar and of round puddles
_BLOCK = (0.24, 0.2, 0.24)  # that becomes a round puddle [m]
_CELLS, _SECONDS = 48, 1.6  # its grid [cells/m] and time [s]
_MUD = Liquid(viscosity=10, yield_stress=50)


def run(resolutions: tuple[int, ...] = (64, 128), seconds: float = 6.0) -> Result:
    """Run all four flows; the puddle and the slump at each resolution [cells/m], for so long."""
    parts = (_channel(), _plates(), _puddle(resolutions, seconds), _slump(resolutions, seconds))
    checks = [check for checks, _ in parts for check in checks]
    return Result([*checks, _round_puddle()], [panel for _, panel in parts])


def _channel() -> tuple[list[Check], Panel]:
    """Let liquids fall along a channel with sticky walls, whose ends are open."""
    checks, curves = [], []
    for k, (name, (liquid, gravity)) in enumerate(LIQUIDS.items()):
        weight = liquid.density * gravity
        fastest = channel_speed(liquid, np.zeros(1), weight)[0]
        errors = []
        for cells in _PLACES:
            lower = (round(0.3 * _FINE) + cells) / _FINE
            fluid = Box(material=liquid, lower=(0.05, lower), upper=(0.95, lower + CHANNEL))
            walls = Walls(lower=(0.0, lower), upper=(1.0, lower + CHANNEL), contact="sticky")
            scene = Scene(dim=2, resolution=_FINE, gravity=(gravity, 0), walls=walls, bodies=[fluid])
            solver = MpmSolver(scene)
            solver.advance(60)  # then the flow is steady
            y, u = _near_middle(solver)
            place = y - lower - CHANNEL / 2
            errors.append(_rms(u - channel_speed(liquid, place, weight)) / fastest)
        figure = f"channel, {name}: profile, rms over the largest speed"
        checks.append(Check.at_most(f"{figure}, worst of {len(_PLACES)} places", max(errors), _PROFILE))
        line = np.linspace(-CHANNEL / 2, CHANNEL / 2, 101)
        exact = channel_speed(liquid, line, weight) / fastest
        curves.append(Curve(*_means(place / CHANNEL, u / fastest), name, k, "o"))
        curves.append(Curve(line / CHANNEL, exact, colour=k))
    return checks, Panel("Channel", "place over the width", "speed over the largest", curves)


def channel_speed(liquid: Liquid, place: Floats, weight: float) -> Floats:
    """Return the steady speeds [m/s] at distances from the middle of the channel [m], by the law.

    The weight per volume along it [N/m^3] makes a shear stress in proportion to the distance.
    """
    power = 1 + 1 / liquid.flow_index

    def risen(distance: Floats) -> Floats:
        return np.asarray(np.maximum(weight * np.abs(distance) - liquid.yield_stress, 0) ** power)

    fall = risen(np.array(CHANNEL / 2)) - risen(place)
    return np.asarray(fall / (weight * liquid.viscosity ** (1 / liquid.flow_index) * power))


def _plates() -> tuple[list[Check], Panel]:
    """Shear blocks of two lengths between sticky plates that move apart; the difference has no ends."""
    drags = {}
    for length in (0.7, 0.4):
        sides = (0.5 - length / 2, 0.5 + length / 2)
        fluid = Box(
            material=Liquid(viscosity=_VISCOSITY), lower=(sides[0], 0.3), upper=(sides[1], 0.3 + _WIDTH)
        )
        plates = [
            BoxObstacle(
                lower=(0.0, y), upper=(1.0, y + 0.05), contact="sticky", motion=Motion(velocity=(side, 0.0))
            )
            for y, side in ((0.25, -_SPEED / 2), (0.3 + _WIDTH, _SPEED / 2))
        ]
        scene = Scene(dim=2, resolution=_RESOLUTION, gravity=(0, 0), bodies=[fluid], obstacles=plates)
        solver = MpmSolver(scene)
        solver.keep_forces()
        solver.advance(60)
        drags[length] = -float(solver.frame_forces()[-1, 0])
        y, u = _near_middle(solver)
        if length > 0.5:
            place, speed = (y - 0.3) / _WIDTH, u / _SPEED + 0.5
    stress = (drags[0.7] - drags[0.4]) / 0.3
    error = stress / (_VISCOSITY * _SPEED / _WIDTH) - 1
    checks = [
        Check.at_most("plates: profile, rms over the speed", _rms(speed - place), _PROFILE),
        Check.at_most("plates: shear stress, relative error", error, _PROFILE),
    ]
    curves = [Curve(*_means(place, speed), "Newtonian", 0, "o"), Curve((0, 1), (0, 1), colour=0)]
    return checks, Panel("Between plates", "place over the gap", "speed over the plate's", curves)


def _puddle(resolutions: tuple[int, ...], seconds: float) -> tuple[list[Check], Panel]:
    """Let a square spread on a floor, beside a smooth wall that stands for its other half."""
    scale = (_G * _SIDE**6 / (3 * _VISCOSITY / 1000.0)) ** 0.2
    checks, curves = [], []
    for k, resolution in enumerate(resolutions):
        solver = _let_go(Liquid(viscosity=_VISCOSITY), resolution)
        time, front = [], []
        while solver.frame * solver.scene.frame_dt < seconds:
            solver.advance(20)
            time.append(solver.frame * solver.scene.frame_dt)
            front.append(float(np.sort(solver.positions[:, 0])[-5:].mean()))
        t, x = np.array(time), np.array(front)
        late = t > seconds / 3
        error = float((x / (_FRONT * scale * t**0.2) - 1)[late].mean())
        checks.append(Check.at_most(f"puddle, {resolution}²: front, mean relative error", error, _SPREAD))
        power = float(np.polyfit(np.log(t[late]), np.log(x[late]), 1)[0])
        checks.append(Check.reported(f"puddle, {resolution}²: power of time", power, "0.2"))
        curves.append(Curve(t, x, f"{resolution} cells/m", k))
    curves.append(Curve(t, _FRONT * scale * t**0.2, "Huppert 1982", style="--"))
    scales = {"xscale": "log", "yscale": "log", "xticks": (0.1, 1), "xticklabels": ("0.1", "1")}
    ticks = {"yticks": (0.2, 0.3, 0.4, 0.5), "yticklabels": ("0.2", "0.3", "0.4", "0.5")}
    return checks, Panel("Puddle", "time [s]", "front [m]", curves, scales | ticks)


def _round_puddle() -> Check:
    """Let a quarter of a block spread in 3D, between smooth walls that stand for the others."""
    smooth = Wall(friction=0.0)
    faces = WallFaces(x_lower=smooth, z_lower=smooth)
    walls = Walls(lower=(0.0, 0.1, 0.0), upper=(0.9, 0.9, 0.9), faces=faces)
    wide, high, deep = _BLOCK
    quarter = Box(
        material=Liquid(viscosity=_VISCOSITY), lower=(0.0, 0.1, 0.0), upper=(wide / 2, 0.1 + high, deep / 2)
    )
    solver = MpmSolver(Scene(dim=3, resolution=_CELLS, walls=walls, bodies=[quarter]))
    solver.advance(round(_SECONDS / solver.scene.frame_dt))
    x, _, z = solver.positions.astype(np.float64).T
    sectors = (np.arctan2(z, x) / (np.pi / 16)).astype(int)
    radius = np.mean([np.sort(np.hypot(x, z)[sectors == k])[-3:].mean() for k in range(8)])
    scale = (_G * (wide * high * deep) ** 3 / (3 * _VISCOSITY / 1000.0)) ** 0.125
    error = float(radius / (_ROUND * scale * _SECONDS**0.125) - 1)
    return Check.at_most(f"round puddle, {_CELLS}³: radius, relative error", error, _SPREAD)


def _slump(resolutions: tuple[int, ...], seconds: float) -> tuple[list[Check], Panel]:
    """Let a square of mud slump until its yield stress holds it."""
    weight = _MUD.density * _G
    height = (3 * _MUD.yield_stress * _SIDE**2 / weight) ** (1 / 3)
    length = height**2 * weight / (2 * _MUD.yield_stress)
    checks, curves = [], []
    for k, resolution in enumerate(resolutions):
        solver = _let_go(_MUD, resolution)
        solver.advance(round(seconds / solver.scene.frame_dt))
        x, spacing = solver.positions.astype(np.float64), solver.scene.spacing
        places = np.arange(1.5 * solver.scene.dx, x[:, 0].max(), 2 * solver.scene.dx)
        near = [np.sort(x[np.abs(x[:, 0] - place) < solver.scene.dx, 1])[-4:] for place in places]
        top = np.array([column.mean() for column in near]) - 0.1 + spacing / 2
        checks += [
            Check.at_most(f"slump, {resolution}²: height, relative error", top[0] / height - 1, _SPREAD),
            Check.reported(
                f"slump, {resolution}²: run-out over that of a thin layer", x[:, 0].max() / length, "1"
            ),
        ]
        curves.append(Curve(places, top, f"{resolution} cells/m", k))
    line = np.linspace(0, length, 201)
    curves.append(Curve(line, height * np.sqrt(1 - line / length), "Liu and Mei 1989", style="--"))
    return checks, Panel("Slump", "place [m]", "height [m]", curves)


def _let_go(liquid: Liquid, resolution: int) -> MpmSolver:
    walls = Walls(lower=(0.0, 0.1), upper=(1.0, 0.9), faces=WallFaces(x_lower=Wall(friction=0.0)))
    square = Box(material=liquid, lower=(0.0, 0.1), upper=(_SIDE, 0.1 + _SIDE))
    return MpmSolver(Scene(dim=2, resolution=resolution, walls=walls, bodies=[square]))


def _near_middle(solver: MpmSolver) -> tuple[Floats, Floats]:
    """Return heights [m] and velocities along x [m/s] of the particles around the middle one."""
    x, v = solver.positions.astype(np.float64), solver.velocities.astype(np.float64)
    middle = np.abs(x[:, 0] - np.median(x[:, 0])) < 0.1
    return x[middle, 1], v[middle, 0]


def _means(place: Floats, value: Floats) -> tuple[Floats, Floats]:
    """Return means over 26 bins of the place."""
    bins = np.digitize(place, np.linspace(place.min(), place.max() + 1e-9, 27))
    return tuple(np.array([one[bins == k].mean() for k in range(1, 27)]) for one in (place, value))  # type: ignore[return-value]


def _rms(error: Floats) -> float:
    return float(np.sqrt(np.square(error).mean()))
