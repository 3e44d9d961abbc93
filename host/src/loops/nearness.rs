//! Which keyframes the graph fixes to each other: those few metres of path and loops apart.

use std::collections::{BTreeMap, BinaryHeap};

/// A way along the graph, ordered so that the shortest is the greatest.
#[derive(Debug, PartialEq)]
struct Way {
    length_m: f64,
    keyframe: usize,
}

impl Eq for Way {}

impl Ord for Way {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        other.length_m.total_cmp(&self.length_m).then(other.keyframe.cmp(&self.keyframe))
    }
}

impl PartialOrd for Way {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

/// Shortest ways along a graph (Dijkstra): length \[m\] to every keyframe within `limit_m` of `from`. `neighbours` gives
/// the keyframes one edge away and the edge's length \[m\].
pub(crate) fn reachable_within<I: IntoIterator<Item = (usize, f64)>>(
    from: usize,
    limit_m: f64,
    neighbours: impl Fn(usize) -> I,
) -> BTreeMap<usize, f64> {
    let mut reached = BTreeMap::new();
    let mut queue = BinaryHeap::from([Way { length_m: 0.0, keyframe: from }]);
    while let Some(Way { length_m, keyframe }) = queue.pop() {
        if length_m > limit_m || reached.contains_key(&keyframe) {
            continue;
        }
        reached.insert(keyframe, length_m);
        let onward = neighbours(keyframe).into_iter();
        queue.extend(onward.map(|(keyframe, edge_m)| Way { length_m: length_m + edge_m, keyframe }));
    }
    reached
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_loop_is_a_short_cut() {
        // A line of 100 keyframes 2 m apart, whose ends are joined by a loop of 10 m.
        let neighbours = |k: usize| {
            let mut next: Vec<(usize, f64)> = Vec::new();
            next.extend(k.checked_sub(1).map(|before| (before, 2.0)));
            next.extend((k < 99).then_some((k + 1, 2.0)));
            next.extend((k == 0).then_some((99, 10.0)));
            next.extend((k == 99).then_some((0, 10.0)));
            next
        };
        let reached = reachable_within(3, 20.0, neighbours);
        assert_eq!(
            reached.keys().copied().collect::<Vec<_>>(),
            [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 97, 98, 99]
        );
        assert_eq!((reached[&99], reached[&97]), (16.0, 20.0));
    }
}
