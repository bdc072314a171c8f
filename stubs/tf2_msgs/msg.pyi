from genpy import Message
from geometry_msgs.msg import TransformStamped

class TFMessage(Message):
    transforms: list[TransformStamped]
    def __init__(self, transforms: list[TransformStamped] = ...) -> None: ...
