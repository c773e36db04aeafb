"""Does what the agent is shown matter more if one thing about its training was changed?

The interventions of `why_do` on the agents of `agents_why`.
"""

from dataclasses import dataclass, replace

from cpl.experiments.listen import why_do

__all__ = ["EXPERIMENT", "PROFILES", "Config"]


@dataclass(frozen=True, kw_only=True)
class Config(why_do.Config):
    """The interventions; see `cpl.experiments.listen.why_do.Config`."""

    agents: tuple[str, ...] = ("louder", "farther", "longer", "blurred")
    tops_mps: tuple[float, ...] = (30.0, 40.0)
    q_values: tuple[float, ...] = (0.0, 0.4, 0.8, 1.2)


PROFILES = {
    "smoke": Config(
        pairs=1, models="smoke", episodes=4, validation_episodes=2, blocks=2, vehicles_count=8,
        agents=("louder", "longer"), tops_mps=(40.0,), q_values=(0.0, 1.0), donors=2,
    ),
    "book": Config(
        pairs=1, episodes=40, validation_episodes=2, blocks=20, agents=("louder",),
        tops_mps=(40.0,), q_values=(0.0, 1.2), donors=10,
    ),
    "paper": Config(pairs=3, episodes=125, validation_episodes=2, blocks=25),
}  # fmt: skip


EXPERIMENT = replace(why_do.EXPERIMENT, profiles=PROFILES)
