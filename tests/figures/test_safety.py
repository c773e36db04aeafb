"""The safety case: a line a hazard, a cell a fault, numbers from the rows that it is given."""

import numpy as np
import pandas as pd
import pytest

from cpl.figures import safety
from cpl.robot.drill import PHASES, PLACEMENTS, WHAT
from cpl.robot.safety import HAZARDS
from cpl.robot.trials import DEEDS


@pytest.fixture
def stops():
    rows = [
        {"deed": deed, "phase": phase, "placement": place, "zero_s": 0.01 * k, "left": 0}
        for deed in DEEDS
        for phase in PHASES
        for place in PLACEMENTS
        for k in range(10)
    ]
    return pd.DataFrame(rows)


@pytest.fixture
def faults():
    rows = [
        {
            "fault": name, "phase": phase, "placement": place, "outcome": "camera",
            "zero_s": 1.7 if name == "cut" else 0.2, "blind_s": 1.5 if name == "cut" else 0.0,
            "fastest_mps": 0.97, "moved_m": 0.5, "log": "whole",
        }
        for name in WHAT
        for phase in PHASES
        for place in PLACEMENTS
    ]  # fmt: skip
    return pd.DataFrame(rows)


def test_the_case_has_a_line_for_each_hazard_with_its_tests(stops, faults):
    shown = safety.case(stops, faults).markdown
    assert len(shown.splitlines()) == 2 + len(HAZARDS)
    for each in HAZARDS:
        assert each.hazard in shown
        for name in each.tests:
            file, _, function = name.partition("::")
            assert f"`{file}`: {function[5:].replace('_', ' ')}" in shown
    assert "0.50 m at most, 1 m allowed" in shown


def test_times_count_from_when_something_could_be_heard(stops, faults):
    link = next(each for each in HAZARDS if "cut" in each.faults)
    seconds = safety.seconds_of(link, stops, faults)
    assert seconds.max() == pytest.approx(0.2)
    assert len(seconds) == 20 + 2 * len(link.faults)
    on = faults.assign(outcome="timeout")
    assert len(safety.seconds_of(link, stops, on)) == 20


def test_a_deed_is_told_by_its_distribution(stops):
    shown = safety.deeds(stops).markdown.splitlines()
    assert len(shown) == 2 + len(DEEDS)
    assert all("| 20 | 0.045 | 0.090 | 0.090 | 0 |" in line for line in shown[2:])
    assert safety.worst(stops) == pytest.approx(np.quantile(np.arange(10) / 100, 0.99))


def test_the_matrix_has_a_cell_for_each_phase(faults):
    shown = safety.matrix(faults, "robot").markdown.splitlines()
    assert shown[0] == "| fault | standing | walking | stopping |"
    assert len(shown) == 2 + len(WHAT)
    assert "camera; zero 1.70 s; 0.97 m/s; log whole" in "\n".join(shown)
