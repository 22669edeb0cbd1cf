#!/usr/bin/env bash
# The pictures of docs/contact-gallery.md: runs the scenes of scenes/contact and draws frames of them. A few minutes.
# PYTHON names an interpreter with docs/figures/requirements.txt (default: python3).
set -euo pipefail
cd "$(dirname "$0")/../.."
binary=${BINARY:-target/release/variational}
[ -n "${BINARY:-}${DRAW_ONLY:-}" ] || cargo build --release
out=${OUT:-out/contact}
draw() { "${PYTHON:-python3}" docs/figures/render_frame.py "$out/$1/$1.pvd" --by none --out "docs/images/contact/$1.png" "${@:2}"; }
for scene in ${*:-folding-flag tablecloth skirt-on-body ball-on-drum dominoes cards twisted-mat newtons-cradle bolt \
        rope jelly-stack gripper}; do
    [ -n "${DRAW_ONLY:-}" ] || "$binary" run "scenes/contact/$scene.toml" --quiet --out "$out/$scene"
    case $scene in
        folding-flag) draw folding-flag --at 0.2 0.4 0.6 0.9 --up 1 0 0 --view 0.5 -0.8 1.2 --size 1200 360 ;;
        tablecloth) draw tablecloth --view 1 -1.4 0.6 --size 900 560 ;;
        skirt-on-body) draw skirt-on-body --at 0.1 0.4 0.8 --view 0.2 -1.4 0.3 --size 1200 460 ;;
        ball-on-drum) draw ball-on-drum --at 0 0.25 0.5 --view 1 -1.4 0.5 --size 1200 300 ;;
        twisted-mat) draw twisted-mat --at 0.25 1.25 --view 0 -1.4 0.5 --size 1200 130 ;;
        dominoes) draw dominoes --at 0.2 0.6 0.85 --no-edges --view 0.6 -1.4 0.5 --size 1200 280 ;;
        cards) draw cards --no-edges --view 0.5 -1.4 0.4 --size 560 420 ;;
        newtons-cradle) draw newtons-cradle --at 0 0.4 0.75 --no-edges --view 0.2 -1.4 0.2 --size 1200 220 ;;
        bolt) draw bolt --exaggerate 20 --view 1.2 -0.9 0.8 --size 800 620 ;;
        rope) draw rope --at 0.2 0.7 1.2 --view 1 -1.4 0.7 --size 1200 480 ;;
        jelly-stack) draw jelly-stack --at 0 0.4 1.2 --size 1200 400 ;;
        gripper) draw gripper --at 0 0.4 1.5 --view 0.4 -1.4 0.4 --size 1200 400 ;;
    esac
done
