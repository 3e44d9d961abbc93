//! Cortex-M: start, and the clock that counts instructions.

use cortex_m::peripheral::{SYST, syst::SystClkSource};

/// Instructions per tick of SysTick: with `-icount shift=0` an instruction takes a nanosecond, and the board runs at
/// 25 MHz.
const INSTRUCTIONS_PER_TICK: u64 = 40;
/// SysTick counts this many ticks down, then starts again.
const TICKS: u64 = 1 << 24;

#[cortex_m_rt::entry]
fn main() -> ! {
    if let Some(mut peripherals) = cortex_m::Peripherals::take() {
        peripherals.SYST.set_clock_source(SystClkSource::Core);
        peripherals.SYST.set_reload(TICKS as u32 - 1);
        peripherals.SYST.clear_current();
        peripherals.SYST.enable_counter();
    }
    crate::start().exit_process()
}

/// Instructions so far, from 0 again after [`TICKS`].
pub fn instructions() -> u64 {
    (TICKS - 1 - u64::from(SYST::get_current())) * INSTRUCTIONS_PER_TICK
}

/// Instructions between two readings: right up to 671 million.
pub fn since(before: u64, now: u64) -> u64 {
    let period = TICKS * INSTRUCTIONS_PER_TICK;
    if now >= before { now - before } else { now + period - before }
}
