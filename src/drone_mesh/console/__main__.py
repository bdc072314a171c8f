"""The program drone_mesh_console, or one line if a package that it needs is missing."""

from __future__ import annotations

import sys


def main() -> int:
    """Run the program; the exit status."""
    try:
        from drone_mesh.console.gateway_command import main as serve
    except ImportError as error:
        print(
            f"drone_mesh_console needs the Python package {error.name}: "
            "pip install 'drone_mesh[console]'",
            file=sys.stderr,
        )
        return 1
    return serve()


if __name__ == "__main__":
    sys.exit(main())
