"""Does it matter to what a policy does which rule tracks its quantile?

Every member of `cpl.conformal.family` drives the look-ahead's gate over the changing stream of
`gate_stream`, and the paper's switch on the road 20-40. Nobody tuned them: the settings are those
of ``cpl.conformal.family.MEMBERS``; under the gate the error is in units of its running scale, as
the headline's.

Protocol, fixed before any of these seeds was driven:

- Data: profile `paper`: policy pairs from 2 on, those on which nothing about the gate was chosen,
  2 to 9 as far as the computing time of the edition reaches and at least five of them, decided
  without a look at results. Each 48 streams x 32 episodes = 1,536 episodes a method, from
  environment seed 30,000,000 on, which nobody used, the same for all methods and pairs; each stream
  stays in each of eight worlds once for four episodes. The switch: the same seeds, on 20-40.
- Rivals under the gate: `constant`, nine margins; `frozen` and `EWMA tuned`, tuned in distribution
  on validation seeds; `quantile`, the headline of `gate_stream`; `donor quantile`, its margins of
  another stream in the same world; `near misses` (conformal decision theory) and `costly near
  misses` (an error with a near miss counts three times); `pi_speed` without a gate; `oracle`, a
  look-ahead with the true future.
- Statistic: the share of episodes that crash, minus that of the best constant at the same pooled
  mean speed, read off straight lines between the constants (under the switch: between thresholds
  q_safe without a quantile).
- Intervals: hierarchical bootstrap over pairs, then streams (crossed), 2,000 resamples, Student's
  t; Holm's correction over the members that a claim names.
- The claims and their rules are rows 54 to 57 of the ledger.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cpl.conformal.family import MEMBERS
from cpl.experiments.gate.drivers import Foresight, Plain, Switching
from cpl.experiments.gate.replays import Recording, Replaying, donor
from cpl.experiments.gate.streams import schedule
from cpl.experiments.gate.study import Streams, averaged, frozen, gated, quantile, run, values
from cpl.experiments.run.spec import Experiment, Inputs, Shard, grid
from cpl.experiments.trained.policies import need_policies_of_pair
from cpl.policies.gate import Constant, Costly, Decision, Margin, Recorded, Tracked
from cpl.settings.ranges import Natural

__all__ = ["EXPERIMENT", "PROFILES", "Config"]


_SEEDS = 30_000_000  # environment seeds from here on
_PARTS = ("members", "rivals", "oracle", "switch")
_TOP = 40.0  # [m] the margin that an infinite threshold stands for


@dataclass(frozen=True, kw_only=True)
class Config(Streams):
    """The streams, the rivals, and how the members are driven; see `Streams`.

    Attributes:
        first_pair: The first of the pairs.
        levels: Thresholds q_safe of the switch without a quantile [-].
        q_safe: That of the switch with one [-].
        switch_alpha: Miscoverage aimed at under the switch [-], the paper's.
    """

    first_pair: Natural = 2
    stay: int = 4
    margins: tuple[float, ...] = (0.0, 2.0, 4.0, 5.0, 5.9, 6.2, 7.0, 9.0, 13.0)
    levels: tuple[float, ...] = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
    q_safe: float = 0.6
    switch_alpha: float = 0.1


PROFILES = {
    "smoke": Config(
        pairs=1, first_pair=0, models="smoke", worlds=("in", "noise"), streams=2, stay=1,
        margins=(0.0, 6.0), levels=(0.3, 0.9),
    ),
    "book": Config(pairs=1, streams=8, stay=1),
    "paper": Config(pairs=5, streams=48),
}  # fmt: skip


def _pairs(config: Config) -> range:
    return range(config.first_pair, config.first_pair + config.pairs)


def run_shard(config: Config, shard: Shard, inputs: Inputs) -> pd.DataFrame:
    """Drive one pair's streams with some of the methods.

    Returns:
        One row a method, stream and visit to a world, the columns of `gate_stream`; `setting` is
        "gate" or "switch", `method` a member's name or a rival's, `value` a constant's margin [m]
        or, under the switch, its q_safe.
    """
    part, pair = shard.text("part"), shard.number("pair")
    safe, speed = (values(inputs, kind, pair) for kind in ("safe", "speed"))
    worlds = schedule(config.worlds, config.streams, config.stay, seed=3)
    drive = {"members": _members, "rivals": _rivals, "oracle": _oracle}
    if part == "switch":
        found = _switch(config, safe, speed, worlds.shape[1])
    else:
        found = drive[part](config, speed, worlds)
    found.insert(0, "pair", np.int8(pair))
    return found.reset_index(drop=True)


EXPERIMENT = Experiment(
    run=run_shard,
    profiles=PROFILES,
    shards=grid("{part}-{pair}", pair=_pairs, part=_PARTS),
    needs=need_policies_of_pair,
    label="simulated",
    extent=("pairs",),
    rtol=1e-5,  # sums of float32 numbers; crashes and steps are compared exactly
)


def _members(config: Config, speed: Any, worlds: NDArray[np.str_]) -> pd.DataFrame:  # noqa: ANN401
    """Drive the gate with every member's margin."""
    n = config.streams
    margins: dict[str, Margin] = {
        name: Tracked(
            member.make(1.0), n, alpha=config.alpha, q0=2.0, memory=config.memory, top=_TOP
        )
        for name, member in MEMBERS.items()
    }
    driver = gated(list(margins), list(margins.values()), n, speed)
    return _run(config, [driver], worlds)


