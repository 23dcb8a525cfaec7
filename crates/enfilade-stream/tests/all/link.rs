//! The simulated link.

use std::time::Duration;

use enfilade_stream::{
    Catalog, FetchError, PieceId, PieceSizes, Reply, SimulatedLink, SimulatedLinkOptions, Source,
};

fn catalog(n: usize) -> Catalog {
    let piece = PieceSizes {
        n_packed: 100_000,
        n_resident: 300_000,
    };
    Catalog::new(vec![piece; n], &[])
}

/// Lets time pass by milliseconds. Returns the replies with their times.
fn run(link: &mut SimulatedLink, until_ms: u64) -> Vec<(u64, Reply)> {
    let (mut out, mut replies) = (Vec::new(), Vec::new());
    for ms in 0..=until_ms {
        link.advance(Duration::from_millis(ms));
        link.poll(&mut replies);
        out.extend(replies.drain(..).map(|r| (ms, r)));
    }
    out
}

fn options() -> SimulatedLinkOptions {
    SimulatedLinkOptions {
        latency: Duration::from_millis(50),
        bandwidth: 1e6,
        ..SimulatedLinkOptions::default()
    }
}

// Covers W2.
#[test]
fn transfers_take_the_latency_and_share_the_bandwidth() {
    let mut link = SimulatedLink::new(&catalog(3), options()).with_contents(vec![vec![7], vec![8]]);
    link.request(PieceId(0));
    let replies = run(&mut link, 200);
    assert_eq!(replies.len(), 1);
    assert!((150..=151).contains(&replies[0].0), "{}", replies[0].0);
    assert_eq!(replies[0].1.bytes, Ok(vec![7]));
    let mut link = SimulatedLink::new(&catalog(3), options());
    link.request(PieceId(0));
    link.advance(Duration::from_millis(50));
    link.request(PieceId(1)); // begins at 100, when the first is half done
    let replies = run(&mut link, 400);
    let times: Vec<u64> = replies.iter().map(|r| r.0).collect();
    // 50 ms alone, then 100 ms at half the rate for the first; then the rest of the second, alone.
    assert!(
        (200..=201).contains(&times[0]) && (250..=251).contains(&times[1]),
        "{times:?}"
    );
    assert!((link.n_bytes() - 200_000.0).abs() < 1.0);
    link.request(PieceId(9));
    link.poll(&mut Vec::new());
}

// Covers W2.
#[test]
fn errors_and_breaks_come_at_their_rates_and_equal_seeds_give_equal_replies() {
    let n = 2000;
    let outcome = |seed| {
        let options = SimulatedLinkOptions {
            bandwidth: 1e9,
            error_rate: 0.1,
            short_read_rate: 0.3,
            seed,
            ..options()
        };
        let mut link = SimulatedLink::new(&catalog(n), options);
        for piece in 0..n as u32 {
            link.request(PieceId(piece));
        }
        let replies = run(&mut link, 1000);
        assert_eq!(replies.len(), n);
        let bad = replies.iter().filter(|r| r.1.bytes.is_err()).count();
        // 200 expected, standard deviation 13.
        assert!((120..280).contains(&bad), "{bad}");
        let all: Vec<(u64, u32, bool)> = replies
            .iter()
            .map(|(ms, r)| (*ms, r.piece.0, r.bytes.is_ok()))
            .collect();
        all
    };
    assert_eq!(outcome(1), outcome(1));
    assert_ne!(outcome(1), outcome(2));
}

// Covers W2.
#[test]
fn a_cut_link_answers_with_errors_and_a_canceled_request_not_at_all() {
    let mut link = SimulatedLink::new(&catalog(3), options());
    link.request(PieceId(0));
    link.request(PieceId(1));
    link.cancel(PieceId(1));
    link.set_down(true);
    link.request(PieceId(2));
    let replies = run(&mut link, 300);
    let pieces: Vec<u32> = replies.iter().map(|r| r.1.piece.0).collect();
    assert_eq!(pieces, [0, 2]);
    for (_, reply) in &replies {
        assert!(matches!(reply.bytes, Err(FetchError::Unreachable { .. })));
    }
    link.set_down(false);
    link.request(PieceId(0));
    assert_eq!(link.n_bytes(), 0.0);
}
