"""Creates engines by name, for command-line options; the engine of a node on the ground."""

from __future__ import annotations

from dataclasses import dataclass, field

from drone_mesh.by_name import in_one_line, load_by_name
from drone_mesh.drone.fence import Fence
from drone_mesh.drone.geodesy import Origin
from drone_mesh.drone.interfaces import IDroneEngine
from drone_mesh.drone.location import Location
from drone_mesh.drone.mavlink.limits import FlightLimits, Permissions
from drone_mesh.errors import ConfigurationError, GoalRefused, LocationUnknown


class GroundEngine(IDroneEngine):
    """Stays where it is and refuses every goal. Any thread may call it."""

    def __init__(self, node_id: int, location: Location | None, frame_digest: int = 0) -> None:
        """`location` None: the node's position is unknown."""
        self._frame_digest = frame_digest
        self._node_id = node_id
        self._location = location

    def set_goal(self, latitude: float, longitude: float, height: float) -> None:
        """Raises GoalRefused: the node does not fly."""
        raise GoalRefused(f"drone {self._node_id} cannot fly: {self.why_not_fly()}")

    def get_location(self) -> Location:
        """The given position. Raises LocationUnknown if there is none."""
        if self._location is None:
            raise LocationUnknown("no position was given; use --latitude and --longitude")
        return self._location

    def frame_digest(self) -> int:
        return self._frame_digest

    def why_not_fly(self) -> str:
        """Always: the node never flies."""
        return "it stands on the ground"


GROUND = "ground"
MAVLINK = "mavlink:"


@dataclass(frozen=True)
class FlightOptions:
    """How the drones of a program fly."""

    drone: str = GROUND  # "ground", "mavlink:ADDRESS" or "package.module:Class"
    origin: Origin | None = None
    limits: FlightLimits = field(default_factory=FlightLimits)
    permissions: Permissions = field(default_factory=Permissions)
    fence: Fence = field(default_factory=Fence)

    def __post_init__(self) -> None:
        """Raise ConfigurationError for a combination that cannot fly."""
        if self.drone.startswith(MAVLINK) and self.origin is None:
            raise ConfigurationError("--drone mavlink: needs --origin LAT,LON,ALT")


def create_engine(node_id: int, location: Location | None, options: FlightOptions) -> IDroneEngine:
    """The engine of one node; `location` is the position of a node on the ground, if known.

    Raises ConfigurationError if the engine cannot be created.
    """
    if options.drone.startswith(MAVLINK):
        return _mavlink_engine(node_id, options)
    engine: IDroneEngine
    if options.drone == GROUND:
        digest = options.origin.digest if options.origin is not None else 0
        engine = GroundEngine(node_id, location, digest)
    else:
        engine = _own_engine(node_id, options.drone)
    engine.fence = options.fence
    return engine


def _mavlink_engine(node_id: int, options: FlightOptions) -> IDroneEngine:
    try:  # pymavlink's classes take a second to load on a Raspberry Pi
        from drone_mesh.drone.mavlink.engine import MavlinkEngine
    except ImportError as error:
        raise ConfigurationError(
            f"the Python package {error.name} is missing, which --drone mavlink: needs: "
            "pip install 'drone_mesh[raspberry]'"
        ) from error
    assert options.origin is not None  # checked by FlightOptions
    address = options.drone[len(MAVLINK) :]
    return MavlinkEngine(
        node_id, address, options.origin, options.limits, options.permissions, options.fence
    )


def _own_engine(node_id: int, name: str) -> IDroneEngine:
    if ":" not in name:
        raise ConfigurationError(
            f"invalid --drone {name!r}: use ground, mavlink:ADDRESS or package.module:Class"
        )
    make = load_by_name("--drone", name)
    with in_one_line(f"--drone {name!r} cannot be created"):
        engine = make(node_id)
    if not isinstance(engine, IDroneEngine):
        raise ConfigurationError(f"--drone {name!r} does not implement IDroneEngine")
    return engine
