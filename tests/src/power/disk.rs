//! A model of a file system that loses power.
//!
//! Changes that have not been synced may be lost: of a file any of its writes, sector by sector; of
//! a folder its latest changes of names, in their order. Syncing a file also keeps its own name and
//! those of the folders above it, as the journals of ext4, XFS and btrfs do, but no other files.
//! Mapped shared memory is never on the medium.

use super::{Operation, What};
use crate::random::Random;
use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};
use std::{fs, io};

/// Bytes that are written completely or not at all.
const SECTOR: u64 = 512;

type Names = BTreeMap<String, usize>;

/// The state after all operations so far, and how much of it is certainly on the medium.
#[derive(Clone, Debug)]
pub struct Disk {
    /// The first node is the root folder, which always exists.
    nodes: Vec<Node>,
}

#[derive(Clone, Debug)]
enum Node {
    File(File),
    Folder(Folder),
}

#[derive(Clone, Debug, Default)]
struct File {
    /// The content that is certainly on the medium.
    certain: Vec<u8>,
    /// Changes since the last sync, each with the time when it was done.
    since: Vec<(u64, Change)>,
    length: u64,
}

#[derive(Clone, Debug)]
enum Change {
    Write { at: u64, bytes: Vec<u8> },
    Length(u64),
}

/// A name, and the node that it is given to; none if the name is removed.
type Naming = (String, Option<usize>);

#[derive(Clone, Debug, Default)]
struct Folder {
    certain: Names,
    /// Since the last sync: names that were given to a node or removed; those of one operation
    /// happen together or not at all.
    since: Vec<(u64, Vec<Naming>)>,
    now: Names,
}

/// How much of the uncertain changes a loss of power leaves.
#[derive(Debug)]
pub enum Left<'a> {
    /// All.
    All,
    /// None.
    Nothing,
    /// A random part.
    Some(&'a mut Random),
}

impl Default for Disk {
    fn default() -> Self {
        Self {
            nodes: vec![Node::Folder(Folder::default())],
        }
    }
}

impl Disk {
    /// Carries out an operation. Operations on a file that has no name any more are ignored.
    ///
    /// # Panics
    /// If it is impossible, so the operations are not those of one run.
    pub fn apply(&mut self, operation: &Operation) {
        let done = operation.done;
        match &operation.what {
            What::Open { path, empty } => {
                if self.find(path).is_none() {
                    self.nodes.push(Node::File(File::default()));
                    self.name(done, vec![(path, Some(self.nodes.len() - 1))]);
                } else if *empty {
                    self.change(done, path, Change::Length(0));
                }
            }
            What::Write { path, at, bytes } => {
                if let Some(Node::File(file)) = self.find(path).map(|at| &self.nodes[at]) {
                    let at = at.unwrap_or(file.length);
                    let bytes = bytes.clone();
                    self.change(done, path, Change::Write { at, bytes });
                }
            }
            What::Length { path, bytes } => self.change(done, path, Change::Length(*bytes)),
            What::Sync(path) => self.sync(operation.asked, path),
            What::Folder(path) => {
                self.nodes.push(Node::Folder(Folder::default()));
                self.name(done, vec![(path, Some(self.nodes.len() - 1))]);
            }
            What::Link { from, to } => {
                let node = self.find(from).expect("what is linked is there");
                self.name(done, vec![(to, Some(node))]);
            }
            What::Rename { from, to } => {
                let node = self.find(from).expect("what is renamed is there");
                self.name(done, vec![(from, None), (to, Some(node))]);
            }
            What::Remove(path) => self.name(done, vec![(path, None)]),
        }
    }

    fn find(&self, path: &Path) -> Option<usize> {
        let mut at = 0;
        for part in path.components() {
            match (&self.nodes[at], part) {
                (Node::Folder(folder), Component::Normal(name)) => {
                    at = *folder.now.get(name.to_str()?)?;
                }
                _ => return None,
            }
        }
        Some(at)
    }

    fn folder(&mut self, path: &Path) -> &mut Folder {
        let at = self.find(path).expect("the folder is there");
        match &mut self.nodes[at] {
            Node::Folder(folder) => folder,
            Node::File(_) => panic!("{} is no folder", path.display()),
        }
    }

    /// Gives and removes names; within one folder this is one change.
    fn name(&mut self, done: u64, changes: Vec<(&PathBuf, Option<usize>)>) {
        for (path, node) in changes {
            let parent = path.parent().expect("a name stands in a folder");
            let name = path.file_name().and_then(|name| name.to_str());
            let name = name.expect("a name in UTF-8").to_owned();
            let folder = self.folder(parent);
            match node {
                Some(node) => folder.now.insert(name.clone(), node),
                None => folder.now.remove(&name),
            };
            match folder.since.last_mut() {
                Some((same, together)) if *same == done => together.push((name, node)),
                _ => folder.since.push((done, vec![(name, node)])),
            }
        }
    }

