//! What whoever comes from another machine has to know, and where the page is.

use crate::private::open_own_file;
use hilare_operator::address::{is_open, parse};
use std::fs::{self, OpenOptions};
use std::io::{self, Read, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;

/// Name of the token's file in the runtime directory, which is its user's alone.
const FILE: &str = "page-token";
/// Random bytes of a token.
const BYTES: usize = 16;

/// Makes a token where `listen` is open to other machines. The page's address, if there is one.
pub fn make(dir: &Path, listen: &str) -> Result<Option<String>, String> {
    if listen.is_empty() {
        return Ok(None);
    }
    if !parse(listen).is_ok_and(is_open) {
        return Ok(Some(url(listen, None)));
    }
    let failed = |error: io::Error| format!("no token for the page: {error}");
    let mut random = [0; BYTES];
    fs::File::open("/dev/urandom").and_then(|mut file| file.read_exact(&mut random)).map_err(failed)?;
    let token: String = random.iter().map(|byte| format!("{byte:02x}")).collect();
    let file = dir.join(FILE);
    let mut options = OpenOptions::new();
    // Whatever the umask is.
    options.write(true).create_new(true).mode(0o600);
    let written = open_own_file(&file, &mut options).and_then(|mut file| file.write_all(token.as_bytes()));
    written.map_err(failed)?;
    Ok(Some(url(listen, Some(&token))))
}

/// The token of a robot.
pub fn read(dir: &Path) -> Result<String, String> {
    let file = dir.join(FILE);
    fs::read_to_string(&file).map_err(|error| format!("{}: {error}", file.display()))
}

/// The page's address.
pub fn url(listen: &str, token: Option<&str>) -> String {
    let Ok(address) = parse(listen) else { return String::new() };
    let machine = machine();
    // All addresses are none to go to.
    let at = match address.ip().is_unspecified() && !machine.is_empty() {
        true => format!("{machine}:{}", address.port()),
        false => address.to_string(),
    };
    let token = token.map_or(String::new(), |token| format!("?token={token}"));
    format!("http://{at}/{token}")
}

/// The machine's name; empty if it has none.
pub fn machine() -> String {
    let name = fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
    let name = name.trim();
    if name.chars().all(|c| c.is_ascii_alphanumeric() || ".-".contains(c)) {
        name.to_owned()
    } else {
        String::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt;

    #[test]
    fn there_is_a_token_where_others_may_come_and_only_its_user_can_read_it() {
        let dir = tempfile::tempdir().expect("a directory");
        assert_eq!(make(dir.path(), ""), Ok(None));
        assert_eq!(make(dir.path(), "127.0.0.1:7070"), Ok(Some("http://127.0.0.1:7070/".to_owned())));
        assert!(read(dir.path()).is_err());
        let url = make(dir.path(), "192.168.1.2:7070").expect("a token").expect("an address");
        let token = read(dir.path()).expect("a token");
        assert_eq!((token.len(), url), (2 * BYTES, format!("http://192.168.1.2:7070/?token={token}")));
        let mode = fs::metadata(dir.path().join(FILE)).expect("a file").permissions().mode();
        assert_eq!(mode & 0o777, 0o600);
        assert!(make(dir.path(), "0.0.0.0:7070").is_err(), "another's file is not taken over");
    }
}
