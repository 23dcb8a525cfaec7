//! Memory use of this process.

/// Resident memory, if the system reports it: on Linux. [Units: bytes]
#[must_use]
pub fn held_memory() -> Option<u64> {
    of_status("VmRSS:")
}

/// Most resident memory so far, if the system reports it: on Linux. [Units: bytes]
#[must_use]
pub fn most_held_memory() -> Option<u64> {
    of_status("VmHWM:")
}

fn of_status(name: &str) -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix(name))?;
    let kilobytes: u64 = line.split_whitespace().next()?.parse().ok()?;
    Some(kilobytes << 10)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(target_os = "linux")]
    fn it_grows_with_what_is_held() {
        let before = held_memory().unwrap();
        let held = std::hint::black_box(vec![1_u8; 64 << 20]);
        let after = held_memory().unwrap();
        assert!(after > before + (48 << 20), "{before} {after}");
        drop(held);
        assert!(most_held_memory().unwrap() > before + (48 << 20));
    }
}
