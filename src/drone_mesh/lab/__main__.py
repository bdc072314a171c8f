#!/usr/bin/env python3
"""python3 -m drone_mesh.lab: experiments without ROS."""

import sys

from drone_mesh.lab.command import main

if __name__ == "__main__":
    sys.exit(main())
