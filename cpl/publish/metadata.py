"""What lies in `data/`, told in three ways: checksums, an RO-Crate and a Croissant description.

All three are drawn from the files and their manifests, so that none of them can be forgotten: a
test compares them with the tree.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from cpl.store import Manifest, atomic_write, data_path, manifests, project_root

__all__ = ["CHECKSUMS", "CRATE", "CROISSANT", "checksums", "differences", "write"]

CHECKSUMS = "checksums.json"
CRATE = "ro-crate-metadata.json"
CROISSANT = "croissant.json"

_LICENCE = "https://spdx.org/licenses/MIT"
_TYPES = {"bool": "sc:Boolean", "str": "sc:Text", "object": "sc:Text", "bytes": "sc:Text"}
_MEDIA = {
    ".parquet": "application/vnd.apache.parquet",
    ".json": "application/json",
    ".mcap": "application/x-mcap",
    ".bag": "application/x-rosbag",
    ".safetensors": "application/octet-stream",
    ".md": "text/markdown",
    ".txt": "text/plain",
}


def checksums(data: Path | None = None) -> dict[str, str]:
    """Return the SHA-256 of every file below `data/` but the three that describe it.

    Args:
        data: The folder; the project's own unless given.

    Returns:
        Path relative to the folder -> 64 hexadecimal digits, sorted.
    """
    base = data_path() if data is None else data
    ours = {CHECKSUMS, CRATE, CROISSANT}
    files = [
        p for p in base.rglob("*") if p.is_file() and p.relative_to(base).as_posix() not in ours
    ]
    return {p.relative_to(base).as_posix(): _sha256(p) for p in sorted(files)}


def differences(data: Path | None = None) -> list[str]:
    """Compare the tree with the checksums that were written down: one line a difference."""
    base = data_path() if data is None else data
    told = json.loads((base / CHECKSUMS).read_text(encoding="utf-8"))
    found = checksums(base)
    missing = [f"missing: {name}" for name in sorted(told.keys() - found.keys())]
    extra = [f"not listed: {name}" for name in sorted(found.keys() - told.keys())]
    both = sorted(told.keys() & found.keys())
    return [*missing, *extra, *(f"changed: {name}" for name in both if told[name] != found[name])]


def write(data: Path | None = None) -> list[Path]:
    """Write the three files anew.

    Args:
        data: The folder; the project's own unless given.

    Returns:
        Their paths.
    """
    base = data_path() if data is None else data
    sums = checksums(base)
    results = manifests(root=base / "results")
    contents = {
        CHECKSUMS: sums,
        CRATE: _crate(base, sums, results),
        CROISSANT: _croissant(sums, results),
    }
    return [
        atomic_write(base / name, json.dumps(content, indent=1, ensure_ascii=False) + "\n")
        for name, content in contents.items()
    ]


def _crate(base: Path, sums: Mapping[str, str], results: Sequence[Manifest]) -> dict[str, Any]:
    """Describe the folder as an RO-Crate: who, under which licence, what each file is."""
    from rocrate.rocrate import ROCrate

    citation = _citation()
    crate = ROCrate()
    crate.name = "Data of the companion to Conformal Policy Learning"
    crate.description = citation["abstract"]
    crate.license = _LICENCE
    crate.datePublished = max(told.made for told in results)
    tables = {f"results/{told.experiment}/{told.profile}.parquet": told for told in results}
    for name, digest in sums.items():
        properties: dict[str, Any] = {
            "name": Path(name).name,
            "encodingFormat": _MEDIA.get(Path(name).suffix, "application/octet-stream"),
            "contentSize": str((base / name).stat().st_size),
            "sha256": digest,
        }
        if name in tables:
            properties |= _about(tables[name])
        crate.add_file(dest_path=name, properties=properties, fetch_remote=False)
    return crate.metadata.generate()


def _about(told: Manifest) -> dict[str, Any]:
    return {
        "description": f"Table of the experiment {told.experiment}, evidence: {told.label}",
        "dateCreated": told.made,
        "version": told.commit,
    }


def _croissant(sums: Mapping[str, str], results: Sequence[Manifest]) -> dict[str, Any]:
    """Describe the published tables column by column (Croissant 1.0)."""
    citation = _citation()
    return {
        "@context": _CONTEXT,
        "@type": "sc:Dataset",
        "name": "conformal-policy-learning-companion",
        "description": citation["abstract"],
        "conformsTo": "http://mlcommons.org/croissant/1.0",
        "citeAs": citation["message"],
        "license": _LICENCE,
        "url": citation["paper"],
        "version": citation["version"],
        "datePublished": max(told.made for told in results),
        "distribution": [_file(told, sums) for told in results],
        "recordSet": [_records(told) for told in results],
    }


def _file(told: Manifest, sums: Mapping[str, str]) -> dict[str, Any]:
    path = f"results/{told.experiment}/{told.profile}.parquet"
    return {
        "@type": "cr:FileObject",
        "@id": _name(told),
        "name": _name(told),
        "description": f"Table of the experiment {told.experiment}, profile {told.profile}",
        "contentUrl": path,
        "encodingFormat": "application/x-parquet",
        "sha256": sums[path],
    }


def _records(told: Manifest) -> dict[str, Any]:
    source = _name(told)
    return {
        "@type": "cr:RecordSet",
        "@id": f"{source}-rows",
        "name": f"{source}-rows",
        "field": [
            {
                "@type": "cr:Field",
                "@id": f"{source}-rows/{column}",
                "name": f"{source}-rows/{column}",
                "description": f"Column {column} of {told.experiment}",
                "dataType": _TYPES.get(kind, "sc:Float" if "float" in kind else "sc:Integer"),
                "source": {"fileObject": {"@id": source}, "extract": {"column": column}},
            }
            for column, kind in told.columns.items()
        ],
    }


def _name(told: Manifest) -> str:
    return f"{told.experiment}-{told.profile}"


def _citation() -> dict[str, str]:
    """Return what the citation file says of the project, so that it is said once."""
    told = yaml.safe_load((project_root() / "CITATION.cff").read_text(encoding="utf-8"))
    paper = told["references"][0]
    arxiv = _first(entry["value"] for entry in paper["identifiers"])
    return {
        "abstract": f"{told['title']}. A replication of: {paper['title']} ({paper['year']}).",
        "message": told["message"],
        "version": str(told["version"]),
        "paper": f"https://arxiv.org/abs/{arxiv.removeprefix('arXiv:')}",
    }


def _first(values: Iterable[str]) -> str:
    return next(iter(values))


def _sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


_CONTEXT = {
    "@language": "en",
    "@vocab": "https://schema.org/",
    "citeAs": "cr:citeAs",
    "column": "cr:column",
    "conformsTo": "dct:conformsTo",
    "cr": "http://mlcommons.org/croissant/",
    "rai": "http://mlcommons.org/croissant/RAI/",
    "data": {"@id": "cr:data", "@type": "@json"},
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    "dct": "http://purl.org/dc/terms/",
    "examples": {"@id": "cr:examples", "@type": "@json"},
    "extract": "cr:extract",
    "field": "cr:field",
    "fileProperty": "cr:fileProperty",
    "fileObject": "cr:fileObject",
    "fileSet": "cr:fileSet",
    "format": "cr:format",
    "includes": "cr:includes",
    "isLiveDataset": "cr:isLiveDataset",
    "jsonPath": "cr:jsonPath",
    "key": "cr:key",
    "md5": "cr:md5",
    "parentField": "cr:parentField",
    "path": "cr:path",
    "recordSet": "cr:recordSet",
    "references": "cr:references",
    "regex": "cr:regex",
    "repeated": "cr:repeated",
    "replace": "cr:replace",
    "sc": "https://schema.org/",
    "separator": "cr:separator",
    "source": "cr:source",
    "subField": "cr:subField",
    "transform": "cr:transform",
}
