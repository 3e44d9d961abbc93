#!/usr/bin/env bash
# The back end on simulated drives along KITTI's true trajectories.
#
#   tests/benchmarks/loops_and_maps.sh slam [NN FRAMES SEED]...      ATE with and without loops, beside KISS-SLAM
#   tests/benchmarks/loops_and_maps.sh wrong [NN FRAMES SEED]...     the detector proposes all it has: which test refuses what
#   tests/benchmarks/loops_and_maps.sh long [NN FRAMES SEED]...      5,000 scans there and back again: time and memory
#   tests/benchmarks/loops_and_maps.sh maps [NN FRAMES SEED]...      what of the true static and moving points is in the map,
#                                                                    with true labels and with those of the built-in model
#   tests/benchmarks/loops_and_maps.sh localise [NN FRAMES SEED]...  the same street with other traffic and other parked cars:
#                                                                    the frames from SPLIT on in a map of those before
#
# Needs the folder ../shared of the workplace (data, peers, simulator); says so and ends where it is not there.
set -euo pipefail
cd "$(dirname "$0")/../.."
shared=../shared out=target/benchmarks data=target/data
[ -d "$shared/tools/lidarsim" ] || { echo "skipped: $shared with data, peers and simulator is not here" >&2; exit 0; }
mkdir -p "$out"
sim=target/lidarsim/release/lidarsim
python3 "$shared/data/unpack.py" "$data" kitti_poses >/dev/null
[ -x "$sim" ] || CARGO_TARGET_DIR=target/lidarsim cargo build --release --manifest-path "$shared/tools/lidarsim/Cargo.toml"
# --workspace: with -p, cargo builds other features of tract anew.
cargo build --release --workspace --bin sdslam --example maps
sdslam=$PWD/target/release/sdslam maps=$PWD/target/release/examples/maps
what=${1:-}
shift || true

# simulate DRIVE NN FRAMES OPTIONS...
simulate() {
    local drive=$1 sequence=$2 frames=$3
    shift 3
    [ -f "$drive/poses/$sequence.txt" ] || "$sim" --poses "$data/kitti_poses/gt/$sequence.txt" \
        --calib "$data/kitti_poses/calib/$sequence.txt" --sequence "$sequence" --frames "$frames" --dynamics normal \
        --out "$drive" "$@" >/dev/null
}

# run DATASET NN OUT OPTIONS...: prints the table's rows on loops and errors
run() {
    local dataset=$1 sequence=$2 to=$3
    shift 3
    "$sdslam" run --dataset "$dataset" --sequence "$sequence" --out "$to" --overwrite --no-elevation-correction "$@" |
        grep -E '^(ATE|t_rel|loops|scans per second|back end|peak memory|map )'
}

slam() { # NN FRAMES SEED
    local drive="$out/$1-$2-seed$3-normal"
    simulate "$drive" "$1" "$2" --seed "$3"
    [ -x target/peers-venv/bin/python ] || "$shared/tools/peers/setup.sh" target/peers-venv
    local ours="$sdslam run --dataset {dataset} --sequence {seq} --threads 2 --overwrite --no-elevation-correction --out {out}"
    target/peers-venv/bin/python "$shared/tools/peers/run_peers.py" "$drive" --seq "$1" --peers kiss-slam --no-correct \
        --no-pin --timeout 20000 --out "$out/slam-$1-$2-seed$3" --cmd "sdslam=$ours" \
        --cmd-poses "sdslam={out}/$1/poses_kitti.txt:camera" --cmd-ms "sdslam={out}/$1/ms.txt" 2>"$out/log.txt"
    grep -A99 '"trajectory_odometry"' "$out/slam-$1-$2-seed$3/sdslam/$1/metrics.json" | grep -m1 ate_m | sed 's/^/without loops: /'
    "$maps" loops "$out/slam-$1-$2-seed$3/sdslam/$1" "$drive" "$1"
}

# Every place that has a few triangles in common is proposed, so that nearly all proposals are wrong; the tests of the back
# end are as ever.
wrong() { # NN FRAMES SEED
    local drive="$out/$1-$2-seed$3-normal" to="$out/wrong-$1-$2-seed$3"
    simulate "$drive" "$1" "$2" --seed "$3"
    mkdir -p "$to"
    cat >"$to/open.toml" <<'TOML'
[loop_closure]
min_inliers = 4
min_score = 0.0
max_runner_up = 1.0
[loops]
max_candidates = 4
TOML
    run "$drive" "$1" "$to" --config "$to/open.toml"
    "$maps" loops "$to/$1" "$drive" "$1"
}

