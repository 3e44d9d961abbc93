#!/usr/bin/env bash
# Builds the firmware, runs it on emulated boards, and compares every answer with the desk's, bit for bit. Prints the
# instructions of each stage, the peak stack and the memory of each section.
#
#   run.sh [--profile full|landmark] [--boards "m7 a53"] [--scans N] [RECORDING]
#
# Without a recording it makes one of N (20) real-size scans through traffic; for the landmark profile, of scans that fit it.
# setup.sh gets what is missing; after `setup.sh --r5` there may be a third board, r5 (Cortex-R5). Fails when a bit
# differs, when a panic can be reached from the hot path, when there is a heap, and when stack, static memory or time of a
# scan are above the limits.
set -euo pipefail

profile=full boards="m7 a53" scans=20 recording=
while [ $# -gt 0 ]; do
    case $1 in
        --profile) profile=$2; shift 2 ;;
        --boards) boards=$2; shift 2 ;;
        --scans) scans=$2; shift 2 ;;
        -*) sed -n '2,10s/^# \?//p' "$0"; exit 2 ;;
        *) recording=$(realpath "$1"); shift ;;
    esac
done
# Static memory of the program [bytes], and the boards on which a scan must take 100 ms at most.
case $profile in
    full) features="" columns=2083 memory_bytes=$((16 << 20)) timely="a53" ;;
    landmark) features="landmark" columns=128 memory_bytes=$((1 << 20)) timely="m7 a53" ;;
    *) echo "no profile is named $profile" >&2; exit 2 ;;
esac
# The largest stack that a scan may need.
STACK_BYTES=32768
SCAN_MS=100

cd "$(dirname "$0")/../.."
# shellcheck source=firmware-sim/board/r5_core.sh
. firmware-sim/board/r5_core.sh
export PATH="$PATH:${CARGO_HOME:-$HOME/.cargo}/bin"
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
fail() { printf 'failed: %s\n' "$*" >&2; exit 1; }
build=$(realpath -m "${CARGO_TARGET_DIR:-target}")/board
case " $boards " in
    *" r5 "*) r5_core=$(r5_core "$build") || fail "there is no core library for the Cortex-R5 (see setup.sh --r5)" ;;
esac

desk() { cargo run --release --quiet --bin sdslam-firmware-sim -- "$@"; }
host() { cargo run --release --quiet --bin sdslam -- "$@"; }

record() {
    host simulate --seed 6 --frames "$scans" --columns $columns --out "$scratch/drive"
    host run --dataset "$scratch/drive" --sequence 80 --no-elevation-correction --out "$scratch/out" \
        --record "$1" >/dev/null
}

# Target, clock [MHz] and machine of a board.
describe() {
    case $1 in
        m7)
            target=thumbv7em-none-eabihf mhz=480
            machine=(qemu-system-arm -M mps2-an500 -cpu cortex-m7)
            ;;
        a53)
            target=aarch64-unknown-none mhz=1000
            machine=(qemu-system-aarch64 -M virt -cpu cortex-a53 -m 128M -nic none)
            ;;
        r5)
            target=$r5_target mhz=1000
            machine=(env QEMU_AUDIO_DRV=none qemu-system-arm -M versatileab -cpu cortex-r5f -m 128M -nic none)
            ;;
        *) fail "no board is named $1" ;;
    esac
}

# Builds a program of the board: build_program NAME FEATURES
build_program() (
    export CARGO_TARGET_DIR=$build DEFMT_LOG=info
    extra=()
    if [ "$target" = "$r5_target" ] && [ "$r5_core" != target ]; then
        extra=(-Zbuild-std=core)
        export RUSTC_BOOTSTRAP=1 __CARGO_TESTS_ONLY_SRC_ROOT=$r5_core
    fi
    cd firmware-sim/board && cargo build --release --quiet --target $target --bin "$1" --features "$2" "${extra[@]}"
)

