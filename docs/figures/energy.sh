#!/usr/bin/env bash
# The picture at the top of the README: total energy over 100 000 steps of one scene under several schemes.
# Needs matplotlib (pip install matplotlib). Takes a few minutes.
set -euo pipefail
cd "$(dirname "$0")/../.."
cargo build --release
for scheme in stormer-verlet implicit-midpoint energy-momentum backward-euler; do
    target/release/variational run scenes/energy.toml --quiet --out "out/energy/$scheme" --set "time.scheme=$scheme"
done
python3 docs/figures/plot_energy.py \
    "Störmer–Verlet=out/energy/stormer-verlet/history.csv" \
    "implicit midpoint=out/energy/implicit-midpoint/history.csv" \
    "energy–momentum=out/energy/energy-momentum/history.csv" \
    "backward Euler=out/energy/backward-euler/history.csv" \
    --step 5e-4 --out docs/images/energy.png
