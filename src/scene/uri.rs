//! What a glTF file refers to: data URIs, and files that must not leave the scene's folder.

use std::{
    fs,
    path::{Component, Path, PathBuf},
};

use super::error::{SceneError, invalid, one_line};

/// No file of a scene may be larger (bytes): beyond it, reading alone would exhaust the memory.
const FILE_LIMIT: u64 = 8 << 30;

/// Where the bytes of a reference come from.
pub(super) enum Source {
    /// Inside the URI: its media type and the bytes.
    Data(String, Vec<u8>),
    /// A file inside the scene's folder, as an absolute path without links.
    File(PathBuf),
}

/// Finds what `uri` names. `folder` is the folder of the scene, or none where the scene came from memory.
///
/// # Errors
/// Other schemes, absolute paths, ways out of the folder (through `..` or a symbolic link), and files that do not exist.
pub(super) fn resolve(uri: &str, folder: Option<&Path>, place: &str) -> Result<Source, SceneError> {
    if let Some(data) = uri.strip_prefix("data:") {
        return data_uri(data)
            .map(|(mime, bytes)| Source::Data(mime, bytes))
            .map_err(|why| invalid(place, why));
    }
    let decoded = String::from_utf8(percent_decode(uri)).map_err(|_| SceneError::Missing {
        place: place.into(),
        uri: one_line(uri),
        why: "its name is not UTF-8".into(),
    })?;
    inside(&decoded, folder, place).map(Source::File)
}

/// Finds the file that a relative path names, inside `folder`; without links.
///
/// # Errors
/// As for [`resolve`].
pub(super) fn inside(
    relative: &str,
    folder: Option<&Path>,
    place: &str,
) -> Result<PathBuf, SceneError> {
    let outside = || SceneError::Outside {
        place: place.into(),
        uri: one_line(relative),
    };
    let missing = |why: &dyn std::fmt::Display| SceneError::Missing {
        place: place.into(),
        uri: one_line(relative),
        why: why.to_string(),
    };
    let scheme = relative.split_once(':').is_some_and(|(scheme, _)| {
        scheme
            .chars()
            .all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c))
    });
    if scheme || relative.starts_with('\\') {
        return Err(outside());
    }
    let mut depth = 0;
    for component in Path::new(relative).components() {
        match component {
            Component::Normal(_) => depth += 1,
            Component::CurDir => {}
            Component::ParentDir => depth -= 1,
            Component::RootDir | Component::Prefix(_) => return Err(outside()),
        }
        if depth < 0 {
            return Err(outside());
        }
    }
    let folder = folder.ok_or_else(|| missing(&"the scene has no folder"))?;
    // That of a file that was named without one.
    let here = folder.as_os_str().is_empty();
    let folder = if here { Path::new(".") } else { folder };
    let folder = fs::canonicalize(folder).map_err(|cause| missing(&cause))?;
    let file = fs::canonicalize(folder.join(relative)).map_err(|cause| missing(&cause))?;
    if file.starts_with(&folder) {
        Ok(file)
    } else {
        Err(outside())
    }
}

/// Reads a regular file of bounded size. Pipes and devices are refused: they may never end.
pub(super) fn read_file(path: &Path) -> std::io::Result<Vec<u8>> {
    let metadata = fs::metadata(path)?;
    if !metadata.is_file() {
        return Err(std::io::Error::other("not a regular file"));
    }
    if metadata.len() > FILE_LIMIT {
        return Err(std::io::Error::other("larger than 8 GiB"));
    }
    fs::read(path)
}

/// Splits what follows `data:` into its media type and its bytes (RFC 2397).
fn data_uri(data: &str) -> Result<(String, Vec<u8>), &'static str> {
    let (head, body) = data.split_once(',').ok_or("its data URI has no comma")?;
    match head.strip_suffix(";base64") {
        Some(mime) => Ok((
            mime.into(),
            base64_decode(body).ok_or("its data URI is not valid base64")?,
        )),
        None => Ok((
            head.split(';').next().unwrap_or_default().into(),
            percent_decode(body),
        )),
    }
}

