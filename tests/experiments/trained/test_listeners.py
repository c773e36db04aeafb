"""The agents of Table I: trained behind the forecast, read back, their penalties chosen."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from cpl.experiments import compute
from cpl.experiments.listen import table1
from cpl.experiments.trained import listeners, penalty_grid
from cpl.experiments.trained.agents import need_agents
from cpl.experiments.trained.listening import AGENTS, decoded, hearing_of, penalty_of
from cpl.network import decode_networks
from cpl.policies.listen import Penalty

pytestmark = pytest.mark.usefixtures("shared_store")


@pytest.fixture(scope="module")
def trained(smoke):
    return smoke("listeners")["listeners"]


def test_every_agent_is_trained_and_found_again(trained):
    assert trained["agent"].unique().tolist() == list(AGENTS)
    assert trained["seed"].nunique() == len(AGENTS)
    assert (trained["seed"] < 10_000_000).all()
    assert trained["model"].map(bool).sum() == len(AGENTS)
    inputs = {"listeners": {f"{agent}-0": rows for agent, rows in trained.groupby("agent")}}
    sizes = {agent: decoded(inputs, "listeners", f"{agent}-0").sizes for agent in AGENTS}
    assert sizes["rl_nq"] == (26, 32, 32, 5)
    assert {sizes[agent] for agent in AGENTS[1:]} == {(27, 32, 32, 5)}
    with pytest.raises(ValueError, match="got 'rl-7'"):
        decoded(inputs, "listeners", "rl-7")
    told = decode_networks(trained["model"].iloc[-1]).config
    assert told["agent"] == "rl_3"
    grid = compute("penalty_grid", profile="smoke").table
    assert told["penalty_q"] == penalty_grid.selected(grid, "rl_1")
    assert told["penalty_product"] == penalty_grid.selected(grid, "rl_2")


def test_the_quantiles_seen_in_training_are_written_down(trained):
    assert (trained["q_seen"] <= trained["q_seen_max"]).all()
    assert (trained["q_seen_95"] <= trained["q_seen_max"]).all()
    assert trained["q_seen_max"].max() > 0


def test_an_agent_is_the_same_however_many_there_are(trained):
    one, three = (replace(listeners.PROFILES["smoke"], pairs=n) for n in (1, 3))
    cut, needs = listeners.EXPERIMENT.shards, listeners.EXPERIMENT.needs
    assert [s.name for s in cut(one)] == [s.name for s in cut(three)[:5]]
    (need,) = need_agents("smoke", AGENTS, 2)
    assert need.config.pairs == 3
    assert need.shards[-1] == "rl_3-2"
    assert needs(one, cut(one)[0])[0].shards == ("pair-0",)


def test_weights_that_are_given_need_no_grid():
    asked = {
        (agent, weight): [
            need.experiment
            for need in listeners.EXPERIMENT.needs(
                replace(listeners.PROFILES["smoke"], penalty_q=weight, penalty_product=weight),
                shard,
            )
        ]
        for weight in (-1.0, 2.0)
        for shard, agent in zip(
            listeners.EXPERIMENT.shards(listeners.PROFILES["smoke"]), AGENTS, strict=True
        )
    }
    with_grid = {key for key, names in asked.items() if "penalty_grid" in names}
    assert with_grid == {("rl_1", -1.0), ("rl_2", -1.0), ("rl_3", -1.0)}


def test_agents_hear_and_pay_what_the_paper_says():
    tracking = listeners.PROFILES["paper"].tracking
    sizes = [
        hearing_of(agent, lambda flat: (flat[:, 0], None), tracking).view.size(25)
        for agent in AGENTS
    ]
    assert sizes == [26, 27, 27, 27, 27]
    paid = [penalty_of(agent, 2.0, 3.0) for agent in AGENTS]
    nothing, both = Penalty(), Penalty(q=2.0, product=3.0)
    assert paid == [nothing, nothing, Penalty(q=2.0), Penalty(product=3.0), both]


def test_the_grid_is_trained_and_judged():
    table = compute("penalty_grid", profile="smoke").table
    assert table[["agent", "weight"]].to_numpy().tolist() == [
        ["rl_1", 0.0], ["rl_1", 1.0], ["rl_2", 1.0],
    ]  # fmt: skip
    assert np.isfinite(table[["paid", "duration_s", "mean_q"]]).all(axis=None)
    assert penalty_grid.selected(table, "rl_2") == 1.0


def test_the_weight_that_pays_most_is_selected():
    table = pd.DataFrame(
        [
            ("rl_1", weight, top, paid)
            for weight, top, paids in (
                (1.0, 30.0, (5.0, 6.0)), (3.0, 30.0, (9.0, 4.0)), (9.0, 30.0, (1.0, 2.0)),
                (1.0, 40.0, (1.0, 1.0)), (3.0, 40.0, (1.0, 1.0)), (9.0, 40.0, (9.0, 9.0)),
            )
            for paid in paids
        ],
        columns=["agent", "weight", "top_mps", "paid"],
    )  # fmt: skip
    assert penalty_grid.selected(table, "rl_1") == 3.0
    assert penalty_grid.selected(table, "rl_1", top_mps=40.0) == 9.0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"agents": ("rl_4",)}, "agents must"),
        ({"agents": ()}, "agents must"),
        ({"pairs": 0}, r"pairs must be in \[1, inf\)"),
        ({"models": "other"}, "models must be in"),
        ({"alpha": 1.0}, "alpha must be in"),
        ({"delay": 2}, "delay >= the horizon"),
        ({"penalty_q": float("nan")}, "q must be finite"),
    ],
)
def test_impossible_trainings_are_refused(change, message):
    with pytest.raises(ValueError, match=message):
        replace(listeners.PROFILES["smoke"], **change)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"weights_q": ()}, "weights_q must"),
        ({"weights_product": (-1.0,)}, "weights_product must"),
        ({"tops_mps": (40.0,)}, "tops_mps must name 30.0"),
        ({"episodes": 0}, "episodes must be in"),
    ],
)
def test_impossible_grids_are_refused(change, message):
    with pytest.raises(ValueError, match=message):
        replace(penalty_grid.PROFILES["smoke"], **change)


@pytest.fixture(scope="module")
def table(smoke):
    return smoke("table1")["table1"]


def test_everybody_drives_the_same_seeds_in_every_range(table):
    config = table1.PROFILES["smoke"]
    names = ["speed", *AGENTS, "switch", "switch below", "switch above", "switch 0.3", "safe",
             "slow"]  # fmt: skip
    carried = [f"{agent} carried" for agent in AGENTS]
    assert table["policy"].unique().tolist() == [*names, *carried]
    assert set(table.loc[table["policy"].isin(carried), "top_mps"]) == {40.0}
    sizes = (
        table.loc[~table["policy"].isin(carried)].groupby(["top_mps", "policy"])["seed"].nunique()
    )
    assert len(sizes) == len(names) * len(config.tops_mps)
    assert (sizes == config.episodes).all()
    assert (table["q_safe"].notna() == table["policy"].str.startswith("switch")).all()
    assert (table["missed"] <= table["scored"]).all()
    assert (table["fast_steps"] <= table["steps"]).all()
    assert (table.query("policy == 'slow'")["fast_steps"] == 0).all()
    assert (table.query("policy != 'switch' and policy != 'slow'")["q_steps"] > 0).any()


def test_thresholds_beside_the_chosen_one_are_beside_it(table):
    q_safe = table.groupby("policy")["q_safe"].first()
    assert q_safe["switch"] - q_safe["switch below"] == pytest.approx(0.1, abs=1e-6)
    assert q_safe["switch above"] - q_safe["switch"] == pytest.approx(0.1, abs=1e-6)
    assert q_safe["switch 0.3"] == pytest.approx(0.3)


def test_only_who_acts_as_pi_speed_is_said_to(table):
    same = table.groupby("policy")["as_speed"].mean()
    assert same["speed"] == 1.0
    assert same["slow"] < 1.0


def test_a_shard_is_a_pure_function_of_its_inputs(table):
    config = table1.PROFILES["smoke"]
    again = table1.EXPERIMENT.run(config, table1.EXPERIMENT.shards(config)[0], inputs_of())
    pd.testing.assert_frame_equal(again, table)


def inputs_of():
    """What `table1` is computed from, as the machinery hands it over."""
    made = {
        name: compute(name, profile="smoke").table
        for name in ("base_policies", "forecasts", "listeners")
    }
    return {
        "base_policies": {f"{k}-0": rows for k, rows in made["base_policies"].groupby("kind")},
        "forecasts": {"pair-0": made["forecasts"]},
        "listeners": {f"{agent}-0": rows for agent, rows in made["listeners"].groupby("agent")},
    }


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"tops_mps": ()}, "tops_mps must name"),
        ({"agents": ("other",)}, "agents must"),
        ({"beside": 0.2}, "beside must be in"),
        ({"allowed": -0.1}, "allowed must be in"),
        ({"q_safe": 3.0}, "q_safe must lie in"),
    ],
)
def test_impossible_tables_are_refused(change, message):
    with pytest.raises(ValueError, match=message):
        replace(table1.PROFILES["smoke"], **change)
