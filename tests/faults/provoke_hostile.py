"""What somebody may send us to make our code run theirs.

Every payload would write a mark into a folder if it ran. An attempt is refused or shown as text;
where the mark appears, or live markup reaches a page, it was silent.
"""

import html
import io
import pickle
import re
import struct
import tempfile
import zipfile
from collections.abc import Callable, Iterator
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
from docutils.core import publish_string

from cpl.cli import UsageError
from cpl.experiments.run.publication import job
from cpl.experiments.run.settings import parsed
from cpl.logs import LogError, RunInfo, read_run, write_run
from cpl.network import decode_networks
from cpl.publish import cache, grid
from cpl.publish.chapters import find_chapter
from cpl.publish.numbers import quoted
from cpl.settings.words import ParameterError, settings
from cpl.store import WorkStore, decode_model, decode_table, project_root
from tests.faults.frame import Row, tally
from tests.logs.conftest import make_rows


def provoke(count: int) -> Iterator[Row]:
    """Try every payload with every reader; `count` has no say in how many there are."""
    del count
    folder = Path(tempfile.mkdtemp(prefix="cpl-faults-"))
    mark = folder / "executed"
    yield tally("trained network, table, log", "pickle in a checkpoint", _pickles(folder, mark))
    yield tally("chapter parameters", "code in a name", _names(mark))
    yield tally("chapter parameters", "code in a value", _values(mark))
    yield tally("experiment settings", "code in a name or value", _settings(mark))
    yield tally("page of a sweep", "live markup in a number or parameter", _markup())
    yield tally("page on logs", "live markup in a log's texts", _markup_in_logs(folder))


class _Payload:
    def __init__(self, mark: Path) -> None:
        self.mark = mark

    def __reduce__(self):
        return (Path.touch, (self.mark,))


def _pickles(folder: Path, mark: Path) -> Iterator[str]:
    """Give poisoned files of several kinds to every reader of stored bytes."""
    readers: dict[str, Callable[[bytes], object]] = {
        "network": decode_networks,
        "model": decode_model,
        "table": decode_table,
        "shard": lambda content: _shard(folder, content),
        "log": lambda content: _log(folder, content),
        "execution": lambda content: _execution(folder, content),
    }
    for content in _poisoned(mark):
        for read in readers.values():
            try:
                refused = read(content) is None
            except (ValueError, LogError):
                refused = True
            yield "refused" if refused and not mark.exists() else "silent"
            mark.unlink(missing_ok=True)


def _poisoned(mark: Path) -> Iterator[bytes]:
    payload = _Payload(mark)
    for protocol in range(pickle.HIGHEST_PROTOCOL + 1):
        yield pickle.dumps(payload, protocol=protocol)
    array = io.BytesIO()
    np.save(array, np.array([payload], dtype=object), allow_pickle=True)
    yield array.getvalue()
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w") as zipped:  # the form of torch's and SB3's archives
        zipped.writestr("archive/data.pkl", pickle.dumps(payload))
        zipped.writestr("policy.pth", pickle.dumps(payload))
        zipped.writestr("data", pickle.dumps(payload))
    yield archive.getvalue()
    header = pickle.dumps(payload)
    yield struct.pack("<Q", len(header)) + header  # a pickle where safetensors has its JSON


def _shard(folder: Path, content: bytes) -> object:
    store, key = WorkStore(folder / "store"), "0" * 64
    path = folder / "store" / "toy" / key / "part.shard"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)
    return store.load("toy", key, "part")


def _log(folder: Path, content: bytes) -> object:
    path = folder / "run.mcap"
    path.write_bytes(content)
    return read_run(path)


def _execution(folder: Path, content: bytes) -> object:
    for ending in ("ipynb", "json"):
        (folder / f"small.{ending}").write_bytes(content)
    return cache.load(folder, "small", "k")


def _code(mark: Path) -> list[str]:
    """Ways to have Python write the mark."""
    touch = f"__import__('pathlib').Path({str(mark)!r}).touch()"
    return [
        touch, f"({touch})", f"[{touch}]", f"0;{touch}", f"0\n{touch}", f"0 or {touch}",
        f"'{touch}'", f"{{{touch}}}", f"lambda: {touch}", f"*{touch},", f"f'{{{touch}}}'",
        f"$(touch {mark})", f"`touch {mark}`", f"; touch {mark}", f"| touch {mark}",
        f"!touch {mark}", f"%run {mark}", f"%%bash\ntouch {mark}", f"{{% {touch} %}}",
        f"\\u005f\\u005fimport\\u005f\\u005f('os').system('touch {mark}')",
    ]  # fmt: skip


def _names(mark: Path) -> Iterator[str]:
    parameters = find_chapter(project_root(), "theory").parameters
    for code in _code(mark):
        for text in (f"{code}=1", f"alpha{code}=0.2", f"alpha:{code}=0.2"):
            yield _outcome(mark, lambda text=text: settings(parameters, [text]))


def _values(mark: Path) -> Iterator[str]:
    parameters = find_chapter(project_root(), "theory").parameters
    for code in _code(mark):
        for parameter in parameters:
            if parameter.type != "str":
                text = f"{parameter.name}={code}"
                yield _outcome(mark, lambda text=text: settings(parameters, [text]))


