//! A fill-reducing elimination order of the nodal graph, and its elimination tree.
//!
//! METIS computes a nested dissection (Karypis, Kumar 1998) of nodes rather than coordinates: the graph is nine times
//! smaller, and the coordinates of a node stay together. The order is then made a postorder of its elimination tree,
//! so that each subtree and each supernode is a range of consecutive nodes.
#![allow(unsafe_code)] // One call into METIS, which has no safe binding for node orders.

use std::sync::Mutex;

use crate::error::SolverError;
use crate::index::NONE;

/// Smaller graphs keep their order, since there is nothing to gain.
const SMALLEST_GRAPH: usize = 4;

/// METIS uses the one random generator of the C library, so calls must not interleave.
static METIS: Mutex<()> = Mutex::new(());

/// An undirected graph: the neighbours of node n, without n itself, are `neighbours[start[n]..start[n + 1]]`.
pub(crate) struct Graph {
    pub(crate) start: Vec<i32>,
    pub(crate) neighbours: Vec<i32>,
    /// Number of free coordinates of each node.
    pub(crate) weights: Vec<i32>,
}

impl Graph {
    pub(crate) fn node_count(&self) -> usize {
        self.start.len() - 1
    }

    pub(crate) fn of(&self, node: usize) -> &[i32] {
        &self.neighbours[self.start[node] as usize..self.start[node + 1] as usize]
    }
}

/// An elimination order with its tree.
pub(crate) struct Ordering {
    /// `order[k]` is the node eliminated at position k.
    pub(crate) order: Vec<u32>,
    /// The inverse of `order`: the position of each node.
    pub(crate) position: Vec<u32>,
    /// Parent position of each position in the elimination tree, or `NONE`; a parent comes after its children.
    pub(crate) parent: Vec<u32>,
}

impl Ordering {
    /// Computes a nested dissection, then a postorder of it.
    pub(crate) fn new(graph: &Graph) -> Result<Self, SolverError> {
        let dissection = if graph.node_count() < SMALLEST_GRAPH || graph.neighbours.is_empty() {
            (0..graph.node_count() as u32).collect()
        } else {
            nested_dissection(graph)?
        };
        let parent = elimination_tree(graph, &dissection, &inverse(&dissection));
        let post = postorder(&parent);
        let order: Vec<u32> = post.iter().map(|&k| dissection[k as usize]).collect();
        let renumber = inverse(&post);
        let parent = post
            .iter()
            .map(|&k| match parent[k as usize] {
                NONE => NONE,
                above => renumber[above as usize],
            })
            .collect();
        let position = inverse(&order);
        Ok(Self { order, position, parent })
    }
}

/// Returns the order in which METIS eliminates the nodes.
fn nested_dissection(graph: &Graph) -> Result<Vec<u32>, SolverError> {
    let count = graph.node_count();
    // METIS takes its input by pointers to mutable memory, so give it copies.
    let (mut start, mut neighbours, mut weights) =
        (graph.start.clone(), graph.neighbours.clone(), graph.weights.clone());
    let (mut order, mut position) = (vec![0_i32; count], vec![0_i32; count]);
    let mut options = [-1_i32; metis_sys::METIS_NOPTIONS as usize];
    options[metis_sys::moptions_et_METIS_OPTION_SEED as usize] = 1;
    let mut node_count = count as i32;
    let guard = METIS.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    // SAFETY: all pointers are to live vectors of the lengths METIS documents (n + 1, the edges twice, n,
    // METIS_NOPTIONS, n, n); the graph has no loops and every edge in both directions; -1 in `options`
    // means the default; nothing is kept after the call.
    let code = unsafe {
        metis_sys::METIS_NodeND(
            &raw mut node_count,
            start.as_mut_ptr(),
            neighbours.as_mut_ptr(),
            weights.as_mut_ptr(),
            options.as_mut_ptr(),
            order.as_mut_ptr(),
            position.as_mut_ptr(),
        )
    };
    drop(guard);
    let order: Vec<u32> = order.into_iter().map(|node| node as u32).collect();
    if code != metis_sys::rstatus_et_METIS_OK || !is_permutation(&order) {
        return Err(SolverError::Ordering { nodes: count, code });
    }
    Ok(order)
}

fn is_permutation(order: &[u32]) -> bool {
    let mut seen = vec![false; order.len()];
    order.iter().all(|&node| seen.get_mut(node as usize).is_some_and(|seen| !std::mem::replace(seen, true)))
}

fn inverse(order: &[u32]) -> Vec<u32> {
    let mut inverse = vec![0; order.len()];
    for (k, &node) in order.iter().enumerate() {
        inverse[node as usize] = k as u32;
    }
    inverse
}

