#!/usr/bin/env bash
# Compares P1 with MuJoCo and MFEM (see compare.py): installs them from PyPI into target/peers, builds
# the release binary, runs. Arguments go to compare.py.
set -euo pipefail
cd "$(dirname "$0")/../.."
venv=target/peers/venv
if [ ! -x "$venv/bin/python" ]; then
    python3 -m venv "$venv"
    "$venv/bin/pip" install --quiet --requirement benches/peers/requirements.txt
fi
cargo build --release --quiet
exec "$venv/bin/python" benches/peers/compare.py "$@"
