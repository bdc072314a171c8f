from genpy import Message
from std_msgs.msg import Header

class Point(Message):
    x: float
    y: float
    z: float
    def __init__(self, x: float = ..., y: float = ..., z: float = ...) -> None: ...

class Vector3(Message):
    x: float
    y: float
    z: float
    def __init__(self, x: float = ..., y: float = ..., z: float = ...) -> None: ...

class Quaternion(Message):
    x: float
    y: float
    z: float
    w: float

class Pose(Message):
    position: Point
    orientation: Quaternion

class Transform(Message):
    translation: Vector3
    rotation: Quaternion

class TransformStamped(Message):
    header: Header
    child_frame_id: str
    transform: Transform
    def __init__(
        self, header: Header = ..., child_frame_id: str = ..., transform: Transform = ...
    ) -> None: ...
