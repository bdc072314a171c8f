"""The parts of a scenario in an experiment file: the types of their values, and the faults."""

import difflib
import re
from typing import Any, ClassVar, Dict, FrozenSet, List, NamedTuple, Optional

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    create_model,
    field_validator,
    model_serializer,
    model_validator,
)
from typing_extensions import Annotated, Literal

from drone_mesh.communication.data.packets import MAX_MESSAGE_BYTES
from drone_mesh.configuration import type_of
from drone_mesh.drone.fleet import MAX_DRONES
from drone_mesh.settings import Setting, settings_of

# Pydantic reads these annotations when the module is loaded, and Python 3.8 has no list[int].


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


# Pydantic reads these annotations when the module is loaded, and Python 3.8 has no list[int].


EVENTS = ("all connected", "the first flight", "the first landing", "the first loss", "healed")

_PATTERN = re.compile(
    r"\s*(?:when\s+|(?P<delay>[0-9]{1,9}(?:\.[0-9]{1,9})?)\s*s\s+after\s+)?"
    r"(?P<event>[a-z ]+?)\s*",
    re.IGNORECASE,
)


class StartCondition(NamedTuple):
    """A delay after the first occurrence of an event."""

    event: str  # one of EVENTS
    delay_s: float


def parse_condition(text: str) -> StartCondition:
    """Raises ValueError, with what is allowed, for an invalid condition."""
    match = _PATTERN.fullmatch(text)
    event = " ".join(match.group("event").lower().split()) if match else ""
    if match is None or event not in EVENTS:
        close = difflib.get_close_matches(event, EVENTS, n=1)
        hint = f"did you mean {close[0]!r}?" if close else f"events: {', '.join(EVENTS)}"
        raise ValueError(f"expected 'when EVENT' or 'N s after EVENT'; {hint}")
    return StartCondition(event, float(match.group("delay") or 0.0))


class Pick(Part):
    """The drones: a share or number selected by some rule, or these ids."""

    share: Optional[Share] = None  # of all drones of the layout that are not spared
    number: Optional[Annotated[int, Field(ge=0, le=MAX_DRONES)]] = None
    ids: Optional[List[NodeId]] = None
    pick: Literal["random", "cut_vertex", "next_to_gateway", "circle", "busiest"] = "random"
    center: Optional[Point] = None  # circle; default: a random drone
    radius_m: Optional[Above0] = None  # circle: everything within it
    spare: Literal["gateways", "nothing"] = "gateways"

    @model_validator(mode="after")
    def _has_one_selection(self) -> "Pick":
        given = [key for key in ("share", "number", "ids") if getattr(self, key) is not None]
        if self.pick == "circle" and self.radius_m is None:
            raise ValueError("pick circle needs radius_m")
        if self.pick == "circle" and not given:
            return self
        if len(given) != 1:
            raise ValueError("give exactly one of share, number and ids")
        return self


class Broken(Pick):
    """Drones whose radios send, or receive, nothing for a while."""

    for_s: Optional[Above0] = None


class Link(Part):
    """One link between two drones, or a number of random ones."""

    between: Optional[Annotated[List[NodeId], Field(min_length=2, max_length=2)]] = None
    number: Annotated[int, Field(ge=1, le=10_000)] = 1
    for_s: Optional[Above0] = None  # default: to the end

    @model_validator(mode="after")
    def _is_one_link_or_a_number(self) -> "Link":
        if self.between is not None and "number" in self.model_fields_set:
            raise ValueError("give either between or number")
        if self.between is not None and len(set(self.between)) == 1:
            raise ValueError("a link is between two drones")
        return self


class Jam(Part):
    """Noise in a circle: packets from or to a drone within it are lost.

    On a shared channel: a transmitter at its centre, at its edge as strong as a link at the edge of
    the range; `loss` is then the share of the time that it sends.
    """

    center: Point
    radius_m: Above0
    for_s: Optional[Above0] = None
    loss: Share = 1.0


class GatewayOff(Part):
    """A gateway that is off for a while."""

    id: NodeId = 0
    for_s: Optional[Above0] = None


class Loss(Part):
    """Packet loss on all links, in place of radio.loss."""

    share: Share
    for_s: Optional[Above0] = None


