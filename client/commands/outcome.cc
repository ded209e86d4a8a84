#include "client/commands/outcome.h"

#include <cstdio>

namespace joulecast::client {

Exit exit_of(Fault fault) {
  switch (fault) {
    case Fault::invalid:
    case Fault::not_found:
    case Fault::conflict:
    case Fault::too_large:
    case Fault::corrupt:
      return Exit::fault;
    case Fault::infeasible:
      return Exit::infeasible;
    case Fault::stopped:
    case Fault::unavailable:
      return Exit::unreachable;
    case Fault::internal:
      break;
  }
  return Exit::internal;
}

Exit report(const Error& error) {
  std::fprintf(stderr, "joulecast: %s\n", describe(error).c_str());
  // An invalid value of an option is wrong use, also if it is detected after parsing.
  if (error.fault == Fault::invalid && error.field.starts_with("--")) return Exit::usage;
  return exit_of(error.fault);
}

}  // namespace joulecast::client
