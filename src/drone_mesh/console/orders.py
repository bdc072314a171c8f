"""The requests that a page may send."""

from __future__ import annotations

from typing import Iterable, List, Literal, NamedTuple, Optional, Sequence, Tuple, Union

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError
from typing_extensions import Annotated

from drone_mesh.communication.interfaces import MAX_NODE_ID
from drone_mesh.configuration import MAX_REAL_TIME_FACTOR
from drone_mesh.console.controls import MeshControls, OrderRefused
from drone_mesh.drone.fence import MOST_CORNERS
from drone_mesh.drone.fleet import MAX_DRONES
from drone_mesh.drone.flight_path import Vector
from drone_mesh.drone.geodesy import Origin
from drone_mesh.drone.goal import MAX_COORDINATE_M, MAX_HEIGHT_M
from drone_mesh.drone.location import Location
from drone_mesh.earth_files import Placemarks, is_earth_file, read_placemarks
from drone_mesh.earth_files.plan import MAX_PLAN_CHARACTERS
from drone_mesh.errors import ConfigurationError
from drone_mesh.fence_file import MAX_NAME as MAX_AREA_NAME
from drone_mesh.formations.layouts import MAX_CASE, MAX_NAME, Order, read_layout
from drone_mesh.formations.mission_files import MOST_WAYPOINTS, is_mission_file, read_mission
from drone_mesh.formations.missions import MAX_SPEED_M_S, Mission
from drone_mesh.formations.preview import LostRoutes, lost_routes
from drone_mesh.state.model import MeshStatus

MAX_LAYOUT_CHARACTERS = 30_000  # three times what 254 drones need
MAX_ORDER_NUMBER = 2**53  # JavaScript integers are exact up to here
LIMITS = {  # for the page's forms; metres, and the largest id
    "coordinate": MAX_COORDINATE_M,
    "height": MAX_HEIGHT_M,
    "id": MAX_NODE_ID,
    "characters": MAX_PLAN_CHARACTERS,  # of a file
}

NodeId = Annotated[int, Field(ge=0, le=MAX_NODE_ID)]
NodeOrNone = Optional[NodeId]
Coordinate = Annotated[float, Field(ge=-MAX_COORDINATE_M, le=MAX_COORDINATE_M, allow_inf_nan=False)]
Height = Annotated[float, Field(ge=0, le=MAX_HEIGHT_M, allow_inf_nan=False)]
HeightOrNone = Optional[Height]
Corners = Annotated[List[Tuple[Coordinate, Coordinate]], Field(max_length=MOST_CORNERS)]
NodeIds = Annotated[List[NodeId], Field(min_length=1, max_length=MAX_DRONES)]
Gateways = Annotated[List[NodeId], Field(max_length=MAX_DRONES)]
Waypoints = Annotated[
    List[Tuple[Coordinate, Coordinate, Height]], Field(min_length=1, max_length=MOST_WAYPOINTS)
]
Places = Annotated[
    List[Tuple[NodeId, Coordinate, Coordinate, Height]],
    Field(min_length=1, max_length=MAX_DRONES),
]
MomentOrNone = Optional[Annotated[float, Field(ge=0, le=1e9, allow_inf_nan=False)]]  # simulated s
HeardOrNone = Optional[Annotated[float, Field(allow_inf_nan=False)]]  # `at` of the last "alive"
SwitchOrNone = Optional[bool]
FactorOrNone = Optional[Annotated[float, Field(gt=0, le=MAX_REAL_TIME_FACTOR, allow_inf_nan=False)]]


Place = Tuple[int, float, float, float]
"""A drone, and x, y and z in metres."""

AnyPlace = Tuple[NodeOrNone, float, float, float]
"""The same in a file; None: any drone."""


class LayoutOffer(NamedTuple):
    """A layout that the page can send drones to."""

    case: int
    name: str
    places: Sequence[Place]


