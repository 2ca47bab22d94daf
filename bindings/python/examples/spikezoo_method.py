"""Serves a method of Spike-Zoo (0.2.3) to `spikelane benchmark run`, without changes of its code.

    pip install spikezoo
    spikelane benchmark run quick --server 'python3 bindings/python/examples/spikezoo_method.py tfp' -o runs/spikezoo-tfp

`tfp` and `tfi` need no weights. Spike-Zoo reads the stream, selects the readouts, computes the image and divides the image by
the rate of white. For networks with weights, add the version of the weights, such as `base v023`: Spike-Zoo downloads them.
"""

from __future__ import annotations

import contextlib
import json
import sys
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

# The answers of the server are the lines of standard output, so the messages of Spike-Zoo go to standard error.
with contextlib.redirect_stdout(sys.stderr):
    from spikezoo.models import build_model_name
    from spikezoo.utils.spike_utils import load_vidar_dat


def load_model(name: str, version: str = "local") -> Any:
    """Returns a model of Spike-Zoo. The version `local` is for methods without weights."""
    model = build_model_name(name).build_network(mode="eval", version=version)
    # The code of TFI selects CUDA, also on computers without CUDA.
    model.net.device = model.device
    return model


@torch.no_grad()
def reconstruct(model: Any, request: dict[str, Any]) -> NDArray[np.float32]:
    """Returns the image (H, W) of a request; white is 1."""
    spikes = load_vidar_dat(request["stream"], request["height"], request["width"], out_format="tensor")
    batch = {"spike": spikes[None], "rate": torch.tensor([request["white_rate"]])}
    image: NDArray[np.float32] = (
        model.get_outputs_dict(model.feed_to_device(batch))["recon_img"][0, 0].float().cpu().numpy()
    )
    return image


def serve(model: Any) -> None:
    """Answers requests until standard input ends."""
    print("ready", flush=True)
    for line in sys.stdin:
        request = json.loads(line)
        try:
            with contextlib.redirect_stdout(sys.stderr):
                np.save(request["output"], reconstruct(model, request))
            print("ok", flush=True)
        except Exception as error:  # A fault costs only the score of its sequence.
            print(" ".join(f"{type(error).__name__}: {error}".split()), flush=True)


if __name__ == "__main__":
    with contextlib.redirect_stdout(sys.stderr):
        chosen = load_model(*sys.argv[1:])
    serve(chosen)
