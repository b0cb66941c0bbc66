//! Makes the buffers that a plan lists.

use bytemuck::Pod;

use crate::error::Result;
use crate::gpu::{Buffer, Commands, Gpu, Memory};
use crate::plan::buffers::PlannedBuffer;

/// Structs of buffers, each field with its type and how it is made of the constructor's arguments.
macro_rules! buffers {
    ($(#[$doc:meta])* pub struct $name:ident($($argument:ident: $given:ty),*) {
        $($(#[$note:meta])* $field:ident: $type:ty = $made:expr),* $(,)?
    }) => {
        $(#[$doc])*
        pub struct $name {
            $($(#[$note])* pub $field: $type),*
        }

        impl $name {
            pub(super) fn made($($argument: $given),*) -> Result<$name> {
                Ok($name { $($field: $made),* })
            }
        }
    };
}

pub(in crate::engine) use buffers;

/// What a plan lists, and where it is to be.
pub struct Planned<'a> {
    pub gpu: &'a Gpu,
    pub buffers: Vec<PlannedBuffer>,
}

impl Planned<'_> {
    fn listed<T>(&self, name: &str) -> impl Iterator<Item = &PlannedBuffer> {
        self.buffers.iter().filter(move |planned| planned.name == name).inspect(|planned| {
            assert_eq!(planned.element, std::any::type_name::<T>(), "elements of {}", planned.name);
        })
    }

    /// All buffers of a name, in the plan's order.
    pub fn all<T: Pod>(&self, name: &str) -> Result<Vec<Buffer<T>>> {
        self.listed::<T>(name).map(|planned| self.gpu.buffer(name, planned.count, Memory::Device)).collect()
    }

    /// The only one of a name.
    pub fn one<T: Pod>(&self, name: &str) -> Result<Buffer<T>> {
        let [buffer] = self.several(name)?;
        Ok(buffer)
    }

    pub fn several<T: Pod, const N: usize>(&self, name: &str) -> Result<[Buffer<T>; N]> {
        let found = self.all(name)?;
        Ok(found
            .try_into()
            .unwrap_or_else(|found: Vec<_>| panic!("the plan has {} buffers of the name {name} instead of {N}", found.len())))
    }

    /// As many as the content has parts, each with its own, of which the plan keeps all or nothing.
    pub fn filled_parts<T: Pod, const N: usize>(&self, commands: &mut Commands, name: &str, parts: [&[T]; N]) -> Result<[Buffer<T>; N]> {
        let buffers = self.several(name)?;
        for ((buffer, part), planned) in buffers.iter().zip(parts).zip(self.listed::<T>(name)) {
            if planned.count > 0 {
                assert_eq!(part.len() as u64, buffer.count(), "elements of {name}");
                commands.upload(buffer, part)?;
            }
        }
        Ok(buffers)
    }

    /// The only one of a name, set to zero.
    pub fn zeroed<T: Pod>(&self, commands: &mut Commands, name: &str) -> Result<Buffer<T>> {
        let buffer = self.one(name)?;
        commands.clear(&buffer);
        Ok(buffer)
    }

    /// The only one of a name with its content, of which the plan keeps all or nothing.
    pub fn filled<T: Pod>(&self, commands: &mut Commands, name: &str, content: &[T]) -> Result<Buffer<T>> {
        let buffer = self.one(name)?;
        if self.listed::<T>(name).any(|planned| planned.count > 0) {
            assert_eq!(content.len() as u64, buffer.count(), "elements of {name}");
            commands.upload(&buffer, content)?;
        }
        Ok(buffer)
    }
}
