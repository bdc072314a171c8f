"""Numbers on the pages are those of the code."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from drone_mesh import fence_file
from drone_mesh.air.obstacles import BOX_CLEARANCE_M, CUT_DB, METRE_DB
from drone_mesh.communication.control.control_plane import ITechnique
from drone_mesh.communication.data.packets import MAX_MESSAGE_BYTES
from drone_mesh.communication.repair import c3r, fiedler, group_repair, legs, lone_repair
from drone_mesh.communication.repair import named_backup as backup
from drone_mesh.communication.repair.interfaces import SILENCE_PATIENCE
from drone_mesh.communication.repair.options import RANGE_M
from drone_mesh.communication.repair.spots import LOWEST_M, PITCH, WITHIN_REACH
from drone_mesh.communication.repair.virtual_spring import REST
from drone_mesh.communication.routing.techniques import etx_tree
from drone_mesh.communication.timing import MeshTiming
from drone_mesh.communication.wire.packet_types import TECHNIQUE_TYPES
from drone_mesh.console import demonstration, earth, history, put_back
from drone_mesh.drone import fence, flight_path, goal, way_round
from drone_mesh.drone.battery import LAND_AT_PERCENT
from drone_mesh.drone.mavlink import authority, commander, own_fence, pilot, telemetry
from drone_mesh.drone.mavlink.limits import FlightLimits
from drone_mesh.drone.route import LEAD_S
from drone_mesh.earth_files import MAX_CHARACTERS
from drone_mesh.earth_files.placemarks import STEP_M
from drone_mesh.earth_files.plan import MAX_PLAN_CHARACTERS
from drone_mesh.execution import REQUESTS_PER_STEP
from drone_mesh.formations import airspace, departures, mission_files, missions, standing_order
from drone_mesh.inprocess import drone as inprocess
from drone_mesh.inprocess.radio import HOP_DELAY_S
from drone_mesh.internet.http_internet import ANSWER_WITHIN_S
from drone_mesh.lab import engine, estimate, experiment, plan, policies, scenario, statistics
from drone_mesh.lab.scenario_parts import Churn
from drone_mesh.nrf24.settings import RadioSettings
from drone_mesh.raspberry.node_events import EVENTS_KEPT
from drone_mesh.state.alarms import LOW_BATTERY_PERCENT
from drone_mesh.state.condition import SILENT_AFTER_S
from drone_mesh.state.links import JUST_LOST_S, SOON_S
from drone_mesh.state.packets import MOST_SAMPLED
from drone_mesh.web.access import FREE_GUESSES, GUESS_PERIOD_S
from drone_mesh.world.body import BodyLimits

ROOT = Path(__file__).resolve().parents[2]
WORDS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")


def of_ros(module: str, name: str) -> float:
    """A constant of a module that needs ROS, which these tests do without."""
    source = (ROOT / "src" / "drone_mesh" / "ros" / module).read_text(encoding="utf-8")
    return float(re.search(rf"^{name} = ([\d.]+)", source, re.M)[1])


def of_page(module: str, name: str) -> float:
    """A constant of a script of the console's page."""
    static = ROOT / "src" / "drone_mesh" / "console" / "static"
    return float(re.search(rf"^const {name} = (\d+);", (static / module).read_text(), re.M)[1])


CHECK_S, LOST_S = MeshTiming.check_period_s, ITechnique.connection_lost_after_s
SAMPLES_S = backup.FEW_SAMPLES * lone_repair.SAMPLE_S
WATCHED_S = of_ros("world/mesh_state.py", "WATCHED_PERIOD_S")
REPORT_S = of_ros("host/host_reports.py", "REPORT_PERIOD_S")
LARGE_S = 254 * of_ros("host/host_reports.py", "REPORT_PERIOD_PER_NODE_S")
AGAIN_S = of_ros("host/node_access.py", "ORDER_PERIOD_S")
AT_ONCE = of_ros("host/node_access.py", "MOST_ORDERS_AT_ONCE")
INFO_S = of_ros("world/engine_server.py", "INFO_PERIOD_S")
LIMITS = FlightLimits()
LAYERS = 1 + int((LIMITS.max_height_m - LIMITS.cruise_height_m) / LIMITS.layer_m)
BODY = BodyLimits()
HOP_S = RadioSettings().acknowledged_s

