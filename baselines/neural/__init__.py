"""Neural maps by other authors, trained for one shape at a time."""

import parapoint.learned  # noqa: F401 (says what to install where torch is missing)
