"""One run as an experiment file describes it, and its streams of random numbers."""

# Pydantic reads these annotations when the module is loaded, and Python 3.8 has no list[int].
import random
from typing import Any, ClassVar, Dict, FrozenSet, List, Optional, Tuple

from pydantic import Field, field_validator, model_validator
from typing_extensions import Annotated, Literal

from drone_mesh.air.obstacle_file import BoxRow
from drone_mesh.air.obstacles import CUT_DB, Obstacles
from drone_mesh.communication.node.node_configuration import DEFAULT_ROUTING
from drone_mesh.communication.repair.options import DEFAULT_REPAIR, RANGE_M, RepairOptions
from drone_mesh.communication.timing import MeshTiming
from drone_mesh.drone.battery import PowerModel
from drone_mesh.drone.fence import Fence
from drone_mesh.drone.fleet import MAX_DRONES
from drone_mesh.drone.flight_path import SPEED_M_S
from drone_mesh.drone.geodesy import Origin
from drone_mesh.drone.goal import MAX_HEIGHT_M
from drone_mesh.errors import ConfigurationError
from drone_mesh.fence_file import areas_json, fence_in, fence_of
from drone_mesh.formations.relief import ReliefRules
from drone_mesh.lab.motion_settings import MotionSettings
from drone_mesh.lab.scenario_parts import (
    Above0,
    AtLeast0,
    Fault,
    Part,
    PartOfKind,
    Point,
    Share,
    part_with_settings,
)
from drone_mesh.nrf24.emulator.space import RICIAN_K_DB

_Drones = Annotated[int, Field(ge=2, le=MAX_DRONES)]
_DRAWN = ("drones", "gateways", "ids")
_RANDOM = (*_DRAWN, "width_m", "least_distance_m", "require", "gateway_at")


class Layout(PartOfKind):
    """The start positions of the drones."""

    KEYS: ClassVar[Dict[str, FrozenSet[str]]] = {
        "uniform": frozenset({"mean_degree", *_RANDOM}),
        "clusters": frozenset({"clusters", "cluster_radius_m", *_RANDOM}),
        "grid": frozenset({"columns", "spacing_m", *_DRAWN}),
        "line": frozenset({"spacing_m", "at_end", *_DRAWN}),
        "casus": frozenset({"case", "gateways"}),
        "file": frozenset({"path", "places"}),  # which has the ids and the gateways
    }

    kind: Literal["uniform", "clusters", "grid", "line", "casus", "file"] = "uniform"
    drones: _Drones = 25  # gateways included
    gateways: Annotated[int, Field(ge=1, le=MAX_DRONES)] = 1
    ids: Literal["in_order", "shuffled"] = "in_order"
    mean_degree: Optional[Annotated[float, Field(gt=0, le=253)]] = None  # uniform; default: 8
    width_m: Optional[Above0] = None  # of the square; uniform: instead of mean_degree
    least_distance_m: AtLeast0 = 0.0  # between two drones
    require: Literal["connected", "nothing"] = "connected"
    gateway_at: Literal["middle", "corner", "random"] = "middle"
    clusters: Annotated[int, Field(ge=1, le=64)] = 4
    cluster_radius_m: Above0 = 9.0
    columns: Optional[Annotated[int, Field(ge=1, le=MAX_DRONES)]] = None  # default: a square
    spacing_m: Above0 = 6.0
    at_end: Annotated[int, Field(ge=1, le=MAX_DRONES)] = 1  # line: so many, 0.1 m apart
    case: int = 0  # of config/casus.yaml
    path: Optional[str] = None  # file: id,x,y,role lines, beside the experiment
    places: Optional[List[List[float]]] = None  # its content: id, x, y, 1 for a gateway

    @model_validator(mode="after")
    def _can_be_drawn(self) -> "Layout":
        if self.mean_degree is not None and self.width_m is not None:
            raise ValueError("mean_degree and width_m exclude each other: give one")
        if self.kind == "file" and self.path is None:
            raise ValueError("a layout of kind file needs path")
        if self.kind != "file" and self.gateways >= self.drones and self.kind != "casus":
            raise ValueError(f"{self.gateways} gateways leave no router of {self.drones} drones")
        return self


