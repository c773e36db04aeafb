"""Drive many episodes with an agent that hears, and show it another quantile if one wishes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cpl.forecast.history import History
from cpl.highway import Config, Plan
from cpl.network import MLP
from cpl.policies._driving import Driving
from cpl.policies._log import Rides
from cpl.policies.listen.hearing import Hearing
from cpl.policies.switch import Bools, Chooser, Floats, Ints, Moment

__all__ = ["Choose", "Heard", "Intervene", "best", "by_chooser", "ride"]

Choose = Callable[[Moment, NDArray[np.float32]], Ints]
"""From a moment and what is seen, (n, size), to choices (n,)."""

Intervene = Callable[[Floats, Moment], Floats]
"""From the quantiles (n,) and the moment to the quantiles that the agent is shown, (n,)."""

Heard = Rides
"""What `ride` returns; `steps` has other columns than those of `drive`."""

_FAST = 30.0  # [m/s] the top of the paper's training range


def best(network: MLP) -> Choose:
    """Return who takes the choice of the largest value.

    Args:
        network: From what is seen to a value for each choice.
    """
    return lambda moment, seen: network(seen).argmax(axis=1)


def by_chooser(chooser: Chooser) -> Choose:
    """Return who chooses between (pi_safe, pi_speed) as a chooser of `drive` does.

    Args:
        chooser: The switch, say.
    """
    return lambda moment, seen: np.where(chooser(moment), 0, 1)


def ride(
    road: Config,
    hearing: Hearing,
    choose: Choose,
    seeds: Sequence[int] | NDArray[np.integer],
    *,
    settings: int = 1,
    intervene: Intervene | None = None,
    n_envs: int = 256,
    record: bool = False,
) -> Heard:
    """Drive one episode for each setting and seed.

    Args:
        road: The road.
        hearing: As in the agent's training.
        choose: The agent: `best(network)`, say.
        seeds: Environment seeds, the same in every setting.
        settings: How many settings `choose` or `intervene` has; `Moment.setting` tells which.
        intervene: What the agent is shown in place of q; the tracker goes on undisturbed.
        n_envs: Roads driven at a time; with `carry` there is one a setting and stream.
        record: Whether every step is returned too.

    Returns:
        The rides. `episodes` has the columns of `cpl.policies.evaluate.Rides`, with `safe_steps`
        and `changes` counting choice 0 where the choices are policies (else 0), and further
        `reward_sum` (what the road paid, without penalties), `fast_steps` (decisions above 30 m/s,
        where nothing was trained) and `trace` (a number that depends on all actions of the
        episode, to tell drivers apart). `steps` has one row a
        decision: `setting`, `seed`, `step`, `speed` (at the decision),
        `l_tilde`, `l_hat` (NaN before the first forecast), `q`, `shown` (what was shown in place
        of q), `choice` and `action`.

    Raises:
        ValueError: If there is nothing to drive.
    """
    driving = Driving(
        road, seeds, settings=settings, forecast=hearing.forecast, tracking=hearing.tracking,
        horizon=hearing.horizon, length=hearing.length, n_envs=n_envs, record=False,
    )  # fmt: skip
    plan, roads = driving.plan, driving.plan.roads
    more = _More(settings, driving.seeds, record)
    memory = _Memory(hearing, road, roads)
    speed = np.zeros(roads)

    def decide(raw: Moment, began: Bools) -> tuple[Bools, Ints]:
        nonlocal speed
        if began.any():
            speed = np.where(began, driving.engine.state().speed[:, 0], speed)
        moment = replace(raw, l_hat=np.where(raw.ready, raw.l_hat, 0.0))
        q = moment.u
        shown = q if intervene is None else np.asarray(intervene(q, moment), np.float64)
        seen = memory.seen(moment.obs, moment.l_hat, shown, moment.step)
        choice = np.asarray(choose(moment, seen), np.int64)
        action = hearing.actions(choice, moment.obs)
        more.decide(plan, moment, driving.l_tilde, speed, shown, choice, action)
        return (choice == 0) & bool(hearing.policies), action

    for turn in driving.turns(decide):
        speed = turn.out.info.speed
        more.pay(turn.out.reward)
        more.end(plan, turn.ended)
        memory.forget(turn.ended)
    episodes = driving.rides().episodes.assign(**more.columns())
    return Heard(episodes=episodes, steps=more.steps())


class _Memory:
    """Observations and quantiles of the last decisions on every road, and what is seen of them."""

    def __init__(self, hearing: Hearing, road: Config, n: int) -> None:
        self._hearing, self._width = hearing, hearing.width(road)
        self._history = History(n, length=hearing.length, width=self._width)
        self._shown = np.zeros((n, hearing.view.quantiles))

    def seen(
        self, obs: NDArray[np.float32], l_hat: Floats, shown: Floats, step: Ints
    ) -> NDArray[np.float32]:
        self._history.push(obs)
        self._shown[:, :-1] = self._shown[:, 1:]
        self._shown[:, -1:] = shown[:, None]
        begun = step == 0
        self._shown[begun] = shown[begun, None]
        return self._hearing.seen(self._history.flat, self._width, l_hat, self._shown)

    def forget(self, ended: NDArray[np.bool_]) -> None:
        self._history.reset(ended)


class _More:
    """What `cpl.policies._log.Log` does not write down."""

    def __init__(self, settings: int, seeds: Ints, record: bool) -> None:
        self._seeds = seeds
        self._rows = np.zeros((2, settings, len(seeds)), np.int64)
        self._rewards, self._paid = np.zeros((settings, len(seeds))), np.zeros(0)
        self._steps: list[dict[str, NDArray[np.generic]]] | None = [] if record else None
        self._now = np.zeros((2, 0), np.int64)

    def decide(
        self,
        plan: Plan,
        moment: Moment,
        l_tilde: Floats,
        speed: Floats,
        shown: Floats,
        choice: Ints,
        action: Ints,
    ) -> None:
        if self._now.shape[1] == 0:
            self._now, self._paid = np.zeros((2, plan.roads), np.int64), np.zeros(plan.roads)
        fast, trace = self._now
        begun = moment.step == 0
        fast[begun], trace[begun], self._paid[begun] = 0, 0, 0.0
        fast += speed > _FAST
        trace[:] = (trace * 31 + action + 1) % _PRIME
        if self._steps is None:
            return
        columns = {
            "setting": plan.setting, "seed": self._seeds[plan.episode], "step": moment.step,
            "speed": speed, "l_tilde": l_tilde,
            "l_hat": np.where(moment.ready, moment.l_hat, np.nan), "q": moment.u,
            "shown": shown, "choice": choice.astype(np.int8), "action": action.astype(np.int8),
        }  # fmt: skip
        self._steps.append({name: values[plan.active] for name, values in columns.items()})

    def pay(self, reward: Floats) -> None:
        self._paid += reward

    def end(self, plan: Plan, ended: NDArray[np.bool_]) -> None:
        place = plan.setting[ended], plan.episode[ended]
        self._rows[:, *place] = self._now[:, ended]
        self._rewards[place] = self._paid[ended]

    def columns(self) -> dict[str, NDArray[np.generic]]:
        fast, trace = self._rows
        rewards = self._rewards
        return {
            "reward_sum": rewards.ravel(), "fast_steps": fast.ravel(), "trace": trace.ravel(),
        }  # fmt: skip

    def steps(self) -> pd.DataFrame | None:
        if self._steps is None:
            return None
        names = self._steps[0]
        joined = {name: np.concatenate([part[name] for part in self._steps]) for name in names}
        frame = pd.DataFrame(joined).sort_values(["setting", "seed", "step"], kind="stable")
        return frame.reset_index(drop=True)


_PRIME = (1 << 31) - 1  # traces fit 32 bits, and their product with 31 fits 64
