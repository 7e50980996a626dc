//! COLLADA (`.dae`): the meshes that the scene shows, where its nodes place them.
//!
//! The unit that the file names is applied. Its `up_axis` is not: coordinates stay in the axes of
//! the file, as RViz and MoveIt read the meshes of robots.

mod geometry;
mod transform;

use super::surface::{Place, Surface};
use super::{Defect, text};
use geometry::Geometry;
use roxmltree::{Node, NodeId};
use std::collections::{HashMap, HashSet};
use std::rc::Rc;
use transform::Affine;

type Xml<'a, 'i> = Node<'a, 'i>;

/// Deepest nesting of nodes, those of instances included: a node may name itself.
const MAX_DEPTH: usize = 64;

/// Most nodes that are visited: nodes that instance nodes multiply.
const MAX_VISITS: usize = 100_000;

/// Most points and corners of all instances together.
const MAX_POINTS: usize = 1 << 24;

/// Reads a file.
pub(super) fn read(bytes: &[u8]) -> Result<Surface, Defect> {
    // Names and comments need not be UTF-8.
    let content = String::from_utf8_lossy(text::without_mark(bytes)?);
    check_tags(&content)?;
    let parsed = roxmltree::Document::parse(&content).map_err(|error| {
        Defect::line(error.pos().row as usize, format!("this is no XML: {}", text::shortened(&error.to_string())))
    })?;
    let root = parsed.root_element();
    if root.tag_name().name() != "COLLADA" {
        let name = text::quoted(root.tag_name().name().as_bytes());
        let reason = format!("the outermost element is {name}, not \"COLLADA\"");
        return Err(Defect::line(1, reason));
    }
    let document = Document::new(root);
    let mut scene =
        Scene { document: &document, surface: Surface::default(), geometries: HashMap::new(), visits: 0, corners: 0 };
    match document.scene()? {
        Some(visual) => scene.add_children(visual, &Affine::identity(), 0)?,
        None => {
            let libraries = children(root, "library_geometries");
            for geometry in libraries.flat_map(|library| children(library, "geometry")) {
                scene.add_geometry(geometry, &Affine::identity())?;
            }
        }
    }
    let mut surface = scene.surface;
    if surface.points.is_empty() {
        return Err(Defect::new("scene", "it shows no mesh").remedy("export the shape as polygons"));
    }
    let unit = document.unit()?;
    surface.points.iter_mut().for_each(|point| *point *= unit);
    Ok(surface)
}

/// Most bytes of a tag, and most declarations of namespaces: the parser compares each with all others.
const MOST_TAG_BYTES: usize = 4096;
const MOST_NAMESPACES: usize = 64;

/// Refuses what takes the parser long.
fn check_tags(content: &str) -> Result<(), Defect> {
    let remedy = "export it with another program";
    if content.matches("xmlns").nth(MOST_NAMESPACES).is_some() {
        return Err(Defect::new("namespaces", format!("more than {MOST_NAMESPACES} are declared")).remedy(remedy));
    }
    // Comments and text in between are no tags.
    let mut rest = content;
    while let Some(start) = rest.find('<') {
        rest = &rest[start..];
        let (end, is_tag) = if rest.starts_with("<!--") { (rest.find("-->"), false) } else { (rest.find('>'), true) };
        let length = end.unwrap_or(rest.len());
        if is_tag && !rest.starts_with("<![CDATA[") && length > MOST_TAG_BYTES {
            return Err(Defect::new("tags", format!("one has more than {MOST_TAG_BYTES} bytes")).remedy(remedy));
        }
        rest = &rest[length.max(1)..];
    }
    Ok(())
}

/// The elements of a file.
struct Document<'a, 'i> {
    root: Xml<'a, 'i>,
    ids: HashMap<&'a str, Xml<'a, 'i>>,
    /// Those that several elements have.
    repeated: HashSet<&'a str>,
}

