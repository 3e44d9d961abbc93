#!/usr/bin/env bash
# Remakes small.sdr, the recording that comes with the desk simulator: 16 scans of 64 x 144 rays through traffic.
set -euo pipefail
cd "$(dirname "$0")"
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
sdslam() { cargo run --release --quiet --bin sdslam -- "$@"; }
sdslam simulate --seed 5 --columns 144 --frames 16 --speed 9 --out "$scratch"
sdslam run --dataset "$scratch" --sequence 80 --no-elevation-correction --out "$scratch/out" --record small.sdr
