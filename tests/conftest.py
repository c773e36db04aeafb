"""What holds for every test: hypothesis draws the same examples each time under CI.

`project` makes small books: what publishes must not know where the book lies.
"""

import os
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

# Deadlines measure the machine, not the code.
settings.register_profile(
    "book", deadline=None, suppress_health_check=[HealthCheck.too_slow], print_blob=True
)
settings.register_profile("ci", parent=settings.get_profile("book"), derandomize=True)
# Enough to walk every branch once, where coverage is what is measured.
settings.register_profile("glance", parent=settings.get_profile("ci"), max_examples=4)
settings.load_profile(os.environ.get("CPL_HYPOTHESIS", "ci" if os.environ.get("CI") else "book"))

HEADER = """---
kernelspec:
  display_name: Python 3
  language: python
  name: python3
---
"""

CHAPTER = (
    HEADER
    + """
# A small chapter

How large is the double of a number? We ask the machine and believe what it says, because the
question is not worth more than that, and the text has to outweigh the code.

```{code-cell} ipython3
:tags: [parameters]
alpha: float = 0.1  # [-] (0, 1): the number
T: int = 400  # [steps] [1, 1000]: another one
sizes: tuple[int, ...] = (1, 2)  # [-] [1, 9]: some more
form: str = "paper"  # [-] {paper, corrected}: a word
note: str = "plain"  # [-] any: text that is shown
seed: int = 3  # [-] [0, 10]: seed of nothing
```

The double is {glue:text}`double`, as the next cell finds out.

```{code-cell} ipython3
from cpl.publish import glue

glue("double", 2 * alpha, "{:.2f}")
print(alpha, T, sizes, form, repr(note))
```
"""
)

CONFIG = """
title: A small book
author: Nobody
only_build_toc_files: true
execute:
  execute_notebooks: "off"
repository:
  url: ""
parse:
  myst_enable_extensions: [colon_fence, dollarmath]
"""


@pytest.fixture
def header() -> str:
    return HEADER


@pytest.fixture
def project(tmp_path: Path) -> Callable[..., Path]:
    """Make a project with a front page and chapters given by name and text."""

    def make(**chapters: str) -> Path:
        root = tmp_path / "project"
        chapters = chapters or {"small": CHAPTER}
        (root / "book").mkdir(parents=True)
        (root / "data").mkdir()
        (root / "_config.yml").write_text(CONFIG)
        entries = "".join(f"  - file: book/{name}\n" for name in chapters)
        (root / "_toc.yml").write_text(f"format: jb-book\nroot: book/front\nchapters:\n{entries}")
        (root / "book" / "front.md").write_text("# A small book\n\nIt has very few pages.\n")
        for name, text in chapters.items():
            (root / "book" / f"{name}.md").write_text(text)
        return root

    return make
