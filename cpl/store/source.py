"""What code a result rests on: the transitive ``cpl`` imports and a digest of what they say.

A key of the store contains the fingerprint of the source below a computation. Comments, docstrings
and layout do not enter it, so improving a text recomputes nothing, while one changed expression
recomputes exactly what depends on it.
"""

import ast
import hashlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import cast

from cpl.store.paths import project_root

__all__ = [
    "cpl_imports",
    "external_imports",
    "fingerprint",
    "import_closure",
    "is_module",
    "module_digests",
]

# Calls that name an experiment as text: a chapter that says compute("coverage") depends on the
# module coverage in one of the folders of cpl.experiments although it never imports it. What such a
# module binds tells it from those that experiments share.
_BY_NAME = {"cpl.experiments": ("compute", "published", "verify")}
_MARK = "EXPERIMENT"


def cpl_imports(code: str, *, root: Path | None = None) -> tuple[str, ...]:
    r"""Name the ``cpl`` modules that a piece of code mentions, wherever in it they are imported.

    Imports inside functions count; imports under ``if TYPE_CHECKING`` do not, they are never run.
    The experiment in ``compute("name")``, ``published("name")`` and ``verify("name")`` counts too;
    if the name is not a literal, every experiment counts. So does every module of a package whose
    folder is walked, ``pkgutil.iter_modules(package.__path__)``.

    Args:
        code: Python source, for example the code cells of a chapter put together.
        root: Project whose ``cpl`` is meant; by default the one this package is imported from.

    Returns:
        Sorted dotted module names, without what those modules import in turn.

    Raises:
        ValueError: If the code is not Python.

    Examples:
        >>> cpl_imports("import numpy\nfrom cpl.store import atomic_write")
        ('cpl.store',)
        >>> cpl_imports("from cpl.store.paths import data_path")
        ('cpl.store.paths',)
    """
    tree = _parse(code, "<code>")
    return _named_modules(tree, "", _resolved(root))


def import_closure(
    *origins: str | Path, root: Path | None = None, within: str = "cpl"
) -> tuple[str, ...]:
    """List every ``cpl`` module that running the origins can import, directly or through others.

    Importing a module runs the ``__init__`` of the packages above it, so these count as well; but
    of a package that nobody imports from, only what its module level imports, since none of its
    functions is called.

    Args:
        origins: Dotted module names (``"cpl.conformal"``), or paths of Python files.
        root: Project whose ``cpl`` is meant; by default the one this package is imported from.
        within: Package outside of which nothing is followed.

    Returns:
        Sorted dotted module names; an origin given by name is in it, one given as a path is not.

    Raises:
        ValueError: If a named module does not exist, or a source is not Python.

    Examples:
        >>> set(import_closure("cpl.store")) >= {"cpl", "cpl.store", "cpl.store.source"}
        True
    """
    base = _resolved(root)
    named: list[str] = []
    for origin in origins:
        if isinstance(origin, Path):
            tree = _parse(origin.read_text(encoding="utf-8"), str(origin))
            named += _named_modules(tree, "", base)
        elif _file_of(origin, base) is None:
            msg = f"origins must be modules of cpl or paths of Python files, got {origin!r}"
            raise ValueError(msg)
        else:
            named.append(origin)
    used: set[str] = set()
    passed_through: set[str] = set()
    while named:
        module = named.pop()
        if module in used:
            continue
        if not f"{module}.".startswith(f"{within}."):
            continue
        used.add(module)
        named += _module_facts(module, base).imports
        for package in set(_packages_above(module)) - passed_through:
            passed_through.add(package)
            named += _module_facts(package, base).imports_at_module_level
    return tuple(sorted(used | passed_through))


def fingerprint(*origins: str | Path, root: Path | None = None) -> str:
    """Digest the meaning of all ``cpl`` code that the origins rest on.

    SHA-256 over the syntax trees of the transitive closure of imports, each without comments,
    docstrings and positions, together with the modules' names.

    Args:
        origins: Dotted module names, or paths of Python files (whose own code then counts too).
        root: Project whose ``cpl`` is meant; by default the one this package is imported from.

    Returns:
        64 hexadecimal digits.

    Raises:
        ValueError: If a named module does not exist, or a source is not Python.

    Examples:
        >>> len(fingerprint("cpl.store"))
        64
        >>> fingerprint("cpl.store.paths") == fingerprint("cpl.store.paths", "cpl.store")
        True
    """
    digest = hashlib.sha256()
    for module, own in module_digests(*origins, root=root).items():
        digest.update(f"{module} {own}\n".encode())
    for origin in sorted(o for o in origins if isinstance(o, Path)):
        tree = _parse(origin.read_text(encoding="utf-8"), str(origin))
        digest.update(f"{origin.name} {_tree_digest(tree)}\n".encode())
    return digest.hexdigest()


