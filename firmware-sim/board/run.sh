#!/usr/bin/env bash
# Builds the firmware, runs it on emulated boards, and compares every answer with the desk's, bit for bit. Prints the
# instructions of each stage, the peak stack and the memory of each section.
#
#   run.sh [--profile full|landmark] [--boards "m7 a53"] [RECORDING]
#
# Without a recording it makes one of 20 real-size scans (landmark: of scans that fit the profile). setup.sh gets what is
# missing.
set -euo pipefail

profile=full boards="m7 a53" recording=
while [ $# -gt 0 ]; do
    case $1 in
        --profile) profile=$2; shift 2 ;;
        --boards) boards=$2; shift 2 ;;
        -*) sed -n '2,8s/^# \?//p' "$0"; exit 2 ;;
        *) recording=$(realpath "$1"); shift ;;
    esac
done
case $profile in
    full) features="" ;;
    landmark) features="--features landmark" ;;
    *) echo "no profile is named $profile" >&2; exit 2 ;;
esac

cd "$(dirname "$0")/../.."
export PATH="$PATH:${CARGO_HOME:-$HOME/.cargo}/bin"
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
fail() { printf 'failed: %s\n' "$*" >&2; exit 1; }
build=$(realpath -m "${CARGO_TARGET_DIR:-target}")/board
# The largest stack that a scan may need.
STACK_BYTES=32768

desk() { cargo run --release --quiet -p sdslam-firmware-sim -- "$@"; }
host() { cargo run --release --quiet -p sdslam -- "$@"; }

if [ -z "$recording" ]; then
    recording=$scratch/made.sdr
    columns=2083
    [ "$profile" = landmark ] && columns=128
    host simulate --seed 6 --frames 20 --columns $columns --out "$scratch/drive"
    host run --dataset "$scratch/drive" --sequence 80 --no-elevation-correction --out "$scratch/out" \
        --record "$recording" >/dev/null
fi

desk replay "$recording" --profile "$profile" --answers "$scratch/desk.sda" >"$scratch/desk.txt"
grep "scans," "$scratch/desk.txt"

# Rows of the table of instructions, from the log.
instructions() {
    awk -v board="$1" -v mhz="$2" '
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
            split("wire_decode label_filter instances landmarks preliminary_pose motion_state precise_pose submap publish", name)
            printf "%-22s%14s%14s\n", "instructions, " board, "mean [10^6]", "max [10^6]"
            for (k = 1; k <= 9; k++) printf "%-22s%14.3f%14.3f\n", name[k], total[k] / scans / 1e6, most[k] / 1e6
            printf "%-22s%14.3f%14.3f\n", "a scan in all", all / scans / 1e6, largest / 1e6
            printf "at %d MHz and one instruction a cycle: %.1f ms mean, %.1f ms max\n", mhz, all / scans / mhz / 1e3, largest / mhz / 1e3
        }' "$3"
}

for board in $boards; do
    case $board in
        m7)
            target=thumbv7em-none-eabihf mhz=480
            machine=(qemu-system-arm -M mps2-an500 -cpu cortex-m7)
            ;;
        a53)
            target=aarch64-unknown-none mhz=1000
            machine=(qemu-system-aarch64 -M virt -cpu cortex-a53 -m 128M -nic none)
            ;;
        *) fail "no board is named $board" ;;
    esac
    folder=$scratch/$board
    mkdir "$folder"
    ln -s "$recording" "$folder/recording.sdr"
    printf '\n== %s, profile %s ==\n' "$board" "$profile"
    # shellcheck disable=SC2086
    (cd firmware-sim/board &&
        DEFMT_LOG=info CARGO_TARGET_DIR=$build cargo build --release --quiet --target $target --bin vehicle $features)
    # Links only when no panic can be reached from the wire decoder and from process_scan.
    (cd firmware-sim/board &&
        CARGO_TARGET_DIR=$build cargo build --release --quiet --target $target --bin proof --features prove) ||
        fail "a panic can be reached from the hot path"
    echo "no panic can be reached from the wire decoder and process_scan (link-time proof)"
    elf=$build/$target/release/vehicle

    symbols=$(readelf --wide --symbols "$elf")
    if grep -E '__rust_alloc|__rg_alloc|alloc::alloc|\bmalloc\b|_ZN5alloc' <<<"$symbols"; then
        fail "there is a heap in the program"
    fi
    echo "no symbol of a heap"

    # An instruction takes a nanosecond of the emulator's time, which is how the program counts them.
    (cd "$folder" && timeout 1800 "${machine[@]}" -nographic -monitor none -serial none -icount shift=0 \
        -semihosting-config enable=on,target=native -kernel "$elf" >log.defmt) ||
        { defmt-print -e "$elf" <"$folder/log.defmt" | tail -5; fail "the program did not end well"; }
    defmt-print -e "$elf" <"$folder/log.defmt" >"$folder/log.txt"
    grep -vE " instructions \[" "$folder/log.txt" || true
    desk compare "$scratch/desk.sda" "$folder/answers.sda" || fail "$board gives other bits than the desk"
    instructions $board $mhz "$folder/log.txt"

    stack=$(sed -n 's/.*peak stack \([0-9]*\) bytes.*/\1/p' "$folder/log.txt")
    [ "${stack:-$((STACK_BYTES + 1))}" -le $STACK_BYTES ] || fail "the stack grew to $stack bytes"
    printf '%-22s%14s\n' "section" "bytes"
    readelf --wide --sections "$elf" | sed 's/^ *\[ *[0-9]*\] //' | while read -r name _ _ _ size _; do
        case $name in
            .vector_table | .text | .rodata | .data | .bss | .external) printf '%-22s%14d\n' "$name" $((16#$size)) ;;
        esac
    done
done
