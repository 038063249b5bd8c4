//! What this program is, down to the last bits that it computes.

use std::fs;
use std::sync::OnceLock;

/// Bytes of the hash.
pub(crate) const HASH_BYTES: usize = 32;

/// Hash of this program and its processor's abilities, since the last bits of numeric code
/// may differ otherwise. `None` when the program cannot read itself.
pub(crate) fn program() -> Option<[u8; HASH_BYTES]> {
    static PROGRAM: OnceLock<Option<[u8; HASH_BYTES]>> = OnceLock::new();
    *PROGRAM.get_or_init(|| {
        let mut hasher = blake3::Hasher::new();
        let read = std::env::current_exe().and_then(|path| {
            hasher.update_reader(fs::File::open(path)?)?;
            Ok(())
        });
        if let Err(error) = read {
            tracing::warn!(
                "This program cannot be read, so no other is known to equal it: {error}"
            );
            return None;
        }
        hasher.update(&[processor()]);
        Some(*hasher.finalize().as_bytes())
    })
}

/// The processor features that numeric libraries depend on.
#[cfg(target_arch = "x86_64")]
fn processor() -> u8 {
    u8::from(std::arch::is_x86_feature_detected!("avx"))
        | u8::from(std::arch::is_x86_feature_detected!("avx2")) << 1
        | u8::from(std::arch::is_x86_feature_detected!("fma")) << 2
        | u8::from(std::arch::is_x86_feature_detected!("avx512f")) << 3
}

/// The processor features that numeric libraries depend on.
#[cfg(not(target_arch = "x86_64"))]
fn processor() -> u8 {
    0
}
