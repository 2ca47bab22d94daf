"""Conversion of tensors to arrays, and errors for objects that are no arrays."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._errors import type_error

_CPU = 1
"""The device type of the CPU in DLPack."""


def to_numpy(value: Any, name: str, expected: str) -> NDArray[Any]:
    """Returns the memory of an array or of a tensor on the CPU as a NumPy array.

    ``name`` is the argument and ``expected`` names the arrays that it takes, both for errors.
    """
    kind = type(value).__name__
    found = f"{'an' if kind[0] in 'aeiouAEIOU' else 'a'} {kind}"
    if isinstance(value, np.ma.MaskedArray):
        raise type_error(name, found, expected, f"fill the masked values: {name}.filled(0)")
    if isinstance(value, np.ndarray):
        return np.asarray(value)
    if kind == "SpikeFrames":
        remedy = "pass the light of the scene" if "float32" in expected else "pass spikes.to_dense() or spikes.packed"
        raise type_error(name, f"{found}, which contains spikes", expected, remedy)
    if hasattr(value, "requires_grad"):
        return _tensor_to_numpy(value, name, expected, found)
    if hasattr(value, "__dlpack_device__"):
        if value.__dlpack_device__()[0] != _CPU:
            raise type_error(name, f"{found} on another device", expected, "copy it to the CPU first")
        return np.from_dlpack(value)
    if hasattr(value, "getbands"):
        codes = f'numpy.asarray({name}.convert("L"), numpy.float32) / 255'
        raise type_error(
            name, f"{found} of mode {value.mode!r}", expected, f"pass ({codes}) ** 2.2, which is linear light"
        )
    if isinstance(value, list | tuple):
        remedy = f"pass numpy.asarray({name}, numpy.{'float64' if 'float64' in expected else 'uint8'})"
        if "float32" in expected:
            remedy += " for codes of 0 to 255, or numpy.float32 for light of 0 to 1"
        raise type_error(name, found, expected, remedy)
    if isinstance(value, str):
        raise type_error(
            name, f"{value[:60]!r} (a str)", expected, "read the file first, for example with numpy.load(path)"
        )
    if hasattr(value, "__array__"):
        raise type_error(name, found, expected, f"pass numpy.asarray({name})")
    described = "None" if value is None else found
    raise type_error(name, described, expected, "pass an array, for example numpy.full(camera.shape, 51, numpy.uint8)")


def _tensor_to_numpy(tensor: Any, name: str, expected: str, found: str) -> NDArray[Any]:
    device = getattr(getattr(tensor, "device", None), "type", "cpu")
    steps = [("requires_grad", ".detach()")] if tensor.requires_grad else []
    if device != "cpu":
        steps.append((f"device {device!r}", ".cpu()"))
    if steps:
        state = " and ".join(state for state, _ in steps)
        calls = "".join(call for _, call in steps)
        raise type_error(name, f"{found} with {state}", f"{expected}, or a tensor on the CPU", f"call {name}{calls}")
    try:
        return np.asarray(tensor)
    except (TypeError, RuntimeError) as error:
        raise type_error(name, f"{found} of {tensor.dtype}", expected, f"call {name}.float()") from error
