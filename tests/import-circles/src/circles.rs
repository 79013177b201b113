//! Strongly connected components of a directed graph (Tarjan 1972).

/// The sets of nodes that reach each other, of two nodes or more; `targets[i]` are the nodes that node i points to.
pub(crate) fn circles(targets: &[Vec<usize>]) -> Vec<Vec<usize>> {
    let mut search = Search {
        targets,
        numbers: vec![None; targets.len()],
        visited: 0,
        open: Vec::new(),
        circles: Vec::new(),
    };
    for node in 0..targets.len() {
        if search.numbers[node].is_none() {
            search.visit(node);
        }
    }
    search.circles
}

struct Search<'a> {
    targets: &'a [Vec<usize>],
    /// The number of each node in the order of the visits.
    numbers: Vec<Option<usize>>,
    visited: usize,
    /// Visited nodes whose circle is not complete, in the order of the visits.
    open: Vec<usize>,
    circles: Vec<Vec<usize>>,
}

impl Search<'_> {
    /// Visits a node and all that it reaches; returns the number of the earliest open node that it reaches.
    fn visit(&mut self, node: usize) -> usize {
        let number = self.visited;
        self.visited += 1;
        let place = self.open.len();
        self.open.push(node);
        let mut lowest = number;
        self.numbers[node] = Some(number);
        let targets = self.targets;
        for &target in &targets[node] {
            let reached = match self.numbers[target] {
                None => self.visit(target),
                Some(earlier) if self.open.contains(&target) => earlier,
                Some(_) => continue,
            };
            lowest = lowest.min(reached);
        }
        if lowest == number {
            let mut circle = self.open.split_off(place);
            if circle.len() > 1 {
                circle.sort_unstable();
                self.circles.push(circle);
            }
        }
        lowest
    }
}

#[cfg(test)]
mod tests {
    use super::circles;

    #[test]
    fn nodes_that_reach_each_other_are_one_circle() {
        let targets = [
            vec![1],
            vec![2],
            vec![0, 3],
            vec![4],
            vec![3],
            vec![0],
            vec![6],
        ];
        assert_eq!(circles(&targets), [vec![3, 4], vec![0, 1, 2]]);
        assert!(circles(&[vec![1, 2], vec![2], vec![]]).is_empty());
    }
}
