"""The paper's method: five small networks, their losses, and how they are trained.

Importing it needs torch, which a plain install leaves out.
"""

import importlib.util

from parapoint.errors import InputError

if importlib.util.find_spec("torch") is None:
    raise InputError("training needs torch, which is not installed: pip install torch")
