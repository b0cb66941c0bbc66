//! What the URIs of a file lead to: data in them, or files beside the scene. Other readers take more than glTF allows, and so does this.

use std::borrow::Cow;
use std::path::{Component, Path, PathBuf};

use base64::Engine;
use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};

use super::read_file;

/// Padded or not.
const BASE64: GeneralPurpose =
    GeneralPurpose::new(&STANDARD, GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent));
const DATA: &str = "data:";

/// The content of a data URI, or of a file beside the scene at `path`; or what is wrong with it.
pub(super) fn read(path: &Path, uri: &str) -> Result<Vec<u8>, String> {
    if let Some(embedded) = uri.get(..DATA.len()).filter(|scheme| scheme.eq_ignore_ascii_case(DATA)).map(|_| &uri[DATA.len()..]) {
        return embedded_data(embedded);
    }
    if uri.contains(':') {
        return Err(format!("lies at {uri}; only files beside this one are read"));
    }
    let name = name_beside(path, uri).ok_or_else(|| format!("has a name that cannot be decoded: {uri}"))?;
    let folder = folder_of(path);
    let place = folder.join(&name);
    // A link may lead out as well as a name.
    let leads_out = || matches!((place.canonicalize(), folder.canonicalize()), (Ok(place), Ok(folder)) if !place.starts_with(&folder));
    if leaves_folder(Path::new(&name)) || leads_out() {
        return Err(format!("lies at {uri}, outside the scene's folder, and is not read; copy it into that folder"));
    }
    read_file(&place)
        .map_err(|reason| format!("lies at {uri}, which {reason}; copy it along with the scene, or export a .glb, which holds everything"))
}

/// The name of the file beside the scene at `path` that a URI means; `None` if that is no text. Backslashes part folders as on the
/// system where the file was written, and what follows `?` or `#` is for a server, unless a file is called so.
pub(super) fn name_beside(path: &Path, uri: &str) -> Option<String> {
    let name = |uri: &str| String::from_utf8(unescaped(uri).into_owned()).ok().map(|name| name.replace('\\', "/"));
    let whole = name(uri)?;
    match uri.find(['?', '#']) {
        Some(end) if !folder_of(path).join(&whole).exists() => name(&uri[..end]),
        _ => Some(whole),
    }
}

fn folder_of(path: &Path) -> PathBuf {
    path.parent().filter(|folder| *folder != Path::new("")).unwrap_or(Path::new(".")).to_owned()
}

/// What follows `data:`, as browsers read it: escaped or not, with line breaks or without.
fn embedded_data(embedded: &str) -> Result<Vec<u8>, String> {
    let (head, body) = embedded.split_once(',').ok_or("has a data URI without the comma that its data follow")?;
    let body = unescaped(body);
    if !head.trim_end().to_ascii_lowercase().ends_with(";base64") {
        return Ok(body.into_owned());
    }
    let decoded = match body.iter().any(u8::is_ascii_whitespace) {
        true => BASE64.decode(body.iter().copied().filter(|byte| !byte.is_ascii_whitespace()).collect::<Vec<u8>>()),
        false => BASE64.decode(body),
    };
    decoded.map_err(|_| "has a data URI that is not base64".into())
}

/// `%20` and the like turned into bytes; what only looks like one stays.
fn unescaped(uri: &str) -> Cow<'_, [u8]> {
    if !uri.contains('%') {
        return Cow::Borrowed(uri.as_bytes());
    }
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let Some((byte, after)) = rest.split_first() {
        let digit = |place: usize| after.get(place).and_then(|byte| char::from(*byte).to_digit(16));
        (rest, _) = match (byte, digit(0), digit(1)) {
            (b'%', Some(high), Some(low)) => (&after[2..], bytes.push((high * 16 + low) as u8)),
            _ => (after, bytes.push(*byte)),
        };
    }
    Cow::Owned(bytes)
}

/// Whether a relative name leads out of the folder that it starts from.
fn leaves_folder(name: &Path) -> bool {
    let mut depth = 0;
    name.components().any(|component| {
        depth += match component {
            Component::Normal(_) => 1,
            Component::CurDir => 0,
            Component::ParentDir => -1,
            Component::RootDir | Component::Prefix(_) => i32::MIN / 2,
        };
        depth < 0
    })
}
