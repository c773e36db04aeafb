"""What CONTRIBUTING.md says of experiments, followed word by word in a copy of the package."""

import os
import re
import subprocess
import sys
from shutil import copytree, ignore_patterns

from cpl.store import project_root


def section(title: str) -> str:
    text = (project_root() / "CONTRIBUTING.md").read_text(encoding="utf-8")
    return re.search(rf"^### {title}.*?\n(.*?)(?=^##)", text, re.MULTILINE | re.DOTALL)[1]


def test_the_experiment_of_the_recipe_is_found_and_computed(tmp_path):
    recipe = section("An experiment")
    (code,) = re.findall(r"```python\n(.*?)```", recipe, re.DOTALL)
    (place,) = re.findall(r"`(cpl/experiments/\S+\.py)`", recipe)
    copytree(project_root() / "cpl", tmp_path / "cpl", ignore=ignore_patterns("__pycache__"))
    (tmp_path / "pyproject.toml").write_text((project_root() / "pyproject.toml").read_text())
    (tmp_path / place).write_text(code, encoding="utf-8")
    words = re.search(r"`cpl (compute \S+ --profile smoke)`", recipe)[1].split()
    done = subprocess.run(
        [sys.executable, "-m", "cpl", *words, "--quiet", "--workers", "1"],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(tmp_path), "CPL_STORE": str(tmp_path / "store")},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "2 rows in 2 shards" in done.stdout
    assert "far_m = 50.0  (a float in (0, inf))" in done.stdout


def test_the_walk_to_the_switch_names_files_that_are_there():
    files = re.findall(r"^\d\. `(\S+)`", section("Where is pi_switch"), re.MULTILINE)
    assert len(files) <= 8
    names = re.findall(
        r"`(choose_thresholds|curve|drive|Switch\(q_safe\))`", section("Where is pi_")
    )
    assert {"choose_thresholds", "curve", "drive"} <= set(names)
    for file in files:
        assert (project_root() / file).is_file()
    setup = (project_root() / files[1]).read_text(encoding="utf-8")
    assert "def choose_thresholds(" in setup
    assert "def curve(" in setup
