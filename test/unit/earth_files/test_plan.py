"""Plans and waypoint files of ground stations: items as they stand, or one line of refusal."""

from __future__ import annotations

import json
import math
from typing import Any

import pytest

from drone_mesh.earth_files.plan import Plan, read_plan, read_waypoints
from drone_mesh.errors import ConfigurationError

# As QGroundControl 4.3 saves it, shorter: take-off, a survey with two items, a landing, a fence.
QGC_PLAN = """{
    "fileType": "Plan",
    "geoFence": {"circles": [], "polygons": [{"inclusion": true, "polygon": [], "version": 1}],
                 "version": 2},
    "groundStation": "QGroundControl",
    "mission": {
        "cruiseSpeed": 15, "firmwareType": 12, "globalPlanAltitudeMode": 1, "hoverSpeed": 5,
        "items": [
            {"AMSLAltAboveTerrain": null, "Altitude": 30, "AltitudeMode": 1, "autoContinue": true,
             "command": 22, "doJumpId": 1, "frame": 3,
             "params": [0, 0, 0, null, 52.0907, 5.1214, 30], "type": "SimpleItem"},
            {"TransectStyleComplexItem": {
                "CameraShots": 9, "FollowTerrain": false, "version": 2,
                "Items": [
                    {"autoContinue": true, "command": 16, "doJumpId": 2, "frame": 3,
                     "params": [0, 0, 0, null, 52.0908, 5.1216, 30], "type": "SimpleItem"},
                    {"autoContinue": true, "command": 206, "doJumpId": 3, "frame": 2,
                     "params": [25, 0, 1, 0, 0, 0, 0], "type": "SimpleItem"}]},
             "angle": 0, "complexItemType": "survey", "polygon": [], "type": "ComplexItem",
             "version": 5},
            {"complexItemType": "StructureScan", "type": "ComplexItem", "version": 3},
            {"autoContinue": true, "command": 20, "doJumpId": 4, "frame": 2,
             "params": [0, 0, 0, 0, 0, 0, 0], "type": "SimpleItem"}
        ],
        "plannedHomePosition": [52.0907, 5.1214, null], "vehicleType": 2, "version": 2},
    "rallyPoints": {"points": [[52.09, 5.12, 10]], "version": 2},
    "version": 1
}"""

# As Mission Planner 1.3 saves it: the first item is the home.
WAYPOINTS = (
    "QGC WPL 110\r\n"
    "0\t1\t0\t16\t0\t0\t0\t0\t52.0907\t5.1214\t3.000000\t1\r\n"
    "1\t0\t3\t22\t0.00000000\t0.00000000\t0.00000000\tnan\t0\t0\t30.000000\t1\r\n"
    "# by hand\r\n\r\n"
    "2\t0\t10\t16\t5 0 0 0 52.0908 +5.1216 20.5 1\r\n"
)


def items_of(plan: Plan) -> list[tuple[Any, ...]]:
    return [(item.where, item.command, item.frame, *item.values[4:]) for item in plan.items]


def test_a_plan_gives_its_simple_items_those_of_surveys_too_and_names_the_others():
    plan = read_plan(QGC_PLAN)
    assert items_of(plan) == [
        ("item 1", 22, 3, 52.0907, 5.1214, 30.0),
        ("item 2", 16, 3, 52.0908, 5.1216, 30.0),
        ("item 3", 206, 2, 0.0, 0.0, 0.0),
        ("item 4", 20, 2, 0.0, 0.0, 0.0),
    ]
    assert math.isnan(plan.items[0].values[3])
    assert plan.unread == ["'StructureScan' after item 3"]
    assert plan.home == [52.0907, 5.1214]
    assert plan.speed_m_s == 5.0
    assert [fence["inclusion"] for fence in plan.geo_fence["polygons"]] == [True]
    assert plan.rally_points["points"] == [[52.09, 5.12, 10]]


def test_a_plan_of_a_fence_alone_has_no_items():
    plan = read_plan('{"fileType": "Plan", "geoFence": {"circles": [1]}, "rallyPoints": null}')
    assert (plan.items, plan.geo_fence, plan.rally_points) == ([], {"circles": [1]}, {})


def test_the_first_item_of_wpl_110_is_the_home_and_of_120_a_waypoint():
    plan = read_waypoints(WAYPOINTS)
    assert plan.home == [52.0907, 5.1214]
    assert items_of(plan) == [
        ("line 3", 22, 3, 0.0, 0.0, 30.0),
        ("line 6", 16, 10, 52.0908, 5.1216, 20.5),
    ]
    other = read_waypoints(WAYPOINTS.replace("110", "120"))
    assert other.home is None
    assert [item.where for item in other.items] == ["line 2", "line 3", "line 6"]


def plan_with(**mission: Any) -> str:
    return json.dumps({"fileType": "Plan", "mission": mission})


def simple(**changes: Any) -> str:
    item = {"type": "SimpleItem", "command": 16, "frame": 3, "params": [0] * 7, **changes}
    return plan_with(items=[item])


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("{", "not JSON: "),
        ("[" * 100_000, "nested too deeply"),
        ("[]", r"the plan is not an object: \[\]"),
        ('{"type": "FeatureCollection"}', "not a plan of QGroundControl"),
        ('{"fileType": "Plan", "geoFence": 3}', "geoFence is not an object: 3"),
        (plan_with(items=7), "items 7 are not a list"),
        (plan_with(items=["x"]), "item 1 is not an object: 'x'"),
        (plan_with(items=[{"TransectStyleComplexItem": {"Items": [3]}}]), "item 1 is not an obj"),
        (simple(params=[0] * 6), r"item 1: params \[.* are not 7 numbers"),
        (simple(params=[*[0] * 6, math.nan]), r"item 1: params \[.* are not 7 numbers"),
        (simple(params=[*[0] * 6, 1e300]), r"item 1: params \[.* are not 7 numbers"),
        (simple(command=True), "item 1: needs a command and a frame"),
        (simple(frame=None), "item 1: needs a command and a frame"),
        (simple(AltitudeMode=3), "item 1: frame 3 does not go with AltitudeMode 3"),
        (simple(AltitudeMode=1, frame=0), "item 1: frame 0 does not go with AltitudeMode 1"),
    ],
)
def test_a_bad_plan_is_refused_in_one_line(text, why):
    with pytest.raises(ConfigurationError, match=why) as caught:
        read_plan(text)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "line 1: expected QGC WPL 110"),
        ("QGC WPL 100\n", "line 1: expected QGC WPL 110"),
        ("QGC WPL 110\n0,1,0,16,0,0,0,0,52,5,3,1\n", "line 2: expected 12 numbers"),
        ("QGC WPL 110\n0 1 0 16 0 0 0 0 52,09 5 3 1\n", "line 2: '52,09' is not a number"),
        ("QGC WPL 110\n0 1 3.0 16 0 0 0 0 52 5 3 1\n", "line 2: expected 12 numbers, of which"),
    ],
)
def test_bad_waypoints_are_refused_in_one_line(text, why):
    with pytest.raises(ConfigurationError, match=why):
        read_waypoints(text)
