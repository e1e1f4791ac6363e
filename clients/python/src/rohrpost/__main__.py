"""``python -m rohrpost``: for people who have nothing else of Rohrpost installed."""

import sys

from .cli import main

if __name__ == "__main__":
    sys.exit(main())
