//! The section on attention: the matrices, and the share that each kind of token receives.

use super::section::section;
use super::{Detail, figure};
use crate::judge::explanation::KINDS;
use maud::{Markup, html};

pub(super) fn attention_section(detail: &Detail) -> Markup {
    section(
        "attention",
        "Attention (figure 7)",
        html! {
            @if detail.gazes.is_empty() {
                p { (detail.system) " has no attention." }
            } @else {
                figure {
                    div.panels {
                        @for gaze in &detail.gazes {
                            div.panel {
                                h3 { "First slot, w = (" (gaze.w_data) ", " (1.0 - gaze.w_data) ")" }
                                (figure::attention(gaze))
                            }
                        }
                        div.panel {
                            h3 { "Along the whole mission" }
                            (figure::shares_legend(detail))
                            (figure::shares(detail))
                        }
                    }
                    figcaption {
                        b { "Figure 7. " } "Second attention layer of " (detail.system) ", mean over the heads, RD, K = 6. "
                        "Matrices: the first slot of evaluation realization " (detail.example) ", darker for more; the grey "
                        "part belongs to the six absent devices. Right: the column sums, by kind of token, as a share of all "
                        "attention, averaged over the slots of each mission and then over all realizations. The paper finds "
                        "that w = (1, 0) attends to the devices and w = (0, 1) almost entirely to the preference. From "
                        code { "attention_initial.csv" } " and " code { "attention.csv" } "."
                    }
                }
                (shares_table(detail))
            }
        },
    )
}

fn shares_table(detail: &Detail) -> Markup {
    html! {
        figure { div.scroll { table {
            thead { tr { th scope="col" { "preference" } @for kind in KINDS { th scope="col" { (kind) span.unit { "%" } } } } }
            tbody {
                @for gaze in &detail.gazes {
                    tr {
                        th scope="row" { "w = (" (gaze.w_data) ", " (1.0 - gaze.w_data) ")" }
                        @for share in gaze.along { td { (format!("{:.1}", 100.0 * share)) } }
                    }
                }
            }
        } }
            figcaption { "Share of all attention that each kind of token receives. From " code { "attention.csv" } "." }
        }
    }
}
