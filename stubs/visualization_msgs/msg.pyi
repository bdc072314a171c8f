from typing import Final

from genpy import Message
from geometry_msgs.msg import Point, Pose, Vector3
from std_msgs.msg import ColorRGBA, Header

class Marker(Message):
    CUBE: Final = 1
    CUBE_LIST: Final = 6
    LINE_STRIP: Final = 4
    LINE_LIST: Final = 5
    TEXT_VIEW_FACING: Final = 9
    MESH_RESOURCE: Final = 10
    ADD: Final = 0
    DELETE: Final = 2
    header: Header
    ns: str
    id: int
    type: int
    action: int
    pose: Pose
    scale: Vector3
    color: ColorRGBA
    frame_locked: bool
    points: list[Point]
    colors: list[ColorRGBA]
    text: str
    mesh_resource: str
    def __init__(
        self, ns: str = ..., id: int = ..., type: int = ..., action: int = ...
    ) -> None: ...

class MarkerArray(Message):
    markers: list[Marker]
    def __init__(self, markers: list[Marker] = ...) -> None: ...
