//! Who may look, and who may command.

use axum::http::{HeaderMap, header};
use rand::TryRng as _;
use rand::rngs::SysRng;
use std::net::SocketAddr;
use subtle::ConstantTimeEq as _;
use thiserror::Error;

/// Fewest characters of a token: below this it could be guessed over a network.
const TOKEN_LEN_MIN: usize = 16;

/// A secret that a viewer shows with every request.
#[derive(Clone, PartialEq, Eq)]
pub struct Token(String);

/// Why a token or an address is refused.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum AccessError {
    /// Too short, or of characters that a header or an address cannot carry.
    #[error("an access token needs at least {TOKEN_LEN_MIN} letters, digits, '-' or '_'")]
    Token,
    /// Anyone who reaches the port could command the aircraft.
    #[error(
        "{0} can be reached from other computers: give a view token and a control token, or use 127.0.0.1"
    )]
    Open(SocketAddr),
    /// The operating system gave no random numbers.
    #[error("no random numbers for a token: {0}")]
    Random(String),
}

impl Token {
    /// A token that the operator chose.
    ///
    /// # Errors
    /// [`AccessError::Token`].
    pub fn new(text: &str) -> Result<Token, AccessError> {
        let allowed = |byte: u8| byte.is_ascii_alphanumeric() || byte == b'-' || byte == b'_';
        let long_enough = text.len() >= TOKEN_LEN_MIN;
        if long_enough && text.bytes().all(allowed) {
            Ok(Token(text.into()))
        } else {
            Err(AccessError::Token)
        }
    }

    /// A random token of 128 bits.
    ///
    /// # Errors
    /// [`AccessError::Random`].
    pub fn random() -> Result<Token, AccessError> {
        let mut bytes = [0; 16];
        SysRng.try_fill_bytes(&mut bytes).map_err(|error| AccessError::Random(error.to_string()))?;
        Ok(Token(bytes.iter().map(|byte| format!("{byte:02x}")).collect()))
    }

    /// The secret, for the address that the program prints.
    #[must_use]
    pub fn secret(&self) -> &str {
        &self.0
    }

    fn matches(&self, shown: &str) -> bool {
        self.0.as_bytes().ct_eq(shown.as_bytes()).into()
    }
}

impl std::fmt::Debug for Token {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Token(..)")
    }
}

/// The rule of one server.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Access {
    /// Every program on this computer may look and command. For a loopback address only.
    Loopback,
    /// The token `view` gives the right to look; the token `control` gives the rights to look and to command.
    Tokens {
        /// To look.
        view: Token,
        /// To look and to command.
        control: Token,
    },
}

/// What a request may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Rights {
    pub view: bool,
    pub control: bool,
}

impl Access {
    /// The rule for an address: the loopback one where other computers cannot reach it and no tokens are given, else
    /// tokens, random ones where none are given.
    ///
    /// # Errors
    /// [`AccessError::Random`].
    pub fn of(address: SocketAddr, tokens: Option<[Token; 2]>) -> Result<Access, AccessError> {
        match tokens {
            None if address.ip().is_loopback() => Ok(Access::Loopback),
            None => Ok(Access::Tokens { view: Token::random()?, control: Token::random()? }),
            Some([view, control]) => Ok(Access::Tokens { view, control }),
        }
    }

    /// Whether a server may listen at `address` under this rule.
    ///
    /// # Errors
    /// [`AccessError::Open`].
    pub fn check(&self, address: SocketAddr) -> Result<(), AccessError> {
        match self {
            Access::Loopback if !address.ip().is_loopback() => Err(AccessError::Open(address)),
            _ => Ok(()),
        }
    }

