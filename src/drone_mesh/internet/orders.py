"""Orders over HTTP: the outcome of each order that a gateway has sent.

No `from __future__ import annotations` here: FastAPI reads the annotations at run time, also on
Python 3.8.
"""

from typing import List

from fastapi import APIRouter, Path
from pydantic import BaseModel, Field
from starlette.exceptions import HTTPException
from typing_extensions import Annotated

from drone_mesh.communication.interfaces import IGatewayCommands, OrderRecord, OrderState
from drone_mesh.communication.orders.book import HIGHEST_NUMBER
from drone_mesh.internet.asking import GatewayDesk
from drone_mesh.internet.guarded_app import UNDONE, Refusal, WholeDigits

OrderNumber = Annotated[
    int,
    Path(ge=1, le=HIGHEST_NUMBER, description="As in the Location header of the order."),
    WholeDigits,
]


class OrderReport(BaseModel):
    """One order as known to the gateway."""

    id: int
    drone: int
    latitude: float = Field(description="y, metres")
    longitude: float = Field(description="x, metres")
    height: int = Field(description="metres")
    state: OrderState
    reason: str = Field(description="Of the state; empty: none.")
    text: str = Field(description="State and reason in words, as in logs and on the page.")
    ordered_s_ago: float
    changed_s_ago: float = Field(description="Seconds in this state.")


class OrderReports(BaseModel):
    """The orders that the gateway remembers, oldest first."""

    gateway: int
    orders: List[OrderReport]


def order_requests(desk: GatewayDesk) -> APIRouter:
    """`GET /orders` and `GET /orders/{id}`."""
    router = APIRouter(responses=UNDONE)

    @router.get("/orders")
    async def orders() -> OrderReports:
        """The outcomes of the orders: the latest of each drone, and up to 100 older ones."""
        return await desk.ask(_report_orders)

    @router.get(
        "/orders/{id}",
        responses={
            404: {"model": Refusal, "description": "No such order, or no longer remembered"},
            422: {"model": Refusal, "description": "Invalid number"},
        },
    )
    async def order(id: OrderNumber) -> OrderReport:
        """The outcome of one order."""
        for report in (await desk.ask(_report_orders)).orders:
            if report.id == id:
                return report
        raise HTTPException(404, f"unknown order {id}: the gateway keeps only the latest")

    return router


def _report_orders(gateway: IGatewayCommands, now_s: float) -> OrderReports:
    return OrderReports(
        gateway=gateway.get_node_id(),
        orders=[_report(order, now_s) for order in gateway.get_orders()],
    )


def _report(order: OrderRecord, now_s: float) -> OrderReport:
    return OrderReport(
        id=order.number,
        drone=order.drone,
        latitude=order.goal.latitude,
        longitude=order.goal.longitude,
        height=int(order.goal.height),
        state=order.state,
        reason=order.reason,
        text=order.state.in_words(order.reason),
        ordered_s_ago=round(max(0.0, now_s - order.ordered_s), 3),
        changed_s_ago=round(max(0.0, now_s - order.changed_s), 3),
    )
