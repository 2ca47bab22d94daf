#!/usr/bin/env bash
# The Python package: built as cargo's tests are, then pytest, stubtest, mypy and ruff in a venv of its own.
# A tool that cannot be installed is said, and what needs it is skipped.
set -euo pipefail
cd "$(dirname "$0")/../.."

skip() {
    echo "bindings/python: skipped: $*"
    exit 0
}

# Debian's interpreter sees Debian's torch; PyPI's wheel of it brings CUDA.
python=/usr/bin/python3
[ -x "$python" ] || python=$(command -v python3) || skip "no python3"
"$python" -c 'import sys; sys.exit(sys.version_info < (3, 10))' || skip "$python is older than 3.10"
venv=target/python
if [ ! -x "$venv/bin/pip" ]; then
    "$python" -m venv --system-site-packages "$venv" || skip "no venv: install python3-venv"
fi
"$venv/bin/pip" install -q 'maturin>=1.9,<2' 'numpy>=1.24' || skip "maturin or numpy could not be installed"
"$venv/bin/pip" install -q pytest || skip "pytest could not be installed"
for tool in mypy ruff; do
    "$venv/bin/pip" install -q "$tool" || echo "bindings/python: without $tool, which could not be installed"
done
"$venv/bin/python" -c 'import torch' 2>/dev/null ||
    echo "bindings/python: without torch: apt-get install python3-torch; its tests are skipped"

# The profile of the tests, so that most of what they compiled is used again.
VIRTUAL_ENV="$PWD/$venv" "$venv/bin/maturin" develop -q
export PATH="$PWD/$venv/bin:$PATH"
SPIKELANE_TRAIN_SECONDS=${SPIKELANE_TRAIN_SECONDS:-5} "$venv/bin/python" -m pytest -q -rs bindings/python/tests
if [ -x "$venv/bin/mypy" ]; then
    "$venv/bin/mypy" --config-file pyproject.toml
fi
if [ -x "$venv/bin/ruff" ]; then
    "$venv/bin/ruff" check bindings/python
    "$venv/bin/ruff" format --check bindings/python
fi
