"""`python -m symoden` is the command line."""

import sys

from symoden.cli import main

sys.exit(main())
