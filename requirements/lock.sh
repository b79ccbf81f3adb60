#!/usr/bin/env bash
# Resolve the .in files in a fresh environment and write the exact versions beside them.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
fresh=$(mktemp -d)
trap 'rm -rf "$fresh"' EXIT
"${1:-python3.11}" -m venv "$fresh"
frozen() { "$fresh/bin/pip" freeze | grep -vE '^(pip|setuptools)==' | sed 's/+cpu$//'; }
"$fresh/bin/pip" install --quiet -r "$here/service.in"
{ echo "# Exact versions of service.in (Python 3.11); made by 'make lock'"; frozen; } >"$here/service.txt"
"$fresh/bin/pip" install --quiet -r "$here/service.txt" -r "$here/dev.in"
{
  echo "# Exact versions of dev.in on top of service.txt (Python 3.11); made by 'make lock'"
  frozen | grep -vxFf "$here/service.txt"
} >"$here/dev.txt"
