//! The output folder: files appear whole or not at all, and nothing is deleted that this run did not write.

use std::fs;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

use super::OutputError;

/// A folder that results are written to.
#[derive(Debug)]
pub(super) struct OutputFolder {
    path: PathBuf,
}

impl OutputFolder {
    /// Creates the folder; one that holds something already is refused unless `overwrite`.
    pub(super) fn create(path: &Path, overwrite: bool) -> Result<Self, OutputError> {
        fs::create_dir_all(path).map_err(writing(path))?;
        let mut entries = fs::read_dir(path).map_err(writing(path))?;
        if !overwrite && entries.next().is_some() {
            return Err(OutputError::Exists { path: path.into() });
        }
        let folder = Self { path: path.into() };
        // A folder that cannot be written is found now, not after an hour.
        drop(folder.begin("run.log")?);
        Ok(folder)
    }

    /// A folder within this one.
    pub(super) fn subfolder(&self, name: &str) -> Result<Self, OutputError> {
        let path = self.path.join(name);
        fs::create_dir_all(&path).map_err(writing(&path))?;
        Ok(Self { path })
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Writes a whole file at once.
    pub(super) fn write(&self, name: &str, bytes: &[u8]) -> Result<(), OutputError> {
        let mut file = self.begin(name)?;
        file.append(bytes)?;
        file.finish()
    }

    /// Begins a file that takes its name when it is finished; dropped before, it leaves nothing behind.
    pub(super) fn begin(&self, name: &str) -> Result<PendingFile, OutputError> {
        let path = self.path.join(name);
        let temporary = temporary_beside(&self.path, name).map_err(writing(&path))?;
        Ok(PendingFile { writer: BufWriter::new(temporary), path })
    }
}

/// A file on its way.
#[derive(Debug)]
pub(super) struct PendingFile {
    writer: BufWriter<NamedTempFile>,
    path: PathBuf,
}

impl PendingFile {
    pub(super) fn append(&mut self, bytes: &[u8]) -> Result<(), OutputError> {
        self.writer.write_all(bytes).map_err(writing(&self.path))
    }

    pub(super) fn finish(self) -> Result<(), OutputError> {
        let path = self.path;
        let file = self.writer.into_inner().map_err(|e| writing(&path)(e.into_error()))?;
        file.persist(&path).map_err(|e| writing(&path)(e.error))?;
        Ok(())
    }
}

/// Begins a file of any path; one that is there already is refused unless `overwrite`.
pub(super) fn begin_file(path: &Path, overwrite: bool) -> Result<PendingFile, OutputError> {
    if !overwrite && path.exists() {
        return Err(OutputError::FileExists { path: path.into() });
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    fs::create_dir_all(folder).map_err(writing(folder))?;
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let temporary = temporary_beside(folder, &name).map_err(writing(path))?;
    Ok(PendingFile { writer: BufWriter::new(temporary), path: path.into() })
}

fn temporary_beside(folder: &Path, name: &str) -> std::io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    let prefix = format!(".{name}.");
    builder.prefix(&prefix).suffix(".partial");
    // Temporary files are private by default; results are for everybody whom the umask allows.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    builder.tempfile_in(folder)
}

fn writing(path: &Path) -> impl FnOnce(std::io::Error) -> OutputError + '_ {
    move |source| OutputError::Write { path: path.into(), source }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).expect("a folder");
        entries.map(|e| e.expect("an entry").file_name().to_string_lossy().into_owned()).collect()
    }

    #[test]
    fn a_file_appears_when_it_is_finished_and_not_before() {
        let root = tempfile::tempdir().expect("a folder");
        let folder = OutputFolder::create(root.path(), false).expect("writable");
        let mut file = folder.begin("a.txt").expect("writable");
        file.append(b"whole").expect("writable");
        assert!(!root.path().join("a.txt").exists());
        file.finish().expect("writable");
        assert_eq!(fs::read(root.path().join("a.txt")).expect("readable"), b"whole");
        assert_eq!(names(root.path()), ["a.txt"]);
    }

    #[test]
    fn a_file_that_is_given_up_leaves_nothing_and_keeps_the_old_one() {
        let root = tempfile::tempdir().expect("a folder");
        fs::write(root.path().join("a.txt"), "old").expect("writable");
        let folder = OutputFolder::create(root.path(), true).expect("writable");
        let mut file = folder.begin("a.txt").expect("writable");
        file.append(b"half").expect("writable");
        drop(file);
        assert_eq!(fs::read(root.path().join("a.txt")).expect("readable"), b"old");
        assert_eq!(names(root.path()), ["a.txt"]);
    }

    #[test]
    fn only_an_empty_folder_is_taken_without_overwriting() {
        let root = tempfile::tempdir().expect("a folder");
        assert!(OutputFolder::create(root.path(), false).is_ok());
        fs::write(root.path().join("mine"), "").expect("writable");
        let refused = OutputFolder::create(root.path(), false);
        assert!(matches!(refused, Err(OutputError::Exists { path }) if path == root.path()));
        assert!(OutputFolder::create(root.path(), true).is_ok());
        assert_eq!(names(root.path()), ["mine"]);
    }

    #[test]
    fn what_cannot_be_written_is_named() {
        let root = tempfile::tempdir().expect("a folder");
        let folder = OutputFolder::create(root.path(), false).expect("writable");
        let path = root.path().join("no/such/file");
        let error = folder.write("no/such/file", b"").expect_err("there is no such folder");
        assert_eq!(error.to_string(), format!("cannot write {}", path.display()));
    }
}
