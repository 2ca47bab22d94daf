#!/bin/sh
# A camera with a hidden effect, from recording to report. Needs `spikelane` in the path; takes a folder, default ./diagnose-example.
set -eu
command -v spikelane > /dev/null || { echo "$0: no spikelane in the path; cargo install --path . puts it there" >&2; exit 1; }
out=${1:-diagnose-example}
mkdir -p "$out"
spikelane preset show scsim-code > "$out/model.toml"
{
    cat "$out/model.toml"
    printf '\n[effects.hot_pixels]\nfraction = 0.008\nfactor = 8\n'
} > "$out/hidden.toml"
# The camera of the model is small here so that the example takes a minute.
sed -i 's/^\[sensor\]/[sensor]\nwidth = 64\nheight = 64/' "$out/model.toml" "$out/hidden.toml"
for take in 1 2; do
    spikelane record "$out/hidden.toml" --readouts 4000 --camera-seed 9 --seed "$take" -o "$out/take$take" --force
done
spikelane diagnose "$out/take1/recordings.toml" --holdout "$out/take2/recordings.toml" -o "$out/diagnosis" --force
