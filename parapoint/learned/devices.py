"""Where the networks are trained and used."""

from parapoint.errors import InputError


def device_of(name: str) -> str:
    """The device of a name: "auto" is CUDA where there is any.

    Raises:
        InputError: there is no such device.
    """
    if name not in ("auto", "cpu", "cuda"):
        raise InputError(f"device must be auto, cpu or cuda, not {name!r}")
    if name == "cpu":
        return name
    import torch  # here, so that an estimator can be made, and described, without it

    available = torch.cuda.is_available()
    if name == "cuda" and not available:
        raise InputError("device cuda: none is available; take auto or cpu")
    return "cuda" if available else "cpu"
