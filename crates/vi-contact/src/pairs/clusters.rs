//! Clusters: sets of nodes that pairs connect.

use vi_core::DisjointSets;

/// Groups the nodes 0 … count − 1 into the sets that `pairs` connect, each in increasing order, in the order of their
/// lowest node. Nodes without a pair are in no set. Nodes for which `is_free` is false connect nothing, so that two
/// bodies on one fixed floor are two clusters.
pub fn clusters<'a>(
    count: usize,
    pairs: impl IntoIterator<Item = &'a [u32]>,
    is_free: impl Fn(u32) -> bool,
) -> Vec<Vec<u32>> {
    let mut sets = DisjointSets::new(count);
    let mut touched = vec![false; count];
    for pair in pairs {
        let mut first = None;
        for &node in pair.iter().filter(|&&node| is_free(node)) {
            touched[node as usize] = true;
            sets.join(node, *first.get_or_insert(node));
        }
    }
    let mut number = vec![None; count];
    let mut clusters: Vec<Vec<u32>> = Vec::new();
    for node in (0..count as u32).filter(|&node| touched[node as usize]) {
        let root = sets.root(node) as usize;
        let cluster = *number[root].get_or_insert_with(|| {
            clusters.push(Vec::new());
            clusters.len() - 1
        });
        clusters[cluster].push(node);
    }
    clusters
}

#[cfg(test)]
mod tests {
    use super::clusters;

    #[test]
    fn pairs_join_nodes_and_fixed_nodes_do_not() {
        let pairs: [&[u32]; 5] = [&[7, 3], &[5, 6], &[3, 1, 1], &[9, 5], &[9, 7]];
        let found = clusters(10, pairs, |node| node != 9);
        assert_eq!(found, [vec![1, 3, 7], vec![5, 6]]);
        let found = clusters(10, pairs, |_| true);
        assert_eq!(found, [vec![1, 3, 5, 6, 7, 9]]);
    }
}