class Radio(PartOfKind):
    """The medium."""

    KEYS: ClassVar[Dict[str, FrozenSet[str]]] = {
        "disc": frozenset({"loss", "delay_s", "jitter_s"}),
        "shared": frozenset({"rate", "links", "loss"}),
        "chips": frozenset({"rate", "links", "loss"}),
    }
    OF_ALL_KINDS = frozenset({"asymmetry_db"})

    kind: Literal["disc", "shared", "chips"] = "disc"
    rate: Optional[Literal["250k", "1M", "2M"]] = None  # not disc: of the air; default: 250k
    links: Literal["disc", "distance"] = "disc"  # not disc: power falls with it, edge at range_m
    loss: Share = 0.0  # disc: of the packets on each link; others: of all frames
    delay_s: AtLeast0 = 0.002
    jitter_s: AtLeast0 = 0.0
    asymmetry_db: AtLeast0 = 0.0  # each radio sends with up to so much less power, drawn


class Probes(Part):
    """Messages and echoes that measure the delivery, between a gateway or any node and another."""

    between: Literal["gateway", "any"] = "gateway"  # and a random router; or two random nodes
    per_s: AtLeast0 = 0.0  # at random times; with a gateway so many of each kind: up, down, echo
    from_s: AtLeast0 = 20.0
    within_s: Above0 = 2.0  # later ones count as lost
    reliable: bool = False  # messages that are sent again until they arrive


class Positions(Part):
    """The positions that the mesh software is told, as in PositionErrors."""

    known: bool = True
    sigma_m: AtLeast0 = 0.0
    outliers: Share = 0.0
    outlier_m: AtLeast0 = 0.0


class Timing(part_with_settings(MeshTiming, leave_out="report_period_s")):  # type: ignore[misc]
    """The adjustable times of the protocol."""


class Repair(part_with_settings(RepairOptions, leave_out="range_m")):  # type: ignore[misc]
    """The adjustable numbers of a repair; the range is that of the scenario."""


class ObstacleSettings(Part):
    """Boxes that block or attenuate the radio, and block flight."""

    path: Optional[str] = None  # a file of boxes, beside the experiment
    boxes: List[BoxRow] = []
    radio: Literal["block", "wall"] = "block"
    cut_db: AtLeast0 = CUT_DB["brick"]  # wall: per wall crossed
    metre_db: AtLeast0 = Obstacles.metre_db  # wall: per metre inside
    exponent: Annotated[float, Field(ge=1, le=6)] = Obstacles.exponent  # of the path loss
    fading: Literal["none", "rayleigh", "rician"] = "none"
    rician_k_db: Annotated[float, Field(ge=-20, le=40)] = RICIAN_K_DB
    ceiling_m: Annotated[float, Field(gt=0, le=MAX_HEIGHT_M)] = MAX_HEIGHT_M  # of flights


class Endurance(Part):
    """Batteries, pads and the relief of drones that hover for hours; see docs/endurance.md."""

    hover_min: Above0 = PowerModel.hover_s / 60.0  # with a full battery
    height_m: Annotated[float, Field(ge=1, le=MAX_HEIGHT_M)] = 4.0  # of all drones but the spares
    spares: Share = 0.15  # of the routers; these are further drones
    pads: Annotated[List[Point], Field(min_length=1)] = [[0.0, 0.0]]  # x, y from the gateway, m
    swap_s: Above0 = ReliefRules().swap_s
    at_once: Annotated[int, Field(ge=1, le=MAX_DRONES)] = 1  # swaps on one pad
    relief: Literal["none", "spare_first", "named_backup", "rotate"] = "spare_first"


class FenceSettings(Part):
    """Areas that drones stay inside or out of."""

    path: Optional[str] = None  # a file of them, beside the experiment
    origin: Optional[str] = None  # LAT,LON,ALT of x 0, y 0, for files in degrees
    areas: List[Dict[str, Any]] = []

    @field_validator("origin")
    @classmethod
    def _is_origin(cls, origin: Optional[str]) -> Optional[str]:
        try:
            if origin is not None:
                Origin.parse(origin)
        except ConfigurationError as error:
            raise ValueError(str(error)) from None
        return origin

    @field_validator("areas")
    @classmethod
    def _are_areas(cls, rows: List[Dict[str, Any]]) -> List[Dict[str, Any]]:
        try:
            fence_of(rows)
        except ConfigurationError as error:
            raise ValueError(str(error)) from None
        return rows

    def fence(self) -> Fence:
        """The fence, which may be none."""
        return fence_in(areas_json(self.areas))


