// Everything but the particles: walls and obstacles, drawn with Canvas2D and hence crisp.

import { cornersOf, placed } from "./motion.js";
import { drawFlatObstacle, drawFlatWalls, drawTank } from "./scenery2d.js";
import { drawBox, drawEdges, drawSolidObstacle } from "./scenery3d.js";

/** Draw what lies behind the particles, at a simulated time [s]. */
export function drawBackdrop(context, view, scene, time) {
  if (scene.dim === 2) {
    drawTank(context, view, scene.walls);
  } else {
    drawBox(context, view, scene.walls);
    scene.obstacles.forEach((obstacle) => drawSolidObstacle(context, view, placed(obstacle, time)));
  }
}

/** Whether the backdrop changes with time. */
export function backdropMoves(scene) {
  return scene.dim === 3 && scene.obstacles.some((obstacle) => obstacle.motion !== undefined);
}

/** Draw what lies in front of the particles, at a simulated time [s]; `bodies` are the rigid ones, or null. */
export function drawForeground(context, view, scene, time, bodies) {
  if (scene.dim === 2) {
    scene.obstacles.forEach((obstacle) => drawFlatObstacle(context, view, placed(obstacle, time)));
    bodies?.drawFlat(context, view);
    drawFlatWalls(context, view, scene.walls);
  } else {
    drawEdges(context, view, cornersOf(scene.walls), true);
  }
}
