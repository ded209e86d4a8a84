#pragma once

#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace joulecast::client {

struct Candidate {
  std::string text;  // ends in '/' or '=' where more is to follow
  std::string meaning;
};

// What may stand in place of the last of `words`, a command line behind the program's name, in the order that
// the help has it. Files are those of the working directory; names of robots are asked of the server that the
// line names.
[[nodiscard]] std::vector<Candidate> candidates(CLI::App& program, const std::vector<std::string>& words);

}  // namespace joulecast::client
