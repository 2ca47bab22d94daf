"""Runs every code block of the guides in order."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest

GUIDES = Path(__file__).resolve().parents[3] / "docs" / "guides"
"""The folder with `python.md`, `training.md` and `embedding.md`."""


def run(guide: Path) -> None:
    """Runs the blocks of a page in one namespace, and skips the page if it needs torch and torch is missing."""
    if not guide.is_file():
        pytest.skip(f"{guide} is not here: the guides lie in the repository")
    blocks = re.findall(r"```python\n(.*?)```", guide.read_text(), re.DOTALL)
    assert blocks
    space: dict[str, object] = {}
    for i, block in enumerate(blocks):
        try:
            exec(compile(block, f"{guide.name}, block {i + 1}", "exec"), space)
        except ModuleNotFoundError as missing:
            if missing.name != "torch":
                raise
            pytest.skip(f"blocks {i + 1} to {len(blocks)} of {guide.name} need torch, which is not here")


def test_every_block_of_the_python_guide_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    run(GUIDES / "python.md")
    assert "fixed pattern" in capsys.readouterr().out
    picture_folder = os.environ.get("SPIKELANE_GUIDE_PICTURES")
    if picture_folder:
        for name in ("light", "tfp", "span"):
            (Path(picture_folder) / f"python-{name}.png").write_bytes((tmp_path / f"{name}.png").read_bytes())


def test_every_block_of_the_training_guide_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    os.environ.setdefault("SPIKELANE_TRAIN_SECONDS", "5")
    run(GUIDES / "training.md")
    assert "error of counting" in capsys.readouterr().out


def test_the_programs_of_the_embedding_guide_have_the_same_number_of_spikes():
    guide = GUIDES / "embedding.md"
    if not guide.is_file():
        pytest.skip(f"{guide} is not here: the guides lie in the repository")
    text = guide.read_text()
    printed = re.search(r"Each program prints ([0-9,]+) spikes", text)
    assert printed
    python = re.search(r"```python needs python:spikelane\n(.*?)```", text, re.DOTALL)
    assert python
    space: dict[str, object] = {}
    exec(compile(python[1], guide.name, "exec"), space)
    number = int(printed[1].replace(",", ""))
    assert space["spikes"].spike_count == number
    # cargo runs the Rust program as a doctest, and bindings/c/ci.sh runs the C program.
    assert f"assert_eq!(spikes.spikes(), {number:_});" in text
