//! Makes the buffers that a plan lists.

use bytemuck::Pod;

use crate::error::Result;
use crate::gpu::{Buffer, Commands, Gpu, Memory};
use crate::plan::buffers::{Declared, PlannedBuffer};

/// Structs of buffers, each field with its type and how it is made of the constructor's arguments.
macro_rules! buffers {
    ($(#[$doc:meta])* pub(crate) struct $name:ident($($argument:ident: $given:ty),*) {
        $($(#[$note:meta])* $field:ident: $type:ty = $made:expr),* $(,)?
    }) => {
        $(#[$doc])*
        pub(crate) struct $name {
            $($(#[$note])* pub(crate) $field: $type),*
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
pub(crate) struct Planned<'a> {
    pub gpu: &'a Gpu,
    pub buffers: Vec<PlannedBuffer>,
}

impl Planned<'_> {
    fn listed<T>(&self, declared: Declared<T>) -> impl Iterator<Item = &PlannedBuffer> {
        self.buffers.iter().filter(move |planned| planned.name == declared.name)
    }

    /// All that are listed, in the plan's order.
    pub(crate) fn all<T: Pod>(&self, declared: Declared<T>) -> Result<Vec<Buffer<T>>> {
        self.listed(declared).map(|planned| self.gpu.buffer(planned.name, planned.count, Memory::Device)).collect()
    }

    /// The only one that is listed.
    pub(crate) fn one<T: Pod>(&self, declared: Declared<T>) -> Result<Buffer<T>> {
        let [buffer] = self.several(declared)?;
        Ok(buffer)
    }

    pub(crate) fn several<T: Pod, const N: usize>(&self, declared: Declared<T>) -> Result<[Buffer<T>; N]> {
        let found = self.all(declared)?;
        Ok(found
            .try_into()
            .unwrap_or_else(|found: Vec<_>| panic!("the plan has {} buffers of the name {} instead of {N}", found.len(), declared.name)))
    }

    /// As many as the content has parts, each with its own, of which the plan keeps all or nothing.
    pub(crate) fn filled_parts<T: Pod, const N: usize>(
        &self,
        commands: &mut Commands,
        declared: Declared<T>,
        parts: [&[T]; N],
    ) -> Result<[Buffer<T>; N]> {
        let buffers = self.several(declared)?;
        for ((buffer, part), planned) in buffers.iter().zip(parts).zip(self.listed(declared)) {
            if planned.count > 0 {
                assert_eq!(part.len() as u64, buffer.count(), "elements of {}", declared.name);
                commands.upload(buffer, part)?;
            }
        }
        Ok(buffers)
    }

    /// The only one that is listed, set to zero.
    pub(crate) fn zeroed<T: Pod>(&self, commands: &mut Commands, declared: Declared<T>) -> Result<Buffer<T>> {
        let [buffer] = self.several_zeroed(commands, declared)?;
        Ok(buffer)
    }

    pub(crate) fn several_zeroed<T: Pod, const N: usize>(&self, commands: &mut Commands, declared: Declared<T>) -> Result<[Buffer<T>; N]> {
        let buffers = self.several(declared)?;
        buffers.iter().for_each(|buffer| commands.clear(buffer));
        Ok(buffers)
    }

    /// The only one that is listed with its content, of which the plan keeps all or nothing.
    pub(crate) fn filled<T: Pod>(&self, commands: &mut Commands, declared: Declared<T>, content: &[T]) -> Result<Buffer<T>> {
        let [buffer] = self.filled_parts(commands, declared, [content])?;
        Ok(buffer)
    }
}
