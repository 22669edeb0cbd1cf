#!/usr/bin/env bash
# Measures the program on 1, 2 and 4 ranks of one thread for docs/scale.md: processor time and peak memory of every rank, and
# the time of the steps.
#   docs/figures/scale.sh            one mesh of 1 029 000 tetrahedra (strong scaling)
#   docs/figures/scale.sh weak       257 250 tetrahedra per rank
#   docs/figures/scale.sh parted     one mesh from a file, read whole by every rank, then parted beforehand
#   docs/figures/scale.sh threads    one mesh, by two ranks of one thread and by one rank of two: for a quiet machine
# Further arguments go to the program.
set -euo pipefail
cd "$(dirname "$0")/../.."
program=${VARIATIONAL_MPI:-mpi/target/release/variational-mpi}
kind=strong
if [ $# -gt 0 ] && [[ $1 =~ ^(strong|weak|threads|parted)$ ]]; then
    kind=$1
    shift
fi
room=$(mktemp -d)
trap 'rm -rf "$room"' EXIT
# Runs the program and prints what the operating system counted for it.
cat > "$room/count.py" <<'PYTHON'
import resource, subprocess, sys

code = subprocess.run(sys.argv[1:], close_fds=False).returncode
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(f"a rank: {used.ru_utime:.1f} s of processor time, {used.ru_maxrss / 1024:.0f} MiB", flush=True)
sys.exit(code)
PYTHON
# measure RANKS THREADS CELLS ARGUMENTS…
measure() {
    echo "$1 ranks of $2 threads, cells = $3"
    sed "s/cells = \[.*\], element/cells = $3, element/" scenes/many-cells.toml > "$room/scene.toml"
    # shellcheck disable=SC2086
    ${MPIEXEC:-mpiexec} -n "$1" python3 "$room/count.py" \
        "$program" run "$room/scene.toml" --out "$room/out" --threads "$2" --quiet "${@:4}"
    grep -o '"[a-z]*_seconds": [0-9.]*\|"bytes_per_force": [0-9]*' "$room/out/report.json"
}
# measure_file RANKS MESH ARGUMENTS…: a free block from a mesh file
measure_file() {
    echo "$1 ranks of 1 thread, mesh = $2"
    sed "s|^box = .*|mesh = \"$2\"|; /^\[\[fix\]\]/,/^region/d" scenes/many-cells.toml > "$room/scene.toml"
    # shellcheck disable=SC2086
    ${MPIEXEC:-mpiexec} -n "$1" python3 "$room/count.py" \
        "$program" run "$room/scene.toml" --out "$room/out" --threads 1 --quiet "${@:3}"
    grep -o '"[a-z]*_seconds": [0-9.]*\|"in_parts": [a-z]*' "$room/out/report.json"
    sha256sum "$room/out/history.csv"
}
whole="[140, 35, 35]"
case $kind in
    strong) for ranks in 1 2 4; do measure $ranks 1 "$whole" "$@"; done ;;
    weak)
        measure 1 1 "[35, 35, 35]" "$@"
        measure 2 1 "[70, 35, 35]" "$@"
        measure 4 1 "$whole" "$@"
        ;;
    parted)
        # A frame at the start is the mesh.
        sed "s/cells = \[.*\], element/cells = $whole, element/" scenes/many-cells.toml > "$room/scene.toml"
        "$program" run "$room/scene.toml" --out "$room/mesh" --quiet --set time.end=1e-5 \
            --set output.interval=1 --set 'output.precision="f64"'
        mesh=$room/mesh/scene_000000.vtu
        python3 "$room/count.py" "$program" part "$mesh" --parts 16 --out "$room/block.parted"
        for ranks in 1 2 4 8; do measure_file $ranks "$mesh" "$@"; done
        for ranks in 1 2 4 8; do measure_file $ranks "$room/block.parted" "$@"; done
        ;;
    threads)
        measure 2 1 "$whole" "$@"
        measure 1 2 "$whole" "$@"
        ;;
esac
