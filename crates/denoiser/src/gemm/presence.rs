//! What tests have to try here, and why they try nothing else.

use super::precision::Precision;

/// The processor's flags that products in bf16 need, as Linux names them.
const NEEDED: [&str; 4] = ["avx512f", "avx512bw", "avx512vl", "avx512_bf16"];

/// All precisions that this processor has: one that is left out is told of, and the system must say that it is not there.
///
/// # Panics
/// If the detection denies what the system has, or claims what it has not.
pub(crate) fn precisions() -> Vec<Precision> {
    let missing = missing_flags();
    let is_there = Precision::Brain.available();
    if let Some(missing) = &missing {
        let name = Precision::Brain;
        assert_eq!(
            is_there,
            missing.is_empty(),
            "{name:?}, {missing:?} missing"
        );
    }
    if is_there {
        return vec![Precision::Single, Precision::Brain];
    }
    let missing = missing.unwrap_or_default();
    eprintln!("products in bf16 are not tried: this processor has no {missing:?}");
    vec![Precision::Single]
}

/// Whether products in bf16 can be tried; see [`precisions`].
pub(crate) fn has_brain() -> bool {
    precisions().contains(&Precision::Brain)
}

/// Those of [`NEEDED`] that /proc/cpuinfo does not list; none where there is no such list.
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
