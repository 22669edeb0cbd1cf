#!/usr/bin/env python3
"""Draws the pictures of docs/theory from the tables that the theory_* examples print.

    python docs/figures/plot_theory.py target/theory docs/images

docs/figures/make_theory.sh makes the tables and calls this.
"""

import csv
import pathlib
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

# Okabe and Ito's colours, told apart with any kind of colour vision.
COLOURS = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#000000", "#E69F00", "#56B4E9"]
plt.rcParams["axes.prop_cycle"] = plt.cycler(color=COLOURS)
plt.rcParams.update({"font.size": 9, "axes.grid": True, "grid.alpha": 0.3, "lines.linewidth": 1.1})


def read(path):
    """The table as {column: array}; a column of words stays a list of words."""
    with open(path, newline="") as file:
        rows = list(csv.DictReader(file))
    table = {}
    for name in rows[0]:
        values = [row[name] for row in rows]
        try:
            table[name] = np.array([float(value) for value in values])
        except ValueError:
            table[name] = np.array(values)
    return table


def groups(table, key):
    """(value, rows of that value) in the order of appearance."""
    for value in dict.fromkeys(table[key].tolist()):
        mask = table[key] == value
        yield value, {name: column[mask] for name, column in table.items()}


def axes(count, width=4.2, height=3.1):
    figure, panels = plt.subplots(1, count, figsize=(width * count, height), layout="constrained")
    return figure, np.atleast_1d(panels)


def label(panel, x, y, title=""):
    panel.set_xlabel(x)
    panel.set_ylabel(y)
    panel.set_title(title, fontsize=9)


def free_particle(t):
    figure, (a, b) = axes(2)
    a.plot(t["t"], t["free"] - t["free_exact"])
    label(a, "t", "x − exact", "free particle")
    b.semilogy(t["t"], np.abs(t["spring_by_action"] - t["spring_by_newton"]) + 1e-18, label="action − Newton")
    b.semilogy(t["t"], np.abs(t["spring_by_action"] - t["spring_exact"]) + 1e-18, label="action − exact")
    b.legend()
    label(b, "t", "difference", "mass and spring, h = 0.2")
    return figure


def oscillator(t):
    figure, (a, b) = axes(2)
    for name, rows in groups(t, "scheme"):
        a.plot(rows["q"], rows["p"], label=name)
        b.semilogy(rows["t"], rows["energy"], label=name)
    a.set_xlim(-2.5, 2.5)
    a.set_ylim(-2.5, 2.5)
    a.set_aspect("equal")
    b.legend(fontsize=7)
    label(a, "q", "p", "phase space, h = 0.2")
    label(b, "t", "energy")
    return figure


def pendulum(t):
    figure, (a, b) = axes(2)
    for h, rows in groups(t, "h"):
        a.plot(rows["t"], rows["energy_error"], label=f"h = {h}")
        b.plot(rows["t"], rows["shadow_error"], label=f"h = {h}")
    a.legend()
    label(a, "t", "H − H₀", "Störmer–Verlet: energy")
    label(b, "t", "H̃ − H̃₀", "shadow energy")
    return figure


def envelope(t):
    figure, (a,) = axes(1, 6)
    a.fill_between(t["window"] * 20_000, t["low"], t["high"], step="post", alpha=0.5)
    a.set_xlim(0, 1e6)
    label(a, "step", "H − H₀", "energy of a pendulum, extremes of each 20 000 steps")
    return figure


def spherical_pendulum(t):
    figure, (a, b, c) = axes(3, 3.8)
    for name, rows in groups(t, "method"):
        if name == "rattle":
            a.plot(rows["x"][:1500], rows["y"][:1500], linewidth=0.5)
        b.semilogy(rows["t"], np.abs(rows["off_surface"]) + 1e-17, label=name)
        c.semilogy(rows["t"], np.abs(rows["energy_error"]) + 1e-17, label=name, linewidth=0.7)
    a.set_aspect("equal")
    b.legend(fontsize=7)
    label(a, "x", "y", "seen from above")
    label(b, "t", "| |x| − 1 |", "distance from the sphere")
    label(c, "t", "|H − H₀|", "energy")
    return figure


def orbit(t):
    figure, (a, b, c) = axes(3, 3.8)
    for name, rows in groups(t, "scheme"):
        if name == "stormer-verlet":
            a.plot(rows["x"], rows["y"], linewidth=0.3)
        b.semilogy(rows["t"], np.abs(rows["energy_error"]) + 1e-17, label=name, linewidth=0.5)
        c.semilogy(rows["t"], np.abs(rows["momentum_error"]) + 1e-17, label=name, linewidth=0.5)
    a.set_aspect("equal")
    b.legend(fontsize=6)
    label(a, "x", "y", "Störmer–Verlet, h = 0.05, T = 200")
    label(b, "t", "|H − H₀|", "energy")
    label(c, "t", "|L − L₀|", "angular momentum")
    return figure


