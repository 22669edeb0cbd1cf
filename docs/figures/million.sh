#!/usr/bin/env bash
# A million steps of a small body: energy and momenta over the whole run, as a picture.
# Needs matplotlib (pip install matplotlib). Takes seconds after the build.
set -euo pipefail
cd "$(dirname "$0")/../.."
cargo build --release
target/release/variational run scenes/million.toml --quiet --out out/million/stormer-verlet
target/release/variational run scenes/million.toml --quiet --out out/million/implicit-midpoint \
    --set 'time.scheme="implicit-midpoint"' --set solver.tolerance=1e-10
python3 docs/figures/plot_million.py out/million docs/images/million.png
