"""A chapter is executed in a real kernel, whole or not at all."""

import os
import signal
import subprocess
import sys
import time

import pytest

from cpl.publish.chapters import find_chapter
from cpl.publish.execute import ExecutionError, as_notebook, execute, with_outputs
from cpl.store import project_root

PAYLOAD = """"; import os; os._exit(3) #\\ {x} `a` ' \" """.strip()


def output(notebook):
    streams = [out for cell in notebook.cells for out in cell.get("outputs", ())]
    return "".join(out["text"] for out in streams if out["output_type"] == "stream")


def test_chosen_values_arrive_in_the_kernel_as_they_are(project):
    chapter = find_chapter(project(), "small")
    chosen = {"alpha": 0.25, "sizes": (3, 4), "form": "corrected", "note": PAYLOAD}
    notebook = execute(chapter, chosen)
    assert output(notebook) == f"0.25 400 (3, 4) corrected {PAYLOAD!r}\n"
    (injected,) = [c for c in notebook.cells if "injected-parameters" in c.metadata.get("tags", ())]
    assert injected.source.splitlines()[0] == "alpha = 0.25"
    glued = notebook.cells[-1].outputs[0]
    assert glued["metadata"]["scrapbook"]["name"] == "double"
    assert glued["data"] == {"application/papermill.record/text/plain": "'0.50'"}


def test_a_failing_cell_says_where_and_why(project, header):
    text = (
        f"{header}# T\n\n```{{code-cell}} ipython3\n:tags: [parameters]\n"
        "a: int = 1  # [-] any: one\n```\n\n```{code-cell} ipython3\nzero = 0\na / zero\n```\n"
    )
    chapter = find_chapter(project(bad=text), "bad")
    with pytest.raises(
        ExecutionError, match=r"(?s)bad: the cell at bad\.md:14 failed: ZeroDiv"
    ) as e:
        execute(chapter)
    assert "----> 2 a / zero" in str(e.value)
    assert "\x1b" not in str(e.value)


def test_kept_outputs_go_under_new_prose_but_not_under_new_code(project):
    root = project()
    chapter = find_chapter(root, "small")
    executed = as_notebook(chapter)
    executed.cells[-1]["outputs"] = [{"output_type": "stream", "name": "stdout", "text": "kept"}]
    path = root / "book" / "small.md"
    path.write_text(path.read_text().replace("A small chapter", "A better title"))
    notebook = with_outputs(find_chapter(root, "small"), executed)
    assert "A better title" in notebook.cells[0].source
    assert output(notebook) == "kept"
    path.write_text(path.read_text().replace("2 * alpha", "3 * alpha"))
    with pytest.raises(ExecutionError, match="other code"):
        with_outputs(find_chapter(root, "small"), executed)


def test_a_kill_leaves_nothing_that_looks_finished(project, header, tmp_path):
    started = tmp_path / "started"
    text = (
        f"{header}# T\n\n```{{code-cell}} ipython3\n:tags: [parameters]\n"
        "a: int = 1  # [-] any: one\n```\n\n```{code-cell} ipython3\n"
        f"import pathlib, time\npathlib.Path({str(started)!r}).touch()\ntime.sleep(60)\n```\n"
    )
    root = project(slow=text)
    code = (
        "from pathlib import Path; from cpl.publish.chapters import find_chapter;"
        "from cpl.publish.run import run_chapter; root = Path(__import__('sys').argv[1]);"
        "run_chapter(find_chapter(root, 'slow'), {}, root / 'out', root)"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", code, str(root)],
        env={**os.environ, "PYTHONPATH": str(project_root())},
        start_new_session=True,
    )
    deadline = time.monotonic() + 60
    while not started.exists() and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.05)
    assert started.exists()
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    assert not (root / "out").exists()
