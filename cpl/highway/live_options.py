"""An environment's options as the dictionary that highway-env has: `env.unwrapped.config`."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, MutableMapping
from dataclasses import fields
from types import MappingProxyType
from typing import Any

from cpl.highway.config import Config
from cpl.highway.options import fixed_options, highway_env_options

__all__ = ["LiveOptions"]


class LiveOptions(MutableMapping[str, Any]):
    """The options, read and changed by highway-env's names.

    What is set holds from the next reset on; until then it is what is read, and the road drives on
    as it was made. What is nested is read-only: set the whole of it.

    Args:
        read: Returns the options in force after the next reset.
        write: Takes changes, or refuses them with a ValueError.

    Example:
        >>> from cpl.highway.options import RENDER_OPTIONS
        >>> options = LiveOptions(lambda: (Config(), RENDER_OPTIONS), print)
        >>> options["lanes_count"], options["observation"]["vehicles_count"], options.get("none")
        (4, 5, None)
        >>> options["lanes_count"] = 3
        {'lanes_count': 3}
    """

    def __init__(
        self,
        read: Callable[[], tuple[Config, Mapping[str, object]]],
        write: Callable[[Mapping[str, Any]], None],
    ) -> None:
        self._read, self._write = read, write

    def __getitem__(self, name: str) -> Any:  # noqa: ANN401
        value = self._all()[name]
        return MappingProxyType(value) if isinstance(value, Mapping) else value

    def __setitem__(self, name: str, value: Any) -> None:  # noqa: ANN401
        self._write({name: value})

    def __delitem__(self, name: str) -> None:
        raise TypeError(f"option {name} has a value always: set another")

    def __iter__(self) -> Iterator[str]:
        return iter(self._all())

    def __len__(self) -> int:
        return len(self._all())

    def __repr__(self) -> str:
        return repr(self._all())

    def update(self, *others: Any, **more: Any) -> None:  # noqa: ANN401
        """Change several options at once; they are judged together.

        Args:
            *others: As for a dictionary.
            **more: Options by name.

        Raises:
            ValueError: An option is unknown, or they do not go together.
        """
        self._write(dict(*others, **more))

    def _all(self) -> dict[str, Any]:
        config, picture = self._read()
        options = {**fixed_options(), **highway_env_options(config), **picture}
        nested = {*options["observation"], *options["action"], "observation_vehicles_count"}
        ours = {field.name for field in fields(Config)} - options.keys() - nested
        return options | {name: getattr(config, name) for name in sorted(ours)}
