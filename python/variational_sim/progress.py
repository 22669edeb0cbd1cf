"""Messages of a run in progress: notes to `logging`, progress to a bar or to a callable."""

from __future__ import annotations

import sys
from collections.abc import Callable
from types import TracebackType
from typing import Any

Progress = Callable[[float, float, float], object]
"""Called with time (s), end (s) and steps per second, at most every 50 ms."""


class Listener:
    """Receives the messages of a run. Notes go to the logger `variational`, findings as warnings."""

    def __init__(self, progress: Progress | None, quiet: bool) -> None:
        self._progress = progress
        self._quiet = quiet
        self._bar: Any = None

    def __enter__(self) -> Listener:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bar is not None:
            self._bar.close()

    def __call__(self, kind: str, content: Any) -> None:
        if kind == "progress":
            t, end, rate = content
            if self._progress is not None:
                self._progress(t, end, rate)
            elif not self._quiet:
                self._show(t, end)
            return
        import logging

        log = logging.getLogger("variational")
        log.log(logging.WARNING if kind == "finding" else logging.INFO, "%s", content)

    def _show(self, t: float, end: float) -> None:
        """Shows a bar of tqdm, if tqdm is installed and the output is a terminal or a notebook."""
        if self._bar is None:
            is_watched = "ipykernel" in sys.modules or (sys.stderr is not None and sys.stderr.isatty())
            try:
                if not is_watched:
                    raise ImportError
                from tqdm.auto import tqdm
            except ImportError:
                self._quiet = True
                return
            self._bar = tqdm(total=end, unit="s", unit_scale=True, leave=False)
        self._bar.update(t - self._bar.n)


def note(texts: list[str], *, warn: bool) -> None:
    """Logs notes of a simulation."""
    if texts:
        import logging

        log = logging.getLogger("variational")
        for text in texts:
            log.log(logging.WARNING if warn else logging.INFO, "%s", text)
