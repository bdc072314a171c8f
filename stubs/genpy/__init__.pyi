from typing import IO

from typing_extensions import Self

class Message:
    __slots__: list[str]
    _type: str
    _md5sum: str
    _connection_header: dict[str, str]  # of a received message
    def serialize(self, buff: IO[bytes]) -> None: ...
    def deserialize(self, str: bytes) -> Self: ...

class Time:
    secs: int
    nsecs: int
    def __init__(self, secs: int = ..., nsecs: int = ...) -> None: ...
    @classmethod
    def from_sec(cls, float_secs: float) -> Self: ...
    def to_sec(self) -> float: ...
    def to_nsec(self) -> int: ...
