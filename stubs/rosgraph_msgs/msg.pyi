from genpy import Message, Time

class Clock(Message):
    clock: Time
    def __init__(self, clock: Time = ...) -> None: ...