class Battery(Part):
    """Drones that die after some distance of flight, or some time."""

    share: Share = 1.0
    fly_m: Optional[Above0] = None
    live_min: Optional[Above0] = None

    @model_validator(mode="after")
    def _has_an_end(self) -> "Battery":
        if self.fly_m is None and self.live_min is None:
            raise ValueError("battery needs fly_m or live_min")
        return self


class Churn(Part):
    """Deaths and returns at random times; or many at once, periodically."""

    deaths_per_min: AtLeast0 = 0.0
    births_per_min: AtLeast0 = 0.0
    switched: Annotated[int, Field(ge=0, le=MAX_DRONES)] = 0  # random drones: off, or on again
    every_s: Above0 = 60.0  # period of `switched`
    for_s: Optional[Above0] = None


class FlightOrders(Part):
    """Flight orders through a gateway: one drone to one place, or random short ones."""

    id: Optional[NodeId] = None
    to: Optional[Annotated[List[float], Field(min_length=2, max_length=3)]] = None
    every_s: Optional[Above0] = None  # random drones, periodically
    within_m: Above0 = 1.0  # distance from the random drone's position
    for_s: Optional[Above0] = None

    @model_validator(mode="after")
    def _has_a_target(self) -> "FlightOrders":
        if (self.id is None) != (self.to is None) or (self.id is None) == (self.every_s is None):
            raise ValueError("order needs id and to, or every_s")
        return self


class FlownLayouts(Part):
    """Layouts of the drone manager, ordered one after the other and kept until they are reached."""

    cases: Annotated[List[Annotated[int, Field(ge=0)]], Field(min_length=1)]
    apart_s: AtLeast0 = 10.0  # between two orders
    shuffled: bool = False  # in another order in each run
    at_once: bool = False  # all drones set out together
    ring_m: Optional[Above0] = None  # then a ring of all routers through the gateway: its radius


class Messages(Part):
    """Users' messages to the first gateway, handed in at once, by these drones in turn."""

    ids: Annotated[List[NodeId], Field(min_length=1)]
    number: Annotated[int, Field(ge=1, le=10_000)]
    size: Annotated[int, Field(ge=0, le=MAX_MESSAGE_BYTES)] = MAX_MESSAGE_BYTES
    reliable: bool = True


class Load(Part):
    """Reliable messages of users to the first gateway, from random routers at random times."""

    per_s: AtLeast0  # of all routers together, on the mean
    size: Annotated[int, Field(ge=0, le=MAX_MESSAGE_BYTES)] = 16
    counted_after_s: AtLeast0 = 0.0  # messages before count for no metric


class Wind(Part):
    """Wind, which slows flights."""

    speed_factor: Annotated[float, Field(gt=0, le=1)]
    for_s: Optional[Above0] = None


class Fault(Part):
    """One event in the network, at a time or when a condition holds."""

    at_s: Optional[AtLeast0] = None
    when: Optional[str] = None
    kill: Optional[Pick] = None
    revive: Optional[Pick] = None
    mute: Optional[Broken] = None
    deaf: Optional[Broken] = None
    cut_link: Optional[Link] = None
    jam: Optional[Jam] = None
    gateway_off: Optional[GatewayOff] = None
    loss: Optional[Loss] = None
    battery: Optional[Battery] = None
    churn: Optional[Churn] = None
    order: Optional[FlightOrders] = None
    layouts: Optional[FlownLayouts] = None
    send: Optional[Messages] = None
    load: Optional[Load] = None
    wind: Optional[Wind] = None

    @field_validator("when")
    @classmethod
    def _is_a_condition(cls, text: Optional[str]) -> Optional[str]:
        if text is not None:
            parse_condition(text)
        return text

    @model_validator(mode="after")
    def _has_one_action_and_one_start(self) -> "Fault":
        if len(self._given) != 1:
            actions = [name for name in type(self).model_fields if name not in ("at_s", "when")]
            raise ValueError(f"a fault is exactly one of {', '.join(actions)}")
        if (self.at_s is None) == (self.when is None):
            raise ValueError("a fault needs either at_s or when")
        return self

    @property
    def action(self) -> str:
        return self._given[0]

    @property
    def _given(self) -> List[str]:
        return [name for name, value in self if value is not None and name not in ("at_s", "when")]

    @property
    def what(self) -> Any:
        return getattr(self, self.action)
