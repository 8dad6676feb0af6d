//! Host names to addresses, without blocking after the start.

use crate::endpoint::SocketName;
use std::io;
use std::net::{SocketAddr, ToSocketAddrs};
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::thread;

/// The addresses of a host. A name is looked up again on demand, on a thread of its own: the system's resolver
/// blocks for many seconds while the network is down.
pub(crate) struct Resolver {
    name: SocketName,
    addresses: Vec<SocketAddr>,
    lookup: Option<Receiver<io::Result<Vec<SocketAddr>>>>,
}

impl Resolver {
    /// Looks the name up once, blocking. A name without an address is no error: it may get one later.
    pub(crate) fn new(name: SocketName) -> Resolver {
        let addresses = resolve(&name).unwrap_or_default();
        Resolver { name, addresses, lookup: None }
    }

    /// The addresses found last.
    pub(crate) fn addresses(&self) -> &[SocketAddr] {
        &self.addresses
    }

    /// Starts a lookup unless one is running.
    pub(crate) fn refresh(&mut self) {
        if self.lookup.is_some() {
            return;
        }
        let (sender, receiver) = channel();
        let name = self.name.clone();
        let spawned = thread::Builder::new().name("resolver".into()).spawn(move || {
            // The port may have been closed meanwhile.
            let _ = sender.send(resolve(&name));
        });
        self.lookup = spawned.is_ok().then_some(receiver);
    }

    /// Takes the result of a lookup that has ended.
    pub(crate) fn settle(&mut self) {
        match self.lookup.as_ref().map(Receiver::try_recv) {
            None | Some(Err(TryRecvError::Empty)) => {}
            Some(Ok(Ok(addresses))) => {
                self.addresses = addresses;
                self.lookup = None;
            }
            Some(Ok(Err(_)) | Err(TryRecvError::Disconnected)) => self.lookup = None,
        }
    }
}

/// All addresses of a name. The brackets of an IPv6 address are removed first, since the resolver reads a scope
/// such as `%eth0` only without them.
///
/// # Errors
/// The resolver's own; a name without addresses is "not found".
pub(crate) fn resolve(name: &SocketName) -> io::Result<Vec<SocketAddr>> {
    let host = name.host.strip_prefix('[').and_then(|host| host.strip_suffix(']')).unwrap_or(&name.host);
    let addresses: Vec<SocketAddr> = (host, name.port).to_socket_addrs()?.collect();
    if addresses.is_empty() { Err(io::ErrorKind::NotFound.into()) } else { Ok(addresses) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn name(host: &str) -> SocketName {
        SocketName { host: host.into(), port: 5 }
    }

    #[test]
    fn addresses_with_brackets_and_scope_resolve() {
        assert_eq!(resolve(&name("[::1]")).unwrap(), ["[::1]:5".parse().unwrap()]);
        let SocketAddr::V6(scoped) = resolve(&name("[fe80::1%lo]")).unwrap()[0] else {
            panic!("an IPv6 address");
        };
        assert_eq!(scoped.scope_id(), 1, "the loopback interface has index 1");
        let SocketAddr::V6(scoped) = resolve(&name("[fe80::1%1]")).unwrap()[0] else {
            panic!("an IPv6 address");
        };
        assert_eq!(scoped.scope_id(), 1);
    }

    #[test]
    fn a_lookup_on_demand_gives_the_addresses() {
        let mut resolver = Resolver { name: name("127.0.0.1"), addresses: Vec::new(), lookup: None };
        resolver.settle();
        assert!(resolver.addresses().is_empty());
        resolver.refresh();
        while resolver.lookup.is_some() {
            resolver.settle();
            thread::yield_now();
        }
        assert_eq!(resolver.addresses(), ["127.0.0.1:5".parse().unwrap()]);
    }

    #[test]
    fn a_name_without_address_is_no_error_at_the_start() {
        assert!(Resolver::new(name("no-such-host.invalid")).addresses().is_empty());
    }
}
