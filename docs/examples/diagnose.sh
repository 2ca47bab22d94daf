#!/bin/sh
# Records a camera with a hidden effect, diagnoses the camera and writes a report. Usage: diagnose.sh [FOLDER], where FOLDER
# is ./diagnose-example by default. `spikelane` must be in the PATH.
set -eu
command -v spikelane > /dev/null || { echo "$0: cannot find spikelane in the PATH; install it with 'cargo install --path crates/cli'" >&2; exit 1; }
out=${1:-diagnose-example}
mkdir -p "$out"
spikelane preset show scsim-code > "$out/model.toml"
{
    cat "$out/model.toml"
    printf '\n[effects.hot_pixels]\nfraction = 0.01\nfactor = 8\n'
} > "$out/hidden.toml"
# A small camera limits the duration of the example to half a minute.
sed -i 's/^\[sensor\]/[sensor]\nwidth = 48\nheight = 48/' "$out/model.toml" "$out/hidden.toml"
for take in 1 2; do
    spikelane record "$out/hidden.toml" --readouts 2000 --camera-seed 9 --seed "$take" -o "$out/take$take" --force
done
spikelane diagnose "$out/take1/recordings.toml" --holdout "$out/take2/recordings.toml" -o "$out/diagnosis" --force
