"""Lets the tests of this folder import its `solver_problems`."""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).parent))
