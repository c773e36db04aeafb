from dataclasses import dataclass
from pathlib import Path

import pytest

from cpl.experiments.run.settings import changed, parsed, spelled


@dataclass(frozen=True, kw_only=True)
class Config:
    alpha: float
    n: int
    rule: str
    exact: bool
    seeds: tuple[int, ...]
    etas: tuple[float, ...]
    kinds: tuple[str, ...]


BASE = Config(
    alpha=0.1, n=5, rule="fixed", exact=True, seeds=(1,), etas=(0.1, 0.2), kinds=("a", "b")
)


@pytest.mark.parametrize(
    ("word", "name", "value"),
    [
        ("alpha=0.2", "alpha", 0.2),
        ("alpha=1", "alpha", 1.0),
        ("n=7", "n", 7),
        ("n=-7", "n", -7),
        ("rule=2", "rule", "2"),
        ("rule=a=b", "rule", "a=b"),
        ("exact=False", "exact", False),
        ("seeds=1,2,3", "seeds", (1, 2, 3)),
        ("seeds=4", "seeds", (4,)),
        ("seeds=(4, 5)", "seeds", (4, 5)),
        ("etas=1,0.5", "etas", (1.0, 0.5)),
        ("kinds=x, y", "kinds", ("x", "y")),
    ],
)
def test_words_are_read_by_type(word, name, value):
    (read,) = parsed(BASE, [word]).items()
    assert read == (name, value)
    assert type(read[1]) is type(value)
    assert getattr(changed(BASE, dict([read])), name) == value


@pytest.mark.parametrize(
    ("word", "named"),
    [
        ("alpa=2", "no parameter 'alpa'; did you mean 'alpha'"),
        ("alpha", "name=value"),
        ("alpha=abc", "alpha must be a float, got 'abc'"),
        ("alpha=1e999", "alpha must be a float, got inf"),
        ("alpha=nan", "alpha must be a float"),
        ("n=1.5", "n must be an int, got '1.5'"),
        ("n=True", "n must be an int, got 'True'"),
        ("exact=1", "exact must be true or false"),
        ("seeds=", "seeds must be one or more int"),
        ("seeds=1,x", "seeds must be one or more int"),
        ("seeds=()", "seeds must be one or more int"),
        ("etas={1: 2}", "etas must be one or more float"),
        ("=1", "no parameter ''"),
    ],
)
def test_what_does_not_fit_is_named(word, named):
    with pytest.raises(ValueError, match=named):
        parsed(BASE, [word])


ATTACKS = [
    "__import__('pathlib').Path('pwned').touch()",
    "open('pwned','w')",
    "(lambda: open('pwned','w'))()",
    "[x for x in [open('pwned','w')]]",
    'f\'{open("pwned","w")}\'',
    "1 if open('pwned','w') else 2",
    "$(touch pwned)",
    "`touch pwned`",
    "; touch pwned",
    "(" * 500,
]


@pytest.mark.parametrize("attack", ATTACKS)
@pytest.mark.parametrize("name", ["alpha", "n", "exact", "seeds", "etas"])
def test_a_value_is_never_run(attack, name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ValueError, match=f"{name} must be"):
        parsed(BASE, [f"{name}={attack}"])
    assert not Path("pwned").exists()


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"alpa": 2}, "no setting 'alpa'; did you mean 'alpha'"),
        ({"alpha": True}, "alpha must be a float, got True"),
        ({"alpha": float("nan")}, "alpha must be a float, got nan"),
        ({"n": 1.0}, "n must be an int, got 1.0"),
        ({"seeds": ()}, "seeds must be one or more int"),
        ({"kinds": (1,)}, "kinds must be one or more str"),
    ],
)
def test_a_value_from_python_is_checked_as_well(changes, named):
    with pytest.raises(ValueError, match=named):
        changed(BASE, changes)


def test_json_has_lists_and_whole_numbers():
    same = changed(BASE, {"alpha": 1, "etas": [1, 2], "kinds": ["x"]})
    assert (same.alpha, same.etas, same.kinds) == (1.0, (1.0, 2.0), ("x",))


def test_spelled_says_what_each_setting_may_be():
    assert "alpha = 0.1  (a float)" in spelled(BASE)
    assert "seeds = (1,)  (one or more int, such as 1,2,3)" in spelled(BASE)
