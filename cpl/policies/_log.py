"""What is written down of the episodes that are driven."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cpl.highway import Plan
from cpl.policies.switch import Bools, Floats, Ints, Moment

__all__ = ["Log", "Rides"]


@dataclass(frozen=True, kw_only=True)
class Rides:
    """What `drive` returns.

    Attributes:
        episodes: One row an episode, by setting, then seed: `setting`, `seed`, `steps`, `crashed`,
            `speed_sum` [m/s, over steps], `last_speed` (after the last step) [m/s], `distance_m`,
            `overtaken`, `safe_steps`, `changes` (how often the other policy took over), `u_sum`
            and `u_steps` (what was added to the forecast, over steps with one), `scored` and
            `missed` (scores that became known, and those above their threshold).
        steps: One row a step if asked for: `setting`, `seed`, `step`, `l_tilde`, `speed` (at the
            time of the decision), `l_hat` and `u` (NaN before the first forecast), `safe` (who
            drives); a last row an episode has its end, with nobody driving.
    """

    episodes: pd.DataFrame
    steps: pd.DataFrame | None = None


_SUMS = ("speed_sum", "safe_steps", "changes", "u_sum", "u_steps", "scored", "missed")


class Log:
    """Sums along the present episodes, and the rows of those that have ended."""

    def __init__(self, settings: int, seeds: Ints, n: int, record: bool) -> None:
        self._seeds, self._shape = seeds, (settings, len(seeds))
        self._now = {name: np.zeros(n) for name in _SUMS}
        self._before = np.zeros(n, dtype=np.bool_)
        self._speed = np.full(n, np.nan)
        names = (*_SUMS, "steps", "crashed", "last_speed", "distance_m", "overtaken")
        self._rows = {name: np.zeros(self._shape) for name in names}
        self._steps: list[dict[str, NDArray[np.generic]]] | None = [] if record else None

    def decide(self, plan: Plan, moment: Moment, safe: Bools, l_tilde: Floats) -> None:
        now, ready = self._now, moment.ready
        now["safe_steps"] += safe
        now["changes"] += (safe != self._before) & (moment.step > 0)
        now["u_sum"] += np.where(ready, moment.u, 0.0)
        now["u_steps"] += ready
        self._before = safe
        if self._steps is not None:
            l_hat, u = (np.where(ready, value, np.nan) for value in (moment.l_hat, moment.u))
            self._add(plan, plan.active, moment.step, l_tilde, l_hat, u, safe.astype(np.int8))

    def score(self, known: Bools, missed: Bools) -> None:
        self._now["scored"] += known
        self._now["missed"] += missed

    def speeds(self, speed: Floats) -> None:
        self._speed = speed
        self._now["speed_sum"] += speed

    def end(
        self,
        plan: Plan,
        ended: Bools,
        step: Ints,
        crashed: Bools,
        x: Floats,
        start_x: Floats,
        l_tilde: Floats,
    ) -> None:
        """Write the rows of episodes that have ended."""
        place = plan.setting[ended], plan.episode[ended]
        for name in _SUMS:
            self._rows[name][place] = self._now[name][ended]
        self._rows["steps"][place] = step[ended]
        self._rows["crashed"][place] = crashed[ended]
        self._rows["last_speed"][place] = self._speed[ended]
        self._rows["distance_m"][place] = (x[:, 0] - start_x)[ended]
        # Every other car begins ahead of the ego car.
        self._rows["overtaken"][place] = (x[:, 1:] <= x[:, :1]).sum(axis=1)[ended]
        if self._steps is not None:
            nothing = np.full(len(ended), np.nan)
            nobody = np.full(len(ended), -1, dtype=np.int8)
            self._add(plan, ended, step, l_tilde, nothing, nothing, nobody)

    def begin(self, again: Bools) -> None:
        for total in self._now.values():
            total[again] = 0.0
        self._speed = np.where(again, np.nan, self._speed)

    def rides(self) -> Rides:
        settings, episodes = self._shape
        frame = pd.DataFrame(
            {
                "setting": np.repeat(np.arange(settings), episodes),
                "seed": np.tile(self._seeds, settings),
                **{name: values.ravel() for name, values in self._rows.items()},
            }
        )
        return Rides(episodes=_typed(frame), steps=self._all_steps())

    def _add(
        self,
        plan: Plan,
        chosen: Bools,
        step: Ints,
        l_tilde: Floats,
        l_hat: Floats,
        u: Floats,
        safe: NDArray[np.int8],
    ) -> None:
        if self._steps is None:
            return
        columns = {
            "setting": plan.setting,
            "seed": self._seeds[plan.episode],
            "step": step,
            "l_tilde": l_tilde,
            "speed": self._speed,
            "l_hat": l_hat,
            "u": u,
            "safe": safe,
        }
        self._steps.append({name: values[chosen] for name, values in columns.items()})

    def _all_steps(self) -> pd.DataFrame | None:
        if self._steps is None:
            return None
        names = self._steps[0]
        joined = {name: np.concatenate([part[name] for part in self._steps]) for name in names}
        frame = pd.DataFrame(joined).sort_values(["setting", "seed", "step"], kind="stable")
        return frame.reset_index(drop=True)


def _typed(frame: pd.DataFrame) -> pd.DataFrame:
    """Give counts their type and the columns their order."""
    whole = ("steps", "overtaken", "safe_steps", "changes", "u_steps", "scored", "missed")
    kinds = {**dict.fromkeys((*whole, "setting", "seed"), "int64"), "crashed": "bool"}
    order = [
        "setting", "seed", "steps", "crashed", "speed_sum", "last_speed", "distance_m",
        "overtaken", "safe_steps", "changes", "u_sum", "u_steps", "scored", "missed",
    ]  # fmt: skip
    return pd.DataFrame({name: frame[name].astype(kinds.get(name, "float64")) for name in order})
