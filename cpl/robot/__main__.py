"""The watchdog as a process: ``python -m cpl.robot``."""

import sys

from cpl.robot.watchdog import main

if __name__ == "__main__":
    sys.exit(main())
