// The request on the page as a command, as a program and as a recipe. The API key stays in the environment.

const shell = (text) => `'${text.replaceAll("'", `'\\''`)}'`;
const CONSTANTS = { true: "True", false: "False", null: "None" };

function python(value) {
  if (Array.isArray(value)) return `[${value.map(python).join(", ")}]`;
  if (typeof value === "string") return JSON.stringify(value);
  if (value === null || typeof value !== "object") return CONSTANTS[value] ?? String(value);
  return `{${Object.entries(value).map(([name, inner]) => `${JSON.stringify(name)}: ${python(inner)}`).join(", ")}}`;
}

/** What the Python program asks for, by kind; what it goes through of the answer, and what it prints of each. */
const PROGRAMS = {
  instances: ["InstancesRequest", "instance", "instances", ["id", "width_px", "centerline_xy[0]"]],
  topology: ["TopologyRequest", "section", "sections", ["id", "length_px", "ends"]],
  plan_disentangle: ["DisentangleRequest", "action", "actions", ["rank", "section", "score"]],
  reconstruct: ["ReconstructRequest", "point", "curve.points_m", []],
};

/** `parts`: the name of the file, or the names of several, by the part that each is. */
export function curlOf(request, parts, origin, withKey) {
  const part = (name, file) => `-F ${shell(`${name}=@"${file.replaceAll(/["\\]/g, "\\$&")}"`)}`;
  const files = Object.entries(parts).flatMap(([name, all]) => [all].flat().map((file) => part(name, file)));
  const lines = [`curl ${shell(`${origin}/v1/jobs?wait=60`)}`];
  if (withKey) lines.push('-H "Authorization: Bearer $DLO_API_KEY"');
  lines.push(`--form-string ${shell(`request=${JSON.stringify(request)}`)}`, ...files);
  return lines.join(" \\\n  ");
}

export function pythonOf({ kind, ...fields }, { image, ...parts }, origin) {
  const [request, item, items, fieldsOf] = PROGRAMS[kind];
  const shown = fieldsOf.length ? fieldsOf.map((name) => `${item}.${name}`).join(", ") : item;
  const named = (given) => Object.entries(given).map(([name, value]) => `${name}=${python(value)}`);
  const files = [...(image ? [python(image)] : []), ...named(parts)];
  return `from dlo_client import Client, ${request}

with Client(${python(origin)}) as client:
    result = client.run(${[`${request}(${named(fields).join(", ")})`, ...files].join(", ")})

for ${item} in result.${items}:
    print(${shown})`;
}

/** The body of `PUT /v1/recipes/{number}`. */
export const recipeOf = (request, name) => ({ name, request });
