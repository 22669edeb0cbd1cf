"""The errors of the package. All can be pickled, so that they cross processes."""

from __future__ import annotations

from typing import NamedTuple


class Problem(NamedTuple):
    """One problem of a scene."""

    key: str
    """The key, such as `body[0].material.density`; empty for the whole scene."""
    message: str
    """What is wrong, and what to write instead."""
    line: int | None = None
    """The line of the scene file, from 1; None for a scene that is not a file or text."""
    file: str | None = None
    """The scene file."""

    def __str__(self) -> str:
        place = "" if self.file is None else f"{self.file}:"
        place += "" if self.line is None else f"{self.line}: " if self.file else f"line {self.line}: "
        return place + (f"{self.key}: " if self.key else "") + self.message


class Error(Exception):
    """An error of the package."""


class SceneError(Error, ValueError):
    """A scene or its meshes have problems. `problems` holds all of them."""

    problems: list[Problem]

    def __init__(self, problems: list[tuple[str, str, int | None, str | None]]) -> None:
        super().__init__(problems)
        self.problems = [Problem(*problem) for problem in problems]

    def __str__(self) -> str:
        return "\n".join(str(problem) for problem in self.problems)


class StepError(Error, ArithmeticError):
    """A step failed. The state is that before the step."""

    def __init__(
        self,
        message: str,
        *,
        step: int | None = None,
        t: float | None = None,
        h: float | None = None,
        term: str | None = None,
        element: int | None = None,
        quantity: str | None = None,
    ) -> None:
        super().__init__(message)
        self.step = step
        """Number of the step, from 1."""
        self.t = t
        """Time at the start of the step, s."""
        self.h = h
        """Size of the step, s."""
        self.term = term
        """The term that left its domain."""
        self.element = element
        """The element at which the term left its domain, in the numbering of the mesh."""
        self.quantity = quantity
        """The quantity, such as `det F`."""


class GuardError(StepError):
    """The energy guard ended a run: the energy grew without a source."""


class OutputError(Error, OSError):
    """A file or directory cannot be read or written."""


class CheckpointError(Error):
    """A checkpoint or snapshot is missing, damaged, or belongs to another scene."""


class StudyError(Error):
    """A study of a scene cannot be made."""


class BusyError(Error, RuntimeError):
    """Another thread is using the simulation."""


class ClosedError(Error, RuntimeError):
    """The simulation was closed."""


class ForkError(Error, RuntimeError):
    """The simulation was made before a fork, and its threads are in the parent process."""
