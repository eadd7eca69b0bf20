//! Stamps the git revision of the sources into the binary, for the outputs that must name it.

#![expect(
    clippy::disallowed_macros,
    clippy::disallowed_methods,
    reason = "a build script speaks to cargo by printing and reads its environment"
)]

use std::process::Command;

fn main() {
    println!("cargo:rerun-if-env-changed=TRACTRIX_GIT_REVISION");
    for path in ["HEAD", "logs/HEAD"] {
        if let Some(file) = git(&["rev-parse", "--git-path", path]) {
            println!("cargo:rerun-if-changed={file}");
        }
    }
    let revision = std::env::var("TRACTRIX_GIT_REVISION")
        .ok()
        .or_else(|| git(&["rev-parse", "HEAD"]))
        .unwrap_or_else(|| "unknown".to_owned());
    println!("cargo:rustc-env=TRACTRIX_GIT_REVISION={revision}");
}

/// First line of a git command's output; none without git or outside a repository.
fn git(args: &[&str]) -> Option<String> {
    let output = Command::new("git").args(args).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    (output.status.success() && !text.trim().is_empty()).then(|| text.trim().to_owned())
}
