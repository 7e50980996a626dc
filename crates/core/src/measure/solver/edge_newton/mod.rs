//! Newton's method for the distance of bodies of several constraints, with active sets.
//!
//! At points x and y, `D` apart along the unit normal n from B to A, steps dx and dy of A's and B's
//! points that minimise the distance to second order solve
//!
//! ```text
//! min n·(dx - dy) + |τ + α - β|² / (2 D) + ½ dxᵀ (Σ λ_i H_i) dx + ½ dyᵀ (Σ μ_j H_j) dy
//! over (g_i(x) - 1) m_i + ∇g_i·dx <= 0,   (h_j(y) - 1) m_j + ∇h_j·dy <= 0
//! ```
//!
//! with the tangential parts τ of `x - y`, α of dx and β of dy, the multipliers λ and μ of the step
//! before, and the constraints straightened by the mean m of their value and 1. While B's active
//! set stays, its minimiser follows x by `β = β_0 + S α`, S from the compliance `G = Z (Zᵀ Q Z)⁻¹
//! Zᵀ` of Q, what is quadratic in dy, on the directions Z that the set leaves free. What is left is
//! the distance from B's offset surface through x, whose curvature is `K = (I - S) / D`: a
//! quadratic program in dx alone, which finds A's active set (`quadratic_program`). Where B's
//! multipliers or constraints say so, its own program then finds another set for it, and A's is
//! solved again.
//!
//! The proof needs no other bracket than that of two smooth bodies: `Σ w_i g_i <= 1` with the
//! weights `λ_i / Σ λ` of the active constraints is one convex constraint that holds all over A and
//! has the same nearest point (`aggregate`). Its tangent plane gives the lower bound; the upper one
//! is attained by points that are moved towards the bodies' interior points until all constraints
//! are proven to hold.
//!
//! Beside a set with a closed form one body alone is linearized (`set_distance`), and likewise for
//! how far it reaches (`farthest`).

mod aggregate;
mod distance;
mod farthest;
mod linearized;
mod quadratic_program;
mod set_distance;
mod share_inside;
mod spot;

pub(in crate::measure) use distance::{EdgeProven, EdgeQuery, EdgeStart, EdgeTrace};
pub(in crate::measure) use farthest::FarthestOfEdges;
pub(in crate::measure) use set_distance::{EdgeShapeProven, EdgeShapeQuery, EdgeShapeStart, EdgeShapeTrace};
