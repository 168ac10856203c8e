// A scene as a file in YAML, as the library and the command line read it: a line for each part.

/** A number with a point, which YAML asks for where there is an exponent. */
const numeral = (x) => String(x).replace(/^(-?\d+)e/, "$1.0e").replace(/e(\d)/, "e+$1");

function flow(value) {
  if (Array.isArray(value)) return `[${value.map(flow).join(", ")}]`;
  if (typeof value === "number") return numeral(value);
  if (value === null || typeof value !== "object") return JSON.stringify(value);
  return `{${Object.entries(value).filter(([, one]) => one !== undefined).map(([key, one]) => `${key}: ${flow(one)}`).join(", ")}}`;
}

/** The text of a scene file. */
export function yamlOf(scene) {
  const lines = Object.entries(scene)
    .filter(([, value]) => value !== null && !(Array.isArray(value) && value.length === 0))
    .map(([key, value]) => {
      const isList = Array.isArray(value) && typeof value[0] === "object";
      return isList ? [`${key}:`, ...value.map((part) => `  - ${flow(part)}`)].join("\n") : `${key}: ${flow(value)}`;
    });
  return `${lines.join("\n")}\n`;
}
