//! Cortex-A in AArch64: start, and the clock that counts instructions. The caches and the memory management unit stay off:
//! an emulator needs neither.

use core::arch::{asm, global_asm};

#[path = "alone.rs"]
mod alone;

/// Instructions per tick of the generic timer: with `-icount shift=0` an instruction takes a nanosecond, and the timer
/// runs at 62.5 MHz.
const INSTRUCTIONS_PER_TICK: u64 = 16;

// The stack, the floating-point unit, the zeroed statics.
global_asm!(
    r#"
.section .text.boot, "ax"
.global _start
_start:
    ldr x0, =_stack_start
    mov sp, x0
    mov x0, #(3 << 20)
    msr cpacr_el1, x0
    isb
    ldr x0, =_bss_start
    ldr x1, =_bss_end
1:  cmp x0, x1
    b.hs 2f
    str xzr, [x0], #8
    b 1b
2:  bl sdslam_main
3:  wfe
    b 3b
"#
);

#[unsafe(no_mangle)]
extern "C" fn sdslam_main() -> ! {
    crate::start().exit_process()
}

/// Instructions so far.
pub fn instructions() -> u64 {
    let ticks: u64;
    // SAFETY: reads a counter.
    unsafe { asm!("isb", "mrs {}, cntvct_el0", out(reg) ticks, options(nostack, nomem)) };
    ticks * INSTRUCTIONS_PER_TICK
}

/// Instructions between two readings.
pub fn since(before: u64, now: u64) -> u64 {
    now.saturating_sub(before)
}
