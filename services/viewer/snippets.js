// The request on the page as a command, as a program and as a recipe. The API key stays in the environment.

const shell = (text) => `'${text.replaceAll("'", `'\\''`)}'`;
const CONSTANTS = { true: "True", false: "False", null: "None" };

function python(value) {
  if (Array.isArray(value)) return `[${value.map(python).join(", ")}]`;
  if (typeof value === "string") return JSON.stringify(value);
  if (value === null || typeof value !== "object") return CONSTANTS[value] ?? String(value);
  return `{${Object.entries(value).map(([name, inner]) => `${JSON.stringify(name)}: ${python(inner)}`).join(", ")}}`;
}

/** `parts`: names of the files, by the part that each is. */
export function curlOf(request, parts, origin, withKey) {
  const files = Object.entries(parts).map(([part, file]) => `-F ${shell(`${part}=@"${file.replaceAll(/["\\]/g, "\\$&")}"`)}`);
  const lines = [`curl ${shell(`${origin}/v1/jobs?wait=60`)}`];
  if (withKey) lines.push('-H "Authorization: Bearer $DLO_API_KEY"');
  lines.push(`--form-string ${shell(`request=${JSON.stringify(request)}`)}`, ...files);
  return lines.join(" \\\n  ");
}

export function pythonOf({ kind, ...fields }, { image, depth }, origin) {
  const given = Object.entries(fields).map(([name, value]) => `${name}=${python(value)}`);
  const files = [python(image), ...(depth ? [`depth=${python(depth)}`] : [])].join(", ");
  return `from dlo_client import Client, InstancesRequest

with Client(${python(origin)}) as client:
    result = client.run(InstancesRequest(${given.join(", ")}), ${files})

for instance in result.instances:
    print(instance.id, instance.width_px, instance.centerline_xy[0])`;
}

/** The body of `PUT /v1/recipes/{number}`. */
export const recipeOf = (request, name) => ({ name, request });
