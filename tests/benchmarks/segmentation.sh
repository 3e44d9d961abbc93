#!/usr/bin/env bash
# Segmentation: time per stage, agreement with a SemanticKITTI network on real scans, and what it does to the SLAM.
#
#   tests/benchmarks/segmentation.sh time                 ms per stage: default model, test network, full-width SqueezeSegV2
#   tests/benchmarks/segmentation.sh real                 KITTI raw drive 0005: agreement, annotated boxes, trajectory, map, van and cyclist
#   tests/benchmarks/segmentation.sh simulated [NN FRAMES SEED]...   along KITTI's trajectories: IoU, and the SLAM's errors
#                                                         with predicted labels beside those with true ones
#
# Needs the folder ../shared of the workplace (data, test network, simulator) and says so where it is not there; SqueezeSegV2
# needs a Python with torch and onnx (PYTHON=...). OPTIONS="..." is passed to every run. Tables also go to target/benchmarks/.
set -euo pipefail
cd "$(dirname "$0")/../.."
shared=../shared out=target/benchmarks/segmentation data=target/data python=${PYTHON:-python3}
teacher=$shared/models/3dmininet_tiny_semantickitti.onnx
[ -f "$teacher" ] || { echo "skipped: $shared with data, test network and simulator is not here" >&2; exit 0; }
mkdir -p "$out"
cargo build --release --bin sdslam
sdslam() { target/release/sdslam "$@"; }

# The value of a row of a table on standard input.
row() { sed -n "s/^ *$1 *//p" | head -1; }

# segment DATASET SEQUENCE NAME [OPTIONS]: labels and times into $out/NAME
segment() {
    local name=$3 input=(--dataset "$1" --sequence "$2")
    shift 3
    sdslam segment "${input[@]}" --overwrite --out "$out/$name" "$@" | tee "$out/$name.txt" | grep -v "% of the points"
}

# run DATASET SEQUENCE NAME [OPTIONS]: the SLAM's results into $out/NAME
run() {
    local name=$3 input=(--dataset "$1" --sequence "$2")
    shift 3
    # shellcheck disable=SC2086
    sdslam run "${input[@]}" --overwrite --out "$out/$name" ${OPTIONS:-} "$@" >"$out/$name.txt"
    for what in "t_rel, r_rel" ATE lost "moving landmarks" "recall, precision" "core, CPU ms" "network, CPU ms" "kNN, CPU ms" "scans per second"; do
        printf '  %-22s %s\n' "$what" "$(row "$what" <"$out/$name.txt")"
    done
}

real_data() { python3 "$shared/data/unpack.py" "$data" >/dev/null; }

times() {
    real_data
    local nets=(default "$teacher") net
    if "$python" -c 'import torch, onnx' 2>/dev/null; then
        mkdir -p "$out/full"
        [ -f "$out/full/squeezesegv2.onnx" ] || "$python" tests/networks/make.py --full "$out/full" squeezesegv2 2>/dev/null
        nets+=("$out/full/squeezesegv2.onnx")
    else
        echo "SqueezeSegV2 is left out: $python has no torch and onnx (PYTHON=... names another)"
    fi
    for net in "${nets[@]}"; do
        echo "== $(basename "$net"), one thread"
        local options=(--threads 1 --frames 0..20)
        [ "$net" = default ] || options+=(--model "$net")
        segment "$data" 90 "time-$(basename "$net" .onnx)" "${options[@]}"
    done
}

real() {
    real_data
    echo "== default model against the test network, 90"
    segment "$data" 90 real-default
    sdslam evaluate --labels-truth "$data/sequences/90/labels" --labels-estimate "$out/real-default/90/labels"
    echo "== test network, then default model against annotated boxes"
    python3 tests/benchmarks/found_in_boxes.py "$data/sequences/90/labels_boxes" "$data/sequences/90/labels" "$out/real-default/90/labels"
    local name options
    for name in labels teacher default; do
        case $name in
            labels) options=() ;;
            teacher) options=(--model "$teacher") ;;
            default) options=(--segment) ;;
        esac
        echo "== 90 with $name"
        run "$data" 90 "real-run-$name" "${options[@]}"
        sdslam evaluate --map-entropy --dataset "$data" --sequence 90 --frames 0..150 --window 50 \
            --poses "$out/real-run-$name/90/poses_kitti.txt" | head -1
        python3 tests/benchmarks/found_movers.py "$data/sequences/90/labels_boxes" "$out/real-run-$name/90/motion"
    done
}

simulated() {
    local sim=target/lidarsim/release/lidarsim
    python3 "$shared/data/unpack.py" "$data" kitti_poses >/dev/null
    [ -x "$sim" ] || CARGO_TARGET_DIR=target/lidarsim cargo build --release --manifest-path "$shared/tools/lidarsim/Cargo.toml"
    while [ $# -ge 3 ]; do
        local name=$1-$2-seed$3 drive
        drive=target/benchmarks/$name-normal
        [ -f "$drive/poses/$1.txt" ] || "$sim" --poses "$data/kitti_poses/gt/$1.txt" --calib "$data/kitti_poses/calib/$1.txt" \
            --sequence "$1" --frames "$2" --seed "$3" --dynamics normal --out "$drive" >/dev/null
        echo "== $name with true labels"
        run "$drive" "$1" "sim-labels-$name" --no-elevation-correction
        echo "== $name with the default model"
        run "$drive" "$1" "sim-default-$name" --no-elevation-correction --segment
        echo "motion:"
        sdslam evaluate --labels-truth "$drive/sequences/$1/labels" --labels-estimate "$out/sim-labels-$name/$1/motion" | grep moving
        sdslam evaluate --labels-truth "$drive/sequences/$1/labels" --labels-estimate "$out/sim-default-$name/$1/motion"
        shift 3
    done
}

case ${1:-} in
    time) times | tee "$out/time.md" ;;
    real) real | tee "$out/real.md" ;;
    simulated)
        shift
        [ $# -gt 0 ] || set -- 10 300 22 07 800 21
        simulated "$@" | tee "$out/simulated.md"
        ;;
    *) sed -n '2,11p' "$0" && exit 2 ;;
esac
