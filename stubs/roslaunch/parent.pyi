from roslaunch.pmon import ProcessMonitor

class ROSLaunchParent:
    pm: ProcessMonitor
    def _start_infrastructure(self) -> None: ...