/// Replaces `%41` by `A`; what is no escape stays.
fn percent_decode(text: &str) -> Vec<u8> {
    let bytes = text.as_bytes();
    let digit = |i: usize| bytes.get(i).and_then(|b| char::from(*b).to_digit(16));
    let mut out = Vec::with_capacity(bytes.len());
    let mut i = 0;
    while i < bytes.len() {
        match (bytes[i], digit(i + 1), digit(i + 2)) {
            (b'%', Some(high), Some(low)) => {
                out.push((high * 16 + low) as u8);
                i += 3;
            }
            (byte, ..) => {
                out.push(byte);
                i += 1;
            }
        }
    }
    out
}

const ALPHABET: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

/// RFC 4648, section 4.
pub(super) fn base64_encode(bytes: &[u8]) -> String {
    let mut out = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let word = chunk.iter().enumerate().fold(0u32, |word, (i, byte)| {
            word | u32::from(*byte) << (16 - 8 * i)
        });
        for i in 0..4 {
            let digit = ALPHABET[(word >> (18 - 6 * i)) as usize & 63];
            out.push(if i <= chunk.len() {
                char::from(digit)
            } else {
                '='
            });
        }
    }
    out
}

/// RFC 4648, section 4; padding may be absent.
fn base64_decode(text: &str) -> Option<Vec<u8>> {
    let text = text.trim_end_matches('=').as_bytes();
    let mut values = [255u8; 256];
    for (value, digit) in ALPHABET.iter().enumerate() {
        values[usize::from(*digit)] = value as u8;
    }
    if text.len() % 4 == 1 {
        return None;
    }
    let mut out = Vec::with_capacity(text.len() / 4 * 3 + 2);
    for chunk in text.chunks(4) {
        let mut word = 0u32;
        for (i, digit) in chunk.iter().enumerate() {
            let value = values[usize::from(*digit)];
            if value == 255 {
                return None;
            }
            word |= u32::from(value) << (18 - 6 * i);
        }
        out.extend_from_slice(&word.to_be_bytes()[1..chunk.len()]);
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_matches_the_rfc_and_returns() {
        for (plain, coded) in [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foobar", "Zm9vYmFy"),
        ] {
            assert_eq!(base64_encode(plain.as_bytes()), coded);
            assert_eq!(base64_decode(coded).unwrap(), plain.as_bytes());
        }
        assert_eq!(base64_decode("Zm9*"), None);
        assert_eq!(base64_decode("Zm9vY"), None);
    }

    #[test]
    fn only_files_inside_the_folder_are_found() {
        let outer = tempfile::tempdir().unwrap();
        let folder = outer.path().join("scene");
        fs::create_dir_all(folder.join("a b")).unwrap();
        fs::write(folder.join("a b/x.bin"), b"x").unwrap();
        fs::write(outer.path().join("secret"), b"s").unwrap();
        let find = |uri: &str| resolve(uri, Some(&folder), "buffer 0");
        assert!(matches!(find("a%20b/x.bin"), Ok(Source::File(_))));
        assert!(matches!(find("a%20b/../a%20b/x.bin"), Ok(Source::File(_))));
        assert!(
            matches!(find("data:text/plain,a%20b"), Ok(Source::Data(_, bytes)) if bytes == b"a b")
        );
        for uri in [
            "../secret",
            "%2e%2e/secret",
            "a%20b/../../secret",
            "/etc/passwd",
            "file:///etc/passwd",
            "https://x/y",
            "C:\\x",
            "\\x",
        ] {
            assert!(
                matches!(find(uri), Err(SceneError::Outside { .. })),
                "{uri}"
            );
        }
        assert!(matches!(find("none.bin"), Err(SceneError::Missing { .. })));
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink(outer.path().join("secret"), folder.join("link")).unwrap();
            assert!(matches!(find("link"), Err(SceneError::Outside { .. })));
        }
    }
}
