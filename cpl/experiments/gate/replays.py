"""Margins that are written down while driving, and driven again in the wrong place."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cpl.experiments.gate.streams import Floats, Gated, Roads
from cpl.policies.gate import Recorded, Sight
from cpl.rng import stream

__all__ = ["Recording", "Replaying", "donor", "replays"]

_STEPS = 40  # decisions of an episode


class Recording:
    """A gated driver whose margins are written down, round by round.

    Args:
        driver: The driver.
    """

    def __init__(self, driver: Gated) -> None:
        self.driver, self.names = driver, driver.names
        self._rounds: list[list[Floats]] = []

    def begin(self, roads: Roads, rows: slice) -> None:
        """Begin a round."""
        self._rounds.append([])
        self.driver.begin(roads, rows)

    def act(
        self, obs: NDArray[np.float32], active: NDArray[np.bool_], roads: Roads, rows: slice
    ) -> NDArray[np.int64]:
        """Choose, and write the margins down."""
        chosen = self.driver.act(obs, active, roads, rows)
        if self.sight is not None:
            self._rounds[-1].append(self.sight.margin.copy())
        return chosen

    @property
    def sight(self) -> Sight | None:
        """What the gate knew at its last decision."""
        return self.driver.sight

    def margins(self) -> Floats:
        """One row a decision; a round in which all had crashed early ends with its last margin."""
        full = [rows + rows[-1:] * (_STEPS - len(rows)) for rows in self._rounds]
        return np.array([row for rows in full for row in rows])


class Replaying(Recording):
    """A gated driver with recorded margins, that begins each round where it was recorded.

    Args:
        driver: The driver.
        recorded: Its margins.
    """

    def __init__(self, driver: Gated, recorded: list[Recorded]) -> None:
        super().__init__(driver)
        self.recorded = recorded

    def begin(self, roads: Roads, rows: slice) -> None:
        """Begin a round, and its margins with it."""
        for margin in self.recorded:
            margin.step = _STEPS * len(self._rounds)
        super().begin(roads, rows)


def donor(q: Floats, worlds: NDArray[np.str_]) -> Floats:
    """Return each stream the margins of the next one that is in the same world at that time.

    Args:
        q: Margins, one row a decision (40 an episode), a column a stream.
        worlds: By stream and round.
    """
    given, here = q.copy(), np.repeat(worlds.T, _STEPS, axis=0)
    for row, names in zip(given, here, strict=True):
        for world in np.unique(names):
            mine = np.flatnonzero(names == world)
            row[mine] = row[np.roll(mine, 1)]
    return given


def replays(q: Floats, worlds: NDArray[np.str_]) -> dict[str, Floats]:
    """Return margins with parts of what the quantile knows: its regime, distribution, mean.

    Args:
        q: As in `donor`.
        worlds: As in `donor`.
    """
    here, mean = np.repeat(worlds.T, _STEPS, axis=0), np.empty_like(q)
    for world in np.unique(worlds):
        mean[here == world] = q[here == world].mean()
    return {
        "donor quantile": donor(q, worlds),
        "shuffled quantile": stream(0, "gate", "shuffle").permuted(q, axis=1),
        "mean quantile of the world": mean,
        "mean quantile": np.full_like(q, q.mean()),
    }
