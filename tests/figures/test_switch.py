"""The pictures of the switch: every curve is named, and safety points upwards."""

import numpy as np
import pandas as pd

from cpl.figures import switch
from cpl.stats import Band, Estimate, Lead, survival

POINTS = pd.DataFrame(
    {
        "duration_s": [40.0, 30.0, 20.0],
        "episode_speed_mps": [20.0, 25.0, 30.0],
        "crashes_per_km": [0.0, 0.5, 1.5],
        "step_speed_mps": [20.0, 24.0, 29.0],
    }
)
PLANES = [("duration_s", "episode_speed_mps"), ("crashes_per_km", "step_speed_mps")]


def estimate(value):
    return Estimate(value=value, low=value - 1, high=value + 1, n=10)


def lead(levels):
    gain = np.linspace(-0.5, 1.0, len(levels))
    band = Band(value=gain, low=gain - 1, high=gain + 1, n=10)
    one = estimate(0.1)
    return Lead(
        levels=np.asarray(levels), gain=band, least=one, mean=one, volume=one, p=0.5, drawn=gain
    )


def test_a_front_has_every_method_and_the_star():
    figure = switch.fronts({"conformal": POINTS, "none": POINTS + 1}, PLANES, star=POINTS.iloc[0])
    upper, lower = figure.axes
    names = [line.get_label() for line in upper.get_lines()]
    assert names == ["conformal", "none", "safe policy alone"]
    assert not upper.yaxis_inverted()
    assert lower.yaxis_inverted()  # fewer collisions are further up


def test_a_front_with_intervals_has_a_cross_at_every_point():
    reach = {name: [estimate(v) for v in POINTS[name]] for name in PLANES[0]}
    figure = switch.fronts({"none": POINTS}, PLANES[:1], reach={"none": reach})
    assert len(figure.axes[0].get_lines()) == 2 * len(POINTS) + 1


def test_leads_say_at_what_level():
    found = {
        "paper": {"none": lead([20.0, 30.0, 40.0])},
        "exposure": {"none": lead([-1.0, -0.5, -0.1])},
    }
    upper, lower = switch.leads(found, first="conformal").axes
    assert upper.get_xlabel() == "at equal mean duration [s]"
    assert lower.get_xlabel() == "at equal collisions per km"
    assert lower.get_lines()[1].get_xdata().tolist() == [1.0, 0.5, 0.1]


def test_means_are_drawn_from_top_to_bottom():
    figure = switch.means({"first": estimate(0.5), "second": estimate(-0.5)}, what="m [m/s]")
    (axes,) = figure.axes
    assert [label.get_text() for label in axes.get_yticklabels()] == ["first", "second"]
    assert axes.yaxis_inverted()


def test_survival_starts_with_everybody():
    curve = survival([10.0, 40.0, 40.0], [True, False, False])
    (axes,) = switch.survivals({"switch": curve}, horizon=40.0).axes
    assert axes.get_lines()[0].get_ydata()[0] == 1.0


def test_every_look_is_told_apart_without_colour():
    methods = ["conformal", "none", "dropout", "ensemble", "hau", "certificates"]
    shapes = [(switch.LOOKS[name].marker, switch.LOOKS[name].dash) for name in methods]
    assert len(set(shapes)) == len(shapes)
