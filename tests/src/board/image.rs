//! The board's image: its sections and symbols, and modified copies.

use super::toolchain;
use anyhow::{Context, Result, ensure};
use gleaner_pilot::{Mission, mission_image};
use object::{Object, ObjectSection, ObjectSymbol, SectionFlags, SectionKind, elf};
use std::ops::Range;
use std::path::Path;

/// An image in memory.
#[derive(Clone)]
pub struct Image {
    bytes: Vec<u8>,
}

/// A section that occupies memory on the board.
#[derive(Clone, Debug)]
pub struct Section {
    /// Its name.
    pub name: String,
    /// Its address at run time.
    pub address: u32,
    /// Bytes.
    pub size: u32,
    /// Whether it is in flash: everything except memory that startup code clears.
    pub in_flash: bool,
    /// Whether it occupies RAM.
    pub in_ram: bool,
}

impl Image {
    /// The mission's section.
    pub const MISSION: &str = ".gleaner_mission";
    /// The model's section.
    pub const MODEL: &str = ".gleaner_model";

    /// Builds the shipped board's image from the present sources.
    ///
    /// # Errors
    /// It cannot be built, with what to do about it.
    pub fn build() -> Result<Image> {
        Image::read(&toolchain::build(toolchain::SHIPPED)?)
    }

    /// The image in this file.
    ///
    /// # Errors
    /// The file cannot be read or is not an ELF file.
    pub fn read(path: &Path) -> Result<Image> {
        let bytes = std::fs::read(path).with_context(|| path.display().to_string())?;
        object::File::parse(&*bytes).with_context(|| path.display().to_string())?;
        Ok(Image { bytes })
    }

    /// The file's bytes.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    fn file(&self) -> object::File<'_> {
        object::File::parse(&*self.bytes).expect("parsed when it was read")
    }

    /// The sections that occupy memory on the board.
    #[must_use]
    pub fn sections(&self) -> Vec<Section> {
        let file = self.file();
        let allocated = |section: &object::Section<'_, '_>| match section.flags() {
            SectionFlags::Elf { sh_flags, .. } => sh_flags.contains(elf::SHF_ALLOC),
            _ => false,
        };
        let mut sections = Vec::new();
        for section in file.sections().filter(allocated).filter(|section| section.size() > 0) {
            let cleared = section.kind() == SectionKind::UninitializedData;
            let address = section.address() as u32;
            sections.push(Section {
                name: section.name().unwrap_or_default().to_owned(),
                address,
                size: section.size() as u32,
                in_flash: !cleared,
                // Flash starts at 0x0800_0000; all RAM is above it, the core-coupled RAM at 0x1000_0000 (RM0090,
                // table 1).
                in_ram: address >= 0x1000_0000,
            });
        }
        sections
    }

    /// The value of a symbol.
    #[must_use]
    pub fn symbol(&self, name: &str) -> Option<u32> {
        let file = self.file();
        let found = file.symbols().find(|symbol| symbol.name() == Ok(name))?;
        Some(found.address() as u32)
    }

    /// The names of all functions in the image.
    #[must_use]
    pub fn functions(&self) -> Vec<String> {
        let file = self.file();
        let functions = file.symbols().filter(|symbol| symbol.kind() == object::SymbolKind::Text);
        functions.filter_map(|symbol| symbol.name().ok().map(str::to_owned)).collect()
    }

    /// The bytes of a section.
    ///
    /// # Errors
    /// No section has this name.
    pub fn section(&self, name: &str) -> Result<&[u8]> {
        Ok(&self.bytes[self.place(name)?])
    }

    /// The stack's range, from its lowest address to its start.
    ///
    /// # Errors
    /// The image lacks the symbols.
    pub fn stack(&self) -> Result<Range<u32>> {
        let symbol =
            |name: &str| self.symbol(name).with_context(|| format!("the image has no symbol {name}"));
        Ok(symbol("_stack_end")?..symbol("_stack_start")?)
    }

    /// The parameters' range in flash.
    ///
    /// # Errors
    /// The image lacks the symbols.
    pub fn parameters(&self) -> Result<Range<u32>> {
        let symbol =
            |name: &str| self.symbol(name).with_context(|| format!("the image has no symbol {name}"));
        Ok(symbol("_parameters_start")?..symbol("_parameters_end")?)
    }

    /// A copy with another mission.
    ///
    /// # Errors
    /// The mission does not fit.
    pub fn with_mission(&self, mission: &Mission) -> Result<Image> {
        let mut copy = self.clone();
        let place = copy.place(Image::MISSION)?;
        let image = mission_image::encode(mission);
        ensure!(image.len() <= place.len(), "the mission's section is too small");
        copy.bytes[place][..image.len()].copy_from_slice(&image);
        Ok(copy)
    }

    /// A copy with one bit of a section inverted.
    ///
    /// # Errors
    /// No section has this name, or it is shorter.
    pub fn with_flipped_bit(&self, section: &str, offset: usize) -> Result<Image> {
        let mut copy = self.clone();
        let place = copy.place(section)?;
        let byte = copy.bytes[place].get_mut(offset).with_context(|| format!("{section} is shorter"))?;
        *byte ^= 1;
        Ok(copy)
    }

    fn place(&self, name: &str) -> Result<Range<usize>> {
        let file = self.file();
        let section =
            file.section_by_name(name).with_context(|| format!("the image has no section {name}"))?;
        let (start, size) = section.file_range().with_context(|| format!("{name} is empty"))?;
        Ok(start as usize..(start + size) as usize)
    }
}
