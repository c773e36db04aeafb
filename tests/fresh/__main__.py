"""Do the README's two commands pass on a machine that has only what the README asks for?

    python3 -S -m tests.fresh               # Debian 12: make book, make test
    python3 -S -m tests.fresh --debian 13   # Python 3.13, without what needs torch

A minimal Debian is made with mmdebstrap, an ordinary user clones the committed state there and runs
the commands, in namespaces of their own: whatever happens, no mount and no process stays behind.
This machine's own ways to packages (pip's settings, certificates, and the constraints, indexes and
folders of wheels that they name) hold there too; nothing else of it is visible. It needs root, or
sudo. It imports the standard library alone, so that it needs no environment.
"""

from __future__ import annotations

import argparse
import os
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.fresh.settings import pip_settings

ROOT = Path(__file__).resolve().parents[2]
ITSELF = (sys.executable, "-S", "-m", "tests.fresh")
FOLDER = "Bücher und Läufe"  # a blank and umlauts: what a home folder may well contain
USER = "reader"
RELEASES = {"12": ("bookworm", "python3.11"), "13": ("trixie", "python3.13")}
DEVICES = ("null", "zero", "full", "random", "urandom", "tty")
# With torch where a build for processors alone can be had by name; else what needs none.
COMMANDS = {
    "12": ("make book", "make test"),
    "13": (
        "python3.13 -m venv .venv",
        "if .venv/bin/python -m pip download -qq --no-deps -d /tmp torch==2.13.0+cpu;"
        " then make venv; else .venv/bin/python -m pip install -qq -c constraints.txt"
        " -e '.[cluster,course,go1,logs,quadruped,t265,tools]'; fi",
        ".venv/bin/python -m pytest -n 2 -p tests.fresh.lacking",
    ),
}


