// The request on the page as a command, as a program and as a recipe. The API key stays in the environment.

const shell = (text) => `'${text.replaceAll("'", `'\\''`)}'`;
const python = (value) => (typeof value === "string" ? JSON.stringify(value) : String(value));

export function curlOf(request, fileName, origin, withKey) {
  const part = `image=@"${fileName.replaceAll(/["\\]/g, "\\$&")}"`;
  const lines = [`curl ${shell(`${origin}/v1/jobs?wait=60`)}`];
  if (withKey) lines.push('-H "Authorization: Bearer $DLO_API_KEY"');
  lines.push(`--form-string ${shell(`request=${JSON.stringify(request)}`)}`, `-F ${shell(part)}`);
  return lines.join(" \\\n  ");
}

export function pythonOf({ kind, ...fields }, fileName, origin) {
  const given = Object.entries(fields).map(([name, value]) => `${name}=${python(value)}`);
  return `from dlo_client import Client, InstancesRequest

with Client(${python(origin)}) as client:
    result = client.run(InstancesRequest(${given.join(", ")}), ${python(fileName)})

for instance in result.instances:
    print(instance.id, instance.width_px, instance.centerline_xy[0])`;
}

/** The body of `PUT /v1/recipes/{number}`. */
export const recipeOf = (request, name) => ({ name, request });
