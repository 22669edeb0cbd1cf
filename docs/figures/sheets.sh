#!/usr/bin/env bash
# The pictures of docs/sheets.md: runs the scenes of sheets and draws frames of them. A few minutes.
# PYTHON names an interpreter with docs/figures/requirements.txt (default: python3).
set -euo pipefail
cd "$(dirname "$0")/../.."
binary=${BINARY:-target/release/variational}
[ -n "${BINARY:-}" ] || cargo build --release
out=${OUT:-out}
run() { "$binary" run "scenes/$1.toml" --quiet --out "$out/$1" || [ $? = 3 ]; }
draw() { "${PYTHON:-python3}" docs/figures/render_frame.py "$out/$1/$1.pvd" --out "docs/images/$1.png" "${@:2}"; }
for scene in ${*:-flag flag-200 tablecloth strip roll}; do
    run "$scene"
    case $scene in
        flag) draw flag --at 0.1 0.3 0.5 --by none --view 1 -1.4 0.6 --size 1500 700 ;;
        flag-200) draw flag-200 --at 0.2 0.4 0.6 --by none --no-edges --view 1 -1.4 0.6 --size 1500 700 ;;
        tablecloth) draw tablecloth --by none --view 1 -1.4 0.9 --size 1100 800 ;;
        strip) draw strip --at 0 0.35 0.45 0.6 --by none --no-edges --view 1.6 -1 0.6 --size 1600 420 ;;
        roll) draw roll --at 0 0.1 0.2 0.4 --by none --view 0.3 -1 0.35 --size 1600 600 ;;
    esac
done
