"""Every block of the guide runs, in its order."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest

GUIDE = Path(__file__).resolve().parents[3] / "docs" / "guides" / "python.md"


def test_every_block_of_the_guide_runs(tmp_path, monkeypatch, capsys):
    if not GUIDE.is_file():
        pytest.skip(f"{GUIDE} is not here: the guide lies in the repository")
    monkeypatch.chdir(tmp_path)
    os.environ.setdefault("SPIKELANE_TRAIN_SECONDS", "5")
    blocks = re.findall(r"```python\n(.*?)```", GUIDE.read_text(), re.DOTALL)
    assert len(blocks) >= 8
    space: dict[str, object] = {}
    for i, block in enumerate(blocks):
        try:
            exec(compile(block, f"{GUIDE.name}, block {i + 1}", "exec"), space)
        except ModuleNotFoundError as missing:
            if missing.name != "torch":
                raise
            pytest.skip(f"blocks {i + 1} to {len(blocks)} need torch, which is not here")
    said = capsys.readouterr().out
    assert "error of counting" in said
    kept = os.environ.get("SPIKELANE_GUIDE_PICTURES")
    if kept:
        for name in ("light", "tfp", "span"):
            (Path(kept) / f"python-{name}.png").write_bytes((tmp_path / f"{name}.png").read_bytes())
