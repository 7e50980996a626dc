//! COLLADA (`.dae`): the meshes that the scene shows, where its nodes place them.
//!
//! The unit that the file names is applied. Its `up_axis` is not: coordinates stay in the axes of
//! the file, as RViz and MoveIt read the meshes of robots.

mod document;
mod geometry;
mod transform;
mod xml;

use super::surface::{Place, Surface};
use super::{Defect, text};
use document::Document;
use geometry::Geometry;
use roxmltree::NodeId;
use std::collections::HashMap;
use std::rc::Rc;
use transform::Affine;
use xml::{Xml, children, place_of, unexpected};

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

/// Most bytes of a tag, and most declarations of namespaces: the parser compares each with all
/// others.
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
