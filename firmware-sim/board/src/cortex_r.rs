//! Cortex-R: start, and the clock that counts instructions. The caches and the memory protection unit stay off: an emulator
//! needs neither.

use core::arch::{asm, global_asm};

#[path = "alone.rs"]
mod alone;

// The stack, the floating-point unit, the zeroed statics.
global_asm!(
    r#"
.section .text.boot, "ax"
.arm
.global _start
_start:
    ldr sp, =_stack_start
    mrc p15, 0, r0, c1, c0, 2
    orr r0, r0, #(0xf << 20)
    mcr p15, 0, r0, c1, c0, 2
    isb
    mov r0, #0x40000000
    vmsr fpexc, r0
    ldr r0, =_bss_start
    ldr r1, =_bss_end
    mov r2, #0
1:  cmp r0, r1
    bhs 2f
    str r2, [r0], #4
    b 1b
2:  bl sdslam_main
3:  wfi
    b 3b
"#
);

#[unsafe(no_mangle)]
extern "C" fn sdslam_main() -> ! {
    // SAFETY: switches the cycle counter on: PMCR.E, PMCNTENSET.C.
    unsafe {
        asm!(
            "mcr p15, 0, {enable}, c9, c12, 0",
            "mcr p15, 0, {cycles}, c9, c12, 1",
            enable = in(reg) 1u32,
            cycles = in(reg) 1u32 << 31,
            options(nostack, nomem)
        );
    }
    crate::start().exit_process()
}

/// Instructions so far, from 0 again after 2^32: with `-icount shift=0` an instruction takes a nanosecond, and the emulated
/// cycle counter counts nanoseconds.
pub fn instructions() -> u64 {
    let cycles: u32;
    // SAFETY: reads a counter.
    unsafe { asm!("mrc p15, 0, {}, c9, c13, 0", out(reg) cycles, options(nostack, nomem)) };
    u64::from(cycles)
}

/// Instructions between two readings: right up to 4294 million.
pub fn since(before: u64, now: u64) -> u64 {
    u64::from((now as u32).wrapping_sub(before as u32))
}
