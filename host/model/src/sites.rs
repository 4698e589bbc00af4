//! Named points of an MJCF: its sites.

use std::path::Path;

use nalgebra::Vector3;

use super::xml::{self, exactly, numbers};
use super::{urdf, write};

/// Returns the link on which a site is, and where it is in the link's frame, m.
///
/// # Errors
/// Says that the file is no MJCF, that there is no such site, or that its place is not stated by `pos`.
pub fn site(path: &Path, name: &str) -> Result<(String, [f64; 3]), String> {
    let what = path.display().to_string();
    let text = urdf::text_of(path).map_err(|error| error.to_string())?;
    let document = xml::document(&text, &what).map_err(|error| error.to_string())?;
    if !document.root_element().has_tag_name("mujoco") {
        return Err(format!("{name}: {what} is no MJCF, and other languages have no sites"));
    }
    let sites = || document.descendants().filter(|node| node.has_tag_name("site"));
    let found = sites().find(|node| node.attribute("name") == Some(name)).ok_or_else(|| {
        let names: Vec<&str> = sites().filter_map(|node| node.attribute("name")).collect();
        format!(
            "{what} has no site {name}; it has {}",
            if names.is_empty() { "none".to_owned() } else { names.join(", ") }
        )
    })?;
    if found.attribute("fromto").is_some() {
        return Err(format!("site {name} is stated by fromto: a corner needs pos"));
    }
    let body = found.parent_element().and_then(|body| body.attribute("name"));
    let body = body.ok_or_else(|| format!("site {name} hangs on the world or on a body without name"))?;
    let place = match numbers(&found, "pos")? {
        None => [0.0; 3],
        Some(values) => exactly::<3>(values, &format!("pos of site {name}"))?,
    };
    // A link's origin is where its joint turns, a body's where its file puts it.
    let parsed = write::parse(&text, &what).map_err(|error| error.to_string())?;
    let anchor = parsed.anchors.get(body).copied().unwrap_or_else(Vector3::zeros);
    Ok((body.to_owned(), (Vector3::from(place) - anchor).into()))
}