def places_of(orders: Iterable[Order]) -> list[Place]:
    """The positions to which a layout sends its drones."""
    return [(drone, goal.longitude, goal.latitude, goal.height) for drone, goal in orders]


def _orders_to(places: Iterable[Place]) -> list[Order]:
    return [Order(drone, Location(y, x, z)) for drone, x, y, z in places]


class FileContent(NamedTuple):
    """The content of a file: places of drones, or ways over x, y, z in metres."""

    places: Sequence[AnyPlace]
    ways: Sequence[Sequence[Vector]]
    speed: float | None = None  # m/s, of the mission that it is; None: it says nothing
    notes: Sequence[str] = ()  # what is told of that mission


class _Request(BaseModel):
    model_config = ConfigDict(strict=True, frozen=True)  # "3" is not a node, 1 not a switch


class _Answered(_Request):
    """A request that is answered; the answer has the same `number`."""

    number: int = Field(ge=0, le=MAX_ORDER_NUMBER)


class PageOrder(_Answered):
    """One order of one page: `do` names the method of MeshControls, all else are its arguments."""

    do: str
    heard: HeardOrNone = None

    def carry_out(self, controls: MeshControls) -> str:
        """Carry the order out; returns a short text for the page. Raises OrderRefused."""
        arguments = self.model_dump(exclude={"number", "heard", "do"})
        text: str = getattr(controls, self.do)(**arguments)
        return text

    def drones(self, layouts: Sequence[LayoutOffer]) -> Sequence[int]:
        """The drones that it sends somewhere."""
        return ()


class _Power(PageOrder):
    do: Literal["power"]
    node: NodeId
    on: bool


class _Fly(PageOrder):
    do: Literal["fly"]
    node: NodeId
    x: Coordinate
    y: Coordinate
    z: Height
    allow_shared_place: bool = False  # also to the place of another drone

    def drones(self, layouts: Sequence[LayoutOffer]) -> Sequence[int]:
        return (self.node,)


class _Layout(PageOrder):
    do: Literal["layout"]
    case: int = Field(ge=0, le=MAX_CASE)

    def drones(self, layouts: Sequence[LayoutOffer]) -> Sequence[int]:
        return [place[0] for offer in layouts if offer.case == self.case for place in offer.places]


class _Formation(PageOrder):
    """Send these drones to places of their own; of gateways only those that the user agreed to."""

    do: Literal["formation"]
    name: str = Field(min_length=1, max_length=MAX_NAME)
    places: Places
    gateways: Gateways = []

    def carry_out(self, controls: MeshControls) -> str:
        return controls.formation(self.name, _orders_to(self.places), self.gateways)

    def drones(self, layouts: Sequence[LayoutOffer]) -> Sequence[int]:
        return [place[0] for place in self.places]


class _Speed(PageOrder):
    do: Literal["speed"]
    paused: bool
    factor: float = Field(ge=0, le=MAX_REAL_TIME_FACTOR, allow_inf_nan=False)


class _Add(PageOrder):
    """Add a drone; without `node` it gets the lowest free id."""

    do: Literal["add"]
    node: NodeOrNone = None
    gateway: bool = False
    x: Coordinate
    y: Coordinate


class _Remove(PageOrder):
    do: Literal["remove"]
    node: NodeId


class _Mission(PageOrder):
    """Let the pilots of these drones fly over waypoints; the mesh is not told."""

    do: Literal["mission"]
    nodes: NodeIds
    waypoints: Waypoints
    speed: float = Field(gt=0, le=MAX_SPEED_M_S, allow_inf_nan=False)
    loop: bool

    def carry_out(self, controls: MeshControls) -> str:
        return controls.mission(self.nodes, Mission(self.waypoints, self.speed, self.loop))


class _Pilots(PageOrder):
    """Pause, resume or stop all missions."""

    do: Literal["pilots"]
    action: Literal["pause", "resume", "stop"]


class _Fence(PageOrder):
    """Add an area to the fence, in place of one of its name; without corners, delete that one."""

    do: Literal["fence"]
    name: str = Field(min_length=1, max_length=MAX_AREA_NAME)
    corners: Corners
    inside: bool = False
    max_height: HeightOrNone = None


