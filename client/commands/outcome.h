#pragma once

#include "base/error.h"

namespace joulecast::client {

// The program's exit codes; part of the command line's contract.
enum class Exit : int {
  ok = 0,
  fault = 1,        // the work failed: an input was read and found wrong, missing or damaged
  usage = 2,        // the command line itself is wrong, or a value given in it
  unreachable = 3,  // server, network or disk did not answer
  infeasible = 4,   // well-formed, but nothing satisfies it
  internal = 5,     // an internal error
  warned = 6        // of check: nothing is wrong, something is suspicious
};

inline constexpr const char* exit_codes_help =
    "Exit codes:\n"
    "  0  done\n"
    "  1  the work failed: an input is wrong, missing or damaged\n"
    "  2  the command line is wrong, or a value given in it\n"
    "  3  server, network or disk could not be reached\n"
    "  4  nothing satisfies the request\n"
    "  5  an internal error\n"
    "  6  check: warnings, but no fault";

[[nodiscard]] Exit exit_of(Fault fault);

// Prints the error on standard error and returns its exit code.
Exit report(const Error& error);

}  // namespace joulecast::client
