//! Pareto fronts and hypervolume of two objectives, both to be maximised.

use crate::env::flight::Reward;

/// The paper's reference point: percent of data, minus battery units.
pub const REFERENCE: Reward = [-1.0, -200.0];

/// Whether `a` is at least as good as `b` in both objectives and better in one.
#[must_use]
pub fn dominates(a: Reward, b: Reward) -> bool {
    a[0] >= b[0] && a[1] >= b[1] && a != b
}

/// The points that no other point dominates, by falling first objective; equal points once.
#[must_use]
pub fn front(points: &[Reward]) -> Vec<Reward> {
    let mut front: Vec<Reward> =
        points.iter().copied().filter(|&p| !points.iter().any(|&q| dominates(q, p))).collect();
    front.sort_by(|a, b| b[0].total_cmp(&a[0]));
    front.dedup();
    front
}

/// The area that the points dominate above `reference`. Points below the reference add nothing.
#[must_use]
pub fn hypervolume(points: &[Reward], reference: Reward) -> f64 {
    let mut area = 0.0;
    let mut floor = f64::from(reference[1]);
    for point in front(points) {
        let width = f64::from(point[0]) - f64::from(reference[0]);
        let height = f64::from(point[1]) - floor;
        if width > 0.0 && height > 0.0 {
            area += width * height;
            floor = f64::from(point[1]);
        }
    }
    area
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_front_keeps_only_what_nothing_dominates() {
        let points = [[1.0, 1.0], [3.0, -1.0], [2.0, 0.0], [2.0, -0.5], [0.5, 1.0], [2.0, 0.0]];
        assert_eq!(front(&points), [[3.0, -1.0], [2.0, 0.0], [1.0, 1.0]]);
    }

    #[test]
    fn hypervolume_is_a_staircase() {
        assert_eq!(hypervolume(&[[100.0, 0.0]], REFERENCE), 101.0 * 200.0);
        assert_eq!(hypervolume(&[[2.0, 1.0], [1.0, 2.0]], [0.0, 0.0]), 3.0);
        assert_eq!(hypervolume(&[[2.0, 1.0], [1.0, 2.0], [1.0, 1.0]], [0.0, 0.0]), 3.0);
        assert_eq!(hypervolume(&[[-5.0, 1.0]], [0.0, 0.0]), 0.0);
        assert_eq!(hypervolume(&[], REFERENCE), 0.0);
    }
}
