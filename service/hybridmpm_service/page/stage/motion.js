// Where a moving obstacle is at a simulated time: the `motion` of docs/reference/http-api.md.

/** An obstacle of the scene as it stands at `time` [s]; a moving box has `corners`, ordered as by cornersOf. */
export function placed(obstacle, time) {
  if (obstacle.motion === undefined) return obstacle;
  const moved = moverAt(obstacle.motion, time);
  switch (obstacle.shape) {
    case "cylinder":
    case "segment":
      return { ...obstacle, start: moved(obstacle.start), end: moved(obstacle.end) };
    case "ball":
      return { ...obstacle, center: moved(obstacle.center) };
    case "box":
      return { ...obstacle, corners: cornersOf(obstacle).map(moved) };
    case "polygon":
    case "mesh":
      return { ...obstacle, vertices: obstacle.vertices.map(moved) };
    default: {
      const point = moved(obstacle.point);
      const tip = moved(obstacle.point.map((value, axis) => value + obstacle.normal[axis]));
      return { ...obstacle, point, normal: tip.map((value, axis) => value - point[axis]) };
    }
  }
}

/** Corners of an axis-aligned box; bit k of the index chooses the upper side along axis k. */
export function cornersOf({ lower, upper }) {
  return Array.from({ length: 2 ** lower.length }, (_, bits) =>
    lower.map((low, axis) => ((bits >> axis) & 1 ? upper[axis] : low)),
  );
}

/** A function that moves a point of an obstacle at time 0 to its place at `time` [s]. */
function moverAt(motion, time) {
  const clock = clockOf(motion, time);
  const spin = motion.angular_velocity ?? 0;
  return (point) => {
    const center = motion.center ?? point;
    const arm = point.map((value, axis) => value - center[axis]);
    const turned = Array.isArray(spin) ? turnInSpace(arm, spin, clock) : turnInPlane(arm, spin * clock);
    return turned.map((value, axis) => center[axis] + value + (motion.velocity?.[axis] ?? 0) * clock);
  };
}

/** Seconds of motion at the given velocities: the time itself, or less for a swing, which comes back. */
function clockOf({ period, phase = 0 }, time) {
  if (period === undefined) return time;
  const swing = (turns) => Math.sin(2 * Math.PI * turns);
  return (period / (2 * Math.PI)) * (swing(time / period + phase) - swing(phase));
}

function turnInPlane(arm, angle) {
  if (angle === 0) return arm;
  const [cosine, sine] = [Math.cos(angle), Math.sin(angle)];
  return [cosine * arm[0] - sine * arm[1], sine * arm[0] + cosine * arm[1]];
}

/** Turn an arm about the axis of `spin` [rad/s] by Rodrigues' formula. */
function turnInSpace(arm, spin, clock) {
  const speed = Math.hypot(...spin);
  if (speed === 0) return arm;
  const [x, y, z] = spin.map((value) => value / speed);
  const [cosine, sine] = [Math.cos(speed * clock), Math.sin(speed * clock)];
  const along = (x * arm[0] + y * arm[1] + z * arm[2]) * (1 - cosine);
  return [
    cosine * arm[0] + sine * (y * arm[2] - z * arm[1]) + along * x,
    cosine * arm[1] + sine * (z * arm[0] - x * arm[2]) + along * y,
    cosine * arm[2] + sine * (x * arm[1] - y * arm[0]) + along * z,
  ];
}
