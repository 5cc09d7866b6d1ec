//! Reading operations on files from a log of `strace` with [`OPTIONS`].

use super::{Operation, What};
use std::collections::HashMap;
use std::ffi::OsString;
use std::fs;
use std::os::unix::ffi::OsStringExt as _;
use std::path::{Path, PathBuf};

/// All threads; times of start and end; descriptors with their paths; complete strings in
/// hexadecimal. The tracer is not the program's parent (-D), so that the program can be killed as
/// usual.
pub const OPTIONS: [&str; 11] = [
    "-D",
    "-f",
    "-ttt",
    "-T",
    "-y",
    "-xx",
    "-s",
    "16777216",
    "-q",
    "-e",
    "trace=openat,creat,open,close,write,pwrite64,writev,pwritev,pwritev2,truncate,ftruncate,fallocate,fsync,fdatasync,\
     syncfs,sync_file_range,rename,renameat,renameat2,link,linkat,symlink,symlinkat,unlink,unlinkat,mkdir,mkdirat,rmdir,\
     copy_file_range,sendfile,lseek",
];

/// One system call.
struct Call<'a> {
    name: &'a str,
    arguments: Vec<&'a str>,
    answer: i64,
    asked: u64,
    done: u64,
}

/// The file position of each descriptor; none if it always writes at the end.
type Places = HashMap<String, Option<u64>>;

/// The operations below `root` in the order in which they were done.
///
/// # Panics
/// If the log contains a call that is not modelled.
pub fn operations(log: &str, root: &Path) -> Vec<Operation> {
    let mut unfinished: HashMap<&str, (u64, &str)> = HashMap::new();
    let mut places = Places::new();
    let mut found = Vec::new();
    for line in log.lines() {
        // Numbers of threads are padded.
        let Some((thread, line)) = split(line.trim_start()) else {
            continue;
        };
        let Some((time, rest)) = split(line) else {
            continue;
        };
        let time = micros(time);
        if let Some(begun) = rest.strip_suffix("<unfinished ...>") {
            unfinished.insert(thread, (time, begun));
        } else if let Some(resumed) = rest.strip_prefix("<... ") {
            let (_, end) = resumed.split_once(" resumed>").expect("a resumed call");
            if let Some((asked, begun)) = unfinished.remove(thread) {
                let whole = format!("{begun}{end}");
                found.extend(
                    call(&whole, asked, Some(time))
                        .and_then(|call| operation(call, &mut places, root)),
                );
            }
        } else {
            found
                .extend(call(rest, time, None).and_then(|call| operation(call, &mut places, root)));
        }
    }
    found.sort_by_key(|operation: &Operation| operation.done);
    found
}

fn split(text: &str) -> Option<(&str, &str)> {
    let (word, rest) = text.split_once(' ')?;
    Some((word, rest.trim_start()))
}

fn micros(time: &str) -> u64 {
    let (seconds, micros) = time.split_once('.').expect("seconds with a fraction");
    seconds.parse::<u64>().expect("seconds") * 1_000_000 + micros.parse::<u64>().expect("µs")
}

/// The call in a line; none if the line is no call, or the call failed.
fn call(text: &str, asked: u64, resumed: Option<u64>) -> Option<Call<'_>> {
    let (name, rest) = text.split_once('(')?;
    let (arguments, end) = rest.rsplit_once(") = ")?;
    let number = end.split(['<', ' ']).next()?;
    let answer: i64 = number.parse().ok()?;
    let took = end
        .rsplit_once('<')
        .and_then(|(_, took)| took.strip_suffix('>'));
    let took = took.map_or(0, micros);
    // The first time is that of the start; a call that was interrupted in the log names its end.
    let done = resumed.unwrap_or(asked + took);
    (answer >= 0).then(|| Call {
        name,
        arguments: arguments.split(", ").map(str::trim).collect(),
        answer,
        asked,
        done,
    })
}

/// The bytes of a string, or of a descriptor's path.
fn bytes(text: &str) -> Vec<u8> {
    let pairs = text.split("\\x").skip(1);
    let byte = |pair: &str| u8::from_str_radix(pair.get(..2).unwrap_or_default(), 16);
    pairs.map(|pair| byte(pair).expect("hexadecimal")).collect()
}

