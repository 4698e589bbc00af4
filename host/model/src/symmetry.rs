//! Symmetry of a model: the links of a pair are mirror images of each other.

use nalgebra::{DMatrix, Matrix3, Vector3};

use super::inertial::{ParameterMap, map_to_parent};
use super::{Model, ModelError};

/// Two links, the second of which has the mirrored parameters of the first.
#[derive(Clone, Debug, PartialEq)]
pub struct Pair {
    /// Index of the one.
    pub left: usize,
    /// Index of its image.
    pub right: usize,
    /// φ of the right one from that of the left.
    pub map: ParameterMap,
    /// At zero position the two frames are turned against each other.
    pub turned: bool,
    /// At zero position their origins are one.
    pub together: bool,
}

/// Origins are mirror images if they miss each other by less, relative to the model's reach.
const ROUNDING: f64 = 1e-6;

/// Returns the name of the other side, if a name has sides.
fn other_side(name: &str) -> Option<String> {
    let words = [("left", "right"), ("Left", "Right"), ("LEFT", "RIGHT")];
    if let Some((left, right)) = words.iter().find(|(left, _)| name.contains(left)) {
        return Some(name.replacen(left, right, 1));
    }
    // Of four legs.
    for (left, right) in [("FL", "FR"), ("RL", "RR"), ("HL", "HR"), ("LF", "RF"), ("LH", "RH")] {
        if let Some(rest) = name.strip_prefix(&format!("{left}_")) {
            return Some(format!("{right}_{rest}"));
        }
    }
    for (left, right) in [("l", "r"), ("L", "R")] {
        if let Some(rest) = name.strip_prefix(&format!("{left}_")) {
            return Some(format!("{right}_{rest}"));
        }
        if let Some(rest) = name.strip_suffix(&format!("_{left}")) {
            return Some(format!("{rest}_{right}"));
        }
    }
    None
}

/// Returns the attitude and origin of every link at zero position, in the base's frame.
fn at_zero(model: &Model) -> Vec<(Matrix3<f64>, Vector3<f64>)> {
    let mut places = vec![(Matrix3::identity(), Vector3::zeros())];
    for link in model.links.iter().skip(1) {
        let (r, p) = places[link.link.parent];
        places.push((r * link.link.rotation, p + r * link.link.position));
    }
    places
}

/// Returns the pairs of links by their names, each with how far its origins are from being mirror images
/// about the plane y = 0 of the base's frame at zero position, m, and how far all may be off by rounding.
fn candidates(model: &Model) -> (Vec<(Pair, f64)>, f64) {
    let places = at_zero(model);
    let reach = places.iter().map(|(_, p)| p.norm()).fold(0.0, f64::max);
    let mirror = Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, 1.0));
    let mut found = Vec::new();
    for (left, link) in model.links.iter().enumerate() {
        let Some(right) = other_side(&link.name).and_then(|name| model.link(&name)) else { continue };
        let ((r_left, p_left), (r_right, p_right)) = (places[left], places[right]);
        let miss = (mirror * p_left - p_right).norm();
        // To the base's axes, mirrored, to the image's axes.
        let none = Vector3::zeros();
        let up = map_to_parent(&r_left, &none);
        let down = map_to_parent(&r_right.transpose(), &none);
        let signs = [1.0, 1.0, -1.0, 1.0, 1.0, 1.0, 1.0, -1.0, 1.0, -1.0];
        let map = down * ParameterMap::from_diagonal(&nalgebra::SVector::from(signs)) * up;
        let turned = (r_left - r_right).norm() > 1e-3;
        let together = (p_left - p_right).norm() <= ROUNDING * reach;
        found.push((Pair { left, right, map, turned, together }, miss));
    }
    (found, ROUNDING * reach)
}

/// Returns those pairs of links, by their names, whose origins are mirror images; others are left out.
pub fn images(model: &Model) -> Vec<Pair> {
    let (found, rounding) = candidates(model);
    found.into_iter().filter(|(_, miss)| *miss <= rounding).map(|(pair, _)| pair).collect()
}

/// Pairs of links by their names (`l_…` and `r_…`, `…_L`, `left…`, `FL_…`), mirror images about the plane y =
/// 0 of the base's frame at zero position.
///
/// # Errors
/// [`ModelError::Option`] if there is no pair, or a pair's origins are no mirror images.
pub fn pairs(model: &Model) -> Result<Vec<Pair>, ModelError> {
    let refuse = |why: String| ModelError::Option(format!("`symmetric_sides`: {}: {why}", model.name));
    let (found, rounding) = candidates(model);
    if let Some((pair, miss)) = found.iter().find(|(_, miss)| *miss > rounding) {
        return Err(refuse(format!(
            "links {} and {} are no mirror images about y = 0 of the base's frame at zero position: their \
             origins miss each other by {:.3} mm",
            model.links[pair.left].name,
            model.links[pair.right].name,
            miss * 1e3
        )));
    }
    if found.is_empty() {
        return Err(refuse(
            "no two links are named for left and right (l_… and r_…, …_l and …_r, left and right)".to_owned(),
        ));
    }
    Ok(found.into_iter().map(|(pair, _)| pair).collect())
}

/// Returns T of `φ = T ψ`, where ψ has no right links of the pairs.
pub fn substitution(links: usize, pairs: &[Pair]) -> DMatrix<f64> {
    let free: Vec<usize> = (0..links).filter(|i| pairs.iter().all(|p| p.right != *i)).collect();
    let mut map = DMatrix::zeros(10 * links, 10 * free.len());
    for (place, i) in free.iter().enumerate() {
        map.view_mut((10 * i, 10 * place), (10, 10)).fill_with_identity();
        for pair in pairs.iter().filter(|p| p.left == *i) {
            map.view_mut((10 * pair.right, 10 * place), (10, 10)).copy_from(&pair.map);
        }
    }
    map
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::human::Person;

    #[test]
    fn people_are_symmetric_about_y_and_their_nominal_guess_is_its_own_image() {
        let person = Person::default();
        for (model, count) in [(person.human34().unwrap(), 6), (person.human58().unwrap(), 9)] {
            let pairs = pairs(&model).unwrap();
            assert_eq!(pairs.len(), count);
            for pair in pairs {
                let [left, right] = [pair.left, pair.right].map(|i| model.links[i].nominal.unwrap());
                let image = pair.map * nalgebra::SVector::<f64, 10>::from(left);
                for (a, b) in image.iter().zip(right) {
                    assert!((a - b).abs() < 1e-14, "{}", model.links[pair.left].name);
                }
            }
        }
    }

    #[test]
    fn links_that_are_no_images_are_named() {
        let mut model = Person::default().human34().unwrap();
        let hand = model.link("r_hand").unwrap();
        model.links[hand].link.position.x += 0.01;
        let said = pairs(&model).unwrap_err().to_string();
        assert!(said.contains("l_hand and r_hand") && said.contains("10.000 mm"), "{said}");
        model.links.truncate(1);
        assert!(pairs(&model).unwrap_err().to_string().contains("no two links"));
        for (name, other) in [("l_arm", "r_arm"), ("arm_L", "arm_R"), ("left_leg", "right_leg")] {
            assert_eq!(other_side(name).as_deref(), Some(other));
        }
        assert_eq!(other_side("torso"), None);
    }
}
