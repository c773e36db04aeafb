from pathlib import Path

import pytest

from cpl.store import cpl_imports, fingerprint, import_closure

TREE = {
    "cpl/__init__.py": "",
    "cpl/low/__init__.py": "from .maths import add\n",
    "cpl/low/maths.py": '"""Add."""\n\n\ndef add(a, b):\n    """Sum."""\n    return a + b  # why\n',
    "cpl/low/other.py": "ZERO = 0\n",
    "cpl/mid.py": "def f():\n    from cpl.low import other\n    return other.ZERO\n",
    "cpl/types.py": (
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from cpl import mid\n"
        "else:\n    import cpl.low.other\n"
    ),
    "cpl/up/__init__.py": "",
    "cpl/up/near.py": "from ..low import maths\nfrom . import side\n",
    "cpl/up/side.py": "import importlib\nX = importlib.import_module('cpl.mid')\n",
    "cpl/experiments/__init__.py": "def compute(name):\n    import cpl.mid\n",
    "cpl/experiments/a/__init__.py": "",
    "cpl/experiments/a/one.py": "import cpl.low.maths\nEXPERIMENT = 1\n",
    "cpl/experiments/a/shared.py": "",
    "cpl/experiments/b/__init__.py": "def start():\n    import cpl.mid\n",
    "cpl/experiments/b/two.py": "EXPERIMENT = 1\n",
    "chapter.py": "from cpl.experiments import compute as run\nrun('one', profile='book')\n",
}

LOW = ["cpl", "cpl.low", "cpl.low.maths", "cpl.low.other"]


@pytest.fixture
def root(tmp_path):
    for name, code in TREE.items():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(code)
    return tmp_path


def change(root: Path, name: str, old: str, new: str) -> None:
    text = (root / name).read_text()
    assert old in text
    (root / name).write_text(text.replace(old, new))


@pytest.mark.parametrize(
    ("origin", "expected"),
    [
        ("cpl", ["cpl"]),
        ("cpl.low.other", LOW),
        ("cpl.mid", [*LOW, "cpl.mid"]),
        ("cpl.types", [*LOW, "cpl.types"]),
        (
            "cpl.up.near",
            [*LOW, "cpl.mid", "cpl.up", "cpl.up.near", "cpl.up.side"],
        ),
    ],
    ids=["top", "package-init", "lazy", "type-checking", "relative-and-import_module"],
)
def test_closure_table(root, origin, expected):
    assert list(import_closure(origin, root=root)) == expected


def test_a_chapter_depends_on_the_experiment_it_names(root):
    closure = import_closure(root / "chapter.py", root=root)
    assert "cpl.experiments.a.one" in closure
    assert "cpl.low.maths" in closure
    assert "cpl.experiments.b.two" not in closure


def test_passing_through_a_package_does_not_call_its_functions(root):
    assert "cpl.mid" not in import_closure("cpl.experiments.a.one", root=root)
    assert "cpl.mid" in import_closure("cpl.experiments", root=root)
    assert "cpl.mid" in import_closure(root / "chapter.py", root=root)


def test_taking_a_module_from_a_package_does_not_use_the_package(root):
    taker = root / "cpl/taker.py"
    taker.write_text("from cpl.experiments.b import two\n")
    assert import_closure("cpl.taker", root=root) == (
        "cpl", "cpl.experiments", "cpl.experiments.b", "cpl.experiments.b.two", "cpl.taker",
    )  # fmt: skip
    # Of a function and of a name that the package binds itself nobody can say that.
    taker.write_text("from cpl.experiments.b import two, start\n")
    assert "cpl.mid" in import_closure("cpl.taker", root=root)
    change(root, "cpl/experiments/b/__init__.py", "def start", "two = 2\n\n\ndef start")
    taker.write_text("from cpl.experiments.b import two\n")
    assert "cpl.mid" in import_closure("cpl.taker", root=root)


