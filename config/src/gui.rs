//! Contents of the GUI.

use crate::directory::Directory;
use crate::reader::{Item, Section};
use rohrpost_mailbox::Name;

/// The section `[gui]`.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Gui {
    /// What to draw.
    pub show: Vec<Show>,
}

/// One kind of data that the GUI draws.
#[derive(Clone, Debug, PartialEq)]
pub struct Show {
    /// Module that it comes from.
    pub from: Name,
    /// Name of the data in the module's interface; none: all that the GUI knows how to draw.
    pub data: Option<String>,
    /// Times a second at most; 0: each one that comes; none: as the GUI thinks best.
    pub rate: Option<f64>,
    /// Line in the file.
    pub line: usize,
}

impl Gui {
    pub(crate) fn read(section: Option<Section<'_>>, directory: &Directory<'_>) -> Self {
        let Some(section) = section else { return Self::default() };
        let example = "[{ from = \"laser.0\", data = \"scan\", rate = 10.0 }]";
        let mut show: Vec<Show> = Vec::new();
        for item in &section.or("show", Vec::new(), |item| item.list(example)) {
            let Some(read) = Show::read(item, directory) else { continue };
            if let Some(first) = show.iter().find(|first| (first.from, &first.data) == (read.from, &read.data)) {
                let from = directory.classes.format(read.from);
                let what = read.data.as_ref().map_or("everything".into(), |data| format!("`{data}`"));
                item.report(format!("{what} of `{from}` is shown in line {} already; drop one", first.line));
            }
            show.push(read);
        }
        section.finish();
        Self { show }
    }
}

impl Show {
    fn read(item: &Item<'_>, directory: &Directory<'_>) -> Option<Self> {
        let section = item.section("[gui] show")?;
        let from = section.required("from", "from = \"laser.0\"");
        let from = from.and_then(|item| {
            let text = item.text("laser.0")?;
            directory.elsewhere(text).or_else(|| directory.module(&item, text))
        });
        let data = section.get("data").and_then(|item| item.text("scan"));
        let rate = section.get("rate").and_then(|item| item.number(0.0..=1000.0, "10.0"));
        section.finish();
        Some(Self { from: from?, data: data.map(Into::into), rate, line: item.line })
    }
}
