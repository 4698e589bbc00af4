//! The meaning of the names of base parameters.

/// Returns a sentence that explains the names, where there are any to explain.
pub fn legend<'a>(names: impl Iterator<Item = &'a str>) -> Option<String> {
    let (mut grouped, mut primed) = (false, false);
    for name in names {
        let quantity = name.rsplit_once('.').map_or("", |(_, quantity)| quantity);
        let own = quantity.trim_end_matches('\'');
        if ["M", "MSx", "MSy", "MSz"].contains(&own)
            || own.strip_prefix('J').is_some_and(|axes| axes.len() == 2)
        {
            grouped = true;
            primed |= quantity.ends_with('\'');
        }
    }
    grouped.then(|| {
        let mut said = "M, MS and J are the mass, the first moment and the tensor about the joint of a link \
                        with the parts of links beyond it that cannot be distinguished from it"
            .to_owned();
        if primed {
            said += "; with a prime (MSx', Jzz') in axes turned so that z' is the joint's axis, which is \
                     none of the link's";
        }
        said
    })
}

#[cfg(test)]
mod tests {
    use super::legend;

    #[test]
    fn primes_are_explained_where_there_are_any() {
        assert_eq!(legend(["offset_fx", "elbow.viscous"].into_iter()), None);
        assert!(!legend(["arm.MSx"].into_iter()).unwrap().contains("prime"));
        assert!(legend(["arm.M", "arm.Jzz'"].into_iter()).unwrap().contains("z' is the joint's axis"));
    }
}
