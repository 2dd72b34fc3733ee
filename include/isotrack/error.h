// What isotrack throws. Every message is one line and names what was expected, what was found, and where.
#pragma once

#include <stdexcept>

namespace isotrack {

/// Base of all errors thrown by the library.
class Error : public std::runtime_error {
public:
    using std::runtime_error::runtime_error;
};

/// An option or argument outside its range.
class OptionError : public Error {
public:
    using Error::Error;
};

/// A file that cannot be read or written.
class IoError : public Error {
public:
    using Error::Error;
};

/// Data that was read but cannot be used: no level set, broken mesh, unsupported transform.
class InputError : public Error {
public:
    using Error::Error;
};

}  // namespace isotrack
