// The four ways in which a computation ends early, split by whose fault it is.
#pragma once

#include <stdexcept>
#include <string>

namespace vdbgeo {

/// Base of every error that vdbgeo throws on purpose. what() is one line fit for a user.
class Error : public std::runtime_error {
    using std::runtime_error::runtime_error;
};

/// The data or a parameter is bad: a damaged file, an open mesh where a closed one is needed, a bad option.
class InvalidInput : public Error {
    using Error::Error;
};

/// Reading or writing failed: no such file, no permission, disk full.
class IoError : public Error {
    using Error::Error;
};

/// The computation itself failed: it diverged, found nothing, or ran into a stated limit.
class NumericalError : public Error {
    using Error::Error;
};

/// The caller's progress callback asked to stop.
class Cancelled : public Error {
 public:
    Cancelled() : Error("interrupted") {}
};

}  // namespace vdbgeo