/// Returns the parent of each position: the first later position in its column of the factor (Liu 1986, with path
/// compression).
fn elimination_tree(graph: &Graph, order: &[u32], position: &[u32]) -> Vec<u32> {
    let mut parent = vec![NONE; order.len()];
    let mut ancestor = parent.clone();
    for k in 0..order.len() as u32 {
        for &neighbour in graph.of(order[k as usize] as usize) {
            let mut at = position[neighbour as usize];
            while at < k {
                let next = std::mem::replace(&mut ancestor[at as usize], k);
                if next == NONE {
                    parent[at as usize] = k;
                    break;
                }
                at = next;
            }
        }
    }
    parent
}

/// Returns the positions in postorder: children before parents, each subtree contiguous.
fn postorder(parent: &[u32]) -> Vec<u32> {
    let count = parent.len();
    let (mut first_child, mut sibling) = (vec![NONE; count], vec![NONE; count]);
    let mut roots = Vec::new();
    for k in (0..count).rev() {
        match parent[k] {
            NONE => roots.push(k as u32),
            above => sibling[k] = std::mem::replace(&mut first_child[above as usize], k as u32),
        }
    }
    let mut post = Vec::with_capacity(count);
    let mut path = Vec::new();
    for root in roots.into_iter().rev() {
        path.push(root);
        while let Some(&at) = path.last() {
            let child = std::mem::replace(&mut first_child[at as usize], NONE);
            if child == NONE {
                post.push(at);
                path.pop();
                let next = sibling[at as usize];
                if next != NONE {
                    path.push(next);
                }
            } else {
                path.push(child);
            }
        }
    }
    post
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the graph of an n × n × n grid with the six neighbours of each point.
    fn grid(n: usize) -> Graph {
        let index = |i: usize, j: usize, k: usize| ((i * n + j) * n + k) as i32;
        let (mut start, mut neighbours) = (vec![0], Vec::new());
        for i in 0..n {
            for j in 0..n {
                for k in 0..n {
                    let at = [i, j, k];
                    for axis in 0..3 {
                        for step in [usize::MAX, 1] {
                            let mut to = at;
                            to[axis] = to[axis].wrapping_add(step);
                            if to[axis] < n {
                                neighbours.push(index(to[0], to[1], to[2]));
                            }
                        }
                    }
                    start.push(neighbours.len() as i32);
                }
            }
        }
        Graph { weights: vec![3; n * n * n], start, neighbours }
    }

    /// Returns the number of entries of the factor, counted by eliminating nodes one after the other.
    fn fill(graph: &Graph, ordering: &Ordering) -> usize {
        let count = graph.node_count();
        let mut columns: Vec<std::collections::BTreeSet<u32>> = vec![Default::default(); count];
        for (k, &node) in ordering.order.iter().enumerate() {
            let later = graph.of(node as usize).iter().map(|&other| ordering.position[other as usize]);
            columns[k].extend(later.filter(|&other| other > k as u32));
        }
        let mut entries = 0;
        for k in 0..count {
            entries += columns[k].len() + 1;
            let first = columns[k].first().copied().unwrap_or(NONE);
            assert_eq!(ordering.parent[k], first, "parent of {k}");
            if first != NONE {
                let rest = columns[k].iter().skip(1).copied().collect::<Vec<_>>();
                columns[first as usize].extend(rest);
            }
        }
        entries
    }

    #[test]
    fn dissection_is_a_postordered_permutation_with_less_fill_than_the_natural_order() {
        let graph = grid(9);
        let ordering = Ordering::new(&graph).unwrap();
        assert!(is_permutation(&ordering.order));
        let natural = Ordering {
            order: (0..729).collect(),
            position: (0..729).collect(),
            parent: elimination_tree(&graph, &(0..729).collect::<Vec<_>>(), &(0..729).collect::<Vec<_>>()),
        };
        assert!(2 * fill(&graph, &ordering) < fill(&graph, &natural));
        // In a postorder the subtree of k is the range of positions that ends at k.
        let mut size = vec![1_usize; 729];
        for k in 0..729 {
            if ordering.parent[k] != NONE {
                assert!(ordering.parent[k] as usize > k);
                size[ordering.parent[k] as usize] += size[k];
            }
        }
        for k in 0..729_usize {
            for below in k + 1 - size[k]..k {
                let above = ordering.parent[below] as usize;
                assert!(above <= k);
            }
        }
    }

    #[test]
    fn graphs_without_edges_keep_their_order() {
        let graph = Graph { start: vec![0; 11], neighbours: Vec::new(), weights: vec![1; 10] };
        let ordering = Ordering::new(&graph).unwrap();
        assert_eq!(ordering.order, (0..10).collect::<Vec<_>>());
        assert!(ordering.parent.iter().all(|&parent| parent == NONE));
    }

    #[test]
    fn the_order_is_the_same_every_time() {
        let graph = grid(7);
        let first = Ordering::new(&graph).unwrap().order;
        let again: Vec<_> = std::thread::scope(|scope| {
            (0..4)
                .map(|_| scope.spawn(|| Ordering::new(&graph).unwrap().order))
                .collect::<Vec<_>>()
                .into_iter()
                .map(|thread| thread.join().unwrap())
                .collect()
        });
        assert!(again.iter().all(|order| *order == first));
    }
}