    /// The rights of a request with these headers.
    pub(crate) fn rights(&self, headers: &HeaderMap) -> Rights {
        match self {
            // The name under which the browser reached the server: a foreign one is a page that had its name resolved to
            // this computer (DNS rebinding).
            Access::Loopback => {
                let local = text(headers, header::HOST).is_some_and(is_loopback_name);
                Rights { view: local, control: local && same_origin(headers) }
            }
            Access::Tokens { view, control } => {
                let shown =
                    text(headers, header::AUTHORIZATION).and_then(|value| value.strip_prefix("Bearer "));
                let shown = shown.unwrap_or_default();
                let may_control = control.matches(shown);
                Rights {
                    view: may_control || view.matches(shown),
                    control: may_control && same_origin(headers),
                }
            }
        }
    }
}

fn text(headers: &HeaderMap, name: header::HeaderName) -> Option<&str> {
    headers.get(name)?.to_str().ok()
}

fn is_loopback_name(host: &str) -> bool {
    let name = match host.strip_prefix('[') {
        Some(rest) => rest.split(']').next().unwrap_or_default(),
        None => host.split(':').next().unwrap_or_default(),
    };
    matches!(name, "localhost" | "127.0.0.1" | "::1")
}

/// Browsers state the origin of a page with every POST; programs that are not browsers state none.
fn same_origin(headers: &HeaderMap) -> bool {
    let Some(origin) = text(headers, header::ORIGIN) else { return true };
    let host = origin.split_once("://").map(|(_, host)| host);
    host.is_some() && host == text(headers, header::HOST)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(pairs: &[(header::HeaderName, &str)]) -> HeaderMap {
        pairs.iter().map(|(name, value)| (name.clone(), value.parse().unwrap())).collect()
    }

    #[test]
    fn loopback_refuses_foreign_hosts_and_origins() {
        let rights = |pairs: &[_]| Access::Loopback.rights(&headers(pairs));
        let all = Rights { view: true, control: true };
        assert_eq!(rights(&[(header::HOST, "127.0.0.1:8080")]), all);
        assert_eq!(
            rights(&[(header::HOST, "localhost:8080"), (header::ORIGIN, "http://localhost:8080")]),
            all
        );
        assert_eq!(rights(&[(header::HOST, "[::1]:8080")]), all);
        assert!(!rights(&[(header::HOST, "evil.example:8080")]).view);
        assert!(!rights(&[(header::HOST, "127.0.0.1.evil.example")]).view);
        assert!(!rights(&[]).view);
        let foreign = rights(&[(header::HOST, "localhost:8080"), (header::ORIGIN, "https://evil.example")]);
        assert!(!foreign.control);
    }

    #[test]
    fn viewing_and_controlling_are_separate_rights() {
        let view = Token::new("view-0123456789abcdef").unwrap();
        let control = Token::new("control-0123456789abcdef").unwrap();
        let access = Access::Tokens { view, control };
        let shown = |token: &str| {
            access.rights(&headers(&[(header::HOST, "drone:80"), (header::AUTHORIZATION, token)]))
        };
        assert_eq!(shown("Bearer view-0123456789abcdef"), Rights { view: true, control: false });
        assert_eq!(shown("Bearer control-0123456789abcdef"), Rights { view: true, control: true });
        assert_eq!(shown("Bearer control-0123456789abcde"), Rights { view: false, control: false });
        assert_eq!(shown("control-0123456789abcdef"), Rights { view: false, control: false });
    }

    #[test]
    fn an_open_address_needs_tokens_and_a_token_needs_length() {
        let open: SocketAddr = "0.0.0.0:8080".parse().unwrap();
        assert_eq!(Access::Loopback.check(open), Err(AccessError::Open(open)));
        assert_eq!(Access::Loopback.check("127.0.0.1:8080".parse().unwrap()), Ok(()));
        let token = || Token::random().unwrap();
        assert_eq!(Access::Tokens { view: token(), control: token() }.check(open), Ok(()));
        assert_eq!(Token::new("short"), Err(AccessError::Token));
        assert_eq!(Token::new("with spaces in it, long"), Err(AccessError::Token));
        assert_ne!(token(), token());
    }
}
