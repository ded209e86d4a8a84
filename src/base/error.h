#pragma once

#include <string>
#include <tl/expected.hpp>
#include <utility>
#include <vector>

namespace joulecast {

// The kind of an error; the HTTP layer maps each to one status, the command line to one exit code.
enum class Fault {
  invalid,      // the caller's input breaks a stated constraint
  not_found,    // the named thing does not exist
  conflict,     // the request contradicts the present state
  infeasible,   // the input is well-formed but has no solution; the message gives the nearest feasible value
  too_large,    // a stated limit on size or count is exceeded
  unavailable,  // a resource is missing for now (disk, network, shutting down)
  stopped,      // the caller no longer waits for the answer
  corrupt,      // stored or received bytes cannot be trusted
  internal      // our bug
};

struct Error {
  Fault fault = Fault::invalid;
  std::string field;    // JSON pointer, column, flag or file that is at fault; empty when none is
  std::string message;  // the violated constraint, with the offending value and the bound

  friend bool operator==(const Error&, const Error&) = default;
};

template <class T>
using Result = tl::expected<T, Error>;

inline tl::unexpected<Error> fail(Fault fault, std::string field, std::string message) {
  return tl::unexpected<Error>(Error{fault, std::move(field), std::move(message)});
}

inline tl::unexpected<Error> invalid(std::string field, std::string message) {
  return fail(Fault::invalid, std::move(field), std::move(message));
}

// What is wrong with one member of a document: its JSON pointer, and a sentence.
struct FieldFault {
  std::string field, says;
};

// All of at least one fault as one error, at the first one's place.
inline Error error_of(const std::vector<FieldFault>& faults) {
  Error error{Fault::invalid, faults.front().field, faults.front().says};
  for (std::size_t k = 1; k < faults.size(); ++k)
    error.message += "; " + faults[k].field + ": " + faults[k].says;
  return error;
}

// "field: message", or the message alone.
inline std::string describe(const Error& error) {
  return error.field.empty() ? error.message : error.field + ": " + error.message;
}

}  // namespace joulecast
