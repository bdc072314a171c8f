"""The requests that a gateway answers over HTTP.

No `from __future__ import annotations` here: FastAPI reads the annotations at run time, also on
Python 3.8.
"""

import logging
import math
import time
from typing import Any, Callable, Dict, List, Optional, Sequence, Tuple, Union

from fastapi import APIRouter, FastAPI, Path, Query, Response
from pydantic import BaseModel, BeforeValidator, Discriminator, Field, Tag
from starlette.exceptions import HTTPException
from typing_extensions import Annotated

from drone_mesh.communication.interfaces import (
    MAX_NODE_ID,
    NO_ROUTE,
    IGatewayCommands,
    KnownNode,
    OrderRecord,
)
from drone_mesh.communication.timing import Throttle
from drone_mesh.drone.geodesy import EarthPlace, Origin
from drone_mesh.drone.goal import MAX_COORDINATE_M, MAX_HEIGHT_M
from drone_mesh.drone.location import Location
from drone_mesh.internet.asking import GatewayDesk
from drone_mesh.internet.data import data_requests
from drone_mesh.internet.guarded_app import (
    UNDONE,
    DecimalDigits,
    ReadStatus,
    Refusal,
    Responses,
    WholeDigits,
    guarded_app,
    status_request,
)
from drone_mesh.internet.orders import order_requests
from drone_mesh.users.desk import UsersDesk
from drone_mesh.web.access import Access, Allowance

MOST_ORDERS_AT_ONCE = 300  # a whole fleet
ORDER_PERIOD_S = 0.05  # wall: of further orders; a full channel carries fewer
ORDER_LOG_PERIOD_S = 10.0  # between two lines about one drone

_log = logging.getLogger(__name__)

DroneId = Annotated[
    int, Path(ge=0, le=MAX_NODE_ID, description="Node id of the drone."), WholeDigits
]
Coordinate = Annotated[
    float,
    Path(ge=-MAX_COORDINATE_M, le=MAX_COORDINATE_M, allow_inf_nan=False, description="Metres."),
    DecimalDigits,
]
SharedPlace = Annotated[
    bool, Query(description="Also to a place where another drone is, flies to or was last heard.")
]
Height = Annotated[
    int,
    Path(ge=0, le=int(MAX_HEIGHT_M), description="Height of the drone's underside, whole metres."),
    WholeDigits,
]


class Ready(BaseModel):
    """The gateway is running."""

    ready: bool
    gateway: int = Field(description="Its node id.")


def _number(value: object) -> object:
    if isinstance(value, (bool, str)):
        raise ValueError("not a number")
    return value


Number = Annotated[float, BeforeValidator(_number)]
WholeNumber = Annotated[int, BeforeValidator(_number)]


class FrameGoal(BaseModel, extra="forbid"):
    """A place in the common frame of the drones."""

    latitude: Number = Field(
        ge=-MAX_COORDINATE_M, le=MAX_COORDINATE_M, allow_inf_nan=False, description="y, metres"
    )
    longitude: Number = Field(
        ge=-MAX_COORDINATE_M, le=MAX_COORDINATE_M, allow_inf_nan=False, description="x, metres"
    )
    height: WholeNumber = Field(
        ge=0, le=int(MAX_HEIGHT_M), description="whole metres above the origin"
    )


class EarthGoal(BaseModel, extra="forbid"):
    """A place on the earth (WGS84)."""

    latitude_deg: Number = Field(ge=-90, le=90, allow_inf_nan=False)
    longitude_deg: Number = Field(ge=-180, le=180, allow_inf_nan=False)
    altitude_m: Number = Field(
        allow_inf_nan=False, description="metres above sea level, as in the origin"
    )


def _form_of(goal: object) -> str:
    """The form in which a goal was begun: by its fields, and in metres if it has none of these."""
    in_degrees = isinstance(goal, EarthGoal) or (
        isinstance(goal, dict) and not goal.keys().isdisjoint(EarthGoal.model_fields)
    )
    return "degrees" if in_degrees else "metres"


Goal = Annotated[
    Union[Annotated[FrameGoal, Tag("metres")], Annotated[EarthGoal, Tag("degrees")]],
    Discriminator(_form_of),
]


class OrderSent(BaseModel):
    """The order was sent through the mesh. The Location header is the address of its state."""

    drone: int
    latitude: float = Field(description="y, metres")
    longitude: float = Field(description="x, metres")
    height: int = Field(description="metres")


class GoalSent(OrderSent):
    """An order whose goal was given in the request body."""

    earth: Optional[EarthGoal] = Field(description="The same in degrees; null: no origin.")


class NodeRoute(BaseModel):
    """A node and the gateway's route to it."""

    id: int
    next_hop: Optional[int] = Field(description="The neighbour that leads to it; null: no route.")
    hops: Optional[int] = Field(description="From its last heartbeat; null: none yet.")
    heard_s_ago: Optional[float] = Field(description="Seconds since it was heard; null: never.")


class NodeRoutes(BaseModel):
    """All nodes known to the gateway, except itself."""

    gateway: int
    nodes: List[NodeRoute]


