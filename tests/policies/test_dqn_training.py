"""Training: equal to Stable-Baselines3, reproducible, honest about bad input, open to wrappers."""

import os
import random
import subprocess
import sys
import tempfile
from dataclasses import replace

import numpy as np
import pytest
import torch

from cpl.experiments.trained.learner_check import EXPERIMENT as CHECK
from cpl.experiments.trained.learner_check import Config as Check
from cpl.experiments.trained.learner_check import compare
from cpl.highway import PAPER, Config
from cpl.policies.dqn import DivergedError, DQNConfig, train
from cpl.policies.dqn.compiled import train_compiled
from cpl.policies.dqn.reference import extract_network, make_dqn, own_globals, train_reference
from cpl.policies.dqn.task import Plain, Task

SMALL = Config(vehicles_count=6, duration=12.0)
QUICK = DQNConfig(steps=160, hidden=(32, 16), learning_starts=40, batch_size=16, curve_every=40)


class Extended(Plain):
    """Appends two numbers, takes a penalty, mirrors lane changes, writes down what it saw."""

    def __init__(self, road, penalty=0.0):
        super().__init__(road)
        self.size += 2
        self.penalty = penalty
        self.steps = 0

    def seen(self, engine, obs):
        more = [self.steps / 100, engine.state().speed[0, 0] / 30]
        return np.append(obs.ravel(), more).astype(np.float32)

    def reset(self, engine, obs):
        return self.seen(engine, obs)

    def action(self, choice):
        return {0: 2, 2: 0}.get(choice, choice)

    def step(self, engine, obs, reward):
        self.steps += 1
        return self.seen(engine, obs), reward - self.penalty


class Written(Plain):
    """Changes nothing and writes down every transition."""

    def __init__(self, road):
        super().__init__(road)
        self.transitions = []

    def reset(self, engine, obs):
        self._obs = obs.ravel()
        return self._obs

    def action(self, choice):
        self._action = choice
        return choice

    def step(self, engine, obs, reward):
        self.transitions.append((self._obs, self._action, np.float32(reward), obs.ravel()))
        self._obs = obs.ravel()
        return self._obs, reward


def same_network(one, other):
    pairs = zip(one.weights + one.biases, other.weights + other.biases, strict=True)
    return all((a == b).all() for a, b in pairs)


def agreement(steps, seed):
    """Decisions until the learners' transitions differ, and how far their weights are apart."""
    config = DQNConfig(steps=steps)
    written = Written(PAPER)
    ours, _ = train_compiled(config, Task((PAPER,), written, seed), seed)
    with own_globals():
        model = make_dqn(config, Task((PAPER,), None, seed), seed)
        model.learn(steps)
        theirs, buffer = extract_network(model.q_net), model.replay_buffer
    for step, (obs, action, reward, following) in enumerate(written.transitions):
        if (
            action != buffer.actions[step, 0, 0]
            or reward != buffer.rewards[step, 0]
            or not np.array_equal(obs, buffer.observations[step, 0].ravel())
            or not np.array_equal(following, buffer.next_observations[step, 0].ravel())
        ):
            return step, np.inf
    apart = max(
        np.abs(a - b).max()
        for a, b in zip(ours.weights + ours.biases, theirs.weights + theirs.biases, strict=True)
    )
    return steps, apart


def test_the_learners_drive_the_same_episodes():
    # 550 decisions, 350 updates, 11 copies to the target network, exploration from 1 to .05.
    steps, apart = agreement(550, seed=2)
    assert steps == 550
    assert apart < 1e-3


def parting_of_the_reference_from_itself(steps, seed):
    """Decisions until torch's fused Adam and its plain one, equal but for rounding, part."""
    found = []
    for fused in (True, False):
        with own_globals():
            model = make_dqn(DQNConfig(steps=steps), Task((PAPER,), None, seed), seed)
            if not fused:
                model.policy.optimizer = torch.optim.Adam(model.q_net.parameters(), lr=5e-4)
            model.learn(steps)
            buffer = model.replay_buffer
            found.append((buffer.actions[:steps, 0, 0], buffer.observations[:steps, 0]))
    (actions, seen), (other_actions, other_seen) = found
    differs = (actions != other_actions) | (seen != other_seen).any(axis=(1, 2))
    return int(differs.argmax()) if differs.any() else steps


@pytest.mark.oracle
def test_the_learners_part_no_earlier_than_the_reference_from_itself():
    # Rounding differences grow on their own until they turn a decision; nothing else may.
    parted = [agreement(2000, seed)[0] for seed in range(3)]
    control = [parting_of_the_reference_from_itself(2000, seed) for seed in range(3)]
    assert min(parted) >= 0.8 * min(control)
    assert np.median(parted) >= 0.6 * np.median(control)


@pytest.mark.oracle
def test_trainings_of_both_learners_are_alike():
    config = Check(compiled_seeds=6, sb3_seeds=4, kinds=("speed",), steps=8_000, episodes=60)
    table = compare_all(config)
    assert table["p_value"].min() > 0.01
    near = (table["compiled"] - table["sb3"]).abs() < 2.5 * table["spread"]
    assert near.all(), table


def compare_all(config):
    import pandas as pd

    return compare(pd.concat([CHECK.run(config, shard) for shard in CHECK.shards(config)]))


