//! The precisions that tests try on this processor.

use super::precision::Precision;

/// The processor's flags that products in bf16 need, as Linux names them.
const NEEDED: [&str; 4] = ["avx512f", "avx512bw", "avx512vl", "avx512_bf16"];

/// All precisions that this processor has. For one that is left out it prints which processor flags are missing.
///
/// # Panics
/// When the detection and the flags that Linux lists do not agree.
pub(crate) fn precisions() -> Vec<Precision> {
    let missing = missing_flags();
    let is_there = Precision::Bf16.available();
    if let Some(missing) = &missing {
        let name = Precision::Bf16;
        assert_eq!(
            is_there,
            missing.is_empty(),
            "{name:?}, {missing:?} missing"
        );
    }
    if is_there {
        return vec![Precision::F32, Precision::Bf16];
    }
    let missing = missing.unwrap_or_default();
    eprintln!("products in bf16 are not tried: this processor has no {missing:?}");
    vec![Precision::F32]
}

/// Whether this processor multiplies in bf16; panics when the detection and the flags that Linux lists do not agree.
pub(crate) fn has_bf16() -> bool {
    precisions().contains(&Precision::Bf16)
}

/// The flags of [`NEEDED`] that /proc/cpuinfo does not list; none where there is no such list.
fn missing_flags() -> Option<Vec<&'static str>> {
    if !cfg!(target_arch = "x86_64") {
        return None;
    }
    let text = std::fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = text.lines().find(|line| line.starts_with("flags"))?;
    let flags: Vec<&str> = line.split_whitespace().collect();
    let missing = NEEDED.into_iter().filter(|flag| !flags.contains(flag));
    Some(missing.collect())
}
