from genpy import Message, Time

class Header(Message):
    seq: int
    stamp: Time
    frame_id: str
    def __init__(self, seq: int = ..., stamp: Time = ..., frame_id: str = ...) -> None: ...

class Bool(Message):
    data: bool
    def __init__(self, data: bool = ...) -> None: ...

class String(Message):
    data: str
    def __init__(self, data: str = ...) -> None: ...

class Float32(Message):
    data: float
    def __init__(self, data: float = ...) -> None: ...

class ColorRGBA(Message):
    r: float
    g: float
    b: float
    a: float
    def __init__(self, r: float = ..., g: float = ..., b: float = ..., a: float = ...) -> None: ...
