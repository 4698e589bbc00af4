//! Functions of a coordinate in OpenSim models, as far as joints use them.

use roxmltree::Node;

/// Functions within one another, at most.
const DEEPEST: usize = 16;

/// A function of one coordinate.
#[derive(Clone, Debug, PartialEq)]
pub enum Function {
    /// A value.
    Constant(f64),
    /// Coefficients, from the highest power on.
    Polynomial(Vec<f64>),
    /// Knots of a natural cubic spline; beyond them it goes on straight.
    Spline(Vec<(f64, f64)>),
    /// Another one, times this factor.
    Scaled(f64, Box<Function>),
}

impl Function {
    /// Reads the function of an element, whatever encloses it.
    ///
    /// # Errors
    /// In words: what is not understood.
    pub fn of(node: &Node) -> Result<Self, String> {
        Self::within(node, DEEPEST)
    }

    fn within(node: &Node, deepest: usize) -> Result<Self, String> {
        let Some(deepest) = deepest.checked_sub(1) else {
            return Err("functions within functions, too many".to_owned());
        };
        let inner = node.children().filter(Node::is_element);
        for child in inner {
            match child.tag_name().name() {
                "function" => return Self::within(&child, deepest),
                "Constant" => return Ok(Self::Constant(one(&child, "value")?)),
                "LinearFunction" | "PolynomialFunction" => {
                    return Ok(Self::Polynomial(numbers(&child, "coefficients")?));
                }
                "SimmSpline" | "NaturalCubicSpline" => {
                    let (x, y) = (numbers(&child, "x")?, numbers(&child, "y")?);
                    let rises = x.windows(2).all(|pair| pair[0] < pair[1]);
                    if x.len() != y.len() || x.is_empty() || !rises {
                        return Err(
                            "a spline whose knots do not rise, or are not as many as its values".to_owned()
                        );
                    }
                    return Ok(Self::Spline(x.into_iter().zip(y).collect()));
                }
                "MultiplierFunction" => {
                    return Ok(Self::Scaled(one(&child, "scale")?, Box::new(Self::within(&child, deepest)?)));
                }
                other if other.ends_with("Function") || other.ends_with("Spline") => {
                    return Err(format!(
                        "a function {other}: known are constant, linear, polynomial, cubic splines and \
                         multiples"
                    ));
                }
                _ => {}
            }
        }
        Err("a transform without a function".to_owned())
    }

    /// Returns its value.
    pub fn at(&self, x: f64) -> f64 {
        match self {
            Self::Constant(value) => *value,
            Self::Polynomial(all) => all.iter().fold(0.0, |sum, c| sum * x + c),
            Self::Spline(knots) => spline(knots, x),
            Self::Scaled(by, inner) => by * inner.at(x),
        }
    }
}

/// Evaluates a natural cubic spline: second derivatives from the tridiagonal equations, zero at both ends.
fn spline(knots: &[(f64, f64)], at: f64) -> f64 {
    let n = knots.len();
    if n == 1 {
        return knots[0].1;
    }
    let h: Vec<f64> = knots.windows(2).map(|k| k[1].0 - k[0].0).collect();
    let slope: Vec<f64> = knots.windows(2).zip(&h).map(|(k, h)| (k[1].1 - k[0].1) / h).collect();
    // Thomas' elimination.
    let mut second = vec![0.0; n];
    let (mut c, mut d) = (vec![0.0; n], vec![0.0; n]);
    for i in 1..n - 1 {
        let diagonal = 2.0 * (h[i - 1] + h[i]) - h[i - 1] * c[i - 1];
        c[i] = h[i] / diagonal;
        d[i] = (6.0 * (slope[i] - slope[i - 1]) - h[i - 1] * d[i - 1]) / diagonal;
    }
    for i in (1..n - 1).rev() {
        second[i] = d[i] - c[i] * second[i + 1];
    }
    let k = knots.partition_point(|(x, _)| *x <= at).clamp(1, n - 1) - 1;
    let (a, b) = ((knots[k + 1].0 - at) / h[k], (at - knots[k].0) / h[k]);
    let straight = a * knots[k].1 + b * knots[k + 1].1;
    if !(0.0..=1.0).contains(&b) {
        let end = if b < 0.0 { k } else { k + 1 };
        let tilt = match end == k {
            true => slope[k] - h[k] / 6.0 * (2.0 * second[k] + second[k + 1]),
            false => slope[k] + h[k] / 6.0 * (second[k] + 2.0 * second[k + 1]),
        };
        return knots[end].1 + tilt * (at - knots[end].0);
    }
    straight + ((a * a * a - a) * second[k] + (b * b * b - b) * second[k + 1]) * h[k] * h[k] / 6.0
}

/// Returns the finite numbers of a child's text.
pub(super) fn numbers(node: &Node, tag: &str) -> Result<Vec<f64>, String> {
    let child = node.children().find(|c| c.has_tag_name(tag));
    let text = child.and_then(|c| c.text()).unwrap_or_default();
    let all: Option<Vec<f64>> =
        text.split_whitespace().map(|word| word.parse().ok().filter(|v: &f64| v.is_finite())).collect();
    all.filter(|all| !all.is_empty()).ok_or_else(|| format!("{tag} of {}: no finite numbers", place(node)))
}

/// Returns the one number of a child's text.
pub(super) fn one(node: &Node, tag: &str) -> Result<f64, String> {
    match numbers(node, tag)?.as_slice() {
        [value] => Ok(*value),
        _ => Err(format!("{tag} of {}: one number is needed", place(node))),
    }
}

/// Returns an element's tag and name.
pub(super) fn place(node: &Node) -> String {
    let tag = node.tag_name().name();
    node.attribute("name")
        .filter(|n| !n.is_empty())
        .map_or_else(|| tag.to_owned(), |name| format!("{tag} {name}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn splines_go_through_their_knots_and_on_straight() {
        let knots = vec![(0.0, 1.0), (1.0, 3.0), (2.5, -1.0), (4.0, 0.0)];
        let spline = Function::Spline(knots.clone());
        for (x, y) in knots {
            assert!((spline.at(x) - y).abs() < 1e-12);
        }
        // The slope is continuous at knots, and beyond the ends it stays.
        let slope = |x: f64| (spline.at(x + 1e-6) - spline.at(x - 1e-6)) / 2e-6;
        for x in [1.0, 2.5] {
            assert!((slope(x - 1e-5) - slope(x + 1e-5)).abs() < 1e-3);
        }
        assert!((slope(-3.0) - slope(0.0001)).abs() < 1e-2 && (slope(9.0) - slope(3.9999)).abs() < 1e-2);
        let line = Function::Spline(vec![(0.0, 0.0), (1.0, 2.0), (3.0, 6.0)]);
        assert!((line.at(1.7) - 3.4).abs() < 1e-12 && (line.at(-2.0) + 4.0).abs() < 1e-12);
        let scaled = Function::Scaled(2.0, Box::new(Function::Polynomial(vec![1.0, 0.0, -1.0])));
        assert_eq!(scaled.at(3.0), 16.0);
    }
}
