//! The parameters that a statement is about.

use super::KnownError;
use crate::standard::{name, weights};
use crate::{Estimate, Kind, Parameter};

/// Names of a body's ten parameters in statements.
const TEN: [&str; 10] = [
    "mass_kg", "mcx_kgm", "mcy_kgm", "mcz_kgm", "ixx_kgm2", "iyy_kgm2", "izz_kgm2", "iyz_kgm2", "izx_kgm2",
    "ixy_kgm2",
];
const CENTRE: [&str; 3] = ["com_x_m", "com_y_m", "com_z_m"];
const CENTRAL: [&str; 6] =
    ["ixx_com_kgm2", "iyy_com_kgm2", "izz_com_kgm2", "iyz_com_kgm2", "izx_com_kgm2", "ixy_com_kgm2"];
const OFFSETS: [&str; 6] =
    ["offset_fx_n", "offset_fy_n", "offset_fz_n", "offset_mx_nm", "offset_my_nm", "offset_mz_nm"];
/// Axes of each tensor element in the order of the parameters.
pub(super) const ELEMENT: [[usize; 2]; 6] = [[0, 0], [1, 1], [2, 2], [1, 2], [2, 0], [0, 1]];

/// The subject of a statement, by places among the fit's parameters.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Subject {
    /// One parameter.
    Parameter(usize),
    /// A coordinate of a link's centre of mass.
    Centre {
        /// The link's mass.
        mass: usize,
        /// The first moment along the coordinate.
        moment: usize,
    },
    /// An element of a link's tensor about its centre of mass, in its axes.
    Central {
        /// The index among the six.
        element: usize,
        /// The link's mass.
        mass: usize,
        /// Its first moments.
        moments: [usize; 3],
        /// The element about the origin.
        inertia: usize,
    },
    /// A plane of symmetry through the origin of a link's frame.
    Symmetry {
        /// The link's mass.
        mass: usize,
        /// The first moment across the plane.
        moment: usize,
        /// The two products of inertia that vanish.
        products: [usize; 2],
        /// The three moments of inertia, which say how large the link is.
        moments: [usize; 3],
    },
}

/// A link of a model, whose standard parameters are searched for.
struct Link<'a> {
    parameters: &'a [Parameter],
    /// The statement, for messages.
    statement: &'a str,
    link: &'a str,
}

impl Link<'_> {
    /// Finds the `k`-th of the ten if it is a parameter by itself.
    fn place(&self, k: usize) -> Result<usize, KnownError> {
        let weight = |p: &Parameter| weights(p, self.link).get(k).copied().unwrap_or(0.0);
        let alone = |p: &Parameter| weight(p) == 1.0 && p.is_by_itself();
        if let Some(j) = self.parameters.iter().position(alone) {
            return Ok(j);
        }
        let needed = name(self.link, k);
        let statement = self.statement.to_owned();
        Err(match self.parameters.iter().find(|p| weight(p) != 0.0) {
            Some(p) => {
                let terms: Vec<_> = p.made_of.iter().map(|(name, weight)| term(name, *weight)).collect();
                KnownError::Combination {
                    name: statement,
                    needed,
                    parameter: p.name.clone(),
                    terms: terms.join(" + "),
                }
            }
            None => KnownError::NotEstimated { name: statement, needed },
        })
    }

    fn places<const N: usize>(&self, ks: [usize; N]) -> Result<[usize; N], KnownError> {
        let mut places = [0; N];
        for (place, k) in places.iter_mut().zip(ks) {
            *place = self.place(k)?;
        }
        Ok(places)
    }
}

fn term(name: &str, weight: f64) -> String {
    if weight == 1.0 { name.to_owned() } else { format!("{} {name}", super::error::significant(weight, 4)) }
}

/// Links of a model, in order.
fn links(parameters: &[Parameter]) -> Vec<&str> {
    let mut links: Vec<&str> = Vec::new();
    for link in parameters.iter().filter_map(Parameter::link) {
        if !links.contains(&link) {
            links.push(link);
        }
    }
    links
}

impl Subject {
    /// Finds the quantity of a name.
    pub(super) fn named(statement: &str, parameters: &[Parameter]) -> Result<Self, KnownError> {
        if let Some(j) = parameters.iter().position(|p| p.name == statement) {
            return Ok(Self::Parameter(j));
        }
        if let Some(place) = OFFSETS.iter().position(|name| *name == statement) {
            let wanted =
                OFFSETS.get(place).and_then(|name| name.rsplit_once('_')).map_or("", |(name, _)| name);
            return match parameters.iter().position(|p| p.kind == Kind::Offset && p.name == wanted) {
                Some(j) => Ok(Self::Parameter(j)),
                None => Err(KnownError::NoOffset { name: statement.to_owned() }),
            };
        }
        let unknown = || KnownError::Name { name: statement.to_owned(), known: Self::names(parameters) };
        let (named, quantity) = match statement.rsplit_once('.') {
            Some((link, quantity)) => (Some(link), quantity),
            None => (None, statement),
        };
        let place = |names: &[&str]| names.iter().position(|name| *name == quantity);
        let (ten, centre, central) = (place(&TEN), place(&CENTRE), place(&CENTRAL));
        if ten.or(centre).or(central).is_none() {
            return Err(unknown());
        }
        let link = find_link(statement, named, parameters)?;
        let link = Link { parameters, statement, link };
        if let Some(k) = ten {
            return Ok(Self::Parameter(link.place(k)?));
        }
        if let Some(k) = centre {
            let [mass, moment] = link.places([0, 1 + k])?;
            return Ok(Self::Centre { mass, moment });
        }
        let element = central.ok_or_else(unknown)?;
        let [mass, x, y, z, inertia] = link.places([0, 1, 2, 3, 4 + element])?;
        Ok(Self::Central { element, mass, moments: [x, y, z], inertia })
    }

