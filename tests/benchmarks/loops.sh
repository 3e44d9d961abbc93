#!/usr/bin/env bash
# Loop detection on simulated drives along KITTI's true trajectories: precision, recall, F1max, times, with the words
# of this project and with the paper's.
#
#   tests/benchmarks/loops.sh [NN FRAMES SEED]...     simulates the drives that are not there yet, then measures
#   tests/benchmarks/loops.sh --dataset DIR NN        measures on a drive with poses and labels
#
# Needs the folder ../shared of the workplace (data, simulator) to simulate; says so and ends where it is not there.
set -euo pipefail
cd "$(dirname "$0")/../.."
shared=../shared out=target/benchmarks data=target/data

measure() { # DATASET NN
    for rule in triangles bow3d; do cargo run --quiet --release --example loops -- "$1" "$2" $rule; done
}

if [ "${1:-}" = --dataset ]; then
    measure "$2" "$3"
    exit
fi
[ -d "$shared/tools/lidarsim" ] || { echo "skipped: $shared with data and simulator is not here" >&2; exit 0; }
mkdir -p "$out"
sim=target/lidarsim/release/lidarsim
python3 "$shared/data/unpack.py" "$data" kitti_poses >/dev/null
[ -x "$sim" ] || CARGO_TARGET_DIR=target/lidarsim cargo build --release --manifest-path "$shared/tools/lidarsim/Cargo.toml"
[ $# -gt 0 ] || set -- 05 2761 45 06 1101 46 07 1101 47 00 2000 40 08 4071 48
while [ $# -ge 3 ]; do
    drive="$out/$1-$2-seed$3-normal"
    [ -f "$drive/poses/$1.txt" ] || "$sim" --poses "$data/kitti_poses/gt/$1.txt" --calib "$data/kitti_poses/calib/$1.txt" \
        --sequence "$1" --frames "$2" --seed "$3" --dynamics normal --out "$drive" >/dev/null
    measure "$drive" "$1"
    shift 3
done
