//! The elements of a COLLADA file by their ids, its unit and its scene.

use super::xml::{Xml, child, children, place_of};
use crate::input::error::Defect;
use crate::input::text;
use std::collections::{HashMap, HashSet};

/// The elements of a file.
pub(super) struct Document<'a, 'i> {
    root: Xml<'a, 'i>,
    ids: HashMap<&'a str, Xml<'a, 'i>>,
    /// Those that several elements have.
    repeated: HashSet<&'a str>,
}

impl<'a, 'i> Document<'a, 'i> {
    pub(super) fn new(root: Xml<'a, 'i>) -> Self {
        let mut document = Self { root, ids: HashMap::new(), repeated: HashSet::new() };
        for element in root.descendants() {
            let Some(id) = element.attribute("id") else { continue };
            if document.ids.insert(id, element).is_some() {
                document.repeated.insert(id);
            }
        }
        document
    }

    /// The element that an attribute names, in the same file.
    pub(super) fn referenced(&self, element: Xml<'a, 'i>, attribute: &str) -> Result<Xml<'a, 'i>, Defect> {
        let name = element.attribute(attribute).unwrap_or_default();
        let id = name.strip_prefix('#');
        if id.is_some_and(|id| self.repeated.contains(id)) {
            let reason = format!("{attribute} is {}, which several elements have", text::quoted(name.as_bytes()));
            return Err(Defect::new(place_of(element), reason).remedy("give each element an id of its own"));
        }
        let found = id.and_then(|id| self.ids.get(id)).copied();
        found.ok_or_else(|| {
            let name = text::quoted(name.as_bytes());
            let reason = format!("{attribute} is {name}, which names no element of this file");
            Defect::new(place_of(element), reason)
        })
    }

    /// Metres per unit.
    pub(super) fn unit(&self) -> Result<f64, Defect> {
        let of_file = child(self.root, "asset").and_then(|asset| child(asset, "unit"));
        let meter = |unit: Xml<'a, 'i>| unit.attribute("meter").unwrap_or("1").trim();
        let is_other = |unit: &Xml<'a, 'i>| {
            let is_unit = unit.is_element() && unit.tag_name().name() == "unit";
            let of_asset = unit.parent().is_some_and(|asset| asset.tag_name().name() == "asset");
            is_unit && of_asset && meter(*unit) != of_file.map_or("1", meter)
        };
        if let Some(inner) = self.root.descendants().find(is_other) {
            let reason = "a part of the file has a unit of its own, which is not read";
            return Err(Defect::new(place_of(inner), reason).remedy("export all parts in one unit"));
        }
        let Some(unit) = of_file else { return Ok(1.0) };
        let Some(meter) = unit.attribute("meter") else { return Ok(1.0) };
        let value = meter.trim().parse().ok().filter(|meter: &f64| *meter > 0.0 && meter.is_finite());
        value.ok_or_else(|| {
            Defect::new(
                place_of(unit),
                format!("the attribute meter is {}, no positive number", text::quoted(meter.as_bytes())),
            )
        })
    }

    /// The scene that is shown; none of files with geometries alone.
    pub(super) fn scene(&self) -> Result<Option<Xml<'a, 'i>>, Defect> {
        let instance = child(self.root, "scene").and_then(|scene| child(scene, "instance_visual_scene"));
        if let Some(instance) = instance {
            return self.referenced(instance, "url").map(Some);
        }
        let libraries = children(self.root, "library_visual_scenes");
        let scenes: Vec<_> = libraries.flat_map(|library| children(library, "visual_scene")).collect();
        match scenes[..] {
            [] => Ok(None),
            [scene] => Ok(Some(scene)),
            _ => Err(Defect::new("scene", "the file holds several scenes and says of none that it is shown")
                .remedy("export one scene")),
        }
    }
}
