"""``python -m skfem_textile``."""

import sys

from .cli.main import main

sys.exit(main())
