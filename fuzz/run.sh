#!/usr/bin/env bash
# Fuzzes every reader: fuzz/run.sh [executions per reader, default 1000000] [readers…]
# Needs a nightly toolchain and `cargo install cargo-fuzz`. Seeds are the sample files of vi-io; findings stay in
# fuzz/artifacts. Files are at most 8 KiB, of which no single allocation may exceed 96 MiB: what zlib could pack there.
set -euo pipefail
cd "$(dirname "$0")"
runs=${1:-1000000}
shift || true
for reader in "${@:-msh vtk vtu obj stl inp scene checkpoint}"; do
    for target in $reader; do
        mkdir -p "corpus/$target"
        features=()
        case "$target" in
            scene) cp ../scenes/*.toml corpus/scene/ && features=(--features program) ;;
            # From nothing: the target adds header and checksum to whatever it is given.
            checkpoint) features=(--features program) ;;
            *) cp ../crates/vi-io/tests/data/*."$target" "corpus/$target/" ;;
        esac
        [ "$target" != vtu ] || cp ../crates/vi-io/tests/data/*.vtp corpus/vtu/
        cargo +nightly fuzz run ${features[@]+"${features[@]}"} "$target" -- -runs="$runs" -max_len=8192 -malloc_limit_mb=96 -rss_limit_mb=2048 \
            -timeout=10 -print_final_stats=1
    done
done