def make_api(
    desk: GatewayDesk,
    access: Access,
    origin: Optional[Origin] = None,
    status: Optional[ReadStatus] = None,
    mesh: Optional[Callable[[int], Dict[str, Any]]] = None,
    users: Optional[UsersDesk] = None,
) -> FastAPI:
    """The ASGI application. Its page /docs loads nothing from the internet.

    With an `origin` of the common frame, goals may be given in degrees. `status` returns the node's
    status, from any thread; `mesh` runs on the gateway's thread and returns what it knows of all
    nodes, with the events after a number. `users` sends and receives messages.
    """
    router = APIRouter(responses=UNDONE)
    order_refusals: Responses = {
        409: {"model": Refusal, "description": "The place of another drone, or no origin"},
        422: {"model": Refusal, "description": "Invalid drone id or place"},
    }

    @router.get("/ready")
    async def ready() -> Ready:
        """Whether the gateway is running; answered by its own thread."""
        return await desk.ask(
            lambda gateway, _now_s: Ready(ready=True, gateway=gateway.get_node_id())
        )

    @router.get("/nodes")
    async def nodes() -> NodeRoutes:
        """The nodes known to the gateway, and its routes to them."""
        return await desk.ask(_routes_of)

    @router.post("/DroneMovement/{id}/{latitude}/{longitude}/{height}", responses=order_refusals)
    async def move_drone(
        id: DroneId,
        latitude: Coordinate,
        longitude: Coordinate,
        height: Height,
        response: Response,
        allow_shared_place: SharedPlace = False,
    ) -> OrderSent:
        """Send a drone to a place, through the mesh."""
        place = Location(latitude, longitude, float(height))
        await send(id, place, response, allow_shared_place)
        return OrderSent(drone=id, latitude=latitude, longitude=longitude, height=height)

    @router.post(
        "/drones/{id}/goal",
        responses={
            **order_refusals,
            400: {"model": Refusal, "description": "The body is not text"},
        },
    )
    async def set_goal(
        id: DroneId,
        goal: Goal,
        response: Response,
        allow_shared_place: SharedPlace = False,
    ) -> GoalSent:
        """Send a drone to a place, in metres or in degrees, through the mesh."""
        if isinstance(goal, FrameGoal):
            place = Location(goal.latitude, goal.longitude, float(goal.height))
        elif origin is not None:
            place = origin.to_frame(EarthPlace(**goal.model_dump()))
            place = place._replace(height=float(round(place.height)))
        else:
            raise HTTPException(
                409, "this gateway has no origin (--origin): give the goal in metres"
            )
        await send(id, place, response, allow_shared_place)
        earth = None if origin is None else EarthGoal(**origin.to_earth(place)._asdict())
        return GoalSent(
            drone=id,
            latitude=place.latitude,
            longitude=place.longitude,
            height=int(place.height),
            earth=earth,
        )

    limit = Allowance(MOST_ORDERS_AT_ONCE, ORDER_PERIOD_S)
    log_lines = Throttle(ORDER_LOG_PERIOD_S)

    async def send(drone: int, place: Location, response: Response, shared: bool) -> None:
        if limit.is_over():
            most = f"{1 / ORDER_PERIOD_S:g} orders a second"
            raise HTTPException(429, f"more than {most}: not sent", headers={"Retry-After": "1"})
        limit.note()

        def order(gateway: IGatewayCommands, now_s: float) -> Tuple[bool, Sequence[OrderRecord]]:
            goal = (place.latitude, place.longitude, int(place.height))
            taken = gateway.send_goal_request_to_drone(drone, *goal, now_s, shared)
            return taken, gateway.get_orders()

        taken, orders = await desk.ask(order)
        if orders:
            response.headers["Location"] = f"/orders/{orders[-1].number}"
        if not taken:
            raise HTTPException(
                503, f"the gateway has no route to drone {drone}: the order was not sent"
            )
        if log_lines.count(f"drone {drone}", time.monotonic()):
            _log.info("drone %d: order sent, to %s", drone, place.in_words())

    if mesh is not None:
        read_mesh = mesh

        @router.get("/mesh", responses=order_refusals)
        async def whole_mesh(
            after: Annotated[
                int, Query(ge=0, description="Events with higher numbers."), WholeDigits
            ] = 0,
        ) -> Dict[str, Any]:
            """All nodes as they reported themselves, and their events: for the web console."""
            return await desk.ask(lambda _gateway, _now_s: read_mesh(after))

    all_requests = APIRouter()
    all_requests.include_router(router)
    all_requests.include_router(order_requests(desk))
    if users is not None:
        all_requests.include_router(data_requests(users))
    if status is not None:
        all_requests.include_router(status_request(status))
    return guarded_app(
        "drone_mesh gateway",
        "Sends drones to places and lists the nodes that this gateway knows.",
        access,
        all_requests,
    )


def _routes_of(gateway: IGatewayCommands, now_s: float) -> NodeRoutes:
    return NodeRoutes(
        gateway=gateway.get_node_id(),
        nodes=[_route_of(node, now_s) for node in gateway.get_known_nodes()],
    )


def _route_of(node: KnownNode, now_s: float) -> NodeRoute:
    heard = math.isfinite(node.heard_s)
    return NodeRoute(
        id=node.node_id,
        next_hop=None if node.next_hop == NO_ROUTE else node.next_hop,
        hops=None if node.hops == NO_ROUTE else node.hops,
        heard_s_ago=round(max(0.0, now_s - node.heard_s), 3) if heard else None,
    )
