#!/usr/bin/env python3
"""Golden results: do two builds compute the same bits?

    golden.py scenes  BINARY SCENES            writes 200 violent scenes of seed 1 into the directory SCENES
    golden.py record  BINARY SCENES TABLE      runs all scenes, on 1 and on 2 threads, and writes their hashes
    golden.py compare TABLE TABLE              lists what differs; exit code 1 if anything does

The scenes are those of scenes/, shortened, and those in SCENES. Of each run the table holds hashes of history.csv, of
the last frame in 64 bits, of the counted work, and of the messages. Hashes are those of one machine and one toolchain:
this is a tool for changes that must not change results, not a test.
"""

import argparse
import concurrent.futures
import hashlib
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import tomllib

ROOT = pathlib.Path(__file__).resolve().parents[2]
COUNT = 200
SEED = 1
# Steps that a scene of scenes/ runs, and fewer where steps are long.
STEPS = 60
FEWER = {"flag-200": 12, "tuning-fork": 10, "csm3": 8, "bar-force": 20, "bar-gravity": 20}
# What the scenes of `variational modes` run.
MODES = {"cube-modes", "cube-modes-octant", "fv32"}
TIMEOUT = 240


def digest(data):
    return hashlib.sha256(data).hexdigest()[:16]


def settings(scene):
    """The overrides that shorten a scene and write its last state in 64 bits."""
    with open(scene, "rb") as file:
        content = tomllib.load(file)
    time = content["time"]
    end = time["end"]
    if "static" not in content and "step" in time:
        steps = FEWER.get(scene.stem, STEPS)
        end = min(end, steps * time["step"])
    pairs = [f"time.end={end!r}", f"output.interval={end!r}", 'output.precision="f64"', "output.history=1"]
    if "fields" not in content.get("output", {}):
        pairs.append('output.fields=["displacement", "velocity"]')
    # A shortened run breaks what its scene asserts of the end; that is no matter here.
    return [argument for pair in pairs for argument in ("--set", pair)]


def run(binary, scene, threads):
    """The hashes of one run."""
    with tempfile.TemporaryDirectory() as directory:
        out = pathlib.Path(directory)
        command = "modes" if scene.stem in MODES else "run"
        arguments = [binary, command, scene, "--out", out]
        if command == "run":
            arguments += ["--threads", str(threads), "--quiet", *settings(scene)]
        try:
            environment = {**os.environ, "RAYON_NUM_THREADS": str(threads)}
            done = subprocess.run(arguments, capture_output=True, timeout=TIMEOUT, cwd=ROOT, env=environment)
        except subprocess.TimeoutExpired:
            return {"timeout": TIMEOUT}
        messages = done.stderr.replace(str(out).encode(), b"OUT")
        result = {"exit": done.returncode, "messages": digest(messages)}
        for name in ("history.csv", "modes.csv"):
            if (out / name).exists():
                result[name] = digest((out / name).read_bytes())
        frames = sorted(out.glob("*.vtu"))
        if frames:
            result["frame"] = digest(frames[-1].read_bytes())
        if command == "run" and (out / "report.json").exists():
            report = json.loads((out / "report.json").read_text())
            kept = {key: report.get(key) for key in ("steps", "work", "substeps", "guard", "energy", "momentum")}
            result["report"] = digest(json.dumps(kept, sort_keys=True).encode())
        return result


def record(binary, scenes, table):
    binary = pathlib.Path(binary).resolve()
    files = sorted((ROOT / "scenes").rglob("*.toml")) + sorted(pathlib.Path(scenes).resolve().glob("*.toml"))
    jobs = [(scene, threads) for scene in files for threads in (1, 2)]
    with concurrent.futures.ThreadPoolExecutor(2) as pool:
        results = pool.map(lambda job: run(binary, *job), jobs)
        rows = {f"{scene.stem} on {threads}": result for (scene, threads), result in zip(jobs, results)}
    pathlib.Path(table).write_text(json.dumps(rows, indent=0))
    differing = [name for name in sorted({scene.stem for scene, _ in jobs})
                 if rows[f"{name} on 1"] != rows[f"{name} on 2"]]
    timeouts = [name for name, result in rows.items() if "timeout" in result]
    print(f"{len(rows)} runs; out of time: {timeouts}; depend on the number of threads: {differing}")
    return 1 if differing else 0


def compare(first, second):
    a, b = (json.loads(pathlib.Path(table).read_text()) for table in (first, second))
    count = 0
    for name in sorted(a.keys() | b.keys()):
        left, right = a.get(name, {}), b.get(name, {})
        parts = [part for part in sorted(left.keys() | right.keys()) if left.get(part) != right.get(part)]
        if parts:
            count += 1
            print(f"{name}: {', '.join(parts)} differ")
    print(f"{count} of {len(a)} runs differ")
    return 1 if count else 0


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("command", choices=("scenes", "record", "compare"))
    parser.add_argument("arguments", nargs="+")
    given = parser.parse_args()
    if given.command == "scenes":
        binary, scenes = given.arguments
        arguments = [binary, "stress", "--count", str(COUNT), "--seed", str(SEED), "--write", scenes]
        return subprocess.run(arguments).returncode
    if given.command == "record":
        return record(*given.arguments)
    return compare(*given.arguments)


if __name__ == "__main__":
    sys.exit(main())
