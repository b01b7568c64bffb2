#!/usr/bin/env bash
# Builds the Python wheel and installs it into a virtual environment of its own; prints that environment's Python.
#
#   python.sh                  the wheel and what its tests need
#   python.sh --engines        with pyspark, ray, dask, and the Java that Spark needs (by apt, as root, where there is none)
#   python.sh --engines-only   those alone, into an environment that has the wheel
#   python.sh --examples-only  what the examples exchange data with (rosbags, pylsl, …), as wheels, into such an environment
#   python.sh --tools-only     an environment that can build it, and no more
#
# Environment:
#   PYTHON3  the Python to start from, 3.10 or newer; default: python3. Installed by apt where there is none and this is root.
#   VENV     the environment; default: target/python
#   PROFILE  cargo's profile; default: release
set -euo pipefail
cd "$(dirname "$0")/.."
readonly venv=${VENV:-$PWD/target/python}

if ! command -v "${PYTHON3:-python3}" >/dev/null || ! "${PYTHON3:-python3}" -c 'import venv, ensurepip' 2>/dev/null; then
    scripts/apt.sh python3 python3-venv
fi
if [[ ${1:-} == --engines* ]] && ! command -v java >/dev/null; then
    scripts/apt.sh default-jre-headless
fi
[[ -x $venv/bin/python ]] || "${PYTHON3:-python3}" -m venv "$venv"
"$venv/bin/python" -m pip install --quiet 'maturin>=1.9,<2'
if [[ ${1:-} == --tools-only ]]; then exit 0; fi
if [[ ${1:-} == --engines-only ]]; then
    "$venv/bin/python" -m pip install --quiet "$(echo "$venv"/wheels/ohmstrain-*.whl)[spark,ray,dask]"
    exit
fi
if [[ ${1:-} == --examples-only ]]; then
    "$venv/bin/python" -m pip install --quiet --only-binary :all: "$(echo "$venv"/wheels/ohmstrain-*.whl)[examples]"
    exit
fi
rm -rf "$venv/wheels"
(cd crates/python && "$venv/bin/maturin" build --quiet --profile "${PROFILE:-release}" --locked --out "$venv/wheels" >&2)
extras=test
if [[ ${1:-} == --engines ]]; then extras=test,spark,ray,dask; fi
wheel=$(echo "$venv"/wheels/ohmstrain-*.whl)
"$venv/bin/python" -m pip install --quiet --force-reinstall --no-deps "$wheel"
"$venv/bin/python" -m pip install --quiet "$wheel[$extras]"
echo "$venv/bin/python"
