//! The tree of nodes, of which each node has one parent: the first that lists it.

use super::json::{Value, list, whole};
use std::collections::BTreeSet;

/// The tree of a document's nodes.
pub(super) struct Tree {
    pub(super) parents: Vec<Option<usize>>,
    /// The last node that lists each.
    last_parents: Vec<Option<usize>>,
    /// The root above each node; none for nodes in a circle or below one.
    roots: Vec<Option<usize>>,
    /// The numbers of the nodes below each, in an order in which they are beside each other.
    spans: Vec<[usize; 2]>,
}

impl Tree {
    pub(super) fn new(nodes: &[Value]) -> Tree {
        let count = nodes.len();
        let (mut parents, mut last_parents) = (vec![None; count], vec![None; count]);
        let children = |i: usize| list(&nodes[i], "children").iter().filter_map(|child| whole(Some(child)));
        for i in 0..count {
            for child in children(i).filter(|child| *child < count) {
                parents[child] = parents[child].or(Some(i));
                last_parents[child] = Some(i);
            }
        }
        let mut tree = Tree { parents, last_parents, roots: vec![None; count], spans: vec![[0; 2]; count] };
        let mut number = 0;
        for root in (0..count).filter(|i| tree.parents[*i].is_none()).collect::<Vec<_>>() {
            // A node is left after its children.
            let mut left = vec![(root, false)];
            while let Some((node, is_done)) = left.pop() {
                if is_done {
                    tree.spans[node][1] = number;
                    continue;
                }
                if tree.roots[node].is_some() {
                    continue;
                }
                tree.roots[node] = Some(root);
                tree.spans[node][0] = number;
                number += 1;
                left.push((node, true));
                let own = |child: &usize| *child < count && tree.parents[*child] == Some(node);
                left.extend(children(node).filter(own).map(|child| (child, false)));
            }
        }
        tree
    }

    /// The root above a node.
    pub(super) fn root(&self, node: usize) -> Option<usize> {
        *self.roots.get(node)?
    }

    /// Whether a node is another or below it.
    pub(super) fn is_below(&self, node: usize, above: usize) -> bool {
        let [start, end] = self.spans[above];
        self.root(node).is_some() && self.root(above).is_some() && (start..end).contains(&self.spans[node][0])
    }

    /// The nodes that are part of a circle, by the first node that lists each or by the last.
    pub(super) fn circles(&self) -> BTreeSet<usize> {
        let mut found = circles(&self.parents);
        found.extend(circles(&self.last_parents));
        found
    }
}

/// The nodes that come back to themselves by their parents.
fn circles(parents: &[Option<usize>]) -> BTreeSet<usize> {
    // The way on which a node was first met; 0 if on none.
    let mut met = vec![0; parents.len()];
    let mut found = BTreeSet::new();
    for start in 0..parents.len() {
        let mut node = Some(start);
        while let Some(own) = node.filter(|node| met[*node] == 0) {
            met[own] = start + 1;
            node = parents[own];
        }
        // A way that comes back to itself ends in a circle.
        while let Some(own) = node.filter(|node| met[*node] == start + 1 && !found.contains(node)) {
            found.insert(own);
            node = parents[own];
        }
    }
    found
}
