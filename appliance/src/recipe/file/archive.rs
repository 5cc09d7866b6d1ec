//! A recipe as one file: an uncompressed ZIP of `recipe.json` and NumPy arrays, with a fingerprint.

use super::refusal::refused;
use super::{FORMAT, VERSION};
use crate::recipe::{RecipeFile, Refusal};
use crate::storage::archive::{Members, packed};
use crate::storage::hex;
use crate::system::headway::Headway;
use hal::bounds::shortened;
use hal::{bounds, npy};
use sha2::{Digest, Sha256};
use std::io::{Read, Seek};
use std::sync::Arc;
use zip::read::ZipFile;

/// The manifest's name in the archive.
const MANIFEST: &str = "recipe.json";
/// The manifest and twelve arrays.
const MAX_MEMBERS: usize = 13;
/// The largest manifest that is read, in bytes.
const MAX_MANIFEST: u64 = 8 << 20;
/// Room for what the archive and the array say of a member, bytes.
const HEADERS: usize = 512;
/// The fingerprint in the manifest while the fingerprint is computed.
const NO_FINGERPRINT: &str = "0000000000000000000000000000000000000000000000000000000000000000";

/// A member of the archive: its name, and what makes its content, which is large.
pub(crate) type Member<'a> = (&'static str, MakeContent<'a>);
type MakeContent<'a> = Box<dyn Fn() -> Vec<u8> + 'a>;

