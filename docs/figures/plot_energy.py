#!/usr/bin/env python3
"""Draws the energy of several runs over time from their history.csv files.

    pip install -r docs/figures/requirements.txt
    python docs/figures/plot_energy.py --out docs/images/energy.png \\
        "Störmer–Verlet=out/verlet/history.csv" "implicit midpoint=out/midpoint/history.csv" \\
        "backward Euler=out/backward-euler/history.csv"

Default: total energy over its value at t = 0. --error: |E(t) - E(0)| over it, on a logarithmic scale.
--scale (joules) replaces the divisor where E(0) is zero or has an arbitrary part (gravity's zero).
--step (seconds) turns the axis into steps. Long runs are drawn by the least and the greatest value in
each of some 900 slices of time, joined by a band, so that no excursion is lost (of an error, only by the
greatest: that it crosses zero now and then is no merit).
"""

import argparse
import csv
import pathlib
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

# Okabe and Ito's colours, told apart with any kind of colour vision, the darker ones first for the white
# ground; line styles tell the curves apart in print.
COLOURS = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#000000", "#E69F00", "#56B4E9"]
STYLES = ["-", (0, (6, 2)), (0, (1.5, 1.5)), (0, (6, 2, 1.5, 2))]
INK, FAINT = "#222222", "#DDDDDD"
SLICES = 900


def labelled(text):
    label, equals, path = text.partition("=")
    if not equals or not label or not path:
        raise argparse.ArgumentTypeError(f"'{text}' is not LABEL=PATH")
    if not pathlib.Path(path).is_file():
        raise argparse.ArgumentTypeError(f"{path} is not there")
    return label, pathlib.Path(path)


def read_energy(path):
    with path.open(newline="") as file:
        rows = csv.reader(file)
        header = next(rows, [])
        if "t" not in header or "total" not in header:
            sys.exit(f"{path}: no columns t and total; there are: {', '.join(header) or 'none'}")
        t, total = header.index("t"), header.index("total")
        values = np.array([(row[t], row[total]) for row in rows], dtype=float)
    if len(values) < 2:
        sys.exit(f"{path}: fewer than two rows")
    return values.T


def envelope(times, values):
    """Least and greatest value in each slice of time; the samples themselves where they are few."""
    if len(times) <= 2 * SLICES:
        return times, values, values
    starts = np.linspace(0, len(times), SLICES, endpoint=False).astype(int)
    middle = (times[starts] + np.append(times[starts[1:]], times[-1])) / 2
    middle[0], middle[-1] = times[0], times[-1]
    return middle, np.fmin.reduceat(values, starts), np.fmax.reduceat(values, starts)


def spread(heights, gap):
    """Heights pushed apart, keeping their order, until neighbours are `gap` apart."""
    order = np.argsort(heights)
    placed = np.array(heights, float)[order]
    for _ in range(200):
        overlap = gap - np.diff(placed)
        if np.all(overlap <= 1e-9):
            break
        for i in np.flatnonzero(overlap > 0):
            placed[i] -= overlap[i] / 2
            placed[i + 1] += overlap[i] / 2
    result = np.empty_like(placed)
    result[order] = placed
    return result


def main():
    parser = argparse.ArgumentParser(description="Draws the energy of several runs over time.")
    parser.add_argument("runs", nargs="+", type=labelled, metavar="LABEL=PATH", help="a run's history.csv")
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("energy.png"))
    parser.add_argument("--error", action="store_true", help="relative energy error, logarithmic")
    parser.add_argument("--scale", type=float, help="divisor in joules instead of |E(0)|")
    parser.add_argument("--step", type=float, help="time step in seconds: the axis counts steps")
    parser.add_argument("--title", default="")
    parser.add_argument("--width", type=float, default=8.0, help="inches")
    parser.add_argument("--height", type=float, default=3.6, help="inches")
    arguments = parser.parse_args()
    for name in ["scale", "step"]:
        value = getattr(arguments, name)
        if value is not None and not value > 0:
            parser.error(f"--{name} {value}: must be positive")

    plt.rcParams.update({"font.family": "sans-serif", "font.size": 11, "text.color": INK,
                         "axes.labelcolor": INK, "xtick.color": INK, "ytick.color": INK})
    figure, axes = plt.subplots(figsize=(arguments.width, arguments.height))
    figure.patch.set_facecolor("white")
    ends = []
    for i, (label, path) in enumerate(arguments.runs):
        times, energy = read_energy(path)
        scale = arguments.scale or abs(energy[0])
        if scale == 0:
            sys.exit(f"{path}: the energy at t = 0 is zero; give the exchanged energy with --scale")
        shown = np.abs(energy - energy[0]) / scale if arguments.error else energy / scale
        if arguments.error:
            shown = np.where(shown == 0, np.nan, shown)  # nothing to show on a logarithmic scale
        axis, least, greatest = envelope(times / (arguments.step or 1), shown)
        colour, style = COLOURS[i % len(COLOURS)], STYLES[i % len(STYLES)]
        if not arguments.error:
            axes.fill_between(axis, least, greatest, color=colour, alpha=0.35, linewidth=0)
        axes.plot(axis, greatest, color=colour, linestyle=style, linewidth=1.8, solid_capstyle="round")
        ends.append((label, colour, axis[-1], greatest[-1]))

    if arguments.error:
        axes.set_yscale("log")
    axes.set_xlabel("step" if arguments.step else "time, s")
    axes.set_ylabel("relative energy error" if arguments.error else
                    "energy, J" if arguments.scale == 1 else "energy / energy at the start")
    axes.margins(x=0)
    if arguments.step:
        axes.xaxis.set_major_formatter(lambda value, _: f"{value:,.0f}".replace(",", "\u2009"))
    axes.grid(axis="y", color=FAINT, linewidth=0.8)
    axes.set_axisbelow(True)
    for side in ["top", "right", "left"]:
        axes.spines[side].set_visible(False)
    axes.spines["bottom"].set_color(INK)
    axes.tick_params(length=0, pad=6)
    if arguments.title:
        axes.set_title(arguments.title, loc="left", fontsize=12, fontweight="bold", pad=12)

    # Labels stand at the ends of their curves instead of in a box.
    figure.tight_layout()
    heights = [axes.transAxes.inverted().transform(axes.transData.transform((x, y)))[1] for _, _, x, y in ends]
    for (label, colour, _, _), height in zip(ends, spread(np.nan_to_num(heights), 0.085)):
        axes.text(1.015, height, label, transform=axes.transAxes, color=colour, va="center", fontweight="bold")
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(arguments.out, dpi=150, bbox_inches="tight", facecolor="white", metadata={"Software": None})
    print(arguments.out)


if __name__ == "__main__":
    main()