def main() -> int:
    """Make the machine, run the commands there, take it away again."""
    parser = argparse.ArgumentParser(prog="tests.fresh", description=__doc__.splitlines()[0])
    parser.add_argument("--debian", choices=sorted(RELEASES), default="12")
    parser.add_argument("--out", type=Path, metavar="FOLDER", help="where _build/html is copied to")
    parser.add_argument("--run", metavar="COMMAND", help="instead of the README's commands")
    parser.add_argument("--inside", type=Path, help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.inside:
        return _run_inside(chosen.inside, chosen.debian, chosen.run)
    if missing := [tool for tool in ("mmdebstrap", "unshare", "git") if not shutil.which(tool)]:
        sys.stderr.write(f"a fresh machine cannot be made here without {', '.join(missing)}\n")
        return 2
    if os.geteuid():
        return subprocess.call(["sudo", "--preserve-env", *ITSELF, *sys.argv[1:]], cwd=ROOT)
    for name in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(name, lambda *_: sys.exit(130))
    with tempfile.TemporaryDirectory(prefix="fresh-", dir="/var/tmp") as kept:
        there = Path(kept) / "root"
        _make(there, chosen.debian)
        words = [*ITSELF, "--inside", str(there), "--debian", chosen.debian]
        words += ["--run", chosen.run] if chosen.run else []
        # A mount or a process lives as long as the namespace, and that as long as this process.
        status = subprocess.call(
            ["unshare", "--mount", "--pid", "--fork", "--kill-child", "--", *words], cwd=ROOT
        )
        site = there / "home" / USER / FOLDER / "_build" / "html"
        if status == 0 and chosen.out:
            shutil.rmtree(chosen.out / "html", ignore_errors=True)
            shutil.copytree(site, chosen.out / "html")
    return status


def _make(there: Path, debian: str) -> None:
    """Make the machine, its user and, there, a repository to clone."""
    release, python = RELEASES[debian]
    packages = f"git,make,{python},{python}-venv,ca-certificates"
    with _step(f"a minimal Debian {debian}"):
        words = ["mmdebstrap", "--quiet", "--variant=minbase", f"--include={packages}"]
        subprocess.run([*words, release, str(there)], check=True)
    _call("useradd", "--root", str(there), "--create-home", "--shell", "/bin/bash", USER)
    served = there / "srv" / "cpl.git"
    safe = ["git", "-c", "safe.directory=*", "-C", str(ROOT)]
    if subprocess.run([*safe, "status", "--porcelain"], stdout=-1, check=True).stdout:
        sys.stderr.write("what is not committed is not tested\n")
    words = [*safe, "clone", "--quiet", "--bare", "--no-hardlinks", str(ROOT), str(served)]
    subprocess.run(words, check=True)
    owner = (there / "home" / USER).stat()
    _call("chown", "-R", f"{owner.st_uid}:{owner.st_gid}", str(served))


def _run_inside(there: Path, debian: str, command: str | None) -> int:
    """Mount what a machine has, give it this machine's settings, and run the commands there."""
    settings = pip_settings(os.environ)
    _mount_system(there)
    for name in ("resolv.conf", "hosts"):
        shutil.copyfile(f"/etc/{name}", there / "etc" / name)
    for path in settings.paths:
        _bind(path, there)
    (there / "etc" / "pip.conf").write_text(settings.config, encoding="utf-8")
    home = f"/home/{USER}"
    environ = {"HOME": home, "USER": USER, "PATH": "/usr/local/bin:/usr/bin:/bin"}
    environ |= settings.environ | {n: os.environ[n] for n in ("CI",) if n in os.environ}

    def there_run(what: str, folder: str) -> int:
        words = [_chroot(), f"--userspec={USER}", str(there), "/bin/bash", "-ceu"]
        return subprocess.call([*words, f"cd {shlex.quote(folder)}; {what}"], env=environ)

    there_run(f"git clone --quiet /srv/cpl.git {shlex.quote(FOLDER)}", home)
    for each in [command] if command else COMMANDS[debian]:
        with _step(each):
            status = there_run(each, f"{home}/{FOLDER}")
        if status:
            sys.stderr.write(f"failed on a fresh Debian {debian}: {each}\n")
            return status
    return 0


def _mount_system(there: Path) -> None:
    _call("mount", "--make-rprivate", "/")
    _call("mount", "-t", "proc", "proc", str(there / "proc"))
    _call("mount", "--rbind", "/sys", str(there / "sys"))
    _call("mount", "-t", "tmpfs", "-o", "mode=755", "tmpfs", str(there / "dev"))
    for name in DEVICES:
        (there / "dev" / name).touch()
        _call("mount", "--bind", f"/dev/{name}", str(there / "dev" / name))
    for name in ("shm", "pts"):
        (there / "dev" / name).mkdir()
    _call("mount", "-t", "tmpfs", "-o", "mode=1777", "tmpfs", str(there / "dev" / "shm"))
    options = "newinstance,ptmxmode=0666,mode=620"
    _call("mount", "-t", "devpts", "-o", options, "devpts", str(there / "dev" / "pts"))
    for name, target in (
        ("ptmx", "pts/ptmx"),
        ("fd", "/proc/self/fd"),
        ("stdin", "fd/0"),
        ("stdout", "fd/1"),
        ("stderr", "fd/2"),
    ):
        (there / "dev" / name).symlink_to(target)


def _bind(path: Path, there: Path) -> None:
    """Let a file or folder of this machine be seen there under the same name, to read."""
    place = there / path.relative_to("/")
    if path.is_dir():
        place.mkdir(parents=True, exist_ok=True)
    else:
        place.parent.mkdir(parents=True, exist_ok=True)
        place.touch()
    _call("mount", "--bind", "-o", "ro", str(path), str(place))


def _chroot() -> str:
    """Return the program's path: root has it on its PATH, who came by sudo may not."""
    return shutil.which("chroot") or "/usr/sbin/chroot"


def _call(*words: str) -> None:
    subprocess.run(words, check=True)


@contextmanager
def _step(what: str) -> Iterator[None]:
    """Say what is done, and how long it took."""
    begun = time.monotonic()
    sys.stderr.write(f"=== {what}\n")
    yield
    sys.stderr.write(f"=== {what}: {time.monotonic() - begun:.0f} s\n")


if __name__ == "__main__":
    sys.exit(main())
