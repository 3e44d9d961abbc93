//! Order of elimination: keyframes with the fewest neighbours first, so that a chain with loops stays sparse.

use std::collections::BTreeSet;

/// Elimination order by minimum degree over an undirected graph; ties go to the smaller index.
pub(super) fn minimum_degree(mut neighbours: Vec<BTreeSet<usize>>) -> Vec<usize> {
    let mut queue: BTreeSet<(usize, usize)> =
        neighbours.iter().enumerate().map(|(node, others)| (others.len(), node)).collect();
    let mut order = Vec::with_capacity(neighbours.len());
    while let Some((_, node)) = queue.pop_first() {
        order.push(node);
        // What the node joined is joined directly once it is gone.
        let others = std::mem::take(&mut neighbours[node]);
        for &other in &others {
            queue.remove(&(neighbours[other].len(), other));
            neighbours[other].remove(&node);
            neighbours[other].extend(others.iter().copied().filter(|&third| third != other));
            queue.insert((neighbours[other].len(), other));
        }
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_star_is_eliminated_from_its_tips() {
        let star = |node| if node == 2 { BTreeSet::from([0, 1, 3, 4]) } else { BTreeSet::from([2]) };
        let order = minimum_degree((0..5).map(star).collect());
        assert_eq!(order[..3], [0, 1, 3]);
        assert_eq!(BTreeSet::from_iter(order), BTreeSet::from_iter(0..5));
    }
}
