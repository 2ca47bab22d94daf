"""Progress: a callback, or a bar where tqdm is installed."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

Callback = Callable[[float, float], object]


@contextmanager
def bar(progress: Callback | bool | None, unit: str) -> Iterator[Callback | None]:
    """What the library calls with (done, total): `progress` itself, or tqdm's bar for True.

    Without tqdm True shows nothing: a bar is a convenience, and no reason to fail.
    """
    if progress is None or progress is False:
        yield None
        return
    if progress is not True:
        yield progress
        return
    try:
        from tqdm.auto import tqdm
    except ImportError:
        yield None
        return
    with tqdm(unit=unit) as shown:

        def tell(done: float, total: float) -> None:
            shown.total = total
            shown.update(done - shown.n)

        yield tell
