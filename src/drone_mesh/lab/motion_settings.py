"""How the drones of a run move of themselves, as an experiment file describes it."""

# Pydantic reads these annotations when the module is loaded, and Python 3.8 has no list[int].
from typing import Any, ClassVar, Dict, FrozenSet, List, Optional, Union

from pydantic import Field, field_validator, model_validator
from typing_extensions import Annotated, Literal

from drone_mesh.drone.fleet import MAX_DRONES
from drone_mesh.drone.goal import MAX_HEIGHT_M
from drone_mesh.errors import ConfigurationError
from drone_mesh.lab.scenario_parts import Above0, AtLeast0, PartOfKind, Point, Share
from drone_mesh.mobility import Mobility
from drone_mesh.mobility.settings import Knot
from drone_mesh.mobility.settings import check as check_mobility
from drone_mesh.yaml_file import is_number

_MODEL = ("speed_m_s", "height_m", "share", "gateways")
_CLIMBS = ("climbs", "cruise_height_m")
_MOTION: Dict[str, FrozenSet[str]] = {
    "random_waypoint": frozenset({"pause_s", "steady", "area", *_CLIMBS, *_MODEL}),
    "gauss_markov": frozenset({"alpha", "update_s", "area", *_MODEL}),
    "group": frozenset({"groups", "radius_m", "pause_s", "area", *_CLIMBS, *_MODEL}),
    "patrol": frozenset({"lanes", "waypoints", "area", *_MODEL}),
    "oval": frozenset({"radius_m", *_MODEL}),
    "eight": frozenset({"radius_m", *_MODEL}),
    "trace": frozenset({"path", "knots"}),
}


class MotionSettings(PartOfKind):
    """How drones move that the mesh does not steer, as in Mobility; see docs/motion.md."""

    NAME: ClassVar[str] = "mobility"
    # An axis may set the kind to none beside others: their numbers do no harm.
    KEYS: ClassVar[Dict[str, FrozenSet[str]]] = {
        **_MOTION,
        "none": frozenset().union(*_MOTION.values()),
    }
    OF_ALL_KINDS = frozenset({"told"})

    kind: Literal[
        "none", "random_waypoint", "gauss_markov", "group", "patrol", "oval", "eight", "trace"
    ] = "none"
    told: bool = False  # each leg is ordered through the mesh, and flown like every order
    speed_m_s: Union[float, List[float]] = 0.3
    pause_s: AtLeast0 = Mobility.pause_s
    height_m: Annotated[float, Field(ge=0, le=MAX_HEIGHT_M)] = Mobility.height_m
    share: Share = Mobility.share
    gateways: bool = Mobility.gateways
    steady: bool = Mobility.steady
    climbs: bool = Mobility.climbs
    cruise_height_m: Annotated[float, Field(gt=0, le=MAX_HEIGHT_M)] = Mobility.cruise_height_m
    alpha: Share = Mobility.alpha
    update_s: Above0 = Mobility.update_s
    groups: Annotated[int, Field(ge=1, le=MAX_DRONES)] = Mobility.groups
    radius_m: Above0 = Mobility.radius_m
    lanes: Annotated[int, Field(ge=1, le=1000)] = Mobility.lanes
    waypoints: List[Point] = []
    area: Optional[Annotated[List[float], Field(min_length=4, max_length=4)]] = None
    # x, y, width and depth in m; default: the layout's
    path: Optional[str] = None  # trace: a file beside the experiment
    knots: Optional[List[Annotated[List[float], Field(min_length=5, max_length=5)]]] = None
    # its content: id, t, x, y, z

    @field_validator("speed_m_s", mode="before")
    @classmethod
    def _is_one_speed_or_two(cls, value: object) -> object:
        speeds: List[Any] = value if isinstance(value, list) and len(value) == 2 else [value]
        if not all(is_number(speed) and 0 < speed <= 1e6 for speed in speeds):
            raise ValueError("give one speed above 0, or two in a list, the lower first, in m/s")
        return value

    @model_validator(mode="after")
    def _can_move(self) -> "MotionSettings":
        if self.model_fields_set and "kind" not in self.model_fields_set:
            raise ValueError("nothing moves without a kind: add kind: random_waypoint, for example")
        if self.kind == "trace" and self.path is None:
            raise ValueError("mobility of kind trace needs path")
        if self.area is not None and min(self.area[2:]) <= 0:
            raise ValueError("area needs a width and a depth above 0")
        try:
            check_mobility(self.mobility)
        except ConfigurationError as error:
            raise ValueError(str(error)) from None
        return self

    @property
    def mobility(self) -> Mobility:
        given = self.model_dump(exclude={"told", "area", "path", "speed_m_s", "waypoints", "knots"})
        speed = self.speed_m_s if isinstance(self.speed_m_s, list) else [self.speed_m_s] * 2
        knots: Dict[int, List[Knot]] = {}
        for node, t, x, y, z in self.knots or ():
            knots.setdefault(int(node), []).append((t, x, y, z))
        return Mobility(
            speed_m_s=(speed[0], speed[1]),
            waypoints=tuple((x, y) for x, y in self.waypoints),
            knots=knots,
            **given,
        )
