"""The pictures of Table I: every row is named, in every range."""

import numpy as np
import pandas as pd

from cpl.figures import listen
from cpl.policies.table1 import ROWS, tabulate


def cells(pairs):
    names = [*ROWS, "switch", "safe", "slow"]
    rows = [
        (pair, top, name, seed, 10.0 + k + pair, 25.0 * (10.0 + k))
        for pair in range(pairs)
        for top in (30.0, 40.0)
        for k, name in enumerate(names)
        for seed in range(40)
    ]
    table = pd.DataFrame(
        rows, columns=["pair", "top_mps", "policy", "seed", "steps", "speed_sum"]
    ).assign(crashed=False, last_speed=25.0, distance_m=100.0, q_sum=1.0, q_steps=5, scored=2,
             missed=1, fast_steps=0, as_speed=False)  # fmt: skip
    return tabulate(table)


def test_every_row_stands_beside_the_printed_one():
    figure = listen.printed(cells(3))
    assert len(figure.axes) == 2
    labels = [text.get_text() for text in figure.axes[0].get_yticklabels()]
    assert labels == [listen.NAMES[row] for row in ROWS]
    marks = [line for line in figure.axes[0].get_lines() if line.get_label() == "printed"]
    assert len(marks) == len(ROWS)


def test_one_pair_foretells_nothing_and_is_drawn():
    assert len(listen.printed(cells(1)).axes) == 2


def test_the_coin_s_line_joins_its_two_ends():
    figure = listen.coins(cells(3))
    line = figure.axes[1].get_lines()[0]
    assert line.get_label() == "a coin between the two"
    assert np.isfinite(line.get_xydata()).all()
    assert len(figure.legends[0].get_texts()) == len(listen.NAMES) + 1
