//! The rules `proto/` keeps: those of buf's standard lint that can be read off the descriptors, and
//! a comment everywhere.

use std::collections::{BTreeSet, HashSet};

use prost::Message;
use prost_types::field_descriptor_proto::Label;
use prost_types::{DescriptorProto, FileDescriptorProto, FileDescriptorSet};
use sublevel::service::proto::FILE_DESCRIPTOR_SET;

fn files() -> Vec<FileDescriptorProto> {
    let files = FileDescriptorSet::decode(FILE_DESCRIPTOR_SET).expect("descriptors").file;
    let ours: Vec<_> = files.into_iter().filter(|file| file.package() == "sublevel.v1").collect();
    assert_eq!(ours.len(), 11);
    ours
}

fn is_snake(name: &str) -> bool {
    name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_')
}

/// `SolveStatus` to `SOLVE_STATUS_`.
fn prefix(name: &str) -> String {
    let mut prefix = String::new();
    for c in name.chars() {
        if c.is_ascii_uppercase() && !prefix.is_empty() {
            prefix.push('_');
        }
        prefix.push(c.to_ascii_uppercase());
    }
    prefix + "_"
}

#[test]
fn names_follow_the_rules() {
    let mut used = HashSet::new();
    for file in files() {
        assert!(file.name().starts_with("sublevel/v1/") && file.syntax() == "proto3", "{}", file.name());
        for message in &file.message_type {
            assert!(message.name().starts_with(char::is_uppercase), "{}", message.name());
            assert!(message.field.iter().all(|field| is_snake(field.name())), "{}", message.name());
        }
        for enumeration in &file.enum_type {
            let prefix = prefix(enumeration.name());
            assert_eq!(enumeration.value[0].name(), format!("{prefix}UNSPECIFIED"));
            assert_eq!(enumeration.value[0].number(), 0);
            assert!(enumeration.value.iter().all(|value| value.name().starts_with(&prefix)), "{prefix}");
        }
        for service in &file.service {
            assert!(service.name().ends_with("Service"), "{}", service.name());
            for method in &service.method {
                for (message, suffix) in [(method.input_type(), "Request"), (method.output_type(), "Response")] {
                    assert_eq!(message, format!(".sublevel.v1.{}{suffix}", method.name()));
                    assert!(used.insert(message.to_owned()), "{message} serves two calls");
                }
            }
        }
    }
}

#[test]
fn everything_is_commented() {
    for file in files() {
        let info = file.source_code_info.as_ref().expect("comments are kept");
        let commented: HashSet<&[i32]> = info
            .location
            .iter()
            .filter(|location| !location.leading_comments().trim().is_empty())
            .map(|location| location.path.as_slice())
            .collect();
        let require = |path: &[i32], what: &str| assert!(commented.contains(path), "{what} has no comment");
        // The numbers are those of descriptor.proto: 4 messages, 5 enums, 6 services; in them 2
        // fields, 2 values or methods.
        for (i, message) in (0..).zip(&file.message_type) {
            require(&[4, i], message.name());
            fields(message, |j, field| require(&[4, i, 2, j], &format!("{}.{field}", message.name())));
        }
        for (i, enumeration) in (0..).zip(&file.enum_type) {
            require(&[5, i], enumeration.name());
            (0..).zip(&enumeration.value).for_each(|(j, value)| require(&[5, i, 2, j], value.name()));
        }
        for (i, service) in (0..).zip(&file.service) {
            require(&[6, i], service.name());
            (0..).zip(&service.method).for_each(|(j, method)| require(&[6, i, 2, j], method.name()));
        }
    }
}

fn fields(message: &DescriptorProto, check: impl Fn(i32, &str)) {
    (0..).zip(&message.field).for_each(|(j, field)| check(j, field.name()));
}

/// Everything that clients of an earlier version rely on, a line each: fields with their numbers
/// and types, values, calls.
fn promises() -> BTreeSet<String> {
    let mut promises = BTreeSet::new();
    for file in files() {
        for message in &file.message_type {
            promise_fields(message, message.name(), &mut promises);
        }
        for enumeration in &file.enum_type {
            let value = |value: &prost_types::EnumValueDescriptorProto| {
                format!("enum {} {} = {}", enumeration.name(), value.name(), value.number())
            };
            promises.extend(enumeration.value.iter().map(value));
        }
        for service in &file.service {
            for method in &service.method {
                let streams = |streams| if streams { "stream " } else { "" };
                promises.insert(format!(
                    "call {}.{} {}-> {}",
                    service.name(),
                    method.name(),
                    streams(method.client_streaming()),
                    streams(method.server_streaming()).trim_end(),
                ));
            }
        }
    }
    promises
}

fn promise_fields(message: &DescriptorProto, path: &str, promises: &mut BTreeSet<String>) {
    for field in &message.field {
        let kind = match field.type_name() {
            "" => format!("{:?}", field.r#type()).to_lowercase(),
            name => name.trim_start_matches(".sublevel.v1.").to_owned(),
        };
        let presence = match field.oneof_index {
            _ if field.proto3_optional() => "optional ".to_owned(),
            Some(index) => format!("oneof {} ", message.oneof_decl[index as usize].name()),
            None => String::new(),
        };
        let label = if field.label() == Label::Repeated { "repeated " } else { "" };
        promises.insert(format!("field {path}.{} = {}: {presence}{label}{kind}", field.name(), field.number()));
    }
    for nested in &message.nested_type {
        promise_fields(nested, &format!("{path}.{}", nested.name()), promises);
    }
}

/// `UPDATE_PROMISES=1 cargo test --test proto` adds what is new; what is gone or changed is removed
/// from the file by hand, with a major version.
#[test]
fn nothing_that_clients_rely_on_is_gone() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/proto/promises.txt");
    let kept: BTreeSet<String> = std::fs::read_to_string(path).unwrap_or_default().lines().map(str::to_owned).collect();
    let now = promises();
    let gone: Vec<&String> = kept.difference(&now).collect();
    assert!(gone.is_empty(), "clients of an earlier version break without: {gone:#?}");
    if std::env::var_os("UPDATE_PROMISES").is_some() {
        let lines: Vec<String> = now.into_iter().collect();
        std::fs::write(path, lines.join("\n") + "\n").expect("written");
        return;
    }
    let new: Vec<&String> = now.difference(&kept).collect();
    assert!(new.is_empty(), "add these with UPDATE_PROMISES=1 cargo test --test proto: {new:#?}");
}