def test_the_learners_agree_through_a_wrapper_too():
    networks = []
    for learner in (train_compiled, train_reference):
        wrapper = Extended(SMALL, penalty=0.125)
        networks.append(learner(QUICK, Task((SMALL,), wrapper, 3), 3))
    (ours, our_curve), (theirs, their_curve) = networks
    assert ours.sizes == (27, 32, 16, 5)
    for a, b in zip(ours.weights, theirs.weights, strict=True):
        np.testing.assert_allclose(a, b, atol=1e-5)
    both = our_curve.drop(columns=["loss", "q_mean"]).columns
    np.testing.assert_allclose(our_curve[both], their_curve[both], rtol=1e-6)
    np.testing.assert_allclose(our_curve["loss"], their_curve["loss"], rtol=1e-3)
    np.testing.assert_allclose(our_curve["q_mean"], their_curve["q_mean"], rtol=1e-3)


def test_a_wrapper_sees_every_step_and_its_penalty_is_paid():
    free, dear = (Extended(SMALL, penalty) for penalty in (0.0, 0.5))
    curves = [train(QUICK, SMALL, seed=1, wrapper=w).curve for w in (free, dear)]
    assert free.steps == QUICK.steps
    # Before the first update both drive the same; what differs is the penalty of each step.
    lengths = curves[0]["duration_s"][0]
    paid = curves[0]["episode_return"][0] - curves[1]["episode_return"][0]
    assert paid == pytest.approx(0.5 * lengths)


@pytest.mark.parametrize("learner", ["compiled", "sb3"])
def test_the_same_seed_gives_the_same_bytes(learner):
    one, other, another = (train(QUICK, SMALL, seed=s, learner=learner) for s in (4, 4, 5))
    assert same_network(one.network, other.network)
    assert one.curve.equals(other.curve)
    assert not same_network(one.network, another.network)


OTHER_PROCESSOR = """
import hashlib
from cpl.highway import Config
from cpl.policies.dqn import DQNConfig, train
quick = DQNConfig(steps=160, hidden=(32, 16), learning_starts=40, batch_size=16)
found = train(quick, Config(vehicles_count=6, duration=12.0), seed=4).network
arrays = found.weights + found.biases
print(hashlib.sha256(b"".join(a.tobytes() for a in arrays)).hexdigest())
"""


@pytest.mark.oracle
def test_a_processor_with_shorter_vectors_gives_the_same_bytes(tmp_path):
    older = {"NUMBA_CPU_NAME": "haswell", "NUMBA_CPU_FEATURES": "+avx2,+fma,+sse4.2"}
    said = [
        subprocess.run(
            [sys.executable, "-c", OTHER_PROCESSOR],
            env={**os.environ, **more},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for more in ({}, older | {"NUMBA_CACHE_DIR": str(tmp_path)})
    ]
    assert len(said[0].strip()) == 64
    assert said[0] == said[1]


def test_episodes_draw_their_road_when_there_are_several():
    empty = replace(SMALL, vehicles_count=0)
    task = Task((SMALL, empty), None, seed=0)
    cars = [int(task.reset()[0::5].sum()) for _ in range(12)]
    assert 1 in cars
    assert max(cars) > 1
    with pytest.raises(ValueError, match="roads must agree"):
        Task((SMALL, replace(SMALL, observation_vehicles_count=3)), None, 0)
    with pytest.raises(ValueError, match="at least one road"):
        train(QUICK, [], seed=0)


def numpys_state():
    return np.random.get_state()[1].tobytes()  # noqa: NPY002 - the one the reference draws from


def test_the_reference_leaves_the_process_as_it_was(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    threads = torch.get_num_threads()
    before = random.getstate(), numpys_state(), torch.get_rng_state()
    train(QUICK, SMALL, seed=0, learner="sb3")
    assert random.getstate() == before[0]
    assert numpys_state() == before[1]
    assert torch.equal(torch.get_rng_state(), before[2])
    assert torch.get_num_threads() == threads
    assert list(tmp_path.iterdir()) == []


class Broken(Plain):
    """Pays what is no number."""

    def step(self, engine, obs, reward):
        return obs.ravel(), np.nan


@pytest.mark.parametrize("learner", ["compiled", "sb3"])
def test_a_loss_that_is_no_number_ends_the_training(learner):
    with pytest.raises(DivergedError, match="loss is nan after 41 decisions"):
        train(QUICK, SMALL, seed=0, learner=learner, wrapper=Broken(SMALL))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"steps": 0}, "steps must be an integer >= 1, got 0"),
        ({"batch_size": 32.0}, "batch_size must be an integer >= 1, got 32.0"),
        ({"hidden": ()}, r"hidden must name at least one layer, got \(\)"),
        ({"hidden": (0,)}, "hidden must be an integer >= 1, got 0"),
        ({"learning_rate": 0.0}, "learning_rate must be positive, got 0.0"),
        ({"gamma": np.nan}, r"gamma must be a finite number in \[0, 1\], got nan"),
        ({"exploration_fraction": 1.1}, r"exploration_fraction must be .* got 1.1"),
        ({"max_grad_norm": True}, "max_grad_norm must be .* got True"),
    ],
)
def test_impossible_settings_are_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        DQNConfig(**changes)


def test_arguments_out_of_range_are_refused():
    with pytest.raises(ValueError, match=r"learner must be one of .* got 'torch'"):
        train(QUICK, SMALL, seed=0, learner="torch")
    for seed in (-1, 2**32, 1.0, True):
        with pytest.raises(ValueError, match=r"seed must be an integer in \[0, 2\*\*32\)"):
            train(QUICK, SMALL, seed=seed)
    with pytest.raises(ValueError, match=r"hidden must be in multiples of 16 .* got \(20,\)"):
        train(replace(QUICK, hidden=(20,)), SMALL, seed=0)
    with pytest.raises(ValueError, match=r"batch_size must be in multiples of 16 .* got 20"):
        train(replace(QUICK, batch_size=20), SMALL, seed=0)
