"""``python -m skfem_textile``."""

import sys

from .cli import main

sys.exit(main())
