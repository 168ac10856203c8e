"""Colours of the pictures, as RGB from 0 to 1."""

import numpy as np
import numpy.typing as npt

Colors = npt.NDArray[np.float32]
"""Colours (..., 3), RGB from 0 to 1."""

SKY_TOP = np.array([0.035, 0.055, 0.115], dtype=np.float32)
SKY_BOTTOM = np.array([0.060, 0.105, 0.190], dtype=np.float32)
OUTSIDE = np.array([0.022, 0.034, 0.070], dtype=np.float32)
WALL = np.array([0.30, 0.38, 0.52], dtype=np.float32)
OBSTACLE = np.array([0.40, 0.45, 0.55], dtype=np.float32)
OBSTACLE_EDGE = np.array([0.62, 0.68, 0.78], dtype=np.float32)
RIGID = np.array([0.72, 0.46, 0.24], dtype=np.float32)
RIGID_EDGE = np.array([0.90, 0.66, 0.40], dtype=np.float32)

FAST = 2.5
"""Speed [m/s] from which on particles have the brightest colour."""

# Colours of each particle type at equally spaced speeds from 0 to FAST.
_RAMPS: dict[int, tuple[tuple[float, float, float], ...]] = {
    0: ((0.42, 0.30, 0.52), (0.52, 0.40, 0.62), (0.64, 0.54, 0.74), (0.80, 0.74, 0.88)),
    3: ((0.40, 0.45, 0.55), (0.40, 0.45, 0.55), (0.50, 0.56, 0.66), (0.62, 0.68, 0.78)),
    5: ((0.05, 0.24, 0.58), (0.09, 0.45, 0.85), (0.30, 0.70, 0.98), (0.80, 0.95, 1.00)),
    6: ((0.66, 0.47, 0.22), (0.78, 0.58, 0.29), (0.89, 0.70, 0.39), (0.97, 0.84, 0.56)),
    7: ((0.10, 0.42, 0.24), (0.16, 0.58, 0.32), (0.34, 0.75, 0.42), (0.70, 0.93, 0.62)),
    8: ((0.62, 0.36, 0.07), (0.80, 0.50, 0.10), (0.93, 0.66, 0.22), (1.00, 0.86, 0.52)),
}


def by_speed(kind: int, speed: npt.NDArray[np.floating]) -> Colors:
    """Return the colours (..., 3) of a particle type at speeds (...) [m/s].

    Types are 0 rigid, 3 kinematic, 5 water, 6 sand, 7 elastic and 8 viscous liquid.
    """
    ramp = np.array(_RAMPS[kind], dtype=np.float32)
    stops = np.linspace(0.0, FAST, len(ramp))
    return np.stack([np.interp(speed, stops, ramp[:, channel]) for channel in range(3)], axis=-1).astype(
        np.float32
    )


def mix(a: Colors, b: Colors, weight: npt.NDArray[np.floating]) -> Colors:
    """Blend colours: `a` where `weight` is 0, `b` where it is 1."""
    return a + (b - a) * weight[..., None].astype(np.float32)


def smoothstep(low: float, high: float, x: npt.NDArray[np.floating]) -> npt.NDArray[np.floating]:
    """Return a function of x that rises smoothly from 0 at `low` to 1 at `high`."""
    t = np.clip((x - low) / (high - low), 0.0, 1.0)
    return np.asarray(t * t * (3.0 - 2.0 * t))


def shrink(image: Colors, factor: int) -> Colors:
    """Return the image with `factor` x `factor` pixels averaged into one."""
    height, width = image.shape[0] // factor, image.shape[1] // factor
    return np.asarray(image.reshape(height, factor, width, factor, -1).mean(axis=(1, 3)))


def to_bytes(image: Colors) -> npt.NDArray[np.uint8]:
    """Return colours from 0 to 1 as bytes from 0 to 255, rounded."""
    return (np.clip(image, 0.0, 1.0) * 255.0 + 0.5).astype(np.uint8)