# The rows of the table of instructions, from the log; fails when a scan takes more than the last argument [ms].
instructions() {
    awk -v board="$1" -v mhz="$2" -v limit_ms="$4" '
        / instructions \[/ {
            scans++
            gsub(/[][,]/, " ")
            for (first = 1; $first != "instructions"; first++) { }
            sum = 0
            for (k = 1; k <= 9; k++) { total[k] += $(first + k); sum += $(first + k) }
            for (k = 1; k <= 9; k++) if ($(first + k) > most[k]) most[k] = $(first + k)
            all += sum
            if (sum > largest) largest = sum
        }
        END {
            if (!scans) exit 1
            split("wire_decode label_filter instances landmarks preliminary_pose motion_state precise_pose submap publish", name)
            printf "%-22s%14s%14s\n", "instructions, " board, "mean [10^6]", "max [10^6]"
            for (k = 1; k <= 9; k++) printf "%-22s%14.3f%14.3f\n", name[k], total[k] / scans / 1e6, most[k] / 1e6
            printf "%-22s%14.3f%14.3f\n", "a scan in all", all / scans / 1e6, largest / 1e6
            printf "at %d MHz and one instruction a cycle: %.1f ms mean, %.1f ms max\n", mhz, all / scans / mhz / 1e3, largest / mhz / 1e3
            exit largest / mhz / 1e3 > limit_ms
        }' "$3"
}

check_symbols() {
    if readelf --wide --symbols "$1" | grep -E '__rust_alloc|__rg_alloc|alloc::alloc|\bmalloc\b|_ZN5alloc|_RN.*5alloc'; then
        fail "there is a heap in the program"
    fi
    echo "no symbol of a heap"
}

# The bytes of every section; fails when the memory of the program, the stack left out, is above the profile's limit.
check_sections() {
    local name size memory=0
    printf '%-22s%14s\n' "section" "bytes"
    while read -r name _ _ _ size _; do
        case $name in
            .vector_table | .text | .rodata | .data | .bss | .external) printf '%-22s%14d\n' "$name" $((16#$size)) ;;
        esac
        case $name in
            .data | .bss | .external) memory=$((memory + 16#$size)) ;;
        esac
    done < <(readelf --wide --sections "$1" | sed 's/^ *\[ *[0-9]*\] //')
    printf '%-22s%14d\n' "static memory" "$memory"
    [ "$memory" -gt 0 ] && [ "$memory" -le "$memory_bytes" ] ||
        fail "static memory is $memory bytes, the limit is $memory_bytes"
}

# Runs a program in a folder; its answers and its log are there afterwards.
emulate() {
    local folder=$1 elf=$2
    # An instruction takes a nanosecond of the emulator's time, which is how the program counts them.
    (cd "$folder" && timeout 3000 "${machine[@]}" -nographic -monitor none -serial none -icount shift=0 \
        -semihosting-config enable=on,target=native -kernel "$elf" >log.defmt) ||
        { defmt-print -e "$elf" <"$folder/log.defmt" | tail -5; fail "the program did not end well"; }
    defmt-print -e "$elf" <"$folder/log.defmt" >"$folder/log.txt"
    grep -vE " instructions \[" "$folder/log.txt" || true
}

try_board() {
    local board=$1 folder=$scratch/$1 elf stack limit_ms=1e9
    describe "$board"
    mkdir "$folder"
    ln -s "$recording" "$folder/recording.sdr"
    printf '\n== %s, profile %s ==\n' "$board" "$profile"
    build_program vehicle "$features"
    # Links only when no panic can be reached from the wire decoder and from process_scan.
    build_program proof "prove $features" || fail "a panic can be reached from the hot path"
    echo "no panic can be reached from the wire decoder and process_scan (link-time proof)"
    elf=$build/$target/release/vehicle
    check_symbols "$elf"
    emulate "$folder" "$elf"
    desk compare "$scratch/desk.sda" "$folder/answers.sda" || fail "$board gives other bits than the desk"
    case " $timely " in *" $board "*) limit_ms=$SCAN_MS ;; esac
    instructions "$board" $mhz "$folder/log.txt" $limit_ms || fail "a scan takes more than $limit_ms ms"
    stack=$(sed -n 's/.*peak stack \([0-9]*\) bytes.*/\1/p' "$folder/log.txt")
    [ "${stack:-$((STACK_BYTES + 1))}" -le $STACK_BYTES ] || fail "the stack grew to $stack bytes"
    check_sections "$elf"
}

if [ -z "$recording" ]; then
    recording=$scratch/made.sdr
    record "$recording"
fi
desk replay "$recording" --profile "$profile" --answers "$scratch/desk.sda" >"$scratch/desk.txt"
grep "scans," "$scratch/desk.txt"
[ "$profile" = full ] || desk fit "$recording" --profile "$profile" | tail -n 1
for board in $boards; do
    try_board "$board"
done
