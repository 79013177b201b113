//! Files and folders that commands write: checked before the work, written whole.

use anyhow::{Context, bail};
use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Makes a folder if need be; an error where no file can be written there. To be called before anything is computed.
pub(crate) fn make_writable(folder: &Path) -> anyhow::Result<()> {
    fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
    let probe = part_of(&folder.join("writable"));
    let written = File::create_new(&probe).and_then(|mut file| {
        let written = file.write_all(b"?");
        fs::remove_file(&probe)?;
        written
    });
    written.with_context(|| format!("cannot write into {}", folder.display()))
}

/// Makes a file's folder; an error where the file cannot be written, or where a folder, a device or a pipe has its name, which would be
/// replaced. To be called before anything is computed.
pub(crate) fn make_writable_for(file: &Path) -> anyhow::Result<()> {
    match fs::symlink_metadata(file) {
        Ok(there) if there.is_dir() => bail!(
            "{} is a folder; the name of a file is needed",
            file.display()
        ),
        Ok(there) if !there.is_file() => bail!(
            "{} is there and no regular file; the name of a new file, or of one to be replaced, is needed",
            file.display()
        ),
        _ => {}
    }
    let folder = file.parent().filter(|folder| *folder != Path::new(""));
    make_writable(folder.unwrap_or(Path::new(".")))
        .with_context(|| format!("cannot write {}", file.display()))
}

/// An error where a folder has one of these files already.
pub(crate) fn refuse_existing(folder: &Path, files: &[&str]) -> anyhow::Result<()> {
    match files.iter().find(|file| folder.join(file).exists()) {
        None => Ok(()),
        Some(file) => bail!(
            "{} is there already: name another folder, or remove it",
            folder.join(file).display()
        ),
    }
}

/// Writes a text file that readers see whole or not at all.
pub(crate) fn write_whole(file: &Path, text: &str) -> anyhow::Result<()> {
    let part = part_of(file);
    let written = fs::write(&part, text).and_then(|()| fs::rename(&part, file));
    if written.is_err() {
        let _ = fs::remove_file(&part);
    }
    written.with_context(|| format!("cannot write {}", file.display()))
}

/// A name for a partly written file beside a file, different in each process.
fn part_of(file: &Path) -> PathBuf {
    file.with_extension(format!("{}.part", std::process::id()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::symlink;

    #[test]
    fn only_a_file_is_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::write(at("file"), "").unwrap();
        make_writable_for(&at("file")).unwrap();
        make_writable_for(&at("free")).unwrap();
        symlink("/dev/null", at("device")).unwrap();
        symlink("loop", at("loop")).unwrap();
        for name in ["device", "loop", "file/below", ""] {
            let path = at(name);
            let said = make_writable_for(&path).unwrap_err().to_string();
            assert!(said.contains(path.to_str().unwrap()), "{said}");
        }
    }
}
