//! A model of a file system that loses power.
//!
//! Changes that have not been synced may be lost: of a file any of its writes, sector by sector; of
//! a folder its latest changes of names, in their order; a rename from one folder into another
//! happens in both or in neither. Syncing a file also keeps its own name and those of the folders
//! above it, as the journals of ext4, XFS and btrfs do, but no other files.
//! Mapped shared memory is never on the medium.

use super::{Operation, What};
use crate::random::Random;
use std::collections::{BTreeMap, BTreeSet};
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
    /// The number of operations so far.
    operations: usize,
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
    /// Since the last sync.
    since: Vec<Renaming>,
    now: Names,
}

/// The names that one operation gave to a node or removed in a folder: they happen together, also with
/// those in another folder, or not at all.
#[derive(Clone, Debug)]
struct Renaming {
    operation: usize,
    done: u64,
    names: Vec<Naming>,
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
            operations: 0,
        }
    }
}

impl Disk {
    /// A copy of a folder, of which everything is certainly on the medium.
    ///
    /// # Errors
    /// Those of the file system.
    pub fn holding(folder: &Path) -> io::Result<Self> {
        let mut disk = Self::default();
        disk.hold(0, folder)?;
        Ok(disk)
    }

    fn hold(&mut self, at: usize, folder: &Path) -> io::Result<()> {
        let mut names = Names::new();
        for entry in fs::read_dir(folder)? {
            let entry = entry?;
            let node = self.nodes.len();
            if entry.file_type()?.is_dir() {
                self.nodes.push(Node::Folder(Folder::default()));
                self.hold(node, &entry.path())?;
            } else {
                let certain = fs::read(entry.path())?;
                let length = certain.len() as u64;
                self.nodes.push(Node::File(File {
                    certain,
                    length,
                    since: Vec::new(),
                }));
            }
            names.insert(entry.file_name().to_string_lossy().into_owned(), node);
        }
        self.nodes[at] = Node::Folder(Folder {
            certain: names.clone(),
            since: Vec::new(),
            now: names,
        });
        Ok(())
    }

    /// Carries out an operation. Operations on a file that has no name any more are ignored.
    ///
    /// # Panics
    /// If it is impossible, so the operations are not those of one run.
    pub fn apply(&mut self, operation: &Operation) {
        let done = operation.done;
        self.operations += 1;
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
            What::SyncAll => {
                for at in 0..self.nodes.len() {
                    self.sync_node(operation.asked, at);
                }
            }
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

    /// The folder of a name, and the name.
    fn place<'a>(&self, path: &'a Path) -> (usize, &'a str) {
        let folder = path.parent().and_then(|parent| self.find(parent));
        let name = path.file_name().and_then(|name| name.to_str());
        (
            folder.expect("the folder is there"),
            name.expect("a name in UTF-8"),
        )
    }

    /// Gives and removes names, as one change.
    fn name(&mut self, done: u64, changes: Vec<(&PathBuf, Option<usize>)>) {
        for (path, node) in changes {
            let (at, name) = self.place(path);
            let operation = self.operations;
            let Node::Folder(folder) = &mut self.nodes[at] else {
                panic!("{} is in no folder", path.display());
            };
            match node {
                Some(node) => folder.now.insert(name.to_owned(), node),
                None => folder.now.remove(name),
            };
            let naming = (name.to_owned(), node);
            match folder.since.last_mut() {
                Some(same) if same.operation == operation => same.names.push(naming),
                _ => folder.since.push(Renaming {
                    operation,
                    done,
                    names: vec![naming],
                }),
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
        self.sync_node(asked, at);
        for path in path.ancestors().filter(|path| path.parent().is_some()) {
            let (folder, name) = self.place(path);
            self.settle(folder, |change| {
                change.done <= asked && change.names.iter().any(|(other, _)| other == name)
            });
        }
    }

    fn sync_node(&mut self, asked: u64, at: usize) {
        match &mut self.nodes[at] {
            Node::File(file) => {
                let done = file.since.iter().take_while(|(done, _)| *done <= asked);
                let until = done.count();
                for (_, change) in file.since.drain(..until) {
                    change.apply(&mut file.certain);
                }
            }
            Node::Folder(_) => self.settle(at, |change| change.done <= asked),
        }
    }

    /// Makes the changes of a folder certain up to the last one that is `wanted`, and with them those
    /// of other folders that happen together with one of these.
    fn settle(&mut self, at: usize, wanted: impl Fn(&Renaming) -> bool) {
        let Node::Folder(folder) = &mut self.nodes[at] else {
            return;
        };
        let last = folder.since.iter().rposition(wanted);
        let mut together = Vec::new();
        for change in folder.since.drain(..last.map_or(0, |at| at + 1)) {
            rename(&mut folder.certain, &change.names);
            together.push(change.operation);
        }
        if !together.is_empty() {
            for other in 0..self.nodes.len() {
                let settled: &dyn Fn(&Renaming) -> bool =
                    &|change| together.contains(&change.operation);
                self.settle(other, settled);
            }
        }
    }

    /// Writes what a loss of power leaves into a new folder.
    ///
    /// # Errors
    /// Those of the file system.
    pub fn leave(&self, left: &mut Left<'_>, target: &Path) -> io::Result<()> {
        let kept = self.kept(left);
        self.leave_node(0, &kept, left, target)
    }

    /// Of each node that is a folder, how many of its uncertain changes are left.
    fn kept(&self, left: &mut Left<'_>) -> Vec<usize> {
        let all: Vec<&[Renaming]> = self
            .nodes
            .iter()
            .map(|node| match node {
                Node::Folder(folder) => &*folder.since,
                Node::File(_) => &[],
            })
            .collect();
        let mut kept: Vec<usize> = all
            .iter()
            .map(|changes| match left {
                Left::All => changes.len(),
                Left::Nothing => 0,
                Left::Some(random) => random.below(changes.len() + 1),
            })
            .collect();
        loop {
            let lost: BTreeSet<usize> = all
                .iter()
                .zip(&kept)
                .flat_map(|(changes, &kept)| &changes[kept..])
                .map(|change| change.operation)
                .collect();
            let mut settled = true;
            for (changes, kept) in all.iter().zip(&mut kept) {
                let half = changes[..*kept]
                    .iter()
                    .position(|change| lost.contains(&change.operation));
                settled &= half.is_none();
                *kept = half.unwrap_or(*kept);
            }
            if settled {
                return kept;
            }
        }
    }

    fn leave_node(
        &self,
        at: usize,
        kept: &[usize],
        left: &mut Left<'_>,
        target: &Path,
    ) -> io::Result<()> {
        match &self.nodes[at] {
            Node::File(file) => fs::write(target, file.left(left)),
            Node::Folder(folder) => {
                fs::create_dir(target)?;
                let mut names = folder.certain.clone();
                for change in &folder.since[..kept[at]] {
                    rename(&mut names, &change.names);
                }
                for (name, node) in names {
                    self.leave_node(node, kept, left, &target.join(name))?;
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

fn rename(names: &mut Names, changes: &[Naming]) {
    for (name, node) in changes {
        match node {
            Some(node) => names.insert(name.clone(), *node),
            None => names.remove(name),
        };
    }
}
