"""The command that lets a drone fly a mission of another program, and shows how far it is."""

from __future__ import annotations

import argparse
import math
import queue
import sys
from pathlib import Path

import rospy

from drone_mesh.arguments import decimal, whole
from drone_mesh.communication.interfaces import MAX_NODE_ID
from drone_mesh.drone.goal import MAX_HEIGHT_M
from drone_mesh.errors import MeshError
from drone_mesh.formations.mission_files import read_mission_file
from drone_mesh.formations.missions import MAX_SPEED_M_S, Mission
from drone_mesh.msg import MeshState
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.command_line import join_graph, run_tool
from drone_mesh.ros.graph.conversions import mission_request
from drone_mesh.ros.graph.parameters import earth_origin
from drone_mesh.ros.graph.persistent_service import ServiceGone, call_once
from drone_mesh.srv import FlyMission, FlyMissionRequest

SHOW_EVERY_S = 2.0  # simulated
BEGINS_WITHIN_S = 1.0  # simulated
THERE_M = 1.0  # of the last waypoint: physics holds a drone within half a metre


def mission() -> None:
    parser = argparse.ArgumentParser(
        prog="rosrun drone_mesh mission",
        description="Lets the pilot of a drone fly a mission that was drawn in another program, "
        "and shows how far it is. The mesh is not told. After Ctrl-C the drone flies on.",
        epilog="Exit code: 0 it has flown the mission, or does what was asked; 1 it ended "
        "elsewhere; 2 it did not begin.",
    )
    parser.add_argument("drone", type=whole(0, MAX_NODE_ID), help="its id")
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument(
        "file",
        nargs="?",
        type=Path,
        help="a .plan of QGroundControl, a .waypoints file, or one line in KML or GeoJSON",
    )
    for word in ("pause", "resume", "stop"):
        action = getattr(FlyMissionRequest, word.upper())
        what.add_argument(
            f"--{word}", dest="action", action="store_const", const=action, help="its mission"
        )
    parser.add_argument(
        "--speed", type=decimal(0.01, MAX_SPEED_M_S), metavar="M_S", help="instead of the file's"
    )
    parser.add_argument(
        "--height",
        type=whole(1, int(MAX_HEIGHT_M)),
        metavar="M",
        help="of all waypoints in the air, instead of the file's",
    )
    parser.add_argument("--loop", action="store_true", help="from the last to the first, and on")
    options = parser.parse_args(rospy.myargv()[1:])
    run_tool("mission", lambda: _mission(options))


def _mission(options: argparse.Namespace) -> int:
    join_graph("fly_mission")
    if options.file is None:
        _ask(options.drone, FlyMissionRequest(action=options.action))
        return 0
    drawn = read_mission_file(options.file, earth_origin(""))
    mission = Mission.drawn(drawn, options.speed, options.height, options.loop)
    request = mission_request(mission)
    print(f"{options.file}: {drawn.in_words()}", flush=True)
    heard: queue.Queue[MeshState] = queue.Queue()
    rospy.Subscriber(names.STATE_TOPIC, MeshState, heard.put, queue_size=1)
    _ask(options.drone, request)
    print(f"drone {options.drone} flies it at {mission.speed_m_s:g} m/s", flush=True)
    try:
        place = _follow(heard, options.drone)
    except KeyboardInterrupt:
        print(f"drone {options.drone} flies on", file=sys.stderr)
        raise
    end = request.waypoints[-1]
    is_there = math.dist(place, (end.longitude, end.latitude, end.height)) < THERE_M
    print("the mission is flown" if is_there else "the mission ended before its last waypoint")
    return 0 if is_there else 1


def _ask(drone: int, request: FlyMissionRequest) -> None:
    try:
        answer = call_once(names.mission_service(drone), FlyMission, request)
    except ServiceGone as error:
        raise MeshError(f"{error}: is there a drone {drone} in a running simulation?") from None
    if not answer.success:
        raise MeshError(answer.message)


def _follow(heard: queue.Queue[MeshState], drone: int) -> tuple[float, ...]:
    """Print the progress until there is no mission any more; returns where the drone then is."""
    shown_s, ends_s = -math.inf, math.inf
    while True:
        try:
            mesh = heard.get(timeout=1.0)  # or else Ctrl-C would wait for a message
        except queue.Empty:
            continue
        now_s = mesh.header.stamp.to_sec()
        node = next((node for node in mesh.nodes if node.id == drone), None)
        if node is None:
            return (math.nan,) * 3
        if node.mission and now_s - shown_s >= SHOW_EVERY_S:
            shown_s = now_s
            print(node.mission, flush=True)
        # A state that was on its way when the mission began does not know it.
        ends_s = math.inf if node.mission else min(ends_s, now_s + BEGINS_WITHIN_S)
        if now_s >= ends_s:
            return tuple(node.position)
