//! Writes two reports of made-up experiments into the folder given as argument: `cargo run --example
//! report_demo -- FOLDER`.

#[path = "../cli/tests/integration/report/synthetic.rs"]
mod synthetic;

use std::path::PathBuf;

fn main() -> std::io::Result<()> {
    let folder = PathBuf::from(std::env::args().nth(1).unwrap_or_else(|| ".".to_owned()));
    std::fs::create_dir_all(&folder)?;
    for (name, made_up) in
        [("identified", synthetic::experiment(1000.0)), ("still-poses", synthetic::still_poses())]
    {
        let page = made_up.page();
        let path = folder.join(format!("{name}.html"));
        std::fs::write(&path, &page)?;
        println!("{} ({} kB)\n", path.display(), page.len() / 1000);
        println!("{}", made_up.text());
    }
    Ok(())
}
