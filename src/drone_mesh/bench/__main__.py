#!/usr/bin/env python3
"""python3 -m drone_mesh.bench; needs no ROS with --only inprocess."""

from drone_mesh.bench.command import main

if __name__ == "__main__":
    main()