def module_digests(
    *origins: str | Path, root: Path | None = None, within: str = "cpl"
) -> dict[str, str]:
    """Return the digest of each module in the closure of imports, to say later which one changed.

    Args:
        origins: Dotted module names, or paths of Python files.
        root: Project whose ``cpl`` is meant; by default the one this package is imported from.
        within: As in `import_closure`.

    Returns:
        Dotted module name -> 64 hexadecimal digits, sorted by name.

    Raises:
        ValueError: If a named module does not exist, or a source is not Python.

    Examples:
        >>> sorted(module_digests("cpl.rng"))
        ['cpl', 'cpl.environ', 'cpl.rng']
    """
    base = _resolved(root)
    return {
        m: _module_facts(m, base).digest for m in import_closure(*origins, root=base, within=within)
    }


def external_imports(*origins: str | Path, root: Path | None = None) -> frozenset[str]:
    """Return the top-level names of all other packages that the closure of imports mentions.

    Args:
        origins: Dotted module names, or paths of Python files.
        root: Project whose ``cpl`` is meant; by default the one this package is imported from.

    Raises:
        ValueError: If a named module does not exist, or a source is not Python.

    Examples:
        >>> external_imports("cpl.rng") >= {"hashlib", "numpy", "typing"}
        True
    """
    base = _resolved(root)
    closure = import_closure(*origins, root=base)
    return frozenset(name for module in closure for name in _module_facts(module, base).outside)


def is_module(name: str, *, root: Path | None = None) -> bool:
    """Say whether ``cpl`` has a module of that dotted name.

    Args:
        name: For example ``"cpl.rng"``.
        root: Project whose ``cpl`` is meant; by default the one this package is imported from.

    Examples:
        >>> is_module("cpl.rng"), is_module("cpl.gone")
        (True, False)
    """
    return _file_of(name, _resolved(root)) is not None


def _resolved(root: Path | None) -> Path:
    return project_root() if root is None else Path(root).resolve()


def _parse(code: str, name: str) -> ast.Module:
    try:
        return ast.parse(code, filename=name)
    except SyntaxError as error:
        msg = f"code must be Python, but {name} has an error in line {error.lineno}: {error.msg}"
        raise ValueError(msg) from error


def _file_of(module: str, root: Path) -> Path | None:
    """Return the file that defines a module of ``cpl``, or None if there is none."""
    parts = module.split(".")
    if parts[0] != "cpl" or not all(part.isidentifier() for part in parts):
        return None
    stem = root.joinpath(*parts)
    for path in (stem / "__init__.py", stem.with_name(stem.name + ".py")):
        if path.is_file():
            return path
    return None


def _packages_above(module: str) -> list[str]:
    parts = module.split(".")
    return [".".join(parts[:n]) for n in range(1, len(parts))]


@dataclass(frozen=True, kw_only=True)
class _Facts:
    """What the store knows of one module: whom it imports, and a digest of its own code."""

    imports: tuple[str, ...]
    imports_at_module_level: tuple[str, ...]
    outside: frozenset[str]
    digest: str


def _module_facts(module: str, root: Path) -> _Facts:
    path = _file_of(module, root)
    if path is None:
        return _Facts(
            imports=(), imports_at_module_level=(), outside=frozenset(), digest="namespace"
        )
    stat = path.stat()
    return _read_facts(module, path, root, stat.st_mtime_ns, stat.st_size)


@lru_cache(maxsize=4096)
def _read_facts(module: str, path: Path, root: Path, _mtime: int, _size: int) -> _Facts:
    tree = _parse(path.read_text(encoding="utf-8"), module)
    package = module if path.name == "__init__.py" else module.rpartition(".")[0]
    return _Facts(
        imports=_named_modules(tree, package, root),
        imports_at_module_level=_named_modules(tree, package, root, functions=False),
        outside=frozenset(_outside_modules(tree)),
        digest=_tree_digest(tree),
    )


def _named_modules(
    tree: ast.Module, package: str, root: Path, *, functions: bool = True
) -> tuple[str, ...]:
    named: set[str] = set()
    bound: dict[str, str] = {}
    nodes = list(_live_nodes(tree, functions))
    for node in nodes:
        if isinstance(node, ast.Import):
            for alias in node.names:
                named.add(alias.name)
                bound[alias.asname or alias.name] = alias.name
        elif isinstance(node, ast.ImportFrom):
            origin = _origin(node, package)
            for alias in node.names:
                named.update(_imported(origin, alias.name, root))
                bound[alias.asname or alias.name] = f"{origin}.{alias.name}"
    for node in nodes:
        if isinstance(node, ast.Call):
            named.update(_called_by_name(node, bound, root))
    return tuple(sorted(name for name in named if _file_of(name, root) is not None))


def _imported(origin: str, name: str, root: Path) -> Iterator[str]:
    """Yield what ``from origin import name`` uses: a module of the package, or the package itself.

    A package from which only a module is taken is run and not used: none of its functions is
    called. If it has a name of its own that reads the same, that one is what is imported.
    """
    module = f"{origin}.{name}"
    path, package = _file_of(module, root), _file_of(origin, root)
    if path is not None:
        yield module
    if path is None or package is None or name in _own_names(package, package.stat().st_mtime_ns):
        yield origin


