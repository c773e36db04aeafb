"""Remember: paths, fingerprints of source, and tables that are kept, keyed and checked."""

from cpl.store.paths import atomic_write, data_path, project_root, work_path
from cpl.store.source import cpl_imports, fingerprint, import_closure

__all__ = [
    "atomic_write",
    "cpl_imports",
    "data_path",
    "fingerprint",
    "import_closure",
    "project_root",
    "work_path",
]
