//! The frame of a section of the page.

use maud::{Markup, html};

pub(super) fn section(id: &str, title: &str, body: Markup) -> Markup {
    html! { section id=(id) { h2 { (title) } (body) } }
}