@pytest.mark.parametrize(
    ("code", "expected"),
    [
        ("import cpl.experiments as e\ne.published(name='two')", {"two"}),
        ("import cpl.experiments\ncpl.experiments.compute('two')", {"two"}),
        ("from cpl import experiments\nexperiments.verify('one')", {"one"}),
        ("from cpl.experiments import compute\ncompute(chosen)", {"one", "two"}),
        ("def compute(x): ...\ncompute('one')", set()),
    ],
)
def test_experiments_named_as_text(root, code, expected):
    found = cpl_imports(code, root=root)
    assert {n.rpartition(".")[2] for n in found if n.count(".") == 3} == expected


def test_comments_docstrings_and_layout_do_not_count(root):
    before = fingerprint("cpl.low", root=root)
    change(root, "cpl/low/maths.py", "# why", "# because, at length")
    change(root, "cpl/low/maths.py", "Sum.", "Return the sum of two numbers.")
    change(root, "cpl/low/maths.py", '"""Add."""', "# no module docstring any more")
    change(root, "cpl/low/maths.py", "a + b", "(a +\n            b)")
    assert fingerprint("cpl.low", root=root) == before


def test_a_changed_line_counts_for_exactly_what_depends_on_it(root):
    modules = ["cpl.low", "cpl.low.other", "cpl.mid", "cpl.up.near", "cpl.experiments.b.two"]
    before = {m: fingerprint(m, root=root) for m in modules}
    change(root, "cpl/low/other.py", "ZERO = 0", "ZERO = 1")
    changed = {m for m in modules if fingerprint(m, root=root) != before[m]}
    assert changed == {"cpl.low.other", "cpl.mid", "cpl.up.near"}


@pytest.mark.parametrize(
    ("old", "new"),
    [("a + b", "a - b"), ("a + b", "b + a"), ("def add(a, b)", "def add(a, b=0)")],
)
def test_any_change_of_meaning_counts(root, old, new):
    before = fingerprint("cpl.low.maths", root=root)
    change(root, "cpl/low/maths.py", old, new)
    assert fingerprint("cpl.low.maths", root=root) != before


def test_types_of_constants_count(root):
    seen = set()
    for value in ("0", "0.0", "False", "'0'", "b'0'", "-0.0"):
        (root / "cpl/low/other.py").write_text(f"ZERO = {value}\n")
        seen.add(fingerprint("cpl.low.other", root=root))
    assert len(seen) == 6


def test_a_renamed_module_counts(root):
    before = fingerprint("cpl.experiments.b.two", root=root)
    (root / "cpl/experiments/b/two.py").rename(root / "cpl/experiments/b/three.py")
    assert fingerprint("cpl.experiments.b.three", root=root) != before


def test_a_script_counts_with_its_own_code(root):
    before = fingerprint(root / "chapter.py", root=root)
    change(root, "chapter.py", "'book'", "'paper'")
    assert fingerprint(root / "chapter.py", root=root) != before


@pytest.mark.parametrize("origin", ["cpl.nowhere", "numpy", "cpl..low", "../cpl"])
def test_unknown_modules_are_refused(root, origin):
    with pytest.raises(ValueError, match="origins must be modules"):
        import_closure(origin, root=root)


def test_broken_source_is_named(root):
    (root / "cpl/low/other.py").write_text("def (:\n")
    with pytest.raises(ValueError, match=r"cpl\.low\.other has an error in line 1"):
        fingerprint("cpl.mid", root=root)
    with pytest.raises(ValueError, match="must be Python"):
        cpl_imports("%matplotlib inline")


def test_a_package_whose_folder_is_walked_is_used_whole(root):
    walk = "from cpl import low\n\n\ndef all_of():\n    import pkgutil\n"
    (root / "cpl/walk.py").write_text(f"{walk}    pkgutil.iter_modules(low.__path__)\n")
    assert "cpl.low.other" in import_closure("cpl.walk", root=root)
    (root / "cpl/walk.py").write_text(f"{walk}    pkgutil.iter_modules(__path__)\n")
    assert "cpl.low.other" not in import_closure("cpl.walk", root=root)


def test_the_real_package_is_stable():
    assert fingerprint("cpl.store") == fingerprint("cpl.store")
    assert "cpl.store.paths" in import_closure("cpl.store.source")
