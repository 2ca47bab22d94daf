"""Progress reports: a callback, or a bar if tqdm is installed."""

from __future__ import annotations

from collections.abc import Callable

ProgressCallback = Callable[[float, float], object]


def progress_callback(enabled: bool, unit: str) -> ProgressCallback | None:
    """Returns a callback (done, total) that draws a tqdm bar and closes the bar at the end.

    Returns None if ``enabled`` is false or tqdm is not installed, because a missing bar is no error.
    """
    if not enabled:
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