def henon_heiles(t):
    figure, panels = axes(2)
    for panel, (energy, rows) in zip(panels, groups(t, "energy")):
        for _, part in groups(rows, "orbit"):
            panel.plot(part["y"], part["py"], ".", markersize=1.2)
        label(panel, "y", "p_y", f"x = 0, energy 1/{round(1 / energy)}")
    return figure


def lever(t):
    figure, (a, b) = axes(2)
    a.plot(t["arm"], t["virtual_work"])
    a.axvline(8.0, color="k", linewidth=0.7, linestyle=":")
    label(a, "third arm (m)", "virtual work of tilting (J/rad)")
    b.plot(t["arm"], np.degrees(t["rest_angle"]), ".")
    label(b, "third arm (m)", "stable rest (degrees)")
    return figure


def bead(t):
    figure, (a, b) = axes(2)
    stable = t["stable"] == "true"
    for index, (_, rows) in enumerate(groups(t, "branch")):
        mask = rows["stable"] == "true"
        angle = np.abs(rows["angle"])
        a.plot(rows["omega"], np.where(mask, angle, np.nan), "-", color=COLOURS[index])
        a.plot(rows["omega"], np.where(mask, np.nan, angle), "--", color=COLOURS[index])
    b.plot(t["omega"][stable], t["frequency"][stable], ".", markersize=3)
    a.set_xlim(0, 6)
    b.set_xlim(0, 6)
    label(a, "ω (rad/s)", "angle from the top (degrees)", "equilibria: stable —, unstable – –")
    label(b, "ω (rad/s)", "frequency (rad/s)", "small oscillations")
    return figure


def free_body(t):
    figure, (a, b) = axes(2)
    for k in "123":
        a.plot(t["t"], t[f"spin{k}"], label=f"Π{k}")
    a.legend()
    b.semilogy(t["t"], np.abs(t["energy_error"]) + 1e-17, label="energy")
    b.semilogy(t["t"], t["momentum_error"] + 1e-17, label="momentum in space")
    b.legend()
    label(a, "t", "spin in the body", "intermediate axis")
    label(b, "t", "error", "Gauss, 2 stages")
    return figure


def heavy_top(t):
    figure, (a, b) = axes(2)
    a.plot(t["axis_x"], t["axis_y"])
    a.set_aspect("equal")
    for name in ["energy", "vertical", "axial"]:
        b.semilogy(t["t"], np.abs(t[f"{name}_error"]) + 1e-17, label=name, linewidth=0.6)
    b.legend()
    label(a, "x", "y", "the axis, seen from above")
    label(b, "t", "error", "energy and momenta, Gauss, 2 stages")
    return figure


def double_pendulum(t):
    figure, (a, b) = axes(2)
    a.plot(t["x"], t["z"], linewidth=0.5)
    a.set_aspect("equal")
    b.semilogy(t["t"], t["distance"], label="distance of neighbours")
    b.semilogy(t["t"], np.abs(t["energy_error"]) + 1e-17, label="energy error (J)", linewidth=0.6)
    b.legend()
    label(a, "x", "z", "path of the tip")
    label(b, "t (s)", "")
    return figure


def accelerations(t):
    figure, (a, b) = axes(2)
    a.plot(t["t"], t["q"], label="Hermite cubics")
    a.plot(t["t"], t["exact"], ":", label="exact")
    a.legend()
    b.plot(t["t"], t["error"])
    label(a, "t", "q", "frequencies 1 and 2")
    label(b, "t", "error", "h = 0.05")
    return figure


def bar(t):
    figure, (a, b) = axes(2)
    a.plot(t["t"], t["tip"] * 1e3, label="tip")
    a.plot(t["t"], t["middle"] * 1e3, label="middle")
    a.legend()
    b.plot(t["t"], t["error" if "error" in t else "energy_error"])
    label(a, "t (s)", "displacement (mm)", "a moving bar is caught at its end")
    label(b, "t (s)", "relative energy error", "implicit midpoint")
    return figure


PICTURES = [
    free_particle, oscillator, pendulum, envelope, spherical_pendulum, orbit, henon_heiles, lever, bead,
    free_body, heavy_top, double_pendulum, accelerations, bar,
]


def main():
    if len(sys.argv) != 3:
        sys.exit("usage: plot_theory.py TABLES IMAGES (two directories)")
    tables, images = map(pathlib.Path, sys.argv[1:])
    images.mkdir(parents=True, exist_ok=True)
    for picture in PICTURES:
        name = f"theory_{picture.__name__}"
        figure = picture(read(tables / f"{name}.csv"))
        figure.savefig(images / f"{name}.png", dpi=100)
        plt.close(figure)


if __name__ == "__main__":
    main()
