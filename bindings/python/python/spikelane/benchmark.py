"""Benchmarks: runs a function on every sequence of a suite, and returns its scores.

>>> import spikelane as sl
>>> from spikelane import benchmark
>>> def reconstruct(sequence):
...     image = sl.tfp(sequence.read(), *sequence.shape, at=sequence.readout, half_window=10)
...     return image / sequence.white_rate
>>> scores = benchmark.evaluate(reconstruct, "quick", data="quick", output="runs/mine")  # doctest: +SKIP
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from ._errors import SpikelaneError, SpikelaneWarning, make_error
from ._native import Stream, open_stream
from ._progress import progress_callback

__all__ = ["BenchmarkScores", "BenchmarkSequence", "Score", "evaluate"]

PathLike = str | os.PathLike[str]


@dataclass(frozen=True)
class BenchmarkSequence:
    """The input of a method: a stream without labels and references."""

    path: Path
    """Path of a copy of the stream (layout ``dat``), which exists until the method returns."""
    height: int
    width: int
    readouts: int
    readout: int
    """The readout that the output belongs to, counted from 0."""
    interval: int
    """Readouts between two labeled readouts, or 0 without labels."""
    readout_hz: float
    """Readouts per second."""
    white_rate: float
    """Spikes per readout of a pixel with the light 1."""
    mosaic: dict[str, Any] | None = None
    """The ``pattern`` of a color camera, and of each channel the ``weights`` of linear red, green and blue and the light for
    ``white``. None for a gray camera."""

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width."""
        return self.height, self.width

    def read(self) -> NDArray[np.uint8]:
        """Returns all readouts in packed form, as ``Stream[:]`` does."""
        with self.open() as stream:
            return stream[:]

    def read_dense(self) -> NDArray[np.uint8]:
        """Returns all readouts as zeros and ones with the shape (readouts, height, width)."""
        with self.open() as stream:
            return stream.read_dense()

    def open(self) -> Stream:
        """Opens the stream. Use the result in a ``with`` block."""
        return open_stream(self.path, layout="dat", height=self.height, width=self.width)


Method = Callable[[BenchmarkSequence], Any]
"""A function that returns the output of a sequence.

Reconstructions have the shape (height, width), color images have (height, width, 3), flow has (height, width, 2), and depth
has (height, width). Detections and tracks are lists of dictionaries, as the reference of benchmarks defines them.
"""