impl<'a, 'i> Document<'a, 'i> {
    fn new(root: Xml<'a, 'i>) -> Self {
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
    fn referenced(&self, element: Xml<'a, 'i>, attribute: &str) -> Result<Xml<'a, 'i>, Defect> {
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
    fn unit(&self) -> Result<f64, Defect> {
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

    /// The scene that is shown; none of files that hold geometries alone.
    fn scene(&self) -> Result<Option<Xml<'a, 'i>>, Defect> {
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

/// What was collected of a scene.
struct Scene<'d, 'a, 'i> {
    document: &'d Document<'a, 'i>,
    surface: Surface,
    /// Those read so far: a scene may show one many times.
    geometries: HashMap<NodeId, Rc<Geometry>>,
    visits: usize,
    corners: usize,
}

impl<'a, 'i> Scene<'_, 'a, 'i> {
    /// Adds what a node, or a scene, has inside.
    fn add_children(&mut self, node: Xml<'a, 'i>, frame: &Affine, depth: usize) -> Result<(), Defect> {
        self.visits += 1;
        if depth > MAX_DEPTH || self.visits > MAX_VISITS {
            let reason = format!(
                "nodes are nested deeper than {MAX_DEPTH}, or there are more than {MAX_VISITS} with all instances"
            );
            return Err(Defect::new(place_of(node), reason).remedy("no node may have itself inside"));
        }
        for element in node.children().filter(Xml::is_element) {
            self.visits += 1;
            match element.tag_name().name() {
                "node" => self.add_node(element, frame, depth)?,
                "instance_node" => self.add_node(self.document.referenced(element, "url")?, frame, depth)?,
                "instance_geometry" => self.add_geometry(self.document.referenced(element, "url")?, frame)?,
                "instance_controller" => {
                    let reason = "a shape that joints deform (instance_controller) is not read";
                    return Err(Defect::new(place_of(node), reason).remedy("apply the deformation before exporting"));
                }
                "asset" | "evaluate_scene" | "extra" | "instance_camera" | "instance_light" => {}
                // What `Affine::of_node` reads.
                "matrix" | "translate" | "rotate" | "scale" | "lookat" | "skew" => {}
                _ => return Err(unexpected(element)),
            }
        }
        Ok(())
    }

    fn add_node(&mut self, node: Xml<'a, 'i>, frame: &Affine, depth: usize) -> Result<(), Defect> {
        self.add_children(node, &frame.of_node(node)?, depth + 1)
    }

    fn add_geometry(&mut self, geometry: Xml<'a, 'i>, frame: &Affine) -> Result<(), Defect> {
        let read = match self.geometries.get(&geometry.id()) {
            Some(known) => known.clone(),
            None => Rc::new(Geometry::read(self.document, geometry)?),
        };
        self.geometries.insert(geometry.id(), read.clone());
        let Geometry { points, polygons } = &*read;
        let first = self.surface.points.len();
        // A loop takes memory of its own, however few corners it has.
        self.corners += polygons.iter().flatten().map(|corners| 4 + corners.len()).sum::<usize>();
        if first + points.len() > MAX_POINTS || self.corners > 4 * MAX_POINTS {
            let reason = format!("the instances have more than {MAX_POINTS} points, or four times as many corners");
            return Err(Defect::new(place_of(geometry), reason).remedy("make the mesh coarser"));
        }
        self.surface.points.extend(points.iter().map(|x| frame.apply(x)));
        for (index, loops) in polygons.iter().enumerate() {
            let moved = loops.iter().map(|corners| {
                let mut corners: Vec<usize> = corners.iter().map(|corner| first + corner).collect();
                if frame.mirrors() {
                    corners.reverse();
                }
                corners
            });
            self.surface.add_polygon(Place::Face(index), moved);
        }
        Ok(())
    }
}

/// An element that the format does not have there: passing over it could leave out a shape.
fn unexpected(element: Xml<'_, '_>) -> Defect {
    Defect::new(place_of(element), "the format has no such element here")
}

/// The first child element of a name.
fn child<'a, 'i>(parent: Xml<'a, 'i>, name: &str) -> Option<Xml<'a, 'i>> {
    parent.children().find(|element| element.is_element() && element.tag_name().name() == name)
}

/// All child elements of a name.
fn children<'a, 'i, 'n>(parent: Xml<'a, 'i>, name: &'n str) -> impl Iterator<Item = Xml<'a, 'i>> + use<'a, 'i, 'n> {
    parent.children().filter(move |element| element.is_element() && element.tag_name().name() == name)
}

/// An element as errors name it, with its line.
fn place_of(element: Xml<'_, '_>) -> String {
    let line = element.document().text_pos_at(element.range().start).row;
    let id = element.attribute("id").map(|id| format!(" {}", text::quoted(id.as_bytes()))).unwrap_or_default();
    format!("line {line}, element {}{id}", text::shortened(element.tag_name().name()))
}

/// The words of an element's text, comments left out.
fn words<'a>(element: Xml<'a, '_>) -> impl Iterator<Item = &'a str> {
    element.children().filter(Xml::is_text).filter_map(|text| text.text()).flat_map(str::split_ascii_whitespace)
}

/// The numbers in an element.
fn numbers(element: Xml<'_, '_>) -> Result<Vec<f64>, Defect> {
    let number = |word: &str| {
        text::number(word.as_bytes())
            .map_err(|reason| Defect::new(place_of(element), reason.text).remedy(reason.remedy))
    };
    words(element).map(number).collect()
}

/// The whole numbers in an element.
fn integers(element: Xml<'_, '_>) -> Result<Vec<usize>, Defect> {
    let integer = |word: &str| {
        text::integer(word.as_bytes()).ok_or_else(|| {
            let reason = format!("{} is not the number of a vertex", text::quoted(word.as_bytes()));
            Defect::new(place_of(element), reason)
        })
    };
    words(element).map(integer).collect()
}
