//! The core's sort against the standard library's.

use proptest::prelude::*;
use sdslam_core::total;

proptest! {
    #[test]
    fn sorted_as_by_the_standard_library(mut values in prop::collection::vec(any::<(i16, u8)>(), 0..300)) {
        let mut expected = values.clone();
        expected.sort();
        total::sort_by(&mut values, |a, b| a < b);
        prop_assert_eq!(values, expected);
    }

    #[test]
    fn an_order_that_contradicts_itself_loses_nothing(mut values in prop::collection::vec(any::<u16>(), 0..100)) {
        let mut expected = values.clone();
        total::sort_by(&mut values, |a, b| (a ^ b) & 1 == 0);
        expected.sort();
        values.sort();
        prop_assert_eq!(values, expected);
    }
}
