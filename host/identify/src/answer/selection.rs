//! Selection of parameters by `--estimate`: what must be identified for success.

use rigident_fit::{Kind, Owner, Parameter};

/// Why a word of `--estimate` selects nothing.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SelectionError {
    /// It is no parameter, owner or kind.
    #[error(
        "`estimate` {word}: no parameter, link or drive of that name; there are m, mc, I, offset, and single \
         ones: {}",
        names.join(", ")
    )]
    Unknown {
        /// The word.
        word: String,
        /// Names of the parameters that there are.
        names: Vec<String>,
    },
    /// The offset is not estimated.
    #[error(
        "`estimate` offset: no offset is estimated here; it was known by the rig file, or eliminated by a \
         merge"
    )]
    NoOffset,
}

/// Returns the owner's name; empty for the one link of a rigid body.
pub fn owner_name(owner: &Owner) -> &str {
    match owner {
        Owner::Link(name) | Owner::Drive(name) | Owner::Channel(name) | Owner::Other(name) => name,
    }
}

/// Returns the indices of the parameters that must be identified, in ascending order.
///
/// A word is a parameter's name, a link or drive (all of theirs), or a kind: `m` masses, `mc` first moments,
/// `I` moments and products of inertia, `offset` the offsets of channels. Without words all but the offsets
/// of channels are meant.
///
/// # Errors
/// [`SelectionError`] for the first word that selects nothing.
///
/// ```
/// use rigident_identify::answer::selection::select;
/// use rigident_fit::{Kind, Owner, Parameter};
///
/// let parameter = |name: &str, kind| Parameter {
///     name: name.to_owned(),
///     owner: Owner::Link(String::new()),
///     kind,
///     unit: String::new(),
///     frame: "S".to_owned(),
///     made_of: Vec::new(),
/// };
/// let all = [parameter("m", Kind::Mass), parameter("mcx", Kind::FirstMoment)];
/// assert_eq!(select(&all, &["mc".to_owned()]), Ok(vec![1]));
/// ```
pub fn select(parameters: &[Parameter], words: &[String]) -> Result<Vec<usize>, SelectionError> {
    let is_offset = |p: &Parameter| matches!(p.owner, Owner::Channel(_)) && p.kind == Kind::Offset;
    let all = |good: &dyn Fn(&Parameter) -> bool| -> Vec<usize> {
        parameters.iter().enumerate().filter(|(_, p)| good(p)).map(|(j, _)| j).collect()
    };
    if words.is_empty() {
        return Ok(all(&|p| !is_offset(p)));
    }
    let mut selected = Vec::new();
    for word in words.iter().map(|w| w.trim()) {
        let of_link = |p: &Parameter, kind: Kind| p.kind == kind && matches!(p.owner, Owner::Link(_));
        let by_name = all(&|p| p.name == word);
        let by_owner = all(&|p| !word.is_empty() && owner_name(&p.owner) == word && !is_offset(p));
        let by_kind = match word {
            "m" => all(&|p| of_link(p, Kind::Mass)),
            "mc" => all(&|p| of_link(p, Kind::FirstMoment)),
            "I" => all(&|p| of_link(p, Kind::Inertia)),
            "offset" => all(&is_offset),
            _ => Vec::new(),
        };
        let found = [by_name, by_owner, by_kind].into_iter().find(|found| !found.is_empty());
        match found {
            Some(found) => selected.extend(found),
            None if word == "offset" => return Err(SelectionError::NoOffset),
            None => {
                let names = parameters.iter().map(|p| p.name.clone()).collect();
                return Err(SelectionError::Unknown { word: word.to_owned(), names });
            }
        }
    }
    selected.sort_unstable();
    selected.dedup();
    Ok(selected)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parameters() -> Vec<Parameter> {
        let make = |name: &str, owner: Owner, kind| Parameter {
            name: name.to_owned(),
            owner,
            kind,
            unit: String::new(),
            frame: String::new(),
            made_of: Vec::new(),
        };
        let arm = || Owner::Link("arm".to_owned());
        vec![
            make("arm.M", arm(), Kind::Mass),
            make("arm.MSx", arm(), Kind::FirstMoment),
            make("arm.Jxx", arm(), Kind::Inertia),
            make("offset_fx", Owner::Channel("fx".to_owned()), Kind::Offset),
            make("elbow.offset", Owner::Drive("elbow".to_owned()), Kind::Offset),
            make("elbow.rotor", Owner::Drive("elbow".to_owned()), Kind::Rotor),
        ]
    }

    fn selected(words: &[&str]) -> Result<Vec<usize>, SelectionError> {
        select(&parameters(), &words.iter().map(|w| (*w).to_owned()).collect::<Vec<_>>())
    }

    #[test]
    fn words_select_names_owners_and_kinds() {
        assert_eq!(selected(&[]), Ok(vec![0, 1, 2, 4, 5]));
        assert_eq!(selected(&["arm.MSx", "m"]), Ok(vec![0, 1]));
        assert_eq!(selected(&[" elbow "]), Ok(vec![4, 5]));
        assert_eq!(selected(&["I", "offset", "arm"]), Ok(vec![0, 1, 2, 3]));
    }

    #[test]
    fn words_that_select_nothing_are_refused() {
        assert!(matches!(selected(&["leg"]), Err(SelectionError::Unknown { word, .. }) if word == "leg"));
        let bare: Vec<Parameter> = parameters().into_iter().take(3).collect();
        assert_eq!(select(&bare, &["offset".to_owned()]), Err(SelectionError::NoOffset));
    }
}
