//! Preorder numbers of trees: all descendants of a node follow it, so a comparison decides descent.

/// Returns per node its own number, and the first one after its descendants. `ups` has each node with a parent, and that parent,
/// descendants first; all others are roots. O(n).
pub(crate) fn number_trees(n: usize, ups: &[[usize; 2]]) -> Vec<[u32; 2]> {
    let (mut size, mut is_root) = (vec![1; n], vec![true; n]);
    for &[node, up] in ups {
        size[up] += size[node];
        is_root[node] = false;
    }
    let mut below = vec![[0; 2]; n];
    let mut next_number = 0;
    for root in (0..n).filter(|&i| is_root[i]) {
        below[root] = [next_number, next_number + size[root]];
        next_number += size[root];
    }
    // Number of the next child, per node.
    let mut next: Vec<u32> = below.iter().map(|b| b[0] + 1).collect();
    for &[node, up] in ups.iter().rev() {
        below[node] = [next[up], next[up] + size[node]];
        next[node] = next[up] + 1;
        next[up] += size[node];
    }
    below
}

#[cfg(test)]
mod tests {
    use super::number_trees;

    #[test]
    fn all_below_a_node_follow_it() {
        // 3 and 4 are children of 1, 1 and 2 of 0; 5 is a root.
        let below = number_trees(6, &[[3, 1], [4, 1], [1, 0], [2, 0]]);
        let is_below = |a: usize, b: usize| (below[b][0]..below[b][1]).contains(&below[a][0]);
        let pairs: Vec<_> = (0..6).flat_map(|a| (0..6).map(move |b| (a, b))).collect();
        let found: Vec<_> = pairs
            .into_iter()
            .filter(|&(a, b)| a != b && is_below(a, b))
            .collect();
        assert_eq!(found, [(1, 0), (2, 0), (3, 0), (3, 1), (4, 0), (4, 1)]);
    }
}
