//! What can go wrong between sensor and board, injected at random.

use oorandom::Rand64;

use crate::link::{Delivery, PowerCycle, encoded};
use crate::source::RecordedScan;

/// A kind of fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaultKind {
    /// The scan never comes.
    Drop,
    /// The scan comes twice.
    Duplicate,
    /// The end of the message is missing.
    Truncate,
    /// Some bits are flipped.
    BitFlips,
    /// Garbage comes before the message.
    Garbage,
    /// More points than the board holds.
    OverFull,
    /// The scan comes after the one behind it.
    Late,
    /// The sensor's clock is set, back or forth.
    TimeJump,
    /// The board loses its power for a moment, and all that it knows.
    Reset,
    /// The board loses its power for a moment; the last saved state is still there, one time in four damaged.
    Resume,
}

impl FaultKind {
    /// All kinds.
    pub const ALL: [Self; 10] = [
        Self::Drop,
        Self::Duplicate,
        Self::Truncate,
        Self::BitFlips,
        Self::Garbage,
        Self::OverFull,
        Self::Late,
        Self::TimeJump,
        Self::Reset,
        Self::Resume,
    ];

    /// Name for the table.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Drop => "drop",
            Self::Duplicate => "duplicate",
            Self::Truncate => "truncate",
            Self::BitFlips => "bit flips",
            Self::Garbage => "garbage",
            Self::OverFull => "over-full scan",
            Self::Late => "late scan",
            Self::TimeJump => "time jump",
            Self::Reset => "reset",
            Self::Resume => "reset, resumed",
        }
    }
}

/// Faults of one scenario: which, and in which scan.
pub type Plan = Vec<(usize, FaultKind)>;

/// One to three faults in the scans of `range`.
pub fn plan(random: &mut Rand64, range: std::ops::Range<usize>) -> Plan {
    let count = random.rand_range(1..4) as usize;
    let mut plan: Plan = (0..count)
        .map(|_| {
            let kind = FaultKind::ALL[random.rand_range(0..FaultKind::ALL.len() as u64) as usize];
            (random.rand_range(range.start as u64..range.end as u64) as usize, kind)
        })
        .collect();
    plan.sort_by_key(|(scan, kind)| (*scan, *kind as u8));
    plan.dedup();
    plan
}

/// The scans with the faults of a plan, as they arrive. `capacity` is the board's.
pub fn inject(scans: &[RecordedScan], plan: &Plan, capacity: usize, random: &mut Rand64) -> Vec<Delivery> {
    let mut line: Vec<Delivery> = Vec::new();
    let mut late = None;
    let mut clock_set_s = 0.0;
    for (index, scan) in scans.iter().enumerate() {
        let kinds: Vec<FaultKind> = plan.iter().filter(|(at, _)| *at == index).map(|(_, k)| *k).collect();
        let has = |kind| kinds.contains(&kind);
        if has(FaultKind::TimeJump) {
            clock_set_s += time_jump(random);
        }
        let mut sent = scan.clone();
        sent.stamp_s += clock_set_s;
        if has(FaultKind::OverFull) {
            over_fill(&mut sent, capacity, random);
        }
        let mut delivery = Delivery { bytes: encoded(&sent), ..Delivery::of(scan) };
        if has(FaultKind::Truncate) {
            delivery.bytes.truncate(below(random, delivery.bytes.len()));
        }
        if has(FaultKind::BitFlips) {
            flip_bits(&mut delivery.bytes, random);
        }
        if has(FaultKind::Garbage) {
            let garbage = (0..below(random, 3000)).map(|_| random.rand_u64() as u8);
            delivery.bytes.splice(0..0, garbage);
        }
        delivery.power_cycle = power_cycle(&kinds, random);
        let after = late.take();
        if has(FaultKind::Late) {
            late = Some(delivery);
        } else if !has(FaultKind::Drop) || delivery.power_cycle.is_some() {
            if has(FaultKind::Drop) {
                delivery.bytes.clear();
            }
            if has(FaultKind::Duplicate) {
                line.push(Delivery { power_cycle: None, ..delivery.clone() });
            }
            line.push(delivery);
        }
        line.extend(after);
    }
    line.extend(late);
    line
}

fn power_cycle(kinds: &[FaultKind], random: &mut Rand64) -> Option<PowerCycle> {
    if kinds.contains(&FaultKind::Reset) {
        return Some(PowerCycle::Nothing);
    }
    kinds.contains(&FaultKind::Resume).then(|| match below(random, 4) {
        0 => PowerCycle::DamagedState,
        _ => PowerCycle::SavedState,
    })
}

fn below(random: &mut Rand64, end: usize) -> usize {
    random.rand_range(0..end.max(1) as u64) as usize
}

/// Up to 1000 s, back or forth.
fn time_jump(random: &mut Rand64) -> f64 {
    let size = 10f64.powf(4.0 * random.rand_float() - 1.0);
    if random.rand_u64() & 1 == 0 { size } else { -size }
}

fn flip_bits(bytes: &mut [u8], random: &mut Rand64) {
    for _ in 0..1 + below(random, 20) {
        let at = below(random, bytes.len());
        if let Some(byte) = bytes.get_mut(at) {
            *byte ^= 1 << below(random, 8);
        }
    }
}

/// Repeats the points until there are more than the board holds.
fn over_fill(scan: &mut RecordedScan, capacity: usize, random: &mut Rand64) {
    let wanted = capacity + 1 + below(random, 1000);
    let (points, have) = (scan.points.clone(), scan.points.len());
    if have > 0 {
        scan.points = points.iter().copied().cycle().take(wanted.max(have)).collect();
    }
}
