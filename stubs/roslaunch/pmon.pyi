class ProcessListener:
    def process_died(self, process_name: str, exit_code: int | None) -> None: ...

class Process:
    name: str
    required: bool

class ProcessMonitor:
    def add_process_listener(self, l: ProcessListener) -> None: ...
    def get_process(self, name: str) -> Process | None: ...
