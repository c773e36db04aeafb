"""Who may stop the robot from the keyboard: Ctrl-C, or Enter."""

from __future__ import annotations

import select
import signal
import sys
from types import FrameType, TracebackType
from typing import Self

__all__ = ["Operator"]


class Operator:
    """Listen to the keyboard while a run goes on; call it to learn whether to stop.

    The first Ctrl-C asks for a stop in good order. The second one ends the program, and then the
    watchdog stops the robot.
    """

    def __init__(self) -> None:
        self.stopped = False
        """Whether somebody asked to stop."""

    def __enter__(self) -> Self:
        self._before = signal.signal(signal.SIGINT, self._interrupt)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        signal.signal(signal.SIGINT, self._before)

    def __call__(self) -> bool:
        """Return whether somebody asked to stop."""
        if not self.stopped and sys.stdin is not None and sys.stdin.isatty():
            ready, _, _ = select.select([sys.stdin], [], [], 0)
            if ready:
                sys.stdin.readline()
                self.stopped = True
        return self.stopped

    def _interrupt(self, number: int, frame: FrameType | None) -> None:
        del number, frame
        if self.stopped:
            raise KeyboardInterrupt
        self.stopped = True
