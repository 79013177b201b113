//! Damaged weights of the paper's denoiser, given to the daemon and to `pcc`.

use tests::diffusion_starts::{bad_diffusion_weights, undamaged_start};

use crate::report::Report;
use crate::runs::{Model, weights_folder};

pub(crate) fn run(report: &mut Report) {
    let command = "planner-daemon with [diffusion]; pcc evaluate --planner diffusion";
    report.group("bad diffusion weights", command, |report| {
        let (folder, model) = (weights_folder(), Model::wanted("mixed")?);
        let name = format!(
            "daemon and pcc start with undamaged {}, failures",
            model.text
        );
        report.none_of(&name, &undamaged_start(&folder, &model.name));
        let starts = bad_diffusion_weights(&folder, &model.name);
        let name =
            "truncated, wrong hash, wrong shape, another robot's, NaN: refused by name, status 1";
        report.all_of(name, starts.named, starts.tried);
        report.none_of("bad diffusion weights not refused so", &starts.unexpected);
        Ok(())
    });
}
