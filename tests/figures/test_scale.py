"""What many workers would take: a toy whose answer is known, and the real costs."""

import pytest

from cpl.experiments.run.costs import Stage, expected_seconds
from cpl.experiments.run.schedule import Piece
from cpl.figures import scale

TOY = scale.Costs(
    stages=(
        Stage(
            experiment="train",
            pieces={("train", f"seed-{n}"): Piece(seconds=60.0) for n in range(4)},
            timed=4,
        ),
        Stage(
            experiment="drive",
            pieces={
                ("drive", f"seed-{n}"): Piece(seconds=30.0, needs=(("train", f"seed-{n}"),))
                for n in range(4)
            },
            timed=0,
        ),
    ),
    unknown=("other",),
    driver_s=0.0,
)


def test_a_toy_takes_what_one_works_out_by_hand():
    told = scale.predictions(TOY, [1, 3, 4], driver_s=0.0)
    assert told["once_min"].tolist() == pytest.approx([6.0, 2.5, 1.5])
    assert told["turn_min"].tolist() == pytest.approx([6.0, 3.0, 1.5])
    assert told["bound_min"].tolist() == pytest.approx([6.0, 2.0, 1.5])
    assert scale.enough(TOY, driver_s=0.0) == 4
    assert (TOY.work_s, TOY.longest_s, TOY.timed) == (360.0, 90.0, 4)


def test_rows_say_what_an_experiment_stands_on():
    table = scale.by_experiment(TOY)
    assert table["experiment"].tolist() == ["train", "drive"]
    assert table["stands_on"].tolist() == ["nothing", "train"]
    assert table["work_min"].tolist() == [4.0, 2.0]


def test_the_curve_is_drawn():
    assert scale.curve(TOY, driver_s=0.01, most=20).axes[0].get_xscale() == "log"


def test_the_real_costs_hold_together():
    known = scale.costs()
    assert {need for piece in known.pieces.values() for need in piece.needs} <= known.pieces.keys()
    assert 0 < known.timed <= len(known.pieces)
    assert known.longest_s < known.work_s
    stage = next(stage for stage in known.stages if stage.experiment == "base_policies")
    expected = expected_seconds("base_policies", [name for _, name in stage.pieces])
    assert expected == {name: piece.seconds for (_, name), piece in stage.pieces.items()}