def _settings(mark: Path) -> Iterator[str]:
    config = job("miscoverage", "smoke").config
    for code in _code(mark):
        for text in (f"{code}=1", f"seed={code}"):
            yield _outcome(
                mark, lambda text=text: job("miscoverage", "smoke", parsed(config, [text]))
            )


def _outcome(mark: Path, attempt: Callable[[], object]) -> str:
    try:
        attempt()
    except (ParameterError, ValueError, UsageError):
        refused = True
    else:
        refused = False
    silent = mark.exists() or not refused
    mark.unlink(missing_ok=True)
    return "silent" if silent else "refused"


_MARKUP = (
    "<script>alert(1)</script>",
    "<img src=x onerror=alert(1)>",
    "<svg/onload=alert(1)>",
    "<iframe src=javascript:alert(1)>",
    "<a href=javascript:alert(1)>x</a>",
    "</pre><script>1</script>",
    "</td></tr></table><script>1</script>",
    "<body onload=alert(1)>",
    "<style>*{display:none}</style>",
    "<meta http-equiv=refresh content=0>",
    "<base href=//evil>",
    "<form action=//evil><input>",
    "<object data=//evil>",
    "<embed src=//evil>",
    "<link rel=stylesheet href=//evil>",
    '"><script>1</script>',
    "'><script>1</script>",
    "--><script>1</script>",
    "]]><script>1</script>",
    "&lt;script&gt;alert(1)&lt;/script&gt;",
    '" onmouseover="alert(1)',
    "javascript:alert(1)",
    "<math><mtext><script>1</script>",
    "<details open ontoggle=alert(1)>",
)
_LIVE = {
    "script",
    "iframe",
    "object",
    "embed",
    "link",
    "base",
    "form",
    "img",
    "svg",
    "math",
    "input",
}


class _Reader(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.live: list[str] = []

    def handle_starttag(self, tag, attrs):
        names = [name for name, _ in attrs]
        targets = [value or "" for name, value in attrs if name in ("href", "src")]
        if tag in _LIVE or any(name.startswith("on") for name in names):
            self.live.append(tag)
        if any(target.startswith("javascript:") for target in targets):
            self.live.append(tag)
        if tag == "meta" and "http-equiv" in names:
            self.live.append(tag)


_MARKDOWN = (
    "[x](javascript:alert(1))",
    "![x](x onerror=alert(1))",
    "<javascript:alert(1)>",
    "<http://evil.example>",
    "**x**",
    "`x`",
    "{raw}`html`",
    "$x$",
    "x | y | <script>1</script>",
    "x\n\n<script>1</script>",
    "x\n\n```{raw} html\n<script>1</script>\n```",
    "[x]: javascript:alert(1)",
)


def _markup_in_logs(folder: Path) -> Iterator[str]:
    """Write payloads into the texts of logs, and show those as the chapter on logs does."""
    from myst_parser.docutils_ import Parser

    from cpl.figures.table import rows_or_note
    from cpl.logs import read_runs

    heads = {"run": "run", "config.shape": "path", "config.policy": "policy"}
    settings = {"myst_enable_extensions": ["dollarmath", "colon_fence"], "report_level": 5}
    for number, text in enumerate((*_MARKUP, *_MARKDOWN)):
        logs = folder / f"logs-{number}"
        config = {"shape": text, "policy": text}
        info = RunInfo(provenance="simulated-kinematic", config=config, seed=17)
        write_run(logs / f"{text.replace('/', ' ')[:60]}.mcap", make_rows(4), info)
        runs = read_runs(logs).summary
        page = publish_string(
            str(rows_or_note(runs, heads, {})),
            parser=Parser(),
            writer_name="html5",
            settings_overrides={
                **settings,
                "output_encoding": "unicode",
                "embed_stylesheet": False,
            },
        )
        body = page.partition("<body")[2]
        reader = _Reader()
        reader.feed(body)
        shown = html.unescape(re.sub("<[^>]*>", "", body))
        whole = " ".join(text.split()) in " ".join(shown.split())
        alive = reader.live or any(mark in body for mark in ("<a ", "<strong", "<code", "<em"))
        yield "harmless" if whole and not alive else "silent"


def _markup() -> Iterator[str]:
    chapter = find_chapter(project_root(), "theory")
    for text in _MARKUP:
        run = {
            "parameters": {text: text}, "numbers": {text: text}, "failure": text,
            "page": "000/theory.html", "command": text,
        }  # fmt: skip
        fine = {**run, "failure": None}
        reader = _Reader()
        reader.feed(grid._page(chapter, [run, fine]))
        yield "silent" if reader.live else "harmless"
    poisoned = '{"cells": [{"outputs": [{"data": {"application/papermill.record/text/plain": '
    for text in ("__import__('os')", "open('x')", "1+1", "(lambda: 1)()"):
        try:
            quoted(f'{poisoned}"{text}"}}, "metadata": {{"scrapbook": {{"name": "n"}}}}}}]}}]}}')
        except ValueError:
            yield "refused"
        else:
            yield "silent"
