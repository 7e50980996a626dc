//! Attributes: names, and numbers separated by blanks.

use super::Element;
use super::text::quoted;
use crate::counted;
use crate::error::DescriptionError;

/// Most bytes of a name.
const MOST_NAME_BYTES: usize = 128;

impl<'a> Element<'a, '_> {
    /// Names and values of those without a namespace.
    pub(crate) fn attributes(self) -> impl Iterator<Item = (&'a str, &'a str)> {
        let own = self.0.attributes().filter(|attribute| attribute.namespace().is_none());
        own.map(|attribute| (attribute.name(), attribute.value()))
    }

    /// The value of an attribute that may be missing.
    pub(crate) fn attribute(self, name: &str) -> Option<&'a str> {
        self.0.attribute(name)
    }

    /// The value of an attribute.
    pub(crate) fn required_attribute(self, name: &str) -> Result<&'a str, DescriptionError> {
        self.attribute(name)
            .ok_or_else(|| self.error(format!("it has no attribute {name}"), format!("write {name}=\"...\"")))
    }

    /// The value of an attribute that names something: neither empty nor long, one line.
    pub(crate) fn required_name(self, attribute: &str) -> Result<&'a str, DescriptionError> {
        let name = self.required_attribute(attribute)?;
        let problem = if name.trim().is_empty() {
            format!("{attribute} is empty")
        } else if name.len() > MOST_NAME_BYTES {
            format!("{attribute} has {} bytes, and at most {MOST_NAME_BYTES} are allowed", name.len())
        } else if name.chars().any(char::is_control) {
            format!("{attribute} is {}, which has control characters", quoted(name))
        } else {
            return Ok(name);
        };
        Err(self.attribute_error(attribute, problem, "choose a name of 1 to 128 printable bytes"))
    }

    /// The numbers of an attribute that may be missing: exactly so many.
    pub(crate) fn numbers<const N: usize>(self, name: &str) -> Result<Option<[f64; N]>, DescriptionError> {
        if self.attribute(name).is_none() {
            return Ok(None);
        }
        let numbers = self.number_list(name)?;
        let count = numbers.len();
        numbers.try_into().map(Some).map_err(|_| {
            let [holds, needs] = [count, N].map(|count| counted(count, "number", "numbers"));
            self.attribute_error(name, format!("{name} holds {holds}, not {N}"), format!("write {needs}"))
        })
    }

    /// The numbers of an attribute: exactly so many.
    pub(crate) fn required_numbers<const N: usize>(self, name: &str) -> Result<[f64; N], DescriptionError> {
        self.required_attribute(name)?;
        self.numbers(name)?.ok_or_else(|| self.error(format!("it has no attribute {name}"), "write it"))
    }

    /// The number of an attribute that may be missing.
    pub(crate) fn number(self, name: &str) -> Result<Option<f64>, DescriptionError> {
        Ok(self.numbers(name)?.map(|[number]| number))
    }

    /// The numbers of an attribute.
    pub(crate) fn number_list(self, name: &str) -> Result<Vec<f64>, DescriptionError> {
        let value = self.required_attribute(name)?;
        value.split_ascii_whitespace().map(|word| self.parsed(name, word)).collect()
    }

    fn parsed(self, attribute: &str, word: &str) -> Result<f64, DescriptionError> {
        let shown = quoted(word);
        match word.parse::<f64>() {
            Ok(number) if number.is_finite() => Ok(number),
            Ok(_) => {
                let problem = format!("{attribute} holds {shown}, which is not finite");
                Err(self.attribute_error(attribute, problem, "write a finite number"))
            }
            Err(_) if word.contains(',') => {
                let problem = format!("{attribute} holds {shown}, which has a comma");
                let remedy = "write decimal points (0.5), and blanks between numbers";
                Err(self.attribute_error(attribute, problem, remedy))
            }
            Err(_) => {
                let problem = format!("{attribute} holds {shown}, which is not a number");
                Err(self.attribute_error(attribute, problem, "write a number, such as 0.5 or 1e-3"))
            }
        }
    }
}
