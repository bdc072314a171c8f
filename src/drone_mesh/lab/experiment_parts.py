"""The parts of an experiment file: their base classes and the types of their values."""

# Pydantic reads these annotations when the module is loaded, and Python 3.8 has no list[int].
from typing import Any, ClassVar, Dict, FrozenSet, List

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    create_model,
    model_serializer,
    model_validator,
)
from typing_extensions import Annotated

from drone_mesh.configuration import type_of
from drone_mesh.drone.fleet import MAX_DRONES
from drone_mesh.settings import Setting, settings_of

Share = Annotated[float, Field(ge=0, le=1)]
Above0 = Annotated[float, Field(gt=0, le=1e6)]
AtLeast0 = Annotated[float, Field(ge=0, le=1e6)]
NodeId = Annotated[int, Field(ge=0, lt=MAX_DRONES)]
Point = Annotated[List[float], Field(min_length=2, max_length=2)]


class Part(BaseModel):
    """A part of an experiment file: unknown keys are errors, and no value changes its type."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


def value_of(declared: Setting) -> Any:
    """The type of a key that is a setting."""

    def check(value: object) -> object:
        if not declared.allows(value):
            raise ValueError(f"expected {declared.expected}")
        return value

    return Annotated[type_of(declared), AfterValidator(check)]


def part_with_settings(settings: Any, leave_out: str) -> Any:
    """A part whose keys are the settings of this dataclass, except for the one left out."""
    keys: Any = {
        one.name: (value_of(one), one.plain_default)
        for one in settings_of(settings)
        if one.name != leave_out
    }
    return create_model("Part", __base__=Part, **keys)


class PartOfKind(Part):
    """A part that only has those keys that belong to its kind."""

    KEYS: ClassVar[Dict[str, FrozenSet[str]]]
    OF_ALL_KINDS: ClassVar[FrozenSet[str]] = frozenset()
    NAME: ClassVar[str] = ""  # in errors; default: that of the class

    kind: str

    @model_validator(mode="after")
    def _has_only_keys_of_its_kind(self) -> "PartOfKind":
        allowed = self.KEYS[self.kind] | self.OF_ALL_KINDS
        extra = sorted(self.model_fields_set - allowed - {"kind"})
        if extra:
            what, words = self.NAME or type(self).__name__.lower(), ", ".join(sorted(allowed))
            raise ValueError(f"{what} {self.kind} has no {extra[0]}: it has {words}")
        return self

    @model_serializer(mode="wrap")
    def _dump_keys_of_its_kind(self, dump: Any) -> Dict[str, Any]:
        kept = self.KEYS[self.kind] | self.OF_ALL_KINDS | {"kind"}
        return {key: value for key, value in dump(self).items() if key in kept}
