# Shortcuts; everything works without `just` too.

default:
    @just --list

# formatting, lints, documentation, tests
ci:
    bash .ci/run

# run a scene
run scene *arguments:
    cargo run --release -- run {{scene}} {{arguments}}

# criterion benchmarks
bench:
    cargo bench --workspace
