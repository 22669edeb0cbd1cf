"""Observations of a simulation at one time: energies, momenta, probes, rigid bodies, contact."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Array = NDArray[np.float64]


class Probe(NamedTuple):
    """A probe: position and displacement, m."""

    position: Array
    displacement: Array


class Pose(NamedTuple):
    """A rigid body: its centre (m) and its orientation as a unit quaternion (w, x, y, z)."""

    position: Array
    orientation: Array


class Contact(NamedTuple):
    """Contact at one time."""

    pairs: int
    """Number of pairs with a contact force."""
    smallest_gap: float
    """Their smallest gap, m; infinite without such pairs."""
    friction: float
    """Work of friction since the start, J."""
    damping: float
    """Work of the damping of contact since the start, J."""


class Observation(NamedTuple):
    """Energies (J), momenta, probes and rigid bodies at one time."""

    t: float
    kinetic: float
    elastic: float
    gravity: float
    load: float
    contact: float
    total: float
    momentum: Array
    angular_momentum: Array
    probes: dict[str, Probe]
    rigids: dict[str, Pose]
    load_factor: float | None = None
    contact_facts: Contact | None = None
