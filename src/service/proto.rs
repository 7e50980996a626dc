//! Messages, clients and servers generated from `proto/sublevel/v1`.
#![allow(missing_docs, unreachable_pub, rustdoc::all, clippy::all, clippy::uninlined_format_args)]

tonic::include_proto!("sublevel.v1");

/// The compiled `proto/` files, as server reflection hands them out.
pub const FILE_DESCRIPTOR_SET: &[u8] = tonic::include_file_descriptor_set!("sublevel.v1");
