"""Progress: a callback, or a bar where tqdm is installed."""

from __future__ import annotations

from collections.abc import Callable

ProgressCallback = Callable[[float, float], object]


def progress_callback(wanted: bool, unit: str) -> ProgressCallback | None:
    """What the native half calls with (done, total) for `progress=True`: tqdm's bar, closed at the end.

    Without tqdm it is None: a bar is a convenience, and no reason to fail.
    """
    if not wanted:
        return None
    try:
        from tqdm.auto import tqdm
    except ImportError:
        return None
    shown = tqdm(unit=unit)

    def update_bar(done: float, total: float) -> None:
        shown.total = total
        shown.update(done - shown.n)
        if done >= total:
            shown.close()

    return update_bar