    fn change(&mut self, done: u64, path: &Path, change: Change) {
        let Some(Node::File(file)) = self.find(path).map(|at| &mut self.nodes[at]) else {
            return;
        };
        file.length = match &change {
            Change::Write { at, bytes } => file.length.max(at + bytes.len() as u64),
            Change::Length(length) => *length,
        };
        file.since.push((done, change));
    }

    /// Makes certain what was done before `asked`.
    fn sync(&mut self, asked: u64, path: &Path) {
        let Some(at) = self.find(path) else {
            return;
        };
        match &mut self.nodes[at] {
            Node::File(file) => {
                let until = file
                    .since
                    .iter()
                    .take_while(|(done, _)| *done <= asked)
                    .count();
                for (_, change) in file.since.drain(..until) {
                    change.apply(&mut file.certain);
                }
            }
            Node::Folder(folder) => folder.settle(asked, |_| true),
        }
        let mut path = path;
        while let (Some(parent), Some(name)) = (path.parent(), path.file_name()) {
            self.folder(parent).settle(asked, |other| name == other);
            path = parent;
        }
    }

    /// Writes what a loss of power leaves into a new folder.
    ///
    /// # Errors
    /// Those of the file system.
    pub fn leave(&self, left: &mut Left<'_>, target: &Path) -> io::Result<()> {
        self.leave_node(0, left, target)
    }

    fn leave_node(&self, at: usize, left: &mut Left<'_>, target: &Path) -> io::Result<()> {
        match &self.nodes[at] {
            Node::File(file) => fs::write(target, file.left(left)),
            Node::Folder(folder) => {
                fs::create_dir(target)?;
                for (name, node) in folder.left(left) {
                    self.leave_node(node, left, &target.join(name))?;
                }
                Ok(())
            }
        }
    }
}

impl Change {
    fn apply(&self, content: &mut Vec<u8>) {
        match self {
            Self::Length(length) => content.resize(*length as usize, 0),
            Self::Write { at, bytes } => {
                let (start, end) = (*at as usize, *at as usize + bytes.len());
                if content.len() < end {
                    content.resize(end, 0);
                }
                content[start..end].copy_from_slice(bytes);
            }
        }
    }

    /// A write, split at sector boundaries.
    fn pieces(&self) -> Vec<Self> {
        let Self::Write { at, bytes } = self else {
            return vec![self.clone()];
        };
        let mut pieces = Vec::new();
        let mut start = 0;
        while start < bytes.len() {
            let place = at + start as u64;
            let end = bytes.len().min(start + (SECTOR - place % SECTOR) as usize);
            let bytes = bytes[start..end].to_vec();
            pieces.push(Self::Write { at: place, bytes });
            start = end;
        }
        pieces
    }
}

impl File {
    fn left(&self, left: &mut Left<'_>) -> Vec<u8> {
        let mut content = self.certain.clone();
        for (_, change) in &self.since {
            match left {
                Left::All => change.apply(&mut content),
                Left::Nothing => {}
                Left::Some(random) => {
                    // Mostly the whole write is kept or lost, sometimes a part of its sectors.
                    let torn = random.below(4) == 0;
                    let kept = random.below(2) == 0;
                    for piece in change.pieces() {
                        if if torn { random.below(2) == 0 } else { kept } {
                            piece.apply(&mut content);
                        }
                    }
                }
            }
        }
        content
    }
}

impl Folder {
    /// Makes certain what was done before `asked`, up to the last change of a name that is
    /// `wanted`.
    fn settle(&mut self, asked: u64, wanted: impl Fn(&str) -> bool) {
        let last = self.since.iter().rposition(|(done, names)| {
            *done <= asked && names.iter().any(|(name, _)| wanted(name))
        });
        let until = last.map_or(0, |at| at + 1);
        for (_, names) in self.since.drain(..until) {
            rename(&mut self.certain, &names);
        }
    }

    fn left(&self, left: &mut Left<'_>) -> Names {
        let until = match left {
            Left::All => self.since.len(),
            Left::Nothing => 0,
            Left::Some(random) => random.below(self.since.len() + 1),
        };
        let mut names = self.certain.clone();
        for (_, changes) in &self.since[..until] {
            rename(&mut names, changes);
        }
        names
    }
}

fn rename(names: &mut Names, changes: &[Naming]) {
    for (name, node) in changes {
        match node {
            Some(node) => names.insert(name.clone(), *node),
            None => names.remove(name),
        };
    }
}
