//! The distance of two oriented boxes, by separating axes, and how that changes as they move.
//!
//! Of two boxes that do not overlap one of fifteen axes separates them: a normal of a face, or a direction at
//! right angles to an edge of each (S. Gottschalk, M. Lin, D. Manocha, "OBBTree", SIGGRAPH 1996). The largest
//! gap along such an axis is at most their distance, and equal to it but for corners that face corners or
//! edges.

use nalgebra::{Matrix3, Vector3};

/// Edges are parallel if the sine between them is smaller.
const PARALLEL: f64 = 1e-6;

/// A box at a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlacedBox {
    /// The box's axes, as columns.
    pub axes: Matrix3<f64>,
    /// The box's centre, m.
    pub centre: Vector3<f64>,
    /// Half of its edges, m.
    pub half: Vector3<f64>,
}

impl PlacedBox {
    /// Returns the corner farthest in a direction.
    pub fn support(&self, direction: &Vector3<f64>) -> Vector3<f64> {
        let along = self.axes.tr_mul(direction);
        self.centre + self.axes * self.half.zip_map(&along, |half, along| half.copysign(along))
    }

    /// Returns half of its width in a direction of unit length, m.
    fn reach(&self, direction: &Vector3<f64>) -> f64 {
        self.axes.tr_mul(direction).abs().dot(&self.half)
    }
}

/// The directions that a separating axis is at right angles to.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Axis {
    First,
    Second,
    Edges(Vector3<f64>, Vector3<f64>),
}

/// The axis of the largest gap.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Separation {
    /// The gap, m; negative if the boxes overlap. It is at most their distance.
    pub gap: f64,
    /// The direction from the first box to the second.
    normal: Vector3<f64>,
    axis: Axis,
    points: [Vector3<f64>; 2],
}

/// Returns the axis along which two boxes are farthest apart.
pub fn separation(a: &PlacedBox, b: &PlacedBox) -> Separation {
    let between = b.centre - a.centre;
    let mut best = (f64::NEG_INFINITY, Vector3::zeros(), Axis::First);
    let mut look = |direction: Vector3<f64>, axis: Axis| {
        let along = direction.dot(&between);
        let gap = along.abs() - a.reach(&direction) - b.reach(&direction);
        if gap > best.0 {
            best = (gap, if along < 0.0 { -direction } else { direction }, axis);
        }
    };
    (0..3).for_each(|i| look(a.axes.column(i).into(), Axis::First));
    (0..3).for_each(|i| look(b.axes.column(i).into(), Axis::Second));
    for i in 0..3 {
        for j in 0..3 {
            let edges: [Vector3<f64>; 2] = [a.axes.column(i).into(), b.axes.column(j).into()];
            let across = edges[0].cross(&edges[1]);
            let size = across.norm();
            if size > PARALLEL {
                look(across / size, Axis::Edges(edges[0], edges[1]));
            }
        }
    }
    let (gap, normal, axis) = best;
    Separation { gap, normal, axis, points: [a.support(&normal), b.support(&-normal)] }
}

impl Separation {
    /// Returns how fast the gap grows if one of the boxes, the second if `second`, moves: it turns at `rate`
    /// and its point at the origin has `velocity`.
    pub fn change(&self, second: bool, rate: &Vector3<f64>, velocity: &Vector3<f64>) -> f64 {
        let [first, other] = self.points;
        let of_normal = match (self.axis, second) {
            (Axis::First, false) | (Axis::Second, true) => rate.cross(&self.normal),
            (Axis::Edges(a, b), _) => {
                let across = a.cross(&b);
                let turned = if second { a.cross(&rate.cross(&b)) } else { rate.cross(&a).cross(&b) };
                let turned = turned * across.dot(&self.normal).signum() / across.norm();
                turned - self.normal * self.normal.dot(&turned)
            }
            _ => Vector3::zeros(),
        };
        let point = if second { other } else { first };
        let moved = self.normal.dot(&(velocity + rate.cross(&point)));
        of_normal.dot(&(other - first)) + if second { moved } else { -moved }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Rotation3;

    use super::*;

    /// Returns numbers within ±1.7, of variance one (D. Knuth's linear congruence).
    fn numbers(mut state: u64) -> impl FnMut() -> f64 {
        move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0) * 3.0_f64.sqrt()
        }
    }

    fn some(number: &mut impl FnMut() -> f64, apart: f64) -> PlacedBox {
        let mut three = |size: f64| Vector3::new(size * number(), size * number(), size * number());
        let axes = Rotation3::new(three(2.0)).into_inner();
        PlacedBox { axes, centre: three(apart), half: three(0.3).map(|v| v.abs() + 0.05) }
    }

    /// Returns the distance by another way: points of both boxes in turn brought to the nearest of the other,
    /// which ends at the distance.
    fn distance(a: &PlacedBox, b: &PlacedBox) -> f64 {
        let onto = |p: &Vector3<f64>, to: &PlacedBox| {
            let own = to.axes.tr_mul(&(p - to.centre));
            to.centre + to.axes * own.zip_map(&to.half, |v, half| v.clamp(-half, half))
        };
        let mut p = b.centre;
        for _ in 0..2000 {
            p = onto(&onto(&p, a), b);
        }
        (onto(&p, a) - p).norm()
    }

    #[test]
    fn boxes_are_apart_exactly_where_projections_say_so() {
        let mut number = numbers(3);
        let (mut apart, mut equal) = (0, 0);
        for _ in 0..2000 {
            let (a, b) = (some(&mut number, 0.6), some(&mut number, 0.6));
            let (gap, distance) = (separation(&a, &b).gap, distance(&a, &b));
            assert!(gap <= distance + 1e-9, "{gap} {distance}");
            // Projections come as near as they like to boxes that touch.
            if distance > 1e-3 {
                assert!(gap > 0.0, "{gap} {distance}");
                apart += 1;
                equal += usize::from((gap - distance).abs() < 1e-6);
            } else if distance < 1e-9 {
                assert!(gap <= 1e-9, "{gap}");
            }
        }
        assert!(apart > 300 && equal > 100, "{apart} {equal}");
    }

    #[test]
    fn the_gap_changes_as_finite_differences_say() {
        let mut number = numbers(4);
        for _ in 0..500 {
            let (a, b) = (some(&mut number, 1.0), some(&mut number, 1.0));
            let mut three = || Vector3::new(number(), number(), number());
            let (rate, velocity) = (three(), three());
            let h = 1e-6;
            for second in [false, true] {
                let at = |by: f64| {
                    let turn = Rotation3::new(rate * by).into_inner();
                    let moved = |own: &PlacedBox| PlacedBox {
                        axes: turn * own.axes,
                        centre: turn * own.centre + velocity * by,
                        half: own.half,
                    };
                    if second { separation(&a, &moved(&b)) } else { separation(&moved(&a), &b) }
                };
                let (low, high) = (at(-h), at(h));
                let slope = (high.gap - low.gap) / (2.0 * h);
                // Where another axis or corner takes over there are two slopes.
                let is_smooth = (low.normal - high.normal).norm() < 1e-4
                    && (0..2).all(|k| (low.points[k] - high.points[k]).norm() < 1e-4);
                if is_smooth {
                    let got = separation(&a, &b).change(second, &rate, &velocity);
                    assert!((got - slope).abs() < 1e-6 * (1.0 + slope.abs()), "{got} {slope}");
                }
            }
        }
    }
}