@lru_cache(maxsize=4096)
def _own_names(path: Path, _mtime: int) -> frozenset[str]:
    """Return the names that a module binds, functions and what it imports among them."""
    names: set[str] = set()
    for node in _parse(path.read_text(encoding="utf-8"), str(path)).body:
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)):
            names.add(node.name)
        elif isinstance(node, (ast.Import, ast.ImportFrom)):
            names.update(alias.asname or alias.name.partition(".")[0] for alias in node.names)
        else:
            names.update(n.id for n in ast.walk(node) if isinstance(n, ast.Name))
    return frozenset(names)


def _origin(node: ast.ImportFrom, package: str) -> str:
    """Return the absolute name of what ``from ... import`` imports from."""
    if not node.level:
        return node.module or ""
    above = package.split(".")[: len(package.split(".")) - node.level + 1]
    return ".".join([*above, node.module] if node.module else above)


def _called_by_name(call: ast.Call, bound: dict[str, str], root: Path) -> Iterable[str]:
    """Return modules that a call names otherwise: import_module("cpl.x"), compute("x"), a walk."""
    function = _dotted(call.func)
    head, _, rest = function.partition(".")
    target = f"{bound.get(head, head)}.{rest}" if rest else bound.get(head, head)
    given = (
        call.args[0]
        if call.args
        else next((word.value for word in call.keywords if word.arg == "name"), None)
    )
    if target == "pkgutil.iter_modules" and _dotted(given).endswith(".__path__"):
        walked = _dotted(given).removesuffix(".__path__")
        return _modules_in(bound.get(walked, walked), root)
    literal = given.value if isinstance(given, ast.Constant) else None
    if target == "importlib.import_module":
        return [literal] if isinstance(literal, str) else []
    for room, functions in _BY_NAME.items():
        if target in {f"{room}.{function}" for function in functions}:
            found = _experiments(root.joinpath(*room.split(".")))
            wanted = [literal] if isinstance(literal, str) else list(found)
            return [f"{room}.{found[name]}" for name in wanted if name in found]
    return []


def _experiments(room: Path) -> dict[str, str]:
    """Return the experiments in the folders of a room: name -> dotted name within the room."""
    return {
        path.stem: f"{path.parent.name}.{path.stem}"
        for path in sorted(room.glob("*/*.py"))
        if _MARK in _own_names(path, path.stat().st_mtime_ns)
    }


def _modules_in(package: str, root: Path) -> list[str]:
    folder = root.joinpath(*package.split("."))
    return [f"{package}.{path.stem}" for path in folder.glob("*.py") if path.stem != "__init__"]


def _dotted(node: ast.expr | None) -> str:
    if isinstance(node, ast.Attribute):
        return f"{_dotted(node.value)}.{node.attr}"
    return node.id if isinstance(node, ast.Name) else ""


def _outside_modules(tree: ast.Module) -> Iterator[str]:
    for node in _live_nodes(tree, functions=True):
        if isinstance(node, ast.Import):
            yield from (alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            yield node.module.partition(".")[0]


def _live_nodes(node: ast.AST, functions: bool) -> Iterator[ast.AST]:
    """Walk a tree without what stands under ``if TYPE_CHECKING``, with or without functions."""
    yield node
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.If) and _dotted(child.test).endswith("TYPE_CHECKING"):
            for other in child.orelse:
                yield from _live_nodes(other, functions)
        elif functions or not isinstance(child, (ast.FunctionDef, ast.AsyncFunctionDef)):
            yield from _live_nodes(child, functions)


def _tree_digest(tree: ast.Module) -> str:
    return hashlib.sha256(_canonical(tree).encode()).hexdigest()


def _canonical(node: object) -> str:
    """Write a syntax tree as text: no positions, no docstrings, no field that is empty.

    ``ast.dump`` is not used because its output changes between versions of Python.
    """
    if isinstance(node, ast.AST):
        fields = (
            f"{name}={_canonical(value)}"
            for name, value in _meaningful(node)
            if value is not None and value != []
        )
        return f"{type(node).__name__}({','.join(fields)})"
    if isinstance(node, list):
        members = cast("list[object]", node)
        return f"[{','.join(_canonical(member) for member in members)}]"
    return f"{type(node).__name__}:{node!r}"


def _meaningful(node: ast.AST) -> Iterator[tuple[str, object]]:
    for name, value in ast.iter_fields(node):
        if name == "body" and _has_docstring(node):
            yield name, value[1:]
        elif name not in ("kind", "type_ignores", "type_comment"):
            yield name, value


def _has_docstring(node: ast.AST) -> bool:
    if not isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)):
        return False
    return ast.get_docstring(node, clean=False) is not None
