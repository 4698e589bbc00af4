//! Causes of a difference from a reference, by which quantities differ and in what ratio.

use super::quantity::Quantity;

/// Ratios of units that are mistaken for each other, and what they are of.
const UNITS: [(f64, &str); 4] = [
    (1000.0, "thousand, grams for kilograms or millimetres for metres"),
    (2.204_622_6, "2.2046, pounds for kilograms"),
    (9.806_65, "9.80665, newtons for kilograms"),
    (25.4, "25.4, inches for millimetres"),
];
/// Relative distance at which a ratio is taken for one of units: those of a balance that is right are
/// distinguished by far.
const NEAR: f64 = 0.05;
/// A tensor of twice or half the diameter, where the mass is that of the balance.
const DIAMETER: f64 = 4.0;

/// Returns the likely cause of quantities, mass, centre of mass and tensor, being beyond a bound on |E_n|.
pub(super) fn of(quantities: &[Quantity], limit: f64) -> String {
    let off = |of: &dyn Fn(&str) -> bool| {
        let own = quantities.iter().filter(|quantity| of(&quantity.name));
        own.filter(|quantity| quantity.e_n.is_some_and(|e_n| e_n.abs() > limit)).collect::<Vec<_>>()
    };
    let (mass, centre) = (off(&|name| name == "m"), off(&|name| name.starts_with("com_")));
    let tensor = off(&|name| name.ends_with("_com"));
    let ratio = |all: &[&Quantity]| {
        // The element of the largest reference has the surest ratio.
        let most = all.iter().max_by(|a, b| a.reference.abs().total_cmp(&b.reference.abs()))?;
        let ratio = most.value? / most.reference;
        (ratio.is_finite() && ratio > 0.0).then_some(ratio)
    };
    let near = |ratio: f64, unit: f64| (ratio / unit).ln().abs() < NEAR || (ratio * unit).ln().abs() < NEAR;
    for all in [&mass, &centre, &tensor] {
        let unit = ratio(all).and_then(|ratio| UNITS.iter().find(|(unit, _)| near(ratio, *unit)));
        if let (Some((_, factor)), Some(first)) = (unit, all.first()) {
            return format!("a mistake in units: {} differs by a factor of {factor}", first.name);
        }
    }
    let halved = ratio(&tensor).is_some_and(|ratio| near(ratio, DIAMETER));
    match (mass.is_empty(), centre.is_empty(), tensor.is_empty()) {
        (true, true, false) if halved => {
            "a radius for a diameter in the drawing, a factor of four".to_owned()
        }
        (true, true, _) => {
            "the dimensions or the density of the drawing are not those of the body, or its attitude is \
             another"
                .to_owned()
        }
        (true, false, _) => "another place or mounting than [place] or `mounting` says".to_owned(),
        (false, true, _) => {
            "the body was weighed wrongly, or it is another one; or the gain of the load cell is further off \
             than the rig file allows for"
                .to_owned()
        }
        (false, false, _) => {
            "another body (the wrong file), another mounting, or a fixture that is not taken off (`tare`)"
                .to_owned()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn quantity(name: &str, value: f64, reference: f64, e_n: f64) -> Quantity {
        Quantity {
            name: name.to_owned(),
            unit: "kg".to_owned(),
            value: Some(value),
            u95: Some(0.01),
            reference,
            reference_u95: 0.01,
            e_n: Some(e_n),
            passed: e_n.abs() <= 1.0,
        }
    }

    #[test]
    fn differences_show_the_cause() {
        let cause = |quantities: &[Quantity]| of(quantities, 1.43);
        let centre = |e_n: f64| quantity("com_z", 0.067, 0.067, e_n);
        let tensor = |factor: f64, e_n: f64| quantity("Izz_com", 0.002 * factor, 0.002, e_n);
        let mass = |value: f64, e_n: f64| quantity("m", value, 3.32, e_n);
        assert!(cause(&[mass(3.36, 1.9), centre(0.1), tensor(1.0, 0.3)]).contains("weighed wrongly"));
        assert!(cause(&[mass(1.506, -90.0), centre(0.1), tensor(1.0, 0.3)]).contains("pounds"));
        assert!(cause(&[mass(3.32, 0.0), quantity("com_z", 0.067, 67.0, -900.0)]).contains("millimetres"));
        assert!(cause(&[mass(3.32, 0.2), centre(3.0), tensor(1.0, 0.3)]).contains("place or mounting"));
        assert!(cause(&[mass(3.32, 0.2), centre(0.3), tensor(4.0, 30.0)]).contains("radius for a diameter"));
        assert!(cause(&[mass(3.32, 0.2), centre(0.3), tensor(1.2, 3.0)]).contains("drawing"));
        assert!(cause(&[mass(3.1, -9.0), centre(5.0), tensor(1.2, 3.0)]).contains("another body"));
    }
}