class Sequence(Part):
    """A few random faults over a random mesh, all drawn from the seed; the run ends at rest.

    It replaces layout, loss, faults and duration_s.
    """

    DEATHS: ClassVar[Tuple[str, ...]] = (
        "cut_vertex_killed", "many_killed", "gateway_off", "gateway_moved",
        "killed_in_negotiation", "killed_in_flight",
    )  # fmt: skip
    INCIDENTS: ClassVar[Tuple[str, ...]] = (
        *DEATHS, "silent_for_a_while", "links_cut", "restarted_cut_off", "goes_mute", "goes_deaf",
    )  # fmt: skip

    drones: Annotated[List[_Drones], Field(min_length=2, max_length=2)] = [8, 60]  # least, most
    density: Annotated[List[Above0], Field(min_length=2, max_length=2)] = [7.0, 9.0]
    """Least and most neighbours of a drone far from the edge."""
    incidents: Annotated[List[str], Field(min_length=1)] = list(DEATHS)

    @field_validator("drones", "density")
    @classmethod
    def _are_in_order(cls, ends: List[float]) -> List[float]:
        if ends[0] > ends[1]:
            raise ValueError("give the least first, then the most")
        return ends

    @field_validator("incidents")
    @classmethod
    def _are_known(cls, names: List[str]) -> List[str]:
        for name in names:
            if name not in cls.INCIDENTS:
                raise ValueError(f"unknown incident {name}: use {', '.join(cls.INCIDENTS)}")
        return names


class Scenario(Part):
    """Everything that defines a run, except its seed."""

    model: Literal["mesh", "ideal"] = "mesh"
    layout: Layout = Layout()
    range_m: Annotated[float, Field(gt=0, le=10_000)] = RANGE_M  # bounds of RepairOptions
    radio: Radio = Radio()
    key: bool = False  # a gateway has a mesh key, each router its own keys
    routing: str = DEFAULT_ROUTING
    repair: str = DEFAULT_REPAIR
    repair_options: Repair = Repair()
    timing: Timing = Timing()
    obstacles: ObstacleSettings = ObstacleSettings()
    fence: FenceSettings = FenceSettings()
    mobility: MotionSettings = MotionSettings()
    positions: Positions = Positions()
    probes: Probes = Probes()
    faults: List[Fault] = []
    sequence: Optional[Sequence] = None
    endurance: Optional[Endurance] = None
    grounded_share: Share = 0.0  # of the routers: their drones cannot fly
    duration_s: Annotated[float, Field(gt=0, le=1e6)] = 120.0
    sample_s: Annotated[float, Field(ge=0.05, le=60)] = 1.0  # sampling period of the network
    speed_m_s: Annotated[float, Field(gt=0, le=100)] = SPEED_M_S  # of flights

    @model_validator(mode="after")
    def _is_consistent(self) -> "Scenario":
        is_disc, is_moved = self.radio.kind == "disc", self.mobility.kind != "none"
        actions = [fault.action for fault in self.faults]
        for action in actions:
            if action in ("cut_link", "loss") and not is_disc:
                raise ValueError(f"fault {action} is for the disc radio")
        if self.sequence is not None and not is_disc:
            raise ValueError("a sequence is for the disc radio")
        if self.model == "ideal" and is_moved:
            raise ValueError("model ideal: only repairs move drones there, mobility does not")
        if self.endurance is not None and (self.model == "ideal" or is_moved):
            raise ValueError("endurance: its drones hover, so it needs model mesh and no mobility")
        if "load" in actions and actions.count("load") + actions.count("send") > 1:
            raise ValueError("a load says from when on messages count: no other load or send fits")
        if self.fence.areas and (self.model == "ideal" or is_moved and not self.mobility.told):
            raise ValueError("a fence is for flights that the mesh orders: model mesh, no mobility")
        is_piloted = is_moved and not self.mobility.told
        if is_piloted and any(f.battery and f.battery.fly_m is not None for f in self.faults):
            raise ValueError("battery.fly_m counts no flights of pilots (mobility): use live_min")
        return self


class Streams:
    """The random generators of one run.

    The r-th repetition has the same streams in every cell of an experiment (common random numbers):
    the same layout, victims and losses, whatever the technique under test draws.
    """

    def __init__(self, seed: int, repetition: int) -> None:
        self._root = f"{seed}/{repetition}"

    def generator(self, purpose: str) -> random.Random:
        """A generator for this purpose; equal for equal seed, repetition and purpose."""
        return random.Random(f"{self._root}/{purpose}")  # seeded by SHA-512, equal in each Python

    def number(self, purpose: str) -> int:
        """A 32-bit seed for a part that wants a number."""
        return self.generator(purpose).getrandbits(32)