SENTENCES = {
    "ros": [
        f"none after {of_ros('services/drone_manager.py', 'WAIT_FOR_GATEWAY_S'):g} s of wall time",
        f"within {of_ros('services/drone_manager.py', 'ANSWERS_TIMEOUT_S'):g} s the status is 1",
        f"has been at its place (within {departures.AT_PLACE_M:g} m)",
        f"again after {standing_order.FIRST_PAUSE_S:g} s of simulated time, and then after twice "
        f"as long each time, at most {standing_order.LONGEST_PAUSE_S:g} s",
        f"takes {AT_ONCE:g} orders at once from `/gateway`, and then {1 / AGAIN_S:g} a second",
        f"carries out {WORDS[REQUESTS_PER_STEP]} in each step of the world",
        f"not begun within {ANSWER_WITHIN_S:g} s is answered with 503",
        f"In {of_ros('graph/logs.py', 'COMPLAINT_PERIOD_S'):g} s its log has one line for all",
        f"at least {airspace.APART_M:g} m from each drone at rest",
        f"`flight:=dynamic` {airspace.APART_M + airspace.SWAY_M:g} m, because",
        f"At least {100 * departures.CONNECTED_SHARE:g} % of the drones stay connected",
        f"climbs to {BOX_CLEARANCE_M:g} m above the highest obstacle, or it flies round the "
        f"obstacles at {BOX_CLEARANCE_M:g} m",
        f"Speed is {flight_path.SPEED_M_S:g} m/s.",
        f"(reached at {100 * flight_path.CLIMB_ENDS_AT:g} % of the time)",
        f"(at {100 * flight_path.DESCENT_STARTS_AT:g} %)",
        f"at most {1 / INFO_S:g} times a second",
        f"within ±{goal.MAX_COORDINATE_M:g} m and height is within 0..{goal.MAX_HEIGHT_M:g} m",
        f"is up to {of_ros('graph/resting_clock.py', 'COARSE_S'):g} s old",
        f"sends up to {MAX_MESSAGE_BYTES:,} bytes",
    ],
    "observing": [
        f"more than {of_page('draw.js', 'MOST_LINKS'):g} links that no route uses",
        f"at most {MOST_SAMPLED} packets on `/mesh/packets`",
        f"its dot {of_page('packets.js', 'RUN_MS') / 1000:g} s",
        f"sends {WORDS[len(demonstration._PLACES)]} drones to free places",
        f"after {put_back._WITHIN_S:g} simulated seconds",
        f"low battery ({LOW_BATTERY_PERCENT:g} %)",
        f"said within {of_page('log.js', 'SAME_WITHIN_S'):g} s share one",
        f"(the gateway keeps {EVENTS_KEPT})",
        f"last {history.KEPT_S / 60:g} simulated minutes (with many nodes, as much as fits into "
        f"{history.KEPT_BYTES / 1e6:g} MB)",
        f"waits {WORDS[int(of_page('flights.js', 'HOLD_MS') / 1000)]} seconds, in which",
        f"of more than {of_page('flights.js', 'FAR_M'):g} m, the page asks",
        f"{WORDS[FREE_GUESSES]} wrong tokens gets {WORDS[round(GUESS_PERIOD_S)]} more try a second",
        f"a track are {'half a metre' if STEP_M == 0.5 else '?'} apart or more (the page takes "
        f"them from {earth.MOST_STATES} moments at most)",
        f"more than {MAX_CHARACTERS:,} characters",
        f"(the {of_ros('views/markers.py', 'MOST_LINKS'):g} shortest of each)",
        f"no report from its host for {SILENT_AFTER_S:g} s",
        f"lost in the last {JUST_LOST_S:g} s red, and one that will break within {SOON_S:g} s",
        f"{1 / WATCHED_S:g} Hz of wall time while it has subscribers",
        f"up to {REPORT_S + WATCHED_S:g} s of wall time late, of 254 nodes "
        f"{LARGE_S + WATCHED_S:.1f} s",
    ],
    "strategies": [
        f"checks every {CHECK_S:g} s (the check period)",
        f"hear each other if their places are within {WITHIN_REACH:g} of the range",
        f"the node that named it within {backup.NAMED_FOR * CHECK_S:g} s is silent",
        f"answers within {backup.ANSWERS_S:g} s and that node does not",
        f"it flies after {SAMPLES_S:g} s in which",
        f"`connection_lost_after` of more than {backup.ALONE_S:g} s it waits",
        f"returns to its own after {c3r.TURN_S:g} s",
        f"After {WORDS[c3r.TURNS]} turns of its own",
        f"{PITCH:g} clearances beside the place",
        f"wait {WORDS[int(SILENCE_PATIENCE)]} times as long",
        f"follows {LOST_S:g} s (`connection_lost_after`) after the loss",
        f"{'a third' if group_repair.LATER_ROUNDS * 3 == 1 else '?'} of that once one of its "
        f"drones has flown, until {WORDS[group_repair.ROUNDS_WITHOUT_FLIER + 1]} rounds brought no",
        f"in legs of {'half' if legs.LEG == 0.5 else '?'} the range at most",
        f"more than {WORDS[int(legs.DETOUR)]} times as many legs as the straight way to the "
        "gateway and one more need",
        f"waits for one pause ({legs.PAUSE_S:g} s)",
        f"places it knows within {WORDS[int(legs.NEWS)]} ranges",
        f"until it is {fiedler.BOUND:g} (after",
        f"the nearest {fiedler.MOST_PLACES} (`fiedler`)",
        f"under {'two thirds' if REST * 3 == 2 else '?'} of the range",
    ],
    "techniques": [
        f"for a gain of {etx_tree.SWITCH_BELOW / 128:g} transmissions",
        f"own types {TECHNIQUE_TYPES.start}..{TECHNIQUE_TYPES.stop - 1}",
    ],
    "motion": [
        f"in steps of {inprocess.STEP_S:g} s, and their links",
        f"at a height of {of_ros('world/pilots.py', 'HEIGHT_M'):g} m",
        f"about {WORDS[int(of_ros('world/pilots.py', 'MEAN_DEGREE'))]} neighbours",
        f"links that will break within {SOON_S:g} s",
        f"Without one: {missions.DEFAULT_SPEED_M_S:g} m/s",
        f"Up to {mission_files.MOST_WAYPOINTS:,} waypoints, and {MAX_PLAN_CHARACTERS:,} characters",
        f"more than {goal.MAX_COORDINATE_M / 1000:g} km away",
    ],
    "flying": [
        f"| height above home | {LIMITS.max_height_m:g} m |",
        f"| horizontal distance from home | {LIMITS.max_distance_m:g} m |",
        f"| speed | {LIMITS.speed_m_s:g} m/s |",
        f"| battery to start a flight | {LIMITS.min_battery_percent:g} % |",
        f"| cruise height | {LIMITS.cruise_height_m:g} m, plus a layer of {LIMITS.layer_m:g} m per "
        f"node ({LAYERS} layers)",
        f"whose ids differ by {LAYERS} share one",
        f"its height in the next {authority.FELL_WITHIN_S:g} s says",
        f"{pilot.HOLD_TARGETS_S:g} s after a flight the program sends ArduPilot no more targets",
        f"home is more than {authority.HOME_OFF_M:g} m above or below `--origin`",
        f"more than {fence_file.MOST_AREAS} areas, {fence.MOST_CORNERS} corners of one area and "
        f"{fence_file.MOST_CORNERS:,} of all (a circle has {fence.CIRCLE_CORNERS})",
        f"none past at most {way_round.MOST_MET} areas and obstacles, or none among the first "
        f"{way_round.MOST_LEGS:,} straight pieces",
        f"in the way to one of the {WORDS[way_round.MOST_ENTRIES]} nearest places inside",
        f"and again every {own_fence.LOOK_AGAIN_S:g} s, at once",
        f"for {own_fence.TRIES * own_fence.ASK_AGAIN_S:g} s does not answer",
        f"hangs at the fence for {pilot.STALLED_S:g} s",
        f"more than {-LOWEST_M:g} m below it",
        f"was heard in the last {telemetry.HEARTBEAT_LOST_S:g} s",
        f"a good estimate, not older than {telemetry.FRESH_S:g} s",
        f"within {goal.MAX_COORDINATE_M / 1000:g} km of the origin",
        f"have not moved in the last {telemetry.STICKS_REST_S:g} s",
        f"for the effect: {commander.CARRIED_OUT_WITHIN_S:g} s, {pilot.TAKE_OFF_WITHIN_S:g} s for",
        f"heartbeats at {telemetry.HEARTBEAT_HZ:g} Hz and for GPS and estimator at "
        f"{telemetry.ESTIMATE_HZ:g} Hz",
        f"leads by {LEAD_S:g} s of flight",
        f"a body of {BODY.mass_kg:g} kg with drag",
        f"a battery for {BODY.power.hover_s / 60:g} minutes in the air",
        f"its speed changes by {BODY.crash_m_s:g} m/s",
        f"in the air for {'half a second' if BODY.held_s == 0.5 else '?'}",
        f"At {LAND_AT_PERCENT:g} % of its battery a drone lands",
    ],
    "lab": [
        f"at most {experiment.MOST_CELLS:,} cells and {experiment.MOST_RUNS:,} runs",
        f"(with more than {estimate.MOST_CELLS} cells, of every n-th)",
        f"repeats them for about {estimate.BUDGET_S:g} s",
        f"at least {'a quarter' if estimate.LEAST_SHARE == 0.25 else '?'} of a run",
        f"of these runs is {plan.CONTROL_FROM:,} and up",
        f"one run, {experiment.Experiment.model_fields['timeout_s'].default:g} by default",
        f"after `within_s` ({scenario.Probes().within_s:g} s) is lost",
        f"at once `every_s` ({Churn().every_s:g} s)",
        f"{CUT_DB['brick']:g} dB for each surface crossed and {METRE_DB:g} dB for each metre",
        f"`drones: {scenario.Sequence().drones}`",
        f"nor do fewer than {WORDS[statistics.FEWEST]} values of a mean",
        f"kills its worker {WORDS[engine.DEATHS_ALLOWED + 1]} times",
        f"than `max_distance_m` ({RANGE_M:g} m) hear each other",
        f"takes `delay_s` ({1000 * HOP_DELAY_S:g} ms)",
    ],
    "rl": [
        f"in shares -1..1 of {'half' if policies.LEG == 0.5 else '?'} the range",
        f"{policies.LOOK_S:g} s after a flight, {policies.STAY_S:g} s after it stayed",
        f"of the {policies.SLOTS} nearest neighbours",
        f"{policies.PlacementPolicy.STEP_S:g} s or more, until some agent may act | "
        f"{policies.RoutingPolicy.STEP_S:g} s, the check period",
    ],
    "performance": [
        f"its acknowledgement take {1000 * HOP_S:.2f} ms, settling times included, so it carries "
        f"at most {1 / HOP_S:.0f} packets a second",
    ],
}


@pytest.mark.parametrize("page", sorted(SENTENCES))
def test_a_page_has_the_numbers_of_the_code(page: str) -> None:
    text = " ".join((ROOT / "docs" / f"{page}.md").read_text(encoding="utf-8").split())
    assert [sentence for sentence in SENTENCES[page] if sentence not in text] == []