fn path(text: &str) -> PathBuf {
    PathBuf::from(OsString::from_vec(bytes(text)))
}

/// The number of a descriptor, and its file; none if that has no name any more.
fn descriptor(text: &str) -> (&str, Option<PathBuf>) {
    let (number, rest) = text.split_once('<').unwrap_or((text, ""));
    (number, (!rest.contains("(deleted)")).then(|| path(rest)))
}

/// A name relative to a folder's descriptor.
fn at(folder: &str, name: &str) -> PathBuf {
    descriptor(folder).1.unwrap_or_default().join(path(name))
}

/// The position of a descriptor before a transfer of so many bytes; none if it always writes at the
/// end.
fn passed(places: &mut Places, text: &str, bytes: i64) -> Option<u64> {
    let place = places
        .entry(descriptor(text).0.to_owned())
        .or_insert(Some(0));
    let before = *place;
    if let Some(place) = place {
        *place += bytes as u64;
    }
    before
}

fn operation(call: Call<'_>, places: &mut Places, root: &Path) -> Option<Operation> {
    let Call {
        name,
        arguments,
        answer,
        asked,
        done,
    } = call;
    let inside = |path: PathBuf| path.strip_prefix(root).ok().map(Path::to_path_buf);
    let file = |text: &str| descriptor(text).1.and_then(inside);
    let first = *arguments.first()?;
    let what = match name {
        "openat" => {
            let flags = arguments[2];
            let opened = arguments[2].contains("O_APPEND");
            places.insert(answer.to_string(), (!opened).then_some(0));
            if !(flags.contains("O_WRONLY") || flags.contains("O_RDWR")) {
                return None;
            }
            What::Open {
                path: inside(at(first, arguments[1]))?,
                empty: flags.contains("O_TRUNC"),
            }
        }
        "lseek" => {
            let (number, _) = descriptor(first);
            if let Some(Some(place)) = places.get_mut(number) {
                *place = answer as u64;
            }
            return None;
        }
        "write" => {
            let at = passed(places, first, answer);
            let mut bytes = bytes(arguments[1]);
            bytes.truncate(answer as usize);
            What::Write {
                path: file(first)?,
                at,
                bytes,
            }
        }
        // The other file is one that the run only reads.
        "copy_file_range" => {
            let from = passed(places, first, answer).expect("a place to read from") as usize;
            let at = passed(places, arguments[2], answer);
            let path = file(arguments[2])?;
            let whole = fs::read(descriptor(first).1?).expect("the file that was copied");
            let bytes = whole[from..from + answer as usize].to_vec();
            What::Write { path, at, bytes }
        }
        "pwrite64" => {
            let mut bytes = bytes(arguments[1]);
            bytes.truncate(answer as usize);
            What::Write {
                path: file(first)?,
                at: Some(arguments[3].parse().expect("a place")),
                bytes,
            }
        }
        "ftruncate" => What::Length {
            path: file(first)?,
            bytes: arguments[1].parse().expect("a length"),
        },
        "syncfs" => file(first).map(|_| What::SyncAll)?,
        "fsync" | "fdatasync" => What::Sync(file(first)?),
        "mkdir" => What::Folder(inside(path(first))?),
        "rename" => What::Rename {
            from: inside(path(first))?,
            to: inside(path(arguments[1]))?,
        },
        "link" => What::Link {
            from: inside(path(first))?,
            to: inside(path(arguments[1]))?,
        },
        "linkat" => What::Link {
            from: inside(at(first, arguments[1]))?,
            to: inside(at(arguments[2], arguments[3]))?,
        },
        "unlink" | "rmdir" => What::Remove(inside(path(first))?),
        "unlinkat" => What::Remove(inside(at(first, arguments[1]))?),
        "close" => return None,
        // Shared memory, pipes and sockets are elsewhere.
        other => {
            let ours = |text: &&str| inside(path(text)).is_some() || file(text).is_some();
            let concerned = arguments.iter().any(ours);
            assert!(!concerned, "{other} is not modelled: {arguments:?}");
            return None;
        }
    };
    Some(Operation { asked, done, what })
}
