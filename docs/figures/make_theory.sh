#!/usr/bin/env bash
# Runs every example of docs/theory and draws its picture into docs/images.
# Needs Python with docs/figures/requirements.txt; tables go to target/theory.
set -euo pipefail
cd "$(dirname "$0")/../.."
out=target/theory
mkdir -p "$out"
cargo build --release --examples --locked
for source in examples/theory_*.rs; do
    name=$(basename "$source" .rs)
    echo "$name"
    "${CARGO_TARGET_DIR:-target}/release/examples/$name" > "$out/$name.csv"
done
"${PYTHON:-python3}" docs/figures/plot_theory.py "$out" docs/images
