//! Reads the lines of a file from the last to the first, without reading all of it.

use std::fs::File;
use std::io::{self, ErrorKind};
use std::os::unix::fs::FileExt as _;
use std::path::Path;

/// Bytes that are read at a time.
const BLOCK: u64 = 64 << 10;

/// The lines of a file, the last first, without their ends.
#[derive(Debug)]
pub(super) struct Backward {
    file: Option<File>,
    /// What lies before this place has not been read.
    at: u64,
    /// What was read and not handed out.
    rest: Vec<u8>,
}

impl Backward {
    /// Those of a file; none if it is not there.
    ///
    /// # Errors
    /// Whatever the file system answers.
    pub fn of(path: &Path) -> io::Result<Self> {
        let file = match File::open(path) {
            Err(error) if error.kind() == ErrorKind::NotFound => None,
            opened => Some(opened?),
        };
        let at = file
            .as_ref()
            .map_or(Ok(0), |file| file.metadata().map(|found| found.len()))?;
        let mut lines = Self {
            file,
            at,
            rest: Vec::new(),
        };
        lines.read()?;
        // The end of the last line begins no other one.
        lines.rest.pop_if(|byte| *byte == b'\n');
        Ok(lines)
    }

    /// Reads the block before what was read.
    fn read(&mut self) -> io::Result<()> {
        let Some(file) = &self.file else {
            return Ok(());
        };
        let from = self.at.saturating_sub(BLOCK);
        let mut block = vec![0; (self.at - from) as usize];
        file.read_exact_at(&mut block, from)?;
        block.append(&mut self.rest);
        (self.rest, self.at) = (block, from);
        Ok(())
    }

    fn line(&mut self) -> io::Result<Option<Vec<u8>>> {
        loop {
            if let Some(end) = self.rest.iter().rposition(|byte| *byte == b'\n') {
                let line = self.rest.split_off(end + 1);
                self.rest.truncate(end);
                return Ok(Some(line));
            }
            if self.at == 0 {
                let line = std::mem::take(&mut self.rest);
                return Ok(Some(line).filter(|line| !line.is_empty()));
            }
            self.read()?;
        }
    }
}

impl Iterator for Backward {
    type Item = io::Result<Vec<u8>>;

    fn next(&mut self) -> Option<Self::Item> {
        self.line().transpose()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_come_from_the_last_to_the_first_whatever_their_length() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lines");
        let read =
            || -> Vec<Vec<u8>> { Backward::of(&path).unwrap().map(Result::unwrap).collect() };
        assert_eq!(read(), Vec::<Vec<u8>>::new());
        for length in [1, 10, 65_535, 65_536, 65_537, 200_000] {
            let lines = [vec![b'a'; length], b"b".to_vec(), vec![b'c'; length]];
            for end in ["", "\n"] {
                let text = lines.join(&b'\n');
                std::fs::write(&path, [&text[..], end.as_bytes()].concat()).unwrap();
                let [first, second, third] = lines.clone();
                assert_eq!(read(), [third, second, first], "{length}");
            }
        }
        std::fs::write(&path, "").unwrap();
        assert_eq!(read(), Vec::<Vec<u8>>::new());
    }
}