# A vehicle that backs up along its own path: no step between two scans is longer than in the drive itself.
long() { # NN FRAMES SEED
    local drive="$PWD/$out/$1-$2-seed$3-normal" to="$out/long-$1-$2-seed$3" scans=${SCANS:-5000} n frame from to_file
    simulate "$drive" "$1" "$2" --seed "$3"
    local sequence="$to/data/sequences/$1"
    rm -rf "$to/data"
    mkdir -p "$sequence/velodyne" "$sequence/labels"
    cp "$drive/sequences/$1/calib.txt" "$sequence/"
    for ((n = 0; n < scans; n++)); do
        frame=$((n % (2 * $2 - 2)))
        if [ $frame -ge "$2" ]; then frame=$((2 * $2 - 2 - frame)); fi
        printf -v from '%06d' $frame
        printf -v to_file '%06d' $n
        ln -s "$drive/sequences/$1/velodyne/$from.bin" "$sequence/velodyne/$to_file.bin"
        ln -s "$drive/sequences/$1/labels/$from.label" "$sequence/labels/$to_file.label"
    done
    awk -v scans="$scans" 'BEGIN { for (n = 0; n < scans; n++) printf "%.6f\n", n / 10 }' >"$sequence/times.txt"
    run "$to/data" "$1" "$to" --threads 2
    echo "mean CPU ms per scan, by fifths of the drive: core, back end, largest of the back end"
    paste "$to/$1/cpu_ms.txt" "$to/$1/back_end_cpu_ms.txt" | awk -v scans="$scans" '
        { k = int((NR - 1) * 5 / scans); n[k]++; core[k] += $1; back[k] += $2; if ($2 > most[k]) most[k] = $2 }
        END { for (k = 0; k < 5; k++) printf "%.1f %.1f %.1f\n", core[k] / n[k], back[k] / n[k], most[k] }'
}

maps() { # NN FRAMES SEED
    local drive="$out/$1-$2-seed$3-normal"
    simulate "$drive" "$1" "$2" --seed "$3"
    run "$drive" "$1" "$out/maps-$1-$2-seed$3"
    "$maps" points "$out/maps-$1-$2-seed$3/$1" "$drive" "$1"
    echo "with the labels of the built-in model:"
    run "$drive" "$1" "$out/maps-model-$1-$2-seed$3" --segment
    "$maps" points "$out/maps-model-$1-$2-seed$3/$1" "$drive" "$1"
}

# Parked cars change between two passes of a street, so the map is of the first pass and the drive is the second one.
localise() { # NN FRAMES SEED
    local drive="$out/$1-$2-seed$3-normal" other="$out/$1-$2-seed$3-other" to="$out/localise-$1-$2-seed$3"
    local split=${SPLIT:-830} tries=0 found=0
    simulate "$drive" "$1" "$2" --seed "$3"
    simulate "$other" "$1" "$2" --world-seed "$3" --traffic-seed $(($3 + 1)) --noise-seed $(($3 + 2))
    run "$drive" "$1" "$to/map" --save-map "$to/street.map" --frames "0..$split"
    local common=(--map "$to/street.map" --dataset "$other" --sequence "$1" --overwrite --no-elevation-correction)
    "$sdslam" localize "${common[@]}" --out "$to/drive" --frames "$split..$2"
    "$maps" localised "$to/drive/$1" "$other" "$1" "$to/map/$1" "$drive"
    for ((first = split; first + 25 <= $2; first += 10)); do
        "$sdslam" localize "${common[@]}" --out "$to/global" --frames "$first..$((first + 25))" >"$to/table.txt"
        tries=$((tries + 1))
        after=$(awk '/^found after/ {print $3}' "$to/table.txt")
        [ -n "$after" ] || continue
        if [ "$after" -le 20 ]; then found=$((found + 1)); fi
        "$maps" localised "$to/global/$1" "$other" "$1" "$to/map/$1" "$drive" | sed "s/^/from $first, after $after: /"
    done
    echo "global start: found within 20 scans in $found of $tries tries"
}

case $what in
    slam) [ $# -gt 0 ] || set -- 06 1101 46 07 1101 47 05 2761 45 00 2000 40 08 4071 48 ;;
    wrong | long) [ $# -gt 0 ] || set -- 07 1101 47 ;;
    maps) [ $# -gt 0 ] || set -- 07 1101 47 10 300 22 ;;
    localise) [ $# -gt 0 ] || set -- 06 1101 46 ;;
    *) sed -n '2,12p' "$0" && exit 2 ;;
esac
while [ $# -ge 3 ]; do
    "$what" "$1" "$2" "$3"
    shift 3
done
