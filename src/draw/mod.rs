//! Pictures as SVG: silhouettes of posed bodies ([`Silhouettes`]), curves ([`LineChart`]) and
//! points on logarithmic axes ([`Scatter`]), several of them in one picture ([`stacked`]).
//!
//! Backgrounds are transparent, and every colour has a contrast of at least 3 : 1 against white and
//! against black, so a picture can be read on light and on dark pages. Two colours never carry a
//! meaning alone: dashes or labels do too.
//!
//! Pictures are small: curves keep the vertices that matter on a screen, marks of a series are one
//! path, and meshes are drawn as the area that they cover.

mod canvas;
mod compact;
mod contour;
mod curve;
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
pub use ink::Ink;
pub use scatter::{Group, Marker, Point, Scatter, Stairs};
pub use shadow::shadow;
pub use silhouette::{Outline, Panel, Silhouettes, Span, View, boundary_points, outline, silhouette};
pub use stack::stacked;
