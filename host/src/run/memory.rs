//! What the process has taken from the system.

/// The most resident memory this process has held so far \[KiB\]; none where there is no Linux to tell it.
pub(super) fn peak_kib() -> Option<u64> {
    peak_of(&std::fs::read_to_string("/proc/self/status").ok()?)
}

/// The entry `VmHWM` of a `/proc/.../status`.
fn peak_of(status: &str) -> Option<u64> {
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.split_whitespace().next()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::peak_of;

    #[test]
    fn the_peak_is_read_and_not_the_present_size() {
        let status = "Name:\tsdslam\nVmPeak:\t  900 kB\nVmHWM:\t  512 kB\nVmRSS:\t  100 kB\n";
        assert_eq!(peak_of(status), Some(512));
        assert_eq!(peak_of("Name:\tsdslam\n"), None);
    }
}
