// Shaded pictures of surfaces in space, with what flows as glass: software, since a surface is drawn when a hand moves it.

const LIGHT = [-0.42, 0.68, 0.6]; // to the right, upwards, towards the eye
const GLASS = 0.45; // share of what flows in what is seen through it

/**
 * Draw surfaces into a square canvas.
 *
 * @param view {rows: unit vectors to the right, upwards and towards the eye, middle, scale: shares of the picture's side in a metre}
 * @param parts [{surface: 6 numbers for each corner, place and normal; rgb; isGlass}]
 */
export function shade(canvas, view, parts) {
  const side = canvas.width;
  const context = canvas.getContext("2d");
  const picture = context.createImageData(side, side);
  const layers = [false, true].map((isGlass) => {
    const layer = { depth: new Float32Array(side * side).fill(-Infinity), colour: new Uint32Array(side * side) };
    parts.filter((part) => part.isGlass === isGlass).forEach((part) => fill(layer, side, view, part));
    return layer;
  });
  blend(picture.data, ...layers);
  context.putImageData(picture, 0, 0);
}

function fill({ depth, colour }, side, { rows, middle, scale }, { surface, rgb }) {
  const [right, up, towards] = rows;
  const [red, green, blue] = rgb;
  const [x, y, z, bright] = [0, 1, 2, 3].map(() => new Float64Array(3));
  for (let at = 0; at < surface.length; at += 18) {
    for (let i = 0; i < 3; i += 1) {
      const k = at + 6 * i;
      const [a, b, c] = [surface[k] - middle[0], surface[k + 1] - middle[1], surface[k + 2] - middle[2]];
      x[i] = side * (0.5 + scale * (a * right[0] + b * right[1] + c * right[2]));
      y[i] = side * (0.5 - scale * (a * up[0] + b * up[1] + c * up[2]));
      z[i] = a * towards[0] + b * towards[1] + c * towards[2];
      const [p, q, r] = [surface[k + 3], surface[k + 4], surface[k + 5]];
      const faces = p * towards[0] + q * towards[1] + r * towards[2];
      const lit = (p * right[0] + q * right[1] + r * right[2]) * LIGHT[0] + (p * up[0] + q * up[1] + r * up[2]) * LIGHT[1] + faces * LIGHT[2];
      bright[i] = 0.45 + 0.6 * Math.max(0, faces < 0 ? -lit : lit);
    }
    const area = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0]);
    if (area === 0) continue;
    const [top, bottom] = [Math.max(0, Math.ceil(Math.min(...y) - 0.5)), Math.min(side - 1, Math.floor(Math.max(...y) - 0.5))];
    const [left, end] = [Math.max(0, Math.ceil(Math.min(...x) - 0.5)), Math.min(side - 1, Math.floor(Math.max(...x) - 0.5))];
    // Shares of the second and third corner, and how they grow from column to column.
    const [stepB, stepC] = [(y[2] - y[0]) / area, (y[0] - y[1]) / area];
    for (let row = top; row <= bottom; row += 1) {
      const [across, down] = [left + 0.5 - x[0], row + 0.5 - y[0]];
      let b = (across * (y[2] - y[0]) - (x[2] - x[0]) * down) / area;
      let c = ((x[1] - x[0]) * down - across * (y[1] - y[0])) / area;
      for (let column = left; column <= end; column += 1, b += stepB, c += stepC) {
        const a = 1 - b - c;
        if (a < 0 || b < 0 || c < 0) continue;
        const here = a * z[0] + b * z[1] + c * z[2];
        const pixel = row * side + column;
        if (here <= depth[pixel]) continue;
        depth[pixel] = here;
        const light = a * bright[0] + b * bright[1] + c * bright[2];
        colour[pixel] = (Math.min(255, blue * light) << 16) | (Math.min(255, green * light) << 8) | Math.min(255, red * light);
      }
    }
  }
}

/** Lay what flows, where it is in front, over what is solid. */
function blend(bytes, solid, glass) {
  for (let i = 0; i < solid.colour.length; i += 1) {
    const hasSolid = solid.depth[i] > -Infinity;
    const hasGlass = glass.depth[i] > solid.depth[i];
    if (!hasSolid && !hasGlass) continue;
    const share = !hasGlass ? 0 : hasSolid ? GLASS : 1;
    for (let channel = 0; channel < 3; channel += 1) {
      const below = (solid.colour[i] >> (8 * channel)) & 255;
      const above = (glass.colour[i] >> (8 * channel)) & 255;
      bytes[4 * i + channel] = below + (above - below) * share;
    }
    bytes[4 * i + 3] = hasSolid ? 255 : 255 * (0.35 + GLASS);
  }
}
