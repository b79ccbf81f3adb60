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
# A worker with a GPU: its packages are only looked up, 2 GB would be installed.
listed='import json, sys
for one in json.load(sys.stdin)["install"]: print("{name}=={version}".format(**one["metadata"]))'
{
  echo "# Exact versions of service.txt with cuda.in in place of onnxruntime (Python 3.11); made by 'make lock'"
  "$fresh/bin/pip" install --quiet --dry-run --ignore-installed --report - \
    -r "$here/cuda.in" -r <(grep -v '^onnxruntime==' "$here/service.txt") |
    "$fresh/bin/python" -c "$listed" | sort --ignore-case
} >"$here/cuda.txt"
for extra in s3 telemetry; do
  rm -rf "$fresh" && "${1:-python3.11}" -m venv "$fresh"
  "$fresh/bin/pip" install --quiet -r "$here/service.txt" -r "$here/$extra.in"
  {
    echo "# Exact versions of $extra.in on top of service.txt (Python 3.11); made by 'make lock'"
    frozen | grep -vxFf "$here/service.txt"
  } >"$here/$extra.txt"
done
with=(-r "$here/service.txt" -r "$here/s3.txt" -r "$here/telemetry.txt")
"$fresh/bin/pip" install --quiet "${with[@]}" -r "$here/dev.in"
{
  echo "# Exact versions of dev.in on top of service.txt, s3.txt and telemetry.txt (Python 3.11); made by 'make lock'"
  frozen | grep -vxF -f "$here/service.txt" -f "$here/s3.txt" -f "$here/telemetry.txt"
} >"$here/dev.txt"
# The training extra is a part of dev.txt: the same versions, so that what is tested is what runs.
"${1:-python3.11}" -m venv --clear "$fresh"
"$fresh/bin/pip" install --quiet -r "$here/service.txt" -r "$here/training.in" -c "$here/dev.txt"
{
  echo "# Exact versions of training.in on top of service.txt (Python 3.11); made by 'make lock'"
  frozen | grep -vxFf "$here/service.txt"
} >"$here/training.txt"