class ReadPlaces(_Answered):
    """The page sends a file and asks for the positions of its drones."""

    do: Literal["places"]
    name: str = Field("the file", max_length=300)
    text: str = Field(max_length=MAX_PLAN_CHARACTERS)

    def content(self, origin: Origin | None) -> FileContent:
        """Parse the file. Raises OrderRefused, which says what is wrong where."""
        try:
            if is_mission_file(self.name):
                drawn = read_mission(self.text, self.name, origin)
                return FileContent([], [drawn.waypoints], drawn.speed_m_s, drawn.notes)
            if is_earth_file(self.name):
                return _content_of(read_placemarks(self.text, self.name, origin))
            if len(self.text) > MAX_LAYOUT_CHARACTERS:
                raise OrderRefused(f"{self.name}: longer than {MAX_LAYOUT_CHARACTERS} characters")
            return FileContent(places_of(read_layout(self.text, self.name)), [])
        except ConfigurationError as error:
            raise OrderRefused(str(error)) from error


def _content_of(found: Placemarks) -> FileContent:
    if found.points and not found.is_mission:
        return FileContent([(point.drone, *point.place.to_vector()) for point in found.points], [])
    return FileContent([], [[place.to_vector() for place in path.places] for path in found.paths])


class PreviewLayout(_Answered):
    """The page asks what would happen if it ordered a layout now."""

    do: Literal["preview"]
    case: int = Field(ge=0, le=MAX_CASE)


class Foresee(_Answered):
    """The page asks who would have no route if these drones were at these places."""

    do: Literal["foresee"]
    places: Places

    def lost_routes(self, mesh: MeshStatus) -> LostRoutes:
        """Who that is, and who would lose a route by it."""
        return lost_routes(mesh, dict(_orders_to(self.places)))


class NeighbourWatch(_Request):
    """The page requests details of one node's neighbours; None: stop."""

    do: Literal["watch"]
    node: NodeOrNone


class Demonstrate(_Answered):
    """Begin or end the demonstration, or ask what it would do (`plan`)."""

    do: Literal["demonstrate"]
    heard: HeardOrNone = None
    on: bool
    plan: bool = False


class Acknowledge(_Answered):
    """Somebody has seen the alarms with this text."""

    do: Literal["acknowledge"]
    text: str = Field(max_length=300)


class PacketWatch(_Request):
    """Start or stop sending packets to this page."""

    do: Literal["packets"]
    on: bool


class TimeLine(_Request):
    """Show another moment; None: unchanged."""

    do: Literal["time"]
    t: MomentOrNone = None
    step: int = Field(0, ge=-1000, le=1000)  # states forward, or back if negative
    paused: SwitchOrNone = None
    factor: FactorOrNone = None  # simulated seconds per second
    live: bool = False  # back to the present


class _Numbered(_Request):
    number: int


Request = Union[
    _Power,
    _Fly,
    _Layout,
    _Formation,
    _Speed,
    NeighbourWatch,
    PacketWatch,
    Demonstrate,
    ReadPlaces,
    PreviewLayout,
    Foresee,
    TimeLine,
    Acknowledge,
    _Add,
    _Remove,
    _Mission,
    _Pilots,
    _Fence,
]

_REQUESTS: TypeAdapter[Request] = TypeAdapter(Annotated[Request, Field(discriminator="do")])


def parse_request(text: str) -> Request:
    """Parse a page's message. Raises OrderRefused unless it is a valid request."""
    try:
        return _REQUESTS.validate_json(text)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        key = f"{first['loc'][-1]}: " if first["loc"] else ""
        raise OrderRefused(f"invalid request: {key}{first['msg']}") from None


def number_of(text: str) -> int | None:
    """The number of a refused request, so that the page knows which one it was."""
    try:
        return _Numbered.model_validate_json(text).number
    except ValidationError:
        return None
