"""The one error that a user's own input can cause."""


class InputError(ValueError):
    """Input that cannot be used: its message is one line that says what is wrong and what would do.

    The commands print the message and end with exit status 2; every other exception is a bug of
    ours (or of a method, which then becomes a `failed` row).
    """


class NotFittedError(InputError, AttributeError):
    """A model was asked for what only `fit` or `load` gives it.

    An AttributeError too, as scikit-learn's is: `hasattr(model, "points_")` is False before a fit.
    """
