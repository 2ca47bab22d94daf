//! The user who owns the other end of a connection on this machine.

use std::net::TcpStream;

/// Returns whether the client belongs to the user of this process or to root. Systems other than Linux do not report the
/// user, so the result is true there.
pub(crate) fn is_own_client(stream: &TcpStream) -> bool {
    #[cfg(target_os = "linux")]
    {
        use std::os::unix::fs::MetadataExt as _;
        let Ok(own) = std::fs::metadata("/proc/self").map(|process| process.uid()) else { return false };
        linux::client_user(stream).is_some_and(|user| user == own || user == 0)
    }
    #[cfg(not(target_os = "linux"))]
    {
        let _ = stream;
        true
    }
}

#[cfg(target_os = "linux")]
mod linux {
    use std::net::{SocketAddr, SocketAddrV4, TcpStream};

    /// Number of attempts. While other connections open and close, a read of the table can miss a connection.
    const MAX_ATTEMPTS: usize = 3;

    /// Returns the user of the client, from the tables of all TCP connections.
    pub(super) fn client_user(stream: &TcpStream) -> Option<u32> {
        let (Ok(SocketAddr::V4(client)), Ok(SocketAddr::V4(server))) =
            (stream.peer_addr(), stream.local_addr())
        else {
            return None;
        };
        let read = |file: &str| user_in_table(&std::fs::read_to_string(file).ok()?, client, server);
        // The table of IPv6 contains clients that use the IPv6 form of the address.
        (0..MAX_ATTEMPTS).find_map(|_| read("/proc/net/tcp").or_else(|| read("/proc/net/tcp6")))
    }

    /// Finds the user of the socket that is at `local` and connected to `remote`, in the text of `/proc/net/tcp` or
    /// `/proc/net/tcp6`. The fields of a line are number, local address, remote address, state, queues, timer,
    /// retransmits, user.
    pub(super) fn user_in_table(table: &str, local: SocketAddrV4, remote: SocketAddrV4) -> Option<u32> {
        /// State of an established connection. The user of a socket that is closed already is always 0.
        const ESTABLISHED: &str = "01";
        table.lines().find_map(|line| {
            let fields: Vec<&str> = line.split_whitespace().take(8).collect();
            let &[_, a, b, ESTABLISHED, _, _, _, user] = &fields[..] else { return None };
            if is_address(a, local) && is_address(b, remote) { user.parse().ok() } else { None }
        })
    }

    /// Compares the text of an address with an IPv4 address, or with its IPv6 form `::ffff:a.b.c.d`. The kernel prints
    /// each word of an address as a number of this machine.
    fn is_address(text: &str, address: SocketAddrV4) -> bool {
        let word = |bytes| format!("{:08X}", u32::from_ne_bytes(bytes));
        let ipv4 = format!("{}:{:04X}", word(address.ip().octets()), address.port());
        let ipv6_prefix = || format!("{}{}", "0".repeat(16), word([0, 0, 0xff, 0xff]));
        text.strip_suffix(&ipv4).is_some_and(|prefix| prefix.is_empty() || prefix == ipv6_prefix())
    }
}

#[cfg(all(test, target_os = "linux", target_endian = "little"))]
mod tests {
    use super::linux::user_in_table;
    use std::net::{Ipv4Addr, SocketAddrV4};

    /// A server of user 1000 on port 5000, with clients of users 1000 (port 40000), 65534 (40001, IPv6) and a closed
    /// client (40002).
    const TABLE: &str = "  sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt   uid  timeout inode
   0: 0100007F:1388 00000000:0000 0A 00000000:00000000 00:00000000 00000000  1000        0 11 1 0 100 0 0 10 0
   1: 0100007F:1388 0100007F:9C40 01 00000000:00000000 00:00000000 00000000  1000        0 12 1 0 20 4 30 10 -1
   2: 0100007F:9C40 0100007F:1388 01 00000000:00000000 00:00000000 00000000  1000        0 13 1 0 20 4 30 10 -1
   3: 0000000000000000FFFF00000100007F:9C41 0000000000000000FFFF00000100007F:1388 01 0:0 00:0 0 65534 0 14 1
   4: 0100007F:9C42 0100007F:1388 06 00000000:00000000 03:00000D2B 00000000     0        0 0 3 0\n";

    #[test]
    fn the_user_of_a_client_is_in_the_line_of_the_client() {
        let at = |port| SocketAddrV4::new(Ipv4Addr::LOCALHOST, port);
        let user = |port| user_in_table(TABLE, at(port), at(5000));
        assert_eq!([40000, 40001, 40002, 40003].map(user), [Some(1000), Some(65534), None, None]);
        assert_eq!(
            user_in_table(TABLE, SocketAddrV4::new(Ipv4Addr::new(127, 0, 0, 2), 40000), at(5000)),
            None
        );
    }
}
