"""python3 -m proofs, with src and test on the path: scripts/proofs."""

import sys

from proofs.command import main

sys.exit(main())
