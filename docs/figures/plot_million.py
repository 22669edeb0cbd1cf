"""Energy and momenta of a million steps: plot_million.py DIRECTORY PICTURE."""

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

directory, picture = Path(sys.argv[1]), sys.argv[2]
figure, axes = plt.subplots(1, 3, figsize=(11, 3.2))
for run in sorted(path for path in directory.iterdir() if path.is_dir()):
    history = np.genfromtxt(run / "history.csv", delimiter=",", names=True)
    t, total = history["t"], history["total"]
    momentum = np.stack([history[name] for name in ("px", "py", "pz")])
    angular = np.stack([history[name] for name in ("lx", "ly", "lz")])
    changes = [
        (total - total[0]) / history["kinetic"].max(),
        np.linalg.norm(momentum - momentum[:, :1], axis=0) / np.linalg.norm(momentum[:, 0]),
        np.linalg.norm(angular - angular[:, :1], axis=0) / np.linalg.norm(angular[:, 0]),
    ]
    for axis, change in zip(axes, changes):
        axis.plot(t, change, linewidth=0.6, label=run.name)
for axis, name in zip(axes, ["energy", "linear momentum", "angular momentum"]):
    axis.set_title(f"{name}, relative change", fontsize=10)
    axis.set_xlabel("t / s")
axes[2].legend(frameon=False)
figure.tight_layout()
figure.savefig(picture, dpi=150)