    /// Finds the parameters of a plane of symmetry of a link; an empty name is that of the only one.
    pub(super) fn plane(
        statement: &str,
        link: &str,
        axis: usize,
        parameters: &[Parameter],
    ) -> Result<Self, KnownError> {
        let link = find_link(statement, Some(link).filter(|link| !link.is_empty()), parameters)?;
        let link = Link { parameters, statement, link };
        let [mass, moment, xx, yy, zz] = link.places([0, 1 + axis, 4, 5, 6])?;
        let mut crossing =
            (3..6).filter(|e| ELEMENT.get(*e).is_some_and(|axes| axes.contains(&axis))).map(|e| 4 + e);
        let products = link.places([crossing.next().unwrap_or(7), crossing.next().unwrap_or(8)])?;
        Ok(Self::Symmetry { mass, moment, products, moments: [xx, yy, zz] })
    }

    /// The parameter that it is first about.
    pub(super) fn first(&self) -> usize {
        match self {
            Self::Parameter(j) | Self::Centre { moment: j, .. } => *j,
            Self::Central { inertia: j, .. } | Self::Symmetry { moment: j, .. } => *j,
        }
    }

    /// Returns true for a mass or a moment of inertia of one link: no body has less than nothing of these.
    pub(super) fn is_positive(&self, parameters: &[Parameter]) -> bool {
        match self {
            Self::Parameter(j) => parameters.get(*j).is_some_and(|p| {
                let own = p.link().filter(|_| p.is_by_itself()).map(|link| weights(p, link));
                own.is_some_and(|w| [0, 4, 5, 6].iter().any(|k| w.get(*k) == Some(&1.0)))
            }),
            Self::Central { element, .. } => *element < 3,
            Self::Centre { .. } | Self::Symmetry { .. } => false,
        }
    }

    /// Parameters that a plane of symmetry leaves free, as the size of the link is not known.
    pub(super) fn left_free(&self, estimate: &Estimate) -> Vec<usize> {
        let Self::Symmetry { products, moments, .. } = self else { return Vec::new() };
        let moment =
            |j: usize| Some([estimate.measured(j)?.value, estimate.covariance(j, j)?.max(0.0).sqrt()]);
        if trace(moments.map(moment)).is_some() { Vec::new() } else { products.to_vec() }
    }

    /// Names that statements about a model can have.
    fn names(parameters: &[Parameter]) -> Vec<String> {
        let mut names: Vec<String> = Vec::new();
        for link in links(parameters) {
            let of_link = [&TEN[..], &CENTRE, &CENTRAL].concat();
            if link.is_empty() {
                names.extend(of_link.into_iter().map(str::to_owned));
            } else {
                names.push(format!("{link}.mass_kg, {link}.com_x_m and so on"));
            }
        }
        let offsets = OFFSETS.iter().filter(|_| parameters.iter().any(|p| p.kind == Kind::Offset));
        names.extend(offsets.map(|name| (*name).to_owned()));
        names.extend(parameters.iter().map(|p| p.name.clone()));
        names
    }
}

/// Finds a link by its name, or the only one where none is named.
fn find_link<'a>(
    statement: &str,
    named: Option<&str>,
    parameters: &'a [Parameter],
) -> Result<&'a str, KnownError> {
    let links = links(parameters);
    let found = match (named, links.as_slice()) {
        (None, [only]) => Some(*only),
        (None, _) => None,
        (Some(named), _) => links.iter().copied().find(|link| *link == named),
    };
    found.ok_or_else(|| KnownError::Link {
        name: statement.to_owned(),
        links: links.into_iter().map(str::to_owned).collect(),
    })
}

/// Returns the sum of the three moments, each with its σ; `None` if it may be anything down to nothing.
pub(super) fn trace(moments: [Option<[f64; 2]>; 3]) -> Option<f64> {
    let (mut sum, mut sigma) = (0.0, 0.0);
    for moment in moments {
        let [value, sd] = moment?;
        sum += value;
        sigma += sd;
    }
    (sum > 2.0 * sigma).then_some(sum)
}
