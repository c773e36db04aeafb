"""Remember: paths, fingerprints of source, and tables that are kept, keyed and checked.

Two layers. The *work* layer (outside git) holds finished shards by key; the *published* layer
(``data/results/``, in git) holds what the book shows, with where it comes from.
"""

from cpl.store.keys import canonical_json, plain, stage_key, versions_below
from cpl.store.models import DamagedModelError, Model, decode_model, encode_model
from cpl.store.paths import atomic_write, data_path, project_root, work_path
from cpl.store.published import (
    DamagedResultError,
    Manifest,
    PublishedShard,
    Verification,
    manifests,
    publish,
    read_manifest,
    read_published,
    record_verification,
    staleness,
)
from cpl.store.rules import fixed_rules, rules_in_force
from cpl.store.source import (
    cpl_imports,
    external_imports,
    fingerprint,
    import_closure,
    module_digests,
)
from cpl.store.state import machine, source_commit, today
from cpl.store.tables import (
    bytes_columns,
    decode_table,
    encode_table,
    same_table,
    table_digest,
)
from cpl.store.work import StoredShard, WorkStore

__all__ = [
    "DamagedModelError",
    "DamagedResultError",
    "Manifest",
    "Model",
    "PublishedShard",
    "StoredShard",
    "Verification",
    "WorkStore",
    "atomic_write",
    "bytes_columns",
    "canonical_json",
    "cpl_imports",
    "data_path",
    "decode_model",
    "decode_table",
    "encode_model",
    "encode_table",
    "external_imports",
    "fingerprint",
    "fixed_rules",
    "import_closure",
    "machine",
    "manifests",
    "module_digests",
    "plain",
    "project_root",
    "publish",
    "read_manifest",
    "read_published",
    "record_verification",
    "rules_in_force",
    "same_table",
    "source_commit",
    "stage_key",
    "staleness",
    "table_digest",
    "today",
    "versions_below",
    "work_path",
]
