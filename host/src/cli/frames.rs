//! Frames as they are typed.

use std::str::FromStr;

/// Frames `A..B`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct FrameRange {
    /// First frame.
    pub first: usize,
    /// End, itself not in the range; open if none.
    pub end: Option<usize>,
}

impl FromStr for FrameRange {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let expected = || "expected A..B, A.. or ..B with A < B, e.g. 0..150".to_string();
        let (first, end) = text.split_once("..").ok_or_else(expected)?;
        let number = |text: &str| text.parse::<usize>().map_err(|_| expected());
        let first = if first.is_empty() { 0 } else { number(first)? };
        let end = if end.is_empty() { None } else { Some(number(end)?) };
        if end.is_some_and(|end| end <= first) { Err(expected()) } else { Ok(Self { first, end }) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frame_ranges_may_be_open_at_either_end() {
        let range = |text: &str| text.parse::<FrameRange>().map(|range| (range.first, range.end));
        assert_eq!(range("3..7"), Ok((3, Some(7))));
        assert_eq!(range("3.."), Ok((3, None)));
        assert_eq!(range("..7"), Ok((0, Some(7))));
        for wrong in ["", "7", "7..3", "3..3", "a..b", "-1..3", "3..=7"] {
            assert!(range(wrong).is_err(), "{wrong}");
        }
    }
}
