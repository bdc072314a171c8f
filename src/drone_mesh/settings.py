"""Settings: what people may change, each declared once as a field of a dataclass.

From the declaration follow the options of programs, the keys of files and their checks, the
arguments of launch files, and the help of all.
"""

from __future__ import annotations

import enum
import math
import re
from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import Any, Iterator, Mapping, TypeVar

from drone_mesh.errors import ConfigurationError

Settings = TypeVar("Settings")

_UNIT = re.compile(r"_(m|s)$")


@dataclass(frozen=True)
class Setting:
    """One setting. Bounds are those of numbers."""

    text: str  # what it is, in a few words for help, with the unit
    what: str = ""  # kind of value or its unit, for errors: "metres"
    least: float = -math.inf
    above: float = -math.inf  # a bound that is not allowed itself
    most: float = math.inf
    zero: str = ""  # what 0 stands for, if it is outside the bounds
    name: str = ""  # of the field
    default: Any = None

    @property
    def key(self) -> str:
        """The name for people, without a unit."""
        return _UNIT.sub("", self.name)

    @property
    def words(self) -> tuple[str, ...]:
        """All allowed values, if these are the words of an Enum."""
        kind = type(self.default)
        return tuple(word.value for word in kind) if issubclass(kind, enum.Enum) else ()

    @property
    def plain_default(self) -> Any:
        """The default as people write it: the word of a member of an Enum."""
        return self.default.value if self.words else self.default

    @property
    def bounds(self) -> str:
        """The bounds in words; empty: none."""
        if self.most == math.inf:
            return ""
        if self.above > -math.inf:
            return f"above {self.above:g}, at most {self.most:.10g}"
        or_zero = f", or 0 for {self.zero}" if self.zero else ""
        return f"{self.least:.10g}..{self.most:.10g}{or_zero}"

    @property
    def help(self) -> str:
        """The meaning of the setting, with its bounds."""
        return f"{self.text} ({self.bounds})" if self.bounds else self.text

    @property
    def expected(self) -> str:
        """The allowed values, for errors."""
        return " or ".join(self.words) or ", ".join(filter(None, (self.what, self.bounds)))

    def allows(self, value: object) -> bool:
        """Whether a value of the right type is within the bounds; NaN never is."""
        if not isinstance(value, (int, float)) or not self.bounds:
            return True
        is_zero = bool(self.zero) and value == 0
        return is_zero or (value > self.above and self.least <= value <= self.most)

    def check(self, value: object) -> None:
        """Raise ConfigurationError for a value out of bounds."""
        if not self.allows(value):
            raise ConfigurationError(f"invalid {self.key} {value}: expected {self.expected}")


def setting(default: Any, text: str, what: str = "", **bounds: Any) -> Any:
    """A field of a dataclass that is a setting. The arguments are those of Setting."""
    return field(default=default, metadata={"setting": Setting(text, what, **bounds)})


def settings_of(settings: Any) -> Iterator[Setting]:
    """The settings that a dataclass declares, and those of dataclasses inside it.

    The values of an instance are the defaults.
    """
    for declared in fields(settings):
        value = getattr(settings, declared.name, declared.default)
        if "setting" in declared.metadata:
            yield replace(declared.metadata["setting"], name=declared.name, default=value)
        elif is_dataclass(value):
            yield from settings_of(value)


def with_settings(kind: type[Settings], values: Mapping[str, Any]) -> Settings:
    """A dataclass with these values of its settings, by name; others have their default.

    Words become members of their Enum. Raises ConfigurationError.
    """
    given: dict[str, Any] = {}
    for declared in fields(kind):  # type: ignore[arg-type]
        default: Any = declared.default
        if is_dataclass(default):
            given[declared.name] = with_settings(type(default), values)
        elif declared.name in values:
            value = values[declared.name]
            is_word = isinstance(default, enum.Enum)
            given[declared.name] = type(default)(value) if is_word else value
    return kind(**given)
