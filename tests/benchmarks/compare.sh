#!/usr/bin/env bash
# sdslam beside KISS-ICP, GenZ-ICP and small_gicp on the same scans in the same run.
#
#   tests/benchmarks/compare.sh real                       KITTI raw drive 0005 (90) and KITTI odometry 00, scans 0-15 (91)
#   tests/benchmarks/compare.sh simulated [NN FRAMES SEED TRAFFIC]...   along KITTI's true trajectories
#
# Needs the folder ../shared of the workplace (data, peers, simulator); says so and ends where it is not there.
# Tables go to standard output and to target/benchmarks/.
set -euo pipefail
cd "$(dirname "$0")/../.."
shared=../shared out=target/benchmarks data=target/data
[ -d "$shared/tools/peers" ] || { echo "skipped: $shared with data, peers and simulator is not here" >&2; exit 0; }
mkdir -p "$out"
[ -x target/peers-venv/bin/python ] || "$shared/tools/peers/setup.sh" target/peers-venv
cargo build --release --bin sdslam
sdslam=$PWD/target/release/sdslam

# compare DATASET SEQUENCE PEERS OPTIONS_OF_PEERS OPTIONS_OF_OURS
compare() {
    local run="$sdslam run --dataset {dataset} --sequence {seq} --threads 1 --overwrite $5"
    target/peers-venv/bin/python "$shared/tools/peers/run_peers.py" "$1" --seq "$2" --peers "$3" $4 --timeout 3000 \
        --out "$out/$(basename "$1")-$2" \
        --cmd "sdslam=$run --out {out}" --cmd-poses "sdslam={out}/$2/poses_kitti.txt:camera" \
        --cmd-ms "sdslam={out}/$2/ms.txt" --cmd-cpu "sdslam={out}/$2/cpu_ms.txt" \
        --cmd "paper=$run --preset paper --out {out}" --cmd-poses "paper={out}/$2/poses_kitti.txt:camera" \
        --cmd-ms "paper={out}/$2/ms.txt" --cmd-cpu "paper={out}/$2/cpu_ms.txt" 2>"$out/log.txt" | tee -a "$out/tables.md"
}

real() {
    python3 "$shared/data/unpack.py" "$data" >/dev/null
    for sequence in 90 91; do compare "$data" $sequence kiss-icp,genz-icp,small_gicp "" ""; done
    for program in kiss-icp genz-icp small_gicp sdslam; do
        printf '%s: ' $program
        "$sdslam" evaluate --map-entropy --dataset "$data" --sequence 90 --frames 0..150 --window 50 \
            --poses "$out/data-90/$program/90.txt" | head -1
    done | tee -a "$out/tables.md"
}

simulated() {
    local sim=target/lidarsim/release/lidarsim
    python3 "$shared/data/unpack.py" "$data" kitti_poses >/dev/null
    [ -x "$sim" ] || CARGO_TARGET_DIR=target/lidarsim cargo build --release --manifest-path "$shared/tools/lidarsim/Cargo.toml"
    while [ $# -ge 4 ]; do
        local drive="$out/$1-$2-seed$3-$4"
        [ -f "$drive/poses/$1.txt" ] || "$sim" --poses "$data/kitti_poses/gt/$1.txt" --calib "$data/kitti_poses/calib/$1.txt" \
            --sequence "$1" --frames "$2" --seed "$3" --dynamics "$4" --out "$drive" >/dev/null
        compare "$drive" "$1" kiss-icp,small_gicp --no-correct --no-elevation-correction
        grep -h -A30 '"moving"' "$out/$(basename "$drive")-$1/sdslam/$1/metrics.json" | tee -a "$out/tables.md"
        shift 4
    done
}

case ${1:-} in
    real) real ;;
    simulated)
        shift
        [ $# -gt 0 ] || set -- 07 800 21 normal 07 800 21 heavy 10 300 22 normal 10 300 22 heavy 01 300 23 normal 01 300 23 heavy
        simulated "$@"
        ;;
    *) sed -n '2,9p' "$0" && exit 2 ;;
esac