/// Defines [`Arrays`] with what is done to each of them by its name, which is also that of its
/// member.
macro_rules! arrays {
    ($($(#[$doc:meta])* $name:ident: $element:ty,)*) => {
        /// The arrays of a recipe, row-major over the camera's frame except the phase function and
        /// the amplitude. Clones share them: at 1456 × 1088 pixels they take 60 MB.
        #[derive(Clone, Debug, Default, PartialEq)]
        pub struct Arrays {
            $($(#[$doc])* pub $name: Arc<[$element]>,)*
        }

        impl Arrays {
            /// The name and the number of values of each array.
            pub(crate) fn lengths(&self) -> Vec<(&'static str, usize)> {
                vec![$((stringify!($name), self.$name.len())),*]
            }

            /// Their bytes.
            fn size(&self) -> usize {
                0 $(+ size_of_val(&*self.$name))*
            }

            /// The arrays by their members' names, in rows of as many `columns` as an array of this
            /// name has.
            fn members<'a>(&'a self, columns: impl Fn(&str) -> usize) -> Vec<Member<'a>> {
                vec![$({
                    let columns = columns(stringify!($name));
                    let content = move || npy::write(columns, &self.$name);
                    (concat!(stringify!($name), ".npy"), Box::new(content) as MakeContent<'a>)
                }),*]
            }

            /// Sets an array to the content of its member.
            fn read(&mut self, member: &str, bytes: &[u8]) -> Result<(), Refusal> {
                match member {
                    $(concat!(stringify!($name), ".npy") => self.$name = read(member, bytes)?.into(),)*
                    unknown => return Err(broken(format!("it holds an unknown member {unknown:?}"))),
                }
                Ok(())
            }
        }
    };
}

arrays! {
    /// Φ_P over the projector's raster in turns; empty where the pattern is given by a formula.
    phase_function: f64,
    /// Φ as taught in turns, NaN where not resolved.
    golden_phase: f64,
    /// z as taught in mm, NaN where not resolved.
    golden_height: f32,
    /// ∂z/∂Φ in mm per turn.
    height_slope: f32,
    /// ∂²z/∂Φ² in mm per turn².
    height_curvature: f32,
    /// Weight of a pixel's deviation from golden ([`algo::inspect::Weight::bits`]); 0 where it is
    /// not compared.
    valid: u8,
    /// Modulation as taught, in counts.
    modulation: f32,
    /// Largest |ΔΦ| in turns that a placement within the tolerance can cause; infinite where golden
    /// is not resolved.
    phase_reach: f32,
    /// For all sequences but the full one, behind each other: Φ as taught by this sequence less
    /// `golden_phase`, 1/65536 turn. Empty where golden was not measured with them.
    sequence_offset: i16,
    /// The light of each pixel of the projector's raster, in 1/255 of what its pattern asks for;
    /// empty where that is all of it.
    amplitude: u8,
    /// Least side of the squares of a deviation about each pixel, in pixels; empty where any will
    /// do.
    smoothing: u8,
    /// The demodulated light of the finest level of the full sequence, its real and its imaginary
    /// part behind each other, in 1/64 count of an 8-bit sample; empty where it was not measured.
    golden_signal: i16,
}

impl Arrays {
    /// The largest of [`Self::smoothing`]; 0 where any side will do.
    pub fn widest(&self) -> usize {
        self.smoothing.iter().copied().max().map_or(0, usize::from)
    }
}

/// What is wrong with a file that is not a ZIP, lacks a member, or has one that cannot be read;
/// with the remedy.
pub(crate) fn broken(what: impl std::fmt::Display) -> Refusal {
    let what = shortened(&what.to_string());
    format!("{what}: export the recipe again or teach it").into()
}

/// Packs a recipe; its fingerprint is filled in. Returns the bytes and the fingerprint.
///
/// # Errors
/// In words: the archive cannot be made.
pub fn pack(file: &RecipeFile, arrays: &Arrays) -> Result<(Vec<u8>, String), Refusal> {
    pack_telling(file, arrays, Headway::silent())
}

/// As [`pack`], telling how far it is.
pub(crate) fn pack_telling(
    file: &RecipeFile,
    arrays: &Arrays,
    headway: Headway<'_>,
) -> Result<(Vec<u8>, String), Refusal> {
    let zeroed = RecipeFile {
        fingerprint: NO_FINGERPRINT.into(),
        ..file.clone()
    };
    let manifest = serde_json::to_string_pretty(&zeroed).map_err(broken)?;
    seal(&manifest, members(file, arrays), arrays.size(), headway)
}

/// The arrays by their members' names; one that is empty has no member.
pub(crate) fn members<'a>(file: &RecipeFile, arrays: &'a Arrays) -> Vec<Member<'a>> {
    let mut members = arrays.members(|name| match name {
        "phase_function" | "amplitude" => file.projector.width as usize,
        "golden_signal" => 2 * file.camera.width as usize,
        _ => file.camera.width as usize,
    });
    let mut lengths = arrays.lengths().into_iter();
    members.retain(|_| lengths.next().is_some_and(|(_, length)| length > 0));
    members
}

/// Packs the text of a manifest whose fingerprint is zeros with its arrays of about `size` bytes, as
/// [`pack`] does. One array at a time is in memory twice.
pub(crate) fn seal(
    manifest: &str,
    members: Vec<Member<'_>>,
    size: usize,
    headway: Headway<'_>,
) -> Result<(Vec<u8>, String), Refusal> {
    let fingerprint = fingerprint(manifest.as_bytes(), &members);
    let manifest = manifest.replacen(NO_FINGERPRINT, &fingerprint, 1);
    // What is written can be read.
    if manifest.len() as u64 > MAX_MANIFEST {
        let size = manifest.len();
        return refused!(
            "{MANIFEST} would have {size} bytes where at most {MAX_MANIFEST} are read: draw features with fewer corners"
        );
    }
    let room = size + manifest.len() + HEADERS * (members.len() + 1);
    let first = (MANIFEST, manifest.into_bytes());
    let all = members.len() as f64;
    let others = (0..).zip(&members).map(|(at, (name, content))| {
        headway.done(0.5 + 0.5 * f64::from(at) / all);
        (*name, content())
    });
    let bytes = packed(std::iter::once(first).chain(others), room).map_err(broken)?;
    Ok((bytes, fingerprint))
}

/// Unpacks a recipe of `size` bytes and checks its fingerprint. The bytes of one member at a time
/// are in memory, beside the arrays read so far.
///
/// # Errors
/// In words, with the remedy: it is not a recipe, of another version, or changed.
pub fn unpack(source: impl Read + Seek, size: u64) -> Result<(RecipeFile, Arrays), Refusal> {
    let mut zip = Members::open(source, MAX_MEMBERS).map_err(broken)?;
    let (file, zeroed) = read_manifest(&mut zip)?;
    let mut hash = Fingerprint::new(zeroed.as_bytes());
    let mut arrays = Arrays::default();
    let mut problem = None;
    for name in arrays_of(&zip) {
        let content = zip
            .content(&name, size)
            .map_err(|error| broken(format!("member {name}: {error}")))?;
        hash.add(&name, &content);
        // A wrong fingerprint, checked below, is the better message: the file as a whole was
        // damaged.
        problem = problem.or(arrays.read(&name, &content).err());
    }
    let computed = hash.finish();
    if computed != file.fingerprint {
        return refused!(
            "its fingerprint is {}, its content has {computed}: the file was changed or damaged; export \
             it again or teach it",
            file.fingerprint
        );
    }
    match problem {
        Some(problem) => Err(problem),
        None => Ok((file, arrays)),
    }
}

/// Whether it is a recipe that this program reads, and its content agrees with the fingerprint;
/// read through a small buffer.
pub fn is_sound(source: impl Read + Seek) -> bool {
    agrees(source, |text| Some(parse(text).ok()?.fingerprint))
}

/// Whether the content agrees with the fingerprint that the manifest states, whatever else that
/// says: it is not damaged.
pub(crate) fn is_undamaged(source: impl Read + Seek) -> bool {
    #[derive(serde::Deserialize)]
    struct Stated {
        fingerprint: String,
    }
    agrees(source, |text| {
        Some(serde_json::from_str::<Stated>(text).ok()?.fingerprint)
    })
}

fn agrees(source: impl Read + Seek, stated: impl FnOnce(&str) -> Option<String>) -> bool {
    let computed = || -> Option<bool> {
        let mut zip = Members::open(source, MAX_MEMBERS).ok()?;
        let text = manifest_text(&mut zip).ok()?;
        let fingerprint = stated(&text)?;
        let mut hash = Fingerprint::new(zeroed(&text, &fingerprint).as_bytes());
        for name in arrays_of(&zip) {
            hash.stream(&name, zip.member(&name).ok()?).ok()?;
        }
        Some(hash.finish() == fingerprint)
    };
    computed() == Some(true)
}

/// The manifest, and its text with the fingerprint replaced by zeros.
fn read_manifest(zip: &mut Members<impl Read + Seek>) -> Result<(RecipeFile, String), Refusal> {
    let text = manifest_text(zip)?;
    let file = parse(&text)?;
    let zeroed = zeroed(&text, &file.fingerprint);
    Ok((file, zeroed))
}

fn manifest_text(zip: &mut Members<impl Read + Seek>) -> Result<String, Refusal> {
    let text = zip.content(MANIFEST, MAX_MANIFEST);
    let text = text.map_err(|error| broken(format!("{MANIFEST}: {error}")))?;
    String::from_utf8(text).map_err(broken)
}

fn zeroed(manifest: &str, fingerprint: &str) -> String {
    manifest.replacen(fingerprint, NO_FINGERPRINT, 1)
}

/// The names of all members but the manifest, in order.
fn arrays_of<R: Read + Seek>(zip: &Members<R>) -> Vec<String> {
    let names = zip.names().filter(|name| *name != MANIFEST);
    names.map(str::to_owned).collect()
}

/// Reads only the manifest of a recipe, without checking the fingerprint: for lists.
///
/// # Errors
/// In words, with the remedy: it is not a recipe, or of another version.
pub fn manifest(file: impl Read + Seek) -> Result<RecipeFile, Refusal> {
    let mut zip = Members::open(file, MAX_MEMBERS).map_err(broken)?;
    Ok(read_manifest(&mut zip)?.0)
}

/// Reads the text of a manifest and checks the bounds of its values.
///
/// # Errors
/// In words, with the remedy: it is not a manifest, of another version, or a value is out of its
/// bounds.
pub fn parse(text: &str) -> Result<RecipeFile, Refusal> {
    /// What every version has, read first: another version is reported as such, whatever else it
    /// contains.
    #[derive(serde::Deserialize)]
    struct Versioned {
        #[serde(default)]
        format: serde_json::Value,
        #[serde(default)]
        version: serde_json::Value,
    }
    let Versioned { format, version } =
        serde_json::from_str(text).map_err(|error| broken(format!("recipe.json: {error}")))?;
    if format != FORMAT {
        return Err(broken(format!(
            "recipe.json: format is {format}, not {FORMAT:?}"
        )));
    }
    if version != VERSION {
        let version = shortened(&version.to_string());
        return refused!(
            "recipe.json: version is {version}, this program reads {VERSION}: teach the part again"
        );
    }
    let file: RecipeFile =
        serde_json::from_str(text).map_err(|error| broken(format!("recipe.json: {error}")))?;
    // Checked apart from the bounds: a recipe that is being made has no fingerprint yet.
    bounds::fingerprint("fingerprint", &file.fingerprint)
        .map_err(Refusal::from)
        .and_then(|()| file.check_bounds())
        .map_err(|error| broken(format!("recipe.json: {error}")))?;
    Ok(file)
}

fn read<T: npy::Element>(name: &str, bytes: &[u8]) -> Result<Vec<T>, Refusal> {
    npy::read(bytes)
        .map(|array| array.elements)
        .map_err(|error| broken(format!("member {name}: {error}")))
}

/// SHA-256 over the manifest and then all other members in the order of their names; the name and
/// the content of each are preceded by their lengths.
struct Fingerprint(Sha256);

impl Fingerprint {
    fn new(manifest: &[u8]) -> Self {
        let mut fingerprint = Self(Sha256::new());
        fingerprint.add(MANIFEST, manifest);
        fingerprint
    }

    fn add(&mut self, name: &str, content: &[u8]) {
        for part in [name.as_bytes(), content] {
            self.0.update((part.len() as u64).to_le_bytes());
            self.0.update(part);
        }
    }

    /// As [`Self::add`], without holding the whole content in memory.
    fn stream<R: Read>(&mut self, name: &str, mut member: ZipFile<'_, R>) -> std::io::Result<()> {
        self.0.update((name.len() as u64).to_le_bytes());
        self.0.update(name.as_bytes());
        self.0.update(member.size().to_le_bytes());
        let mut buffer = [0; 1 << 14];
        loop {
            match member.read(&mut buffer)? {
                0 => return Ok(()),
                count => self.0.update(&buffer[..count]),
            }
        }
    }

    fn finish(self) -> String {
        hex(&self.0.finalize())
    }
}

fn fingerprint(manifest: &[u8], members: &[Member<'_>]) -> String {
    let mut sorted: Vec<_> = members.iter().collect();
    sorted.sort_by_key(|(name, _)| *name);
    let mut hash = Fingerprint::new(manifest);
    for (name, content) in sorted {
        hash.add(name, &content());
    }
    hash.finish()
}

/// The first 32 bits of a fingerprint: RECIPE_CRC32 on Modbus.
pub fn short(fingerprint: &str) -> u32 {
    fingerprint
        .get(..8)
        .and_then(|digits| u32::from_str_radix(digits, 16).ok())
        .unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_manifest_that_could_not_be_read_again_is_not_written() {
        for (size, fits) in [(MAX_MANIFEST, true), (MAX_MANIFEST + 1, false)] {
            let manifest = " ".repeat(size as usize);
            let sealed = seal(&manifest, Vec::new(), 0, Headway::silent());
            let read = sealed.and_then(|(bytes, _)| {
                let mut zip = Members::open(std::io::Cursor::new(bytes), MAX_MEMBERS).unwrap();
                manifest_text(&mut zip)
            });
            assert_eq!(
                read.is_ok(),
                fits,
                "{size}: {:?}",
                read.map(|text| text.len())
            );
        }
    }

    #[test]
    fn the_fingerprint_is_computed_as_the_documentation_says() {
        let manifest = format!("{{\"fingerprint\": \"{NO_FINGERPRINT}\"}}");
        let content = |bytes: &'static [u8]| Box::new(|| bytes.to_vec()) as MakeContent<'static>;
        let members = vec![("b.npy", content(b"second")), ("a.npy", content(b"first"))];
        let (_, fingerprint) = seal(&manifest, members, 0, Headway::silent()).unwrap();
        // docs/formats.md: of each member, recipe.json first and the others by name, the length of
        // its name, its name, the number of its bytes, its bytes.
        let all = [
            ("recipe.json", manifest.as_bytes()),
            ("a.npy", b"first"),
            ("b.npy", b"second"),
        ];
        let mut bytes = Vec::new();
        for (name, content) in all {
            for part in [name.as_bytes(), content] {
                bytes.extend((part.len() as u64).to_le_bytes());
                bytes.extend(part);
            }
        }
        assert_eq!(fingerprint, hex(&Sha256::digest(&bytes)));
    }
}
