"""Creates engines by name, for command-line options."""

from __future__ import annotations

from dataclasses import dataclass, field

from drone_mesh.by_name import in_one_line, load_by_name
from drone_mesh.drone.geodesy import Origin
from drone_mesh.drone.ground import GroundEngine
from drone_mesh.drone.interfaces import IDroneEngine
from drone_mesh.drone.location import Location
from drone_mesh.drone.mavlink.limits import FlightLimits, Permissions
from drone_mesh.errors import ConfigurationError

GROUND = "ground"
MAVLINK = "mavlink:"


@dataclass(frozen=True)
class FlightOptions:
    """How the drones of a program fly."""

    drone: str = GROUND  # "ground", "mavlink:ADDRESS" or "package.module:Class"
    origin: Origin | None = None
    limits: FlightLimits = field(default_factory=FlightLimits)
    permissions: Permissions = field(default_factory=Permissions)

    def __post_init__(self) -> None:
        """Raise ConfigurationError for a combination that cannot fly."""
        if self.drone.startswith(MAVLINK) and self.origin is None:
            raise ConfigurationError("--drone mavlink: needs --origin LAT,LON,ALT")


def create_engine(node_id: int, location: Location | None, options: FlightOptions) -> IDroneEngine:
    """The engine of one node; `location` is the position of a node on the ground, if known.

    Raises ConfigurationError if the engine cannot be created.
    """
    if options.drone == GROUND:
        digest = options.origin.digest if options.origin is not None else 0
        return GroundEngine(node_id, location, digest)
    if options.drone.startswith(MAVLINK):
        return _mavlink_engine(node_id, options)
    return _own_engine(node_id, options.drone)


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
    return MavlinkEngine(node_id, address, options.origin, options.limits, options.permissions)


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
