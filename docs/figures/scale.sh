#!/usr/bin/env bash
# Measures scenes/many-cells.toml on 1, 2 and 4 ranks of one thread for docs/scale.md: processor time and peak memory of
# every rank, and the time of the steps.
set -euo pipefail
cd "$(dirname "$0")/../.."
program=${VARIATIONAL_MPI:-mpi/target/release/variational-mpi}
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
for ranks in 1 2 4; do
    echo "$ranks ranks"
    # shellcheck disable=SC2086
    ${MPIEXEC:-mpiexec} -n "$ranks" python3 "$room/count.py" \
        "$program" run scenes/many-cells.toml --out "$room/out" --threads 1 --quiet "$@"
    grep -o '"[a-z]*_seconds": [0-9.]*' "$room/out/report.json"
done
