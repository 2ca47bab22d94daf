#!/usr/bin/env bash
# Kills with SIGKILL at random moments: of `dataset run` (streams, labels, packs) and of `dataset merge`. After each, nothing
# half-written may look finished, and in the end the digest has to be that of an undisturbed run.
#   crates/cli/tests/cluster/kills.sh [PROGRAM] [KILLS] [SEED] [MINUTES] > crates/cli/tests/cluster/kills.txt
set -euo pipefail
program=$(realpath "${1:-target/debug/spikelane}")
kills=${2:-1000}
place=$(mktemp -d "${TMPDIR:-/tmp}/spikelane-kills.XXXXXX")
trap 'rm -rf "$place"' EXIT
python3 "$(dirname "$0")/kills.py" "$program" "$kills" "${3:-1}" "$place" "${4:-600}"
