"""Pictures of a world: all drones are in them, in the right colour, and no screen is needed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from drone_mesh.drone.roles import Role
from drone_mesh.state.condition import Condition
from drone_mesh.state.links import LinkUse
from drone_mesh.state.model import ObstacleStatus
from drone_mesh.view.camera import Camera, Margins, frame
from drone_mesh.view.palette import LIGHT, rgb
from drone_mesh.view.scene import (
    DronePicture,
    LinkPicture,
    Scene,
    Shape,
    drawing_scale,
)
from drone_mesh.view.snapshot import margins_of, render

SIZE = (360, 240)  # small is fast
GATEWAY = DronePicture(0, Role.GATEWAY, (-1.0, 0.0, 0.0))
ROUTER = DronePicture(1, Role.ROUTER, (5.0, 4.0, 0.0))
OTHER = DronePicture(2, Role.ROUTER, (-5.0, 4.0, 0.0))

coordinates = st.floats(-5000, 5000)
places = st.lists(st.tuples(coordinates, coordinates, st.floats(0, 500)), min_size=1, max_size=20)


@pytest.fixture(autouse=True)
def _no_screen(monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)


@pytest.fixture
def shoot(tmp_path):
    """Render and read back: (height, width, 3) numbers 0..255."""

    def shoot(drones, size=SIZE, **others):
        path = tmp_path / "picture.png"
        render(Scene(drones, **others), path, size)
        with Image.open(path) as image:
            assert image.format == "PNG"
            return np.asarray(image.convert("RGB")).astype(int)

    return shoot


def camera_of(drones, size=SIZE):
    return frame(Camera(size), Scene(drones).points(), margins_of(size))


def share_of_colour(pixels, colour, place, radius):
    """Share of the pixels around `place` that have the hue of `colour`, however light or dark."""
    x, y = (int(value) for value in place)
    near = pixels[max(0, y - radius) : y + radius + 1, max(0, x - radius) : x + radius + 1]
    hues, wanted = (
        values - values.min(axis=-1, keepdims=True)
        for values in (near.reshape(-1, 3).astype(float), np.array(rgb(colour)))
    )
    strength = np.linalg.norm(hues, axis=1)
    likeness = hues @ wanted / (np.maximum(strength, 1) * np.linalg.norm(wanted))
    return float(np.mean((likeness > 0.95) & (strength > 8)))


def test_a_flying_drone_has_other_rotors_and_a_box_stays_a_box(shoot):
    standing, flying = (shoot([replace(ROUTER, path=path)]) for path in ((), [ROUTER.position]))
    box = shoot([ROUTER], shape=Shape.BOX)
    place = camera_of([ROUTER]).project([ROUTER.centre()])[0]
    for pixels in (standing, flying, box):
        assert share_of_colour(pixels, ROUTER.colour, place, 2) > 0.5
    assert np.abs(standing - flying).mean() > 0.05
    assert share_of_colour(box, ROUTER.colour, place, 9) > share_of_colour(
        standing, ROUTER.colour, place, 9
    )


def test_an_obstacle_is_shown_and_dims_the_drone_behind_it(shoot):
    front = ObstacleStatus((0.0, -1.0, 1.0), (1.0, 0.5, 2.0))
    behind = DronePicture(1, Role.ROUTER, (0.0, 0.0, 0.0))
    free, hidden = shoot([behind]), shoot([behind], obstacles=[front])
    x, y = map(int, camera_of([behind]).project([behind.centre()])[0])
    assert hidden[y, x, 0] > free[y, x, 0] + 60  # the sandy box, where only the green drone was
    assert hidden[y, x, 1] > hidden[y, x, 0] + 10  # which still shines through


def test_each_drone_is_where_it_stands_in_the_colour_of_its_condition(shoot):
    drones = [GATEWAY] + [
        DronePicture(1 + i, Role.ROUTER, (3.0 * i, 4.0, 0.0), condition)
        for i, condition in enumerate(Condition)
    ]
    assert len({drone.colour for drone in drones}) == len(drones)
    size = (480, 320)
    pixels = shoot(drones, size)
    camera = camera_of(drones, size)
    for drone in drones:
        (place,) = camera.project([drone.centre()])
        assert share_of_colour(pixels, drone.colour, place, radius=3) > 0.5, drone


def test_ids_are_written_and_differ(shoot):
    def above(pixels):
        ((x, y),) = camera_of([ROUTER]).project([ROUTER.position])
        return pixels[int(y) - 40 : int(y) - 8, int(x) - 20 : int(x) + 20]

    one, two = above(shoot([ROUTER])), above(shoot([replace(ROUTER, node_id=200)]))
    assert (one.sum(axis=2) < 300).sum() > 10, "no ink above the drone"
    assert (one != two).any()


def test_links_have_the_colour_of_their_use(shoot):
    drones = [GATEWAY, ROUTER, OTHER]
    links = [LinkPicture(0, 1, LinkUse.ROUTE), LinkPicture(1, 2, LinkUse.LOST)]
    pixels = shoot(drones, links=links)
    camera = camera_of(drones)
    for link in links:
        start, end = (drones[node].position for node in (link.start, link.end))
        middle = tuple((a + b) / 2 for a, b in zip(start, end))
        (place,) = camera.project([middle])
        assert share_of_colour(pixels, LIGHT.of_link(link.use), place, radius=8) > 0.02, link


def test_a_link_to_a_drone_that_is_not_shown_is_left_out(shoot):
    plain, linked = shoot([ROUTER]), shoot([ROUTER], links=[LinkPicture(1, 77)])
    assert (plain == linked).all()


def test_a_flight_is_drawn_to_its_goal_and_the_goal_is_in_the_picture(shoot):
    flying = replace(ROUTER, position=(5.0, 4.0, 8.0), path=[(25.0, 9.0, 8.0), (25.0, 9.0, 0.0)])
    drones = [GATEWAY, flying]
    pixels = shoot(drones)
    (goal,) = camera_of(drones).project([flying.path[-1]])
    assert share_of_colour(pixels, LIGHT.path, goal, radius=10) > 0.05


def test_a_legend_explains_the_colours_that_occur_where_there_is_room_for_it(shoot):
    off = replace(OTHER, condition=Condition.OFF)
    corner = (600 - 160, 68)  # the third row
    for others, there in (([], False), ([off], True)):
        pixels = shoot([GATEWAY, ROUTER, *others], size=(600, 300))
        assert (share_of_colour(pixels, off.colour, corner, radius=4) > 0.5) is there


def test_a_title_is_written_into_the_upper_left_corner(shoot):
    corner = np.s_[:40, :200]
    plain, titled = shoot([ROUTER])[corner], shoot([ROUTER], title="after 12.3 s")[corner]
    assert (titled.sum(axis=2) < 200).sum() > (plain.sum(axis=2) < 200).sum() + 50


@settings(deadline=None, max_examples=40)
@given(places)
def test_the_camera_frames_whatever_there_is(points):
    camera = frame(Camera((1280, 800)), points, Margins(left=80, top=40, right=200, bottom=60))
    pixels = camera.project(points)
    assert (pixels >= [79, 39]).all()
    assert (pixels <= [1081, 741]).all()


def test_a_fleet_fills_the_frame_on_the_side_that_is_short_of_room():
    points = [(0.0, 0.0, 0.0), (100.0, 0.0, 0.0)]
    pixels = frame(Camera((1280, 800)), points, Margins(80, 40, 200, 60)).project(points)
    assert pixels[:, 0] == pytest.approx([80, 1080], abs=1)


@settings(deadline=None, max_examples=40)
@given(places, st.floats(0, 1279), st.floats(0, 799))
def test_what_is_seen_on_the_ground_is_projected_back_to_its_pixel(points, x, y):
    camera = frame(Camera((1280, 800)), points, Margins(80, 40, 200, 60))
    ground = camera.on_ground((x, y))
    assert ground is not None
    (pixel,) = camera.project([ground])
    assert pixel == pytest.approx([x, y], abs=0.5)


def test_the_sky_is_not_ground_and_what_lies_behind_has_no_pixel():
    camera = Camera((100, 100), pitch_deg=0.0, distance_m=10.0, target=(0.0, 0.0, 1.0))
    assert camera.on_ground((50, 10)) is None
    assert camera.on_ground((50, 90)) is not None
    assert np.isnan(camera.project([(0.0, -20.0, 1.0)])).all()


def test_drones_are_drawn_larger_where_there_is_room_and_never_smaller():
    far = [replace(ROUTER, node_id=k, position=(6.0 * k, 0.0, 0.0)) for k in range(10)]
    near = [replace(ROUTER, node_id=k, position=(0.1 * k, 0.0, 0.0)) for k in range(10)]
    assert drawing_scale(far, wanted=4.0) == 4.0
    assert drawing_scale(far, wanted=100.0) == pytest.approx(0.3 * 6.0 / 0.2)
    assert drawing_scale(near, wanted=100.0) == 1.0
    assert drawing_scale([ROUTER], wanted=100.0) == 100.0
    assert ROUTER.size_m(3.0) == pytest.approx((0.6, 0.6, 0.3))
    assert ROUTER.centre(3.0) == pytest.approx((5.0, 4.0, 0.15))


def test_a_point_before_the_camera_is_seen_in_its_pixel():
    camera = Camera((1280, 800), target=(3.0, 4.0, 5.0), yaw_deg=30.0)
    for pixel in ((0.0, 0.0), (640.0, 400.0), (1200.0, 20.0)):
        assert camera.project([camera.before(pixel, 2.0)])[0] == pytest.approx(pixel, abs=0.01)
