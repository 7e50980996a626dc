//! Pictures as SVG: silhouettes of posed bodies ([`Silhouettes`]), curves ([`LineChart`]), points
//! on logarithmic axes ([`Scatter`]) and coloured tables ([`HeatMap`]), several of them in one
//! picture ([`stacked`]).
//!
//! Backgrounds are transparent, and every colour has a contrast of at least 3 : 1 against white and
//! against black, but for the cells of a [`HeatMap`], whose text is dark: a picture can be read on
//! light and on dark pages. Two colours never carry a
//! meaning alone: dashes or labels do too.
//!
//! Pictures are small: curves keep the vertices that matter on a screen, marks of a series are one
//! path, and meshes are drawn as the area that they cover.

mod canvas;
mod compact;
mod contour;
mod curve;
mod heat_map;
mod ink;
mod labels;
mod path;
mod region;
mod scatter;
mod shadow;
mod silhouette;
mod stack;
mod thin;

pub use canvas::ChartError;
pub use curve::{LineChart, Mark, Series};
pub use heat_map::HeatMap;
pub use ink::Ink;
pub use scatter::{Group, Marker, Point, Scatter, Stairs};
pub use shadow::shadow;
pub use silhouette::{Outline, Panel, Silhouettes, Span, View, boundary_points, outline, silhouette};
pub use stack::stacked;
