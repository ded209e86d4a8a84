#pragma once

#include <cstddef>
#include <string>

#include "client/commands/option.h"

namespace joulecast::client {

struct CasesOptions {
  std::string cases;       // file of kept cases
  std::string recordings;  // folder
  std::string engine;      // command; empty: the diagnosis that is built in
  std::string answers;     // file that is continued; empty: nothing is kept
  std::string against;     // file of other answers
  std::string record;      // file that takes the cases with digests and truths; empty: none
  std::string keep;        // folder of the cases' files
  std::size_t sample = 0;  // of each group and channel set; 0: all
  std::size_t jobs = 1;
  bool kept_only = false;  // score kept answers, run no engine
  bool json = false;
};

// `joulecast-study trial --cases FILE`.
Exit run_cases_of(const CasesOptions& options);

}  // namespace joulecast::client
