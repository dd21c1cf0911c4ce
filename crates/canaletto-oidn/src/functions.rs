//! The functions of the C API that denoising takes, and their use.

#![allow(unsafe_code)] // Calls into a C library.

use crate::OidnError;
use crate::library::Library;
use std::ffi::{CStr, c_char, c_int, c_void};
use std::ptr;

type Device = *mut c_void;
type Filter = *mut c_void;

/// `OIDN_DEVICE_TYPE_CPU`.
const CPU: c_int = 1;
/// `OIDN_FORMAT_FLOAT3`.
const FLOAT3: c_int = 3;

/// Declares the functions with their C names and types, and how all are found.
macro_rules! functions {
    ($($field:ident = $name:literal: fn($($argument:ty),*) $(-> $result:ty)?;)*) => {
        /// The functions. Their names in C are those of the literals.
        #[derive(Clone, Copy, Debug)]
        pub(crate) struct Functions {
            $($field: unsafe extern "C" fn($($argument),*) $(-> $result)?,)*
        }

        impl Functions {
            /// Finds all functions.
            pub(crate) fn of(library: &Library) -> Result<Functions, OidnError> {
                Ok(Functions {
                    $($field: {
                        let address = library.function($name)?;
                        // SAFETY: the address is of the function of this name, whose type in `oidn.h` of version 2 is
                        // this one. The library is never unloaded.
                        unsafe {
                            std::mem::transmute::<*mut c_void, unsafe extern "C" fn($($argument),*) $(-> $result)?>(
                                address.as_ptr(),
                            )
                        }
                    },)*
                })
            }
        }
    };
}

functions! {
    new_device = c"oidnNewDevice": fn(c_int) -> Device;
    set_device_int = c"oidnSetDeviceInt": fn(Device, *const c_char, c_int);
    set_device_bool = c"oidnSetDeviceBool": fn(Device, *const c_char, bool);
    commit_device = c"oidnCommitDevice": fn(Device);
    device_error = c"oidnGetDeviceError": fn(Device, *mut *const c_char) -> c_int;
    release_device = c"oidnReleaseDevice": fn(Device);
    new_filter = c"oidnNewFilter": fn(Device, *const c_char) -> Filter;
    set_filter_image = c"oidnSetSharedFilterImage":
        fn(Filter, *const c_char, *mut c_void, c_int, usize, usize, usize, usize, usize);
    set_filter_bool = c"oidnSetFilterBool": fn(Filter, *const c_char, bool);
    commit_filter = c"oidnCommitFilter": fn(Filter);
    execute_filter = c"oidnExecuteFilter": fn(Filter);
    release_filter = c"oidnReleaseFilter": fn(Filter);
}

/// A device that is released at the end of its scope.
struct OwnedDevice<'a>(&'a Functions, Device);

impl Drop for OwnedDevice<'_> {
    fn drop(&mut self) {
        // SAFETY: the device is one of `new_device` and isn't used any more.
        unsafe { (self.0.release_device)(self.1) }
    }
}

/// A filter that is released at the end of its scope, before its device.
struct OwnedFilter<'a>(&'a Functions, Filter);

impl Drop for OwnedFilter<'_> {
    fn drop(&mut self) {
        // SAFETY: the filter is one of `new_filter` and isn't used any more.
        unsafe { (self.0.release_filter)(self.1) }
    }
}

impl OwnedDevice<'_> {
    /// The device's error since the last call, if there is one.
    fn check(&self) -> Result<(), OidnError> {
        let mut message = ptr::null();
        // SAFETY: the device may be null, which asks for the thread's error. `message` is a place for a pointer.
        let code = unsafe { (self.0.device_error)(self.1, &mut message) };
        if code == 0 {
            return Ok(());
        }
        if message.is_null() {
            return Err(OidnError::Library(format!("error {code}")));
        }
        // SAFETY: the library returns a text that ends in NUL and stays until the next call.
        Err(OidnError::Library(unsafe { CStr::from_ptr(message) }.to_string_lossy().into_owned()))
    }
}

impl Functions {
    /// Filters color by albedo and normal into `output`. Layers have width × height values; albedo and normal may have
    /// none.
    pub(crate) fn filter(
        &self,
        [width, height]: [usize; 2],
        [color, albedo, normal]: [&[[f32; 3]]; 3],
        output: &mut [[f32; 3]],
        threads: u32,
    ) -> Result<(), OidnError> {
        // The library reads and writes this many values of each layer.
        let pixels = width * height;
        assert!(color.len() == pixels && output.len() == pixels);
        assert!([albedo, normal].iter().all(|layer| layer.is_empty() || layer.len() == pixels));
        // SAFETY: a device type of the header.
        let device = OwnedDevice(self, unsafe { (self.new_device)(CPU) });
        if device.1.is_null() {
            device.check()?;
            return Err(OidnError::Library("it has no device for this processor".to_owned()));
        }
        let threads = c_int::try_from(threads).unwrap_or(0);
        // SAFETY: the device is valid, and the names are those of the header.
        unsafe {
            (self.set_device_int)(device.1, c"numThreads".as_ptr(), threads);
            (self.set_device_bool)(device.1, c"setAffinity".as_ptr(), false);
            (self.commit_device)(device.1);
        }
        device.check()?;
        // SAFETY: the device is valid and committed; "RT" is the filter of rendered pictures.
        let filter = OwnedFilter(self, unsafe { (self.new_filter)(device.1, c"RT".as_ptr()) });
        if filter.1.is_null() {
            device.check()?;
            return Err(OidnError::Library("it has no filter \"RT\"".to_owned()));
        }
        let set_image = |name: &CStr, values: *mut [f32; 3]| {
            // SAFETY: the filter is valid. `values` are width × height values of three floats side by side, which live
            // until the filter has run.
            unsafe {
                (self.set_filter_image)(filter.1, name.as_ptr(), values.cast(), FLOAT3, width, height, 0, 0, 0);
            }
        };
        // The library only reads these.
        set_image(c"color", color.as_ptr().cast_mut());
        for (name, layer) in [(c"albedo", albedo), (c"normal", normal)] {
            if !layer.is_empty() {
                set_image(name, layer.as_ptr().cast_mut());
            }
        }
        set_image(c"output", output.as_mut_ptr());
        // SAFETY: the filter is valid, its images live until the end of this function.
        unsafe {
            (self.set_filter_bool)(filter.1, c"hdr".as_ptr(), true);
            (self.commit_filter)(filter.1);
        }
        device.check()?;
        // SAFETY: as above.
        unsafe { (self.execute_filter)(filter.1) };
        device.check()
    }
}
