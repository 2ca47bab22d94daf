//! Writes the kernel's random words to standard output, in one of the orders
//! in which the kernel consumes them: `random_words pixels|readouts|streams [SEED]`.
//! `benches/random.sh` feeds them to dieharder.

use std::io::{BufWriter, Write};

use spikelane::unstable::draws::hash::{CounterRng, RoundKey, address_key, hash_bits};
use spikelane::unstable::draws::{RandomStream, Seeds};

/// Pairs of a 400x250 sensor.
const PAIRS: u32 = 50_000;

fn main() -> std::io::Result<()> {
    let order = std::env::args().nth(1).unwrap_or_else(|| "pixels".to_owned());
    let seed = std::env::args().nth(2).and_then(|s| s.parse().ok()).unwrap_or(1);
    let seeds = Seeds { shot: seed, ..Seeds::default() };
    let shot = CounterRng::new(seeds, RandomStream::from_name("shot_noise"));
    let thermal = CounterRng::new(seeds, RandomStream::from_name("thermal_noise"));
    let mut out = BufWriter::with_capacity(1 << 20, std::io::stdout().lock());
    let written = match order.as_str() {
        "pixels" => along_pixels(&mut out, &[shot]),
        "streams" => along_pixels(&mut out, &[shot, thermal]),
        "readouts" => along_readouts(&mut out, shot),
        other => {
            eprintln!("random_words: found \"{other}\", expected pixels, readouts or streams");
            std::process::exit(2);
        }
    };
    match written {
        // The reader has had enough.
        Err(e) if e.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        other => other,
    }
}

/// Frame after frame; with several streams their words alternate.
fn along_pixels(out: &mut impl Write, rngs: &[CounterRng]) -> std::io::Result<()> {
    for readout in 0.. {
        let rounds: Vec<RoundKey> = rngs.iter().map(|c| c.round_key(readout)).collect();
        for pair in 0..PAIRS {
            for &round in &rounds {
                out.write_all(&hash_bits(address_key(pair), round).to_le_bytes())?;
            }
        }
    }
    Ok(())
}

/// Writes a thousand readouts of the first pair of pixels, then of each next pair, and then the next thousand readouts
/// of all pairs.
fn along_readouts(out: &mut impl Write, rng: CounterRng) -> std::io::Result<()> {
    for block in 0u64.. {
        let rounds: Vec<RoundKey> = (0..1000).map(|t| rng.round_key(block * 1000 + t)).collect();
        for pair in 0..PAIRS {
            for &round in &rounds {
                out.write_all(&hash_bits(address_key(pair), round).to_le_bytes())?;
            }
        }
    }
    Ok(())
}