def _rivals(config: Config, speed: Any, worlds: NDArray[np.str_]) -> pd.DataFrame:  # noqa: ANN401
    """Drive it with the headline's margin, what is compared with it, and its donor."""
    n, a = config.streams, config.alpha
    tracked = quantile(n, alpha=a, eta=config.eta, memory=config.memory)
    near: Any = {"near": 0.5, "n": n}
    margins: dict[str, Margin] = {
        "quantile": tracked,
        "frozen": frozen(speed, n, alpha=a),
        "EWMA tuned": averaged(speed, n, alpha=a, memory=config.memory),
        "near misses": Decision(**near, eta=2.0, epsilon=0.02, start=2.0),
        "costly near misses": Costly(**near, eta=1.5, alpha=a, cost=2.0, start=2.0),
        **{f"constant {margin:g}": Constant(margin, n) for margin in config.margins},
    }
    driver = Recording(gated(list(margins), list(margins.values()), n, speed))
    first = _run(config, [driver], worlds)
    given = Recorded(donor(driver.margins()[:, :n], worlds))
    again = Replaying(gated(["donor quantile"], [given], n, speed), [given])
    return pd.concat([first, _run(config, [again], worlds)])


def _oracle(config: Config, speed: Any, worlds: NDArray[np.str_]) -> pd.DataFrame:  # noqa: ANN401
    """Drive without a gate, and with one that knows the future."""
    return _run(config, [Plain("pi_speed", speed), Foresight("oracle", speed)], worlds)


def _switch(config: Config, safe: Any, speed: Any, rounds: int) -> pd.DataFrame:  # noqa: ANN401
    """Drive the switch on the road 20-40: with every member, and without a quantile."""
    n = config.streams
    worlds = np.full((n, rounds), "to40")
    tracked = [
        Switching(
            f"{name} {config.q_safe:g}", safe, speed, n,
            q_safe=config.q_safe, alpha=config.switch_alpha, rule=member.make(1.0),
        )
        for name, member in MEMBERS.items()
    ]  # fmt: skip
    plain = [
        Switching(f"constant {level:g}", safe, speed, n, q_safe=level, rule=None)
        for level in config.levels
    ]
    return _run(config, [*tracked, *plain], worlds, setting="switch")


def _run(
    config: Config, drivers: list[Any], worlds: NDArray[np.str_], setting: str = "gate"
) -> pd.DataFrame:
    return run(drivers, worlds, stay=config.stay, setting=setting, first_seed=_SEEDS)
