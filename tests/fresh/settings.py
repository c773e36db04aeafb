"""How this machine reaches packages: pip's settings, proxies, certificates, and what they name."""

from __future__ import annotations

import configparser
import os
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote, urljoin, urlsplit

__all__ = ["PipSettings", "named_paths", "pip_files", "pip_settings"]

# What the environment says about proxies and certificates, beside pip's own settings.
ABOUT_THE_NET = re.compile(r"PIP_.*|.*_PROXY|.*CERT_?(FILE|DIR)|.*CA_?(BUNDLE|INFO|CERTS)", re.I)


@dataclass(frozen=True)
class PipSettings:
    """How this machine reaches packages.

    Attributes:
        config: pip's configuration files, merged into one.
        environ: What the environment says about pip, proxies and certificates.
        paths: The files and folders that the two name.
    """

    config: str
    environ: dict[str, str]
    paths: tuple[Path, ...]


def pip_files(environ: Mapping[str, str]) -> list[Path]:
    """Name the configuration files that pip reads, in its order: a later one wins.

    Args:
        environ: The environment.
    """
    home = Path(environ.get("HOME", "/"))
    system = environ.get("XDG_CONFIG_DIRS", "/etc/xdg").split(os.pathsep)
    files = [Path(each) / "pip" / "pip.conf" for each in system if each]
    files += [Path("/etc/pip.conf"), home / ".pip" / "pip.conf"]
    files += [Path(environ.get("XDG_CONFIG_HOME", home / ".config")) / "pip" / "pip.conf"]
    files += [Path(environ["PIP_CONFIG_FILE"])] if "PIP_CONFIG_FILE" in environ else []
    return [path for path in files if path.is_file()]


def pip_settings(environ: Mapping[str, str]) -> PipSettings:
    """Read how this machine reaches packages.

    Args:
        environ: The environment.
    """
    merged = configparser.RawConfigParser()
    merged.read(pip_files(environ), encoding="utf-8")
    lines = []
    values = []
    for section in merged.sections():
        lines.append(f"[{section}]")
        for key, value in merged.items(section):
            lines.append(f"{key} = " + value.replace("\n", "\n    "))
            values.append(value)
    told = {
        name: value
        for name, value in environ.items()
        if ABOUT_THE_NET.fullmatch(name) and name != "PIP_CONFIG_FILE"
    }
    paths = named_paths([*values, *told.values()])
    return PipSettings("\n".join(lines) + "\n", told, paths)


def named_paths(values: Iterable[str]) -> tuple[Path, ...]:
    """Find the files and folders that settings name, and the folders that a local index points to.

    Args:
        values: Settings; several words each, paths or `file://` addresses among them.

    >>> named_paths(["https://host/simple", "60", "/etc file:///etc/hosts /no/such"])
    (PosixPath('/etc'), PosixPath('/etc/hosts'))
    """
    found: dict[Path, None] = {}
    for word in (word for value in values for word in value.split()):
        local = word.startswith("file://")
        path = Path(unquote(urlsplit(word).path) if local else word)
        if not path.is_absolute() or path == Path("/") or not path.exists():
            continue
        found[path] = None
        if local and path.is_dir():
            found.update(dict.fromkeys(_pointed_to(path)))
    return tuple(found)


def _pointed_to(index: Path) -> list[Path]:
    """Return the folders outside of a local index in which its pages say that files lie."""
    folders = set()
    for page in index.glob("*/index.html"):
        for link in re.findall(r'href="([^"]+)"', page.read_text(encoding="utf-8")):
            address = urlsplit(urljoin(page.as_uri(), link))
            if address.scheme == "file":
                folders.add(Path(unquote(address.path)).parent)
    return sorted(each for each in folders if not each.is_relative_to(index) and each.is_dir())