@dataclass(frozen=True)
class Score:
    """A score with its 95 % interval. The ends are NaN if there are too few sequences."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class BenchmarkScores:
    """The scores of a method. ``path`` is the score file, which ``spikelane benchmark report`` compares with others."""

    path: Path
    suite: str
    digest: str
    groups: dict[str, dict[str, Score]]
    """The scores of each group by the name of the metric. The group ``overall`` contains all scored splits."""
    faults: dict[str, str]
    """The sequences with the scores of the trivial answer, as ``group/id``, and the reason of each."""
    report: dict[str, Any]
    """The content of the score file."""

    @property
    def overall(self) -> dict[str, Score]:
        return self.groups["overall"]

    @classmethod
    def read(cls, path: PathLike) -> BenchmarkScores:
        """Reads a score file."""
        report = json.loads(Path(path).read_text(encoding="utf-8"))
        groups = {
            group["group"]: {name: _score(metric["pooled"]) for name, metric in group["metrics"].items()}
            for group in report["summaries"]
        }
        faults = {f"{s['group']}/{s['id']}": s["fault"] for s in report["sequences"] if s.get("fault")}
        return cls(Path(path), report["suite"], report["digest"], groups, faults, report)

    def __repr__(self) -> str:
        scores = ", ".join(f"{name} {score.value:.4g}" for name, score in self.overall.items())
        return f"BenchmarkScores({self.suite!r}, {scores}, faults={len(self.faults)})"


def _score(data: dict[str, Any]) -> Score:
    low, high = data.get("interval") or (float("nan"), float("nan"))
    return Score(data["value"], low, high)


def evaluate(
    method: Method,
    suite: PathLike = "quick",
    *,
    data: PathLike,
    output: PathLike,
    name: str | None = None,
    time_limit: float = 60.0,
    resume: bool = False,
    progress: bool = False,
) -> BenchmarkScores:
    """Runs ``method`` on every sequence of ``suite`` and scores its outputs.

    ``suite`` is the name of a suite or the path of a suite file. ``data`` is the folder of the generated suite. If the folder
    does not exist, the suite is generated there; an interrupted generation continues. ``output`` is the folder of the run: it
    receives the outputs and ``score.json``. With ``resume``, an interrupted run continues.

    If ``method`` raises an exception, returns a faulty output or needs more than ``time_limit`` seconds, only this sequence
    is affected: it has the scores of the trivial answer. KeyboardInterrupt ends the run, and finished sequences remain.

    ``name`` is the name of the method in reports (default: the name of the function). ``progress`` draws a bar if tqdm is
    installed.

    Raises SpikelaneError if the suite or a folder is invalid.
    """
    data, output = Path(data), Path(output)
    name = name or getattr(method, "__qualname__", type(method).__name__)
    if not (data / "suite.json").is_file():
        resumed = ["--resume"] if data.exists() else []
        _run(["generate", os.fspath(suite), "-o", os.fspath(data), *resumed], _no_answer, progress)
    _require_suite(data, suite)
    arguments = ["run", os.fspath(data), "-o", os.fspath(output), f"--caller={name}", f"--time-limit={time_limit}"]
    _run([*arguments, *(["--resume"] if resume else [])], lambda request: _answer(method, request), progress)
    return BenchmarkScores.read(output / "score.json")


def _require_suite(data: Path, suite: PathLike) -> None:
    """Raises SpikelaneError if the folder contains another suite than the named one."""
    found = json.loads((data / "suite.json").read_text(encoding="utf-8"))["name"]
    text = os.fspath(suite)
    is_file = Path(text).suffix == ".toml"
    if is_file and (data / "suite.toml").read_bytes() != Path(text).read_bytes():
        raise SpikelaneError(f"'{data}' contains a suite that differs from '{text}': choose another folder for data")
    if not is_file and found != text:
        raise SpikelaneError(
            f"'{data}' contains the suite '{found}', expected '{text}': choose another folder for data"
        )


def _no_answer(request: dict[str, Any]) -> str:
    raise AssertionError(request)


def _run(arguments: list[str], answer: Callable[[dict[str, Any]], str], progress: bool) -> None:
    """Runs the program, answers its requests, and raises SpikelaneError if it fails."""
    command = [sys.executable, "-m", "spikelane", "benchmark", *arguments, "--json"]
    update = progress_callback(progress, "sequences")
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, encoding="utf-8"
    ) as program:
        assert program.stdin is not None and program.stdout is not None
        failure: dict[str, Any] = {}
        for message in _messages(program.stdout):
            if "event" not in message:
                # The program reports why it ended. A closed pipe adds nothing.
                try:
                    program.stdin.write(answer(message) + "\n")
                    program.stdin.flush()
                except BrokenPipeError:
                    pass
            elif message["event"] == "error":
                failure = message
            elif message["event"] in ("done", "scores"):
                for note in message.get("notes", ()):
                    warnings.warn(note, SpikelaneWarning, stacklevel=3)
            elif message["event"] == "progress" and update and "sequences" in message:
                update(message["sequences"], message["total"])
    if program.returncode:
        text = failure.get("message", f"the program ended with the code {program.returncode}")
        raise make_error(text, (failure.get("kind", ""), "", "", "", ""), None, False)


def _messages(lines: IO[str]) -> Iterator[dict[str, Any]]:
    return (json.loads(line) for line in lines)


def _answer(method: Method, request: dict[str, Any]) -> str:
    """Runs the method, writes its output and returns the answer to a request, in one line."""
    output = Path(request.pop("output"))
    sequence = BenchmarkSequence(path=Path(request.pop("stream")), **request)
    try:
        _write(output, method(sequence))
    except Exception as error:
        return " ".join(f"{type(error).__name__}: {error}".split())
    return "ok"


def _write(path: Path, result: Any) -> None:
    if path.suffix == ".json":
        path.write_text(json.dumps(result), encoding="utf-8")
        return
    array: NDArray[Any] = np.asarray(result)
    if not np.issubdtype(array.dtype, np.number) or np.iscomplexobj(array):
        raise TypeError(f"the output has the type {array.dtype}, expected real numbers")
    with path.open("wb") as file:
        element = np.float64 if array.dtype == np.float64 else np.float32
        np.save(file, np.ascontiguousarray(array, dtype=element), allow_pickle=False)
