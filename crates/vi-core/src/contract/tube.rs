//! Configurations near a straight path.

/// All configurations in which every node i is within `reach[i]` (m) of start_i + τ motion_i, with the same τ in [0, 1]
/// for all nodes. The set is convex: if it contains both ends of a straight path, it contains the path.
///
/// Nodes with an infinite reach and no motion may be anywhere.
///
/// Lists of pairs that may meet are valid in a tube. Nodes that move steadily need only a small reach in it, and their
/// pairs depend on relative motions alone.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Tube {
    /// Positions of all nodes at the start of the path, m.
    pub start: Vec<f64>,
    /// Motion of all nodes along the path, m.
    pub motion: Vec<f64>,
    /// Largest distance from the path, one per node, m.
    pub reach: Vec<f64>,
}

impl Tube {
    /// Returns the configurations in which no node is farther than `reach` (m) from its position in x.
    pub fn about(x: &[f64], reach: f64) -> Self {
        Self { start: x.to_vec(), motion: vec![0.0; x.len()], reach: vec![reach; x.len() / 3] }
    }

    /// Returns the middle of the path, m.
    pub fn middle(&self) -> Vec<f64> {
        self.start.iter().zip(&self.motion).map(|(x, motion)| x + 0.5 * motion).collect()
    }

    /// Returns a reach (m) about the middle of the path within which all configurations of the tube lie.
    pub fn largest_reach(&self) -> f64 {
        let reach = |(motion, reach): (&[f64], &f64)| reach + 0.5 * square(motion).sqrt();
        self.motion.chunks_exact(3).zip(&self.reach).map(reach).fold(0.0, f64::max)
    }

    /// Returns the τ for which the squares of the distances of all nodes from the path have the least sum.
    pub fn nearest(&self, x: &[f64]) -> f64 {
        // Several sums over chunks of fixed length, so that the compiler can use vector instructions.
        let (mut along, mut length) = ([0.0; 12], [0.0; 12]);
        let [(x, x_rest), (start, start_rest), (motion, motion_rest)] =
            [x, &self.start, &self.motion].map(|values| values.as_chunks::<12>());
        for (x, (start, motion)) in x.iter().zip(start.iter().zip(motion)) {
            for k in 0..12 {
                along[k] += (x[k] - start[k]) * motion[k];
                length[k] += motion[k] * motion[k];
            }
        }
        for (k, (x, (start, motion))) in x_rest.iter().zip(start_rest.iter().zip(motion_rest)).enumerate() {
            along[k] += (x - start) * motion;
            length[k] += motion * motion;
        }
        let (along, length) = (along.iter().sum::<f64>(), length.iter().sum::<f64>());
        if along > 0.0 && length > 0.0 { (along / length).min(1.0) } else { 0.0 }
    }

    /// Returns the square of the distance of each node from the path at the best τ for x, m².
    fn squares<'a>(&'a self, x: &'a [f64]) -> impl Iterator<Item = f64> + 'a {
        let tau = self.nearest(x);
        let [x, start, motion] = [x, &self.start, &self.motion].map(|values| values.as_chunks::<3>().0);
        x.iter().zip(start.iter().zip(motion)).map(move |(x, (start, motion))| {
            let [a, b, c] = [x[0] - start[0], x[1] - start[1], x[2] - start[2]];
            let [a, b, c] = [a - tau * motion[0], b - tau * motion[1], c - tau * motion[2]];
            a * a + b * b + c * c
        })
    }

    /// Returns the distance of each node from the path at the τ for which the squares of all distances have the least
    /// sum, m.
    pub fn distances<'a>(&'a self, x: &'a [f64]) -> impl Iterator<Item = f64> + 'a {
        self.squares(x).map(f64::sqrt)
    }

    /// Returns whether the tube is known to contain x.
    pub fn contains(&self, x: &[f64]) -> bool {
        // No early end: the loop then needs no branches.
        let is_inside = |all: bool, (square, reach): (f64, &f64)| all & (square <= reach * reach);
        x.len() == self.start.len() && self.squares(x).zip(&self.reach).fold(true, is_inside)
    }

    /// Returns whether the tube is known to contain all configurations of another tube.
    pub fn contains_tube(&self, other: &Self) -> bool {
        let contains_end = |x: &[f64]| {
            let mut reaches = other.reach.iter().zip(&self.reach);
            self.distances(x)
                .all(|distance| reaches.next().is_some_and(|(other, own)| distance + other <= *own))
        };
        other.start.len() == self.start.len() && contains_end(&other.start) && contains_end(&other.end())
    }

    /// Returns the end of the path, m.
    pub fn end(&self) -> Vec<f64> {
        self.start.iter().zip(&self.motion).map(|(x, motion)| x + motion).collect()
    }
}

fn square(vector: &[f64]) -> f64 {
    vector.iter().map(|value| value * value).sum()
}

#[cfg(test)]
mod tests {
    use super::Tube;

    fn tube() -> Tube {
        let motion = vec![1.0, 0.0, 0.0, 0.0, 2.0, 0.0];
        Tube { start: vec![0.0, 0.0, 0.0, 5.0, 0.0, 0.0], motion, reach: vec![0.1, 0.2] }
    }

    #[test]
    fn a_node_that_keeps_up_is_inside_and_one_that_lags_is_not() {
        let tube = tube();
        for tau in [0.0, 0.3, 1.0] {
            assert!(tube.contains(&[tau, 0.09, 0.0, 5.0, 2.0 * tau, 0.19]));
            assert!(!tube.contains(&[tau, 0.11, 0.0, 5.0, 2.0 * tau, 0.0]));
        }
        assert!(!tube.contains(&[0.5, 0.0, 0.0, 5.0, 0.0, 0.0]), "the second node stays behind");
        assert!(!tube.contains(&[1.2, 0.0, 0.0, 5.0, 2.4, 0.0]), "beyond the end");
        assert!(!tube.contains(&[-0.2, 0.0, 0.0, 5.0, -0.4, 0.0]), "before the start");
        assert!(!tube.contains(&[f64::NAN, 0.0, 0.0, 5.0, 0.0, 0.0]));
    }

    #[test]
    fn a_thinner_and_shorter_tube_is_inside() {
        let tube = tube();
        let part = |from: f64, to: f64, reach: f64| Tube {
            start: vec![from, 0.0, 0.0, 5.0, 2.0 * from, 0.0],
            motion: vec![to - from, 0.0, 0.0, 0.0, 2.0 * (to - from), 0.0],
            reach: vec![reach; 2],
        };
        assert!(tube.contains_tube(&part(0.25, 0.75, 0.09)));
        assert!(!tube.contains_tube(&part(0.25, 0.75, 0.11)));
        assert!(!tube.contains_tube(&part(0.5, 1.25, 0.05)));
        let (middle, reach) = (tube.middle(), tube.largest_reach());
        assert!(Tube::about(&middle, 1.0001 * reach).contains_tube(&tube));
    }
}
