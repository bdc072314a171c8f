from genpy import Message
from std_msgs.msg import Header

class KeyValue(Message):
    key: str
    value: str
    def __init__(self, key: str = ..., value: str = ...) -> None: ...

class DiagnosticStatus(Message):
    OK: int
    WARN: int
    ERROR: int
    STALE: int
    level: int
    name: str
    message: str
    hardware_id: str
    values: list[KeyValue]
    def __init__(
        self,
        level: int = ...,
        name: str = ...,
        message: str = ...,
        hardware_id: str = ...,
        values: list[KeyValue] = ...,
    ) -> None: ...

class DiagnosticArray(Message):
    header: Header
    status: list[DiagnosticStatus]
    def __init__(self, header: Header = ..., status: list[DiagnosticStatus] = ...) -> None: ...
