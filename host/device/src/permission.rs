//! The users who may open a port: the group that owns it, and whether this user is in it.

use std::path::Path;

/// Holds the group that owns a port against the user's.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Ownership {
    /// The group's name, or its number where it has none.
    pub group: String,
    /// This process may use what the group owns.
    pub has_group: bool,
    /// The user is a member, and has not logged in anew since.
    pub needs_login: bool,
}

impl Ownership {
    /// Returns what to type so that the port can be opened.
    pub fn advice(&self) -> String {
        if self.needs_login {
            format!("you are in the group {} since your last login: log out and in again", self.group)
        } else {
            format!("`sudo usermod -aG {} $USER`, then log out and in again", self.group)
        }
    }
}

/// Returns whose a port is; `None` where the system has no such groups or does not say.
#[cfg(unix)]
pub fn ownership(port: &str) -> Option<Ownership> {
    use std::os::unix::fs::MetadataExt;

    let gid = std::fs::metadata(Path::new(port)).ok()?.gid();
    let groups = std::fs::read_to_string("/etc/group").ok()?;
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let user = std::env::var("USER").unwrap_or_default();
    Some(judge(gid, &groups, &status, &user))
}

/// Returns whose a port is; this system has no such groups.
#[cfg(not(unix))]
pub fn ownership(port: &str) -> Option<Ownership> {
    let _ = Path::new(port);
    None
}

/// Judges by the texts of `/etc/group` and of `/proc/self/status`.
#[cfg_attr(not(unix), allow(dead_code, reason = "the texts are Unix's"))]
fn judge(gid: u32, groups: &str, status: &str, user: &str) -> Ownership {
    let gid = gid.to_string();
    let line = groups.lines().map(|line| line.split(':').collect::<Vec<_>>());
    let line = line.into_iter().find(|fields| fields.get(2) == Some(&gid.as_str()));
    let name = line.as_ref().and_then(|fields| fields.first()).map_or(gid.as_str(), |name| name);
    let members = line.as_ref().and_then(|fields| fields.get(3)).copied().unwrap_or_default();
    let has = |key: &str| {
        let said = status.lines().find_map(|line| line.strip_prefix(key));
        said.is_some_and(|said| said.split_whitespace().any(|word| word == gid))
    };
    // The superuser needs no group.
    let is_root = status
        .lines()
        .any(|line| line.strip_prefix("Uid:").is_some_and(|ids| ids.split_whitespace().nth(1) == Some("0")));
    let has_group = is_root || has("Groups:") || has("Gid:");
    let is_member = !user.is_empty() && members.split(',').any(|member| member == user);
    Ownership { group: name.to_owned(), has_group, needs_login: !has_group && is_member }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GROUPS: &str = "root:x:0:\ndialout:x:20:ann,ben\nusers:x:100:\n";

    #[test]
    fn a_user_who_is_not_in_the_group_is_advised_to_join_and_a_member_to_log_in() {
        let of = |groups: &str, user: &str| {
            judge(
                20,
                GROUPS,
                &format!("Name:\tx\nUid:\t1000\t1000\nGid:\t1000\t1000\nGroups:\t{groups}\n"),
                user,
            )
        };
        let may = of("20 100 ", "ann");
        assert_eq!((may.group.as_str(), may.has_group, may.needs_login), ("dialout", true, false));
        let stranger = of("100 ", "eve");
        assert!(!stranger.has_group && stranger.advice().contains("usermod -aG dialout"));
        let member = of("100 ", "ben");
        assert!(member.needs_login && member.advice().contains("log out"));
        let root = judge(20, GROUPS, "Uid:\t0\t0\t0\t0\nGroups:\t0 \n", "root");
        assert!(root.has_group);
        assert_eq!(judge(77, GROUPS, "", "ann").group, "77");
    }
}
