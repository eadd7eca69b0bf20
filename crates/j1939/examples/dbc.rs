//! Prints the table of messages as a DBC, for tools that read CAN logs.
//!
//! `cargo run --release -p tractrix-j1939 --example dbc > tractrix.dbc`

use std::io::Write as _;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut text = String::new();
    j1939::dbc::write(&mut text)?;
    std::io::stdout().write_all(text.as_bytes())?;
    Ok(())
}
