//! The section on attention: the matrices, and the share that each kind of token receives.

use super::section::section;
use super::{Detail, Report, figure};
use crate::judge::explanation::KINDS;
use maud::{Markup, html};

pub(super) fn attention_section(report: &Report) -> Markup {
    let details: Vec<&Detail> = report.details.iter().filter(|detail| detail.has_attention()).collect();
    if details.is_empty() {
        return html! {};
    }
    section(
        "attention",
        "Attention (figure 7)",
        html! {
            @for detail in &details {
                figure {
                    div.panels {
                        @for gaze in &detail.gazes {
                            div.panel {
                                h3 { (detail.system) ", first slot, w = (" (gaze.w_data) ", " (1.0 - gaze.w_data) ")" }
                                (figure::attention(gaze))
                            }
                        }
                        div.panel {
                            h3 { (detail.system) ", along the whole mission" }
                            (figure::shares_legend(detail))
                            (figure::shares(detail))
                        }
                    }
                }
            }
            figure { figcaption {
                b { "Figure 7. " } "Second attention layer, mean over the heads, RD, K = 6. Matrices: the first slot of "
                "evaluation realization " (report.example) ", darker for more; the grey part belongs to the six absent devices. "
                "Right: the column sums, by kind of token, as a share of all attention, averaged over the slots of each "
                "mission and then over all realizations. The paper finds that w = (1, 0) attends to the devices and w = (0, 1) "
                "almost entirely to the preference. From " code { "attention_initial.csv" } " and " code { "attention.csv" } "."
            } }
            (shares_table(&details))
        },
    )
}

fn shares_table(details: &[&Detail]) -> Markup {
    html! {
        figure { div.scroll { table {
            thead { tr {
                th scope="col" { "system" } th scope="col" { "preference" }
                @for kind in KINDS { th scope="col" { (kind) span.unit { "%" } } }
            } }
            tbody {
                @for (detail, gaze) in details.iter().flat_map(|detail| detail.gazes.iter().map(move |gaze| (detail, gaze))) {
                    tr {
                        th scope="row" { (detail.system) }
                        td { "w = (" (gaze.w_data) ", " (1.0 - gaze.w_data) ")" }
                        @for share in gaze.along { td { (format!("{:.1}", 100.0 * share)) } }
                    }
                }
            }
        } }
            figcaption { "Share of all attention that each kind of token receives. From " code { "attention.csv" } "." }
        }
    }
}
