"""A setting is taken or refused before anything runs, and never as code."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cpl.publish.declaration import read_parameters
from cpl.settings.words import ParameterError, settings

DECLARED = read_parameters(
    """
alpha: float = 0.1  # [-] (0, 1): miscoverage
eta: float = 1  # [score] (0, inf): step
T: int = 400  # [steps] [1, 1000000]: length
flag: bool = False  # [-] any: a switch
form: str = "paper"  # [-] {paper, corrected}: a word
note: str = ""  # [-] any: text
sizes: tuple[int, ...] = (1, 2)  # [-] [1, 9]: sizes
weights: tuple[float, ...] = (0.5,)  # [-] [0, 1]: weights
"""
)


@pytest.mark.parametrize(
    ("setting", "value"),
    [
        ("alpha=0.2", 0.2),
        ("alpha= 2e-1", 0.2),
        ("eta=3", 3.0),
        ("T=1_000", 1000),
        ("T=+7", 7),
        ("flag=true", True),
        ("flag=False", False),
        ("form=corrected", "corrected"),
        ("note=a = b", "a = b"),
        ("sizes=3", (3,)),
        ("sizes=(3, 4)", (3, 4)),
        ("weights=0,1", (0.0, 1.0)),
    ],
)
def test_allowed_settings_become_values_of_the_declared_type(setting, value):
    (taken,) = settings(DECLARED, [setting]).values()
    assert taken == value
    assert type(taken) is type(value)


@pytest.mark.parametrize(
    ("setting", "says"),
    [
        ("alhpa=0.2", "did you mean 'alpha'"),
        ("alpha=2", r"alpha must be a float in \(0, 1\), got 2"),
        ("alpha=0", r"in \(0, 1\)"),
        ("alpha=abc", "got 'abc'"),
        ("alpha=nan", "got 'nan'"),
        ("alpha=inf", "got 'inf'"),
        ("alpha=1e999", "alpha must be"),
        ("alpha=", "got ''"),
        ("alpha", "name=value"),
        ("alpha=0.1+0.1", "alpha must be"),
        ("alpha=__import__('os').system('true')", "alpha must be"),
        ("alpha=０.２", "alpha must be"),
        ("eta=inf", "eta must be"),
        ("T=0", r"an int in \[1, 1000000\]"),
        ("T=1.5", "an int"),
        ("T=True", "an int"),
        ("T=" + "9" * 5000, "an int"),
        ("T=1;import os", "an int"),
        ("flag=1", "true or false"),
        ("flag=yes", "true or false"),
        ("form=Paper", "one of {paper, corrected}"),
        ("note=two\nlines", "note must be"),
        ("note=\x1b[31m", "note must be"),
        ("note=" + "x" * 201, "note must be"),
        ("sizes=", "one or more int"),
        ("sizes=1,,2", "one or more int"),
        ("sizes=10", r"each in \[1, 9\]"),
        ("weights=nan", "one or more float"),
        ("import os; x=1", "has no parameter"),
        ("alpha\nimport os=1", "has no parameter"),
        ("__class__=1", "has no parameter"),
        ("=1", "has no parameter ''"),
    ],
)
def test_refusals_name_the_parameter_and_what_it_may_be(setting, says):
    with pytest.raises(ParameterError, match=says) as refusal:
        settings(DECLARED, [setting])
    assert "\n" not in str(refusal.value)
    assert "\x1b" not in str(refusal.value)
    assert len(str(refusal.value)) < 250


def test_a_parameter_is_set_once():
    with pytest.raises(ParameterError, match="alpha is set twice"):
        settings(DECLARED, ["alpha=0.2", "alpha=0.3"])


@given(st.floats(allow_nan=False))
def test_a_float_is_taken_exactly_if_it_is_in_range(number):
    alpha = DECLARED[0]
    if 0 < number < 1:
        assert alpha.convert(repr(number)) == number
    else:
        with pytest.raises(ParameterError):
            alpha.convert(repr(number))


@given(st.text(max_size=60))
def test_no_text_becomes_anything_but_a_finite_number(text):
    for parameter in DECLARED[:3]:
        try:
            value = parameter.convert(text)
        except ParameterError:
            continue
        assert isinstance(value, int | float)
        assert math.isfinite(value)


@given(st.lists(st.integers(1, 9), min_size=1, max_size=5))
def test_a_tuple_survives_the_way_through_text(members):
    text = ",".join(map(str, members))
    assert settings(DECLARED, [f"sizes={text}"]) == {"sizes": tuple(members)}
