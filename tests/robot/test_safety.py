"""The safety case: every line is a test that exists, and a measured time that keeps its bound."""

import ast

import numpy as np
import pytest

from cpl.experiments import published
from cpl.figures.safety import seconds_of, worst
from cpl.robot.drill import WHAT
from cpl.robot.safety import HAZARDS, ZERO_WITHIN_S
from cpl.robot.trials import DEEDS
from cpl.store import project_root

IDS = [hazard.hazard for hazard in HAZARDS]


def functions(path):
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}


@pytest.mark.parametrize("hazard", HAZARDS, ids=IDS)
def test_every_line_names_tests_that_exist(hazard):
    assert hazard.tests
    for name in hazard.tests:
        file, _, function = name.partition("::")
        assert function in functions(project_root() / "tests" / file), name


def test_every_fault_and_every_deed_belongs_to_a_line():
    assert {name for each in HAZARDS for name in each.deeds} == set(DEEDS)
    calm = {"storm", "camera_duplicated", "camera_replayed", "camera_reordered"}
    assert {name for each in HAZARDS for name in each.faults} == set(WHAT) - calm


@pytest.fixture(scope="module")
def measured():
    return published("robot_stops").table, published("robot_faults").table


@pytest.mark.parametrize("hazard", HAZARDS, ids=IDS)
def test_every_line_keeps_its_bound(hazard, measured):
    stops, faults = measured
    cells = faults[faults["fault"].isin(hazard.faults)]
    assert (cells["fastest_mps"] <= 1.0).all()
    if hazard.metres is not None:
        assert cells["moved_m"].max() <= hazard.metres
        return
    seconds = seconds_of(hazard, stops, faults)
    assert len(seconds) == 0 or np.quantile(seconds, 0.99) <= ZERO_WITHIN_S


def test_zero_in_time_over_all_single_faults(measured):
    stops, _ = measured
    walks = stops[stops["phase"] == "walking"]
    assert (walks.groupby("deed").size() >= 200).all()
    assert worst(stops) <= ZERO_WITHIN_S
    assert stops["left"].sum() == 0


def test_the_matrix_is_whole(measured):
    _, faults = measured
    assert len(faults) == len(WHAT) * 6
    assert len(WHAT) >= 30
    blind = (faults["fault"] == "cut") & (faults["phase"] == "stopping")
    assert faults.loc[~(blind & (faults["placement"] == "laptop")), "rests"].all()
    over = ~faults["outcome"].isin(["refused", "raised"])
    assert (faults.loc[over, "log"] == "whole").all()
